"""The figures of Wang 2014, chapters 3 and 4, drawn again: slip angles per observer, and the envelope over two lanes."""

from pathlib import Path

import jax.numpy as jnp
import numpy as np

import luenberger
from luenberger.experiment.published.wang_enclosures import TURNED, car, enclosures, known_gains
from luenberger.experiment.published.wang_envelopes import good_and_bad_lane, nominal_observer
from luenberger.experiment.published.wang_estimates import root_mean_squares, slip_estimates
from luenberger.experiment.published.wang_gains import printed_observers
from luenberger.experiment.published.wang_interval import SOURCE as INTERVAL_SOURCE
from luenberger.experiment.published.wang_lpv import SOURCE as LPV_SOURCE
from luenberger.experiment.published.wang_manoeuvre import STEP, linear_truth
from luenberger.experiment.published.wang_plants import STIFFNESS
from luenberger.experiment.published.wang_runs import FIRST, SCORED, Readings, run, slip_truth
from luenberger.methods.interval import IntervalLuenberger
from luenberger.report.figures import Figure, error_bars, estimate_figure
from luenberger.report.page import Page
from luenberger.report.tables import Table
from luenberger.synthesize import synthesize

NAMES = ("front slip angle", "rear slip angle")
# Number of the case in `CASES`, the figures of the dissertation that show it, what was read, and the same for a heading.
SHOWN = (
    (0, "Fig. 3.9", "speed and acceleration read exactly", "exact"),
    (5, "Figs. 3.10 to 3.13", "speed read 4 % low, acceleration 6 % high", "4 % off"),
    (6, "Figs. 3.14 to 3.17", "speed read 10 % low, acceleration 15 % high", "10 % off"),
)
# Half-width of the envelope at its start [rad] in the figures; what follows is the same for any.
FIRST_HALF_WIDTH = 0.01
_STARTS = (
    "The estimators start at one second, away from the truth. The error panel has the scale of what remains after two seconds, the "
    "gain that is merely feasible left aside; a double click in it shows everything."
)
SLOW = "feasibility gain"
NOMINAL, CERTIFIED, PRINTED = "nominal observer", "interval observer, certified", "interval observer, printed gain"


def slip_figures() -> tuple[Figure, ...]:
    """Return both slip angles under every printed observer, one pair of figures for each reading of the sensors."""
    truth, observers = linear_truth(), printed_observers(STEP)
    found, true, time = slip_estimates(observers, truth), slip_truth(truth), truth.time[FIRST:]
    made = []
    for case, figures, words, _ in SHOWN:
        for axle, name in enumerate(NAMES):
            estimates = {n: x[case, :, axle] for n, x in found.items()}
            figure = estimate_figure(time, true[:, axle], estimates, name=name, unit="rad", truth_name="single track")
            reach = _late_error([x for n, x in estimates.items() if n != SLOW], true[:, axle])
            figure.plot.update_yaxes(range=[-reach, reach], row=2)
            made.append(_titled(figure, f"{figures}: {name}, {words}", _STARTS))
    return tuple(made)


def envelope_figures() -> tuple[Figure, ...]:
    """Return both slip angles on two lanes of different stiffness: the nominal observer beside the envelopes."""
    truth = good_and_bad_lane()
    true, time = slip_truth(truth), truth.time[FIRST:]
    nominal = np.asarray(run({NOMINAL: nominal_observer()}, [Readings.of(truth)], jnp.asarray(true[0]))[NOMINAL].x)[0]
    design = synthesize(car(), IntervalLuenberger(objective="mismatch", coordinates="signs"))
    columns = {
        CERTIFIED: (design.gain, np.asarray(design.statistics["transform"])),
        PRINTED: (known_gains()["printed"][0], TURNED),
    }
    found = enclosures(columns, car(), [truth], guess=true[0], half_width=FIRST_HALF_WIDTH)
    bounds = {n: (lower[0], upper[0]) for n, (lower, upper) in found.items()}
    made = []
    for axle, name in enumerate(NAMES):
        sides = {n: (lower[:, axle], upper[:, axle]) for n, (lower, upper) in bounds.items()}
        estimates = {NOMINAL: nominal[:, axle]} | {n: 0.5 * (low + high) for n, (low, high) in sides.items()}
        made.append(
            _titled(
                estimate_figure(
                    time, true[:, axle], estimates, name=name, unit="rad", truth_name="single track", bounds=sides
                ),
                f"Figs. 4.5 and 4.6: {name}, stiffness low from 1.5 s to 4.5 s",
                f"Bands hold for every stiffness in the box, lines through them are their middle. All start at the truth, the bands with "
                f"{1e3 * FIRST_HALF_WIDTH:g} mrad to either side.",
            )
        )
    return tuple(made)


def write_page(path: str | Path) -> Path:
    """Write all figures with the table of errors as one HTML page and return its path.

    Args:
        path: file to write.

    Raises:
        BadInput: the file cannot be written.
    """
    (f, F), (r, R) = STIFFNESS
    page = Page(
        title="Slip angles scheduled by speed: the figures of Wang 2014 drawn again",
        summary="With the speed read wrongly no printed observer is better on both axles than the plain copy of the car without any "
        "correction: the speed that errs is the one from which the correction is computed.\n\n"
        "The envelope holds the true slip angles on both lanes, where the observer that believes one stiffness leaves them. The printed "
        "gains are for (front slip, -rear slip), which the print does not say; the sign of their second row is turned here.",
        assumptions=[
            "The manoeuvre is ours: the dissertation prints the speeds at both ends and shows curves.",
            f"Stiffness of the envelopes: {f:g} to {F:g} N/rad front, {r:g} to {R:g} N/rad rear.",
        ],
        designs={CERTIFIED: synthesize(car(), IntervalLuenberger(objective="mismatch", coordinates="signs"))},
        scores=error_table(),
        figures=[*slip_figures(), *envelope_figures(), *error_figures()],
        citations=[LPV_SOURCE, INTERVAL_SOURCE],
        provenance={"luenberger": luenberger.__version__},
    )
    return page.write(path)


def error_table() -> Table:
    """Return the root mean square errors of every printed observer for the readings that are shown."""
    truth = linear_truth()
    found, true = slip_estimates(printed_observers(STEP), truth), slip_truth(truth)
    rows = []
    for name, x in found.items():
        errors = root_mean_squares(x, true)
        rows.append([name, *(round(1e3 * float(v)) for case, *_ in SHOWN for v in errors[case])])
    heads = [f"{axle}, {short}" for *_, short in SHOWN for axle in ("front", "rear")]
    note = "Root mean square errors [microrad] from two to ten seconds, linear truth, y from the speed as read; the acceleration is off by half as much again."
    return Table(["observer", *heads], rows, [note])


def error_figures() -> tuple[Figure, ...]:
    """Return bars of the errors of both axles with the speed read 10 % low."""
    truth = linear_truth()
    found, true = slip_estimates(printed_observers(STEP), truth), slip_truth(truth)
    case, _, words, _ = SHOWN[-1]
    errors = {n: 1e-3 * root_mean_squares(x, true)[case] for n, x in found.items()}
    return tuple(
        _titled(
            error_bars({n: float(e[axle]) for n, e in errors.items()}, name=f"RMSE of the {name}", unit="rad"),
            f"RMSE of the {name}, {words}",
            "",
        )
        for axle, name in enumerate(NAMES)
    )


def _late_error(estimates: list[np.ndarray], truth: np.ndarray) -> float:
    """Largest error from two seconds on, as figures show it [deg], with a little room."""
    return 1.1 * float(np.rad2deg(max(np.abs(x - truth)[SCORED:].max() for x in estimates)))


def _titled(figure: Figure, title: str, caption: str) -> Figure:
    return Figure(figure.kind, title, figure.plot, f"{caption} {figure.caption}".strip(), figure.colours)
