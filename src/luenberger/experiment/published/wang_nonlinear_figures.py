"""The figures of Wang 2014, chapter 5, drawn again on one page: the oscillator, the fishhook, and the design behind it."""

from pathlib import Path

import numpy as np
import plotly.graph_objects as go

import luenberger
from luenberger.experiment.published.row import Row
from luenberger.experiment.published.wang_fishhook_figure import fishhook_figure
from luenberger.experiment.published.wang_fishhook_runs import (
    brush_plant,
    double_track_truth,
    everybody,
    root_mean_squares,
)
from luenberger.experiment.published.wang_nonlinear import SOURCE
from luenberger.experiment.published.wang_nonlinear_oscillator import motions, oscillator_rows
from luenberger.methods.extended_luenberger import ExtendedLuenberger
from luenberger.report.figures import Figure
from luenberger.report.page import Page
from luenberger.report.palette import TRUTH, styles
from luenberger.report.tables import Table
from luenberger.synthesize import synthesize

# Where oscillator and guess start, and until when they are shown, in steps of 2 ms.
START, GUESS, SHOWN = (0.5, -0.5), (-2.0, 3.0), 6000
NAMES = {"(5.21)": "observer of Theorem 7", "(5.59)": "observer of the example"}
# Share of the stiffness that the tyres of the design may lose, and the bound of its gain.
LOST, LIMIT = 0.9, 30.0


def write_page(path: str | Path) -> Path:
    """Write the figures and the design behind the fishhook as one HTML page and return its path.

    Args:
        path: file to write.

    Raises:
        BadInput: the file cannot be written.
    """
    design = synthesize(brush_plant(LOST), ExtendedLuenberger(goal="l2", gain_limit=LIMIT))
    page = Page(
        title="Observers of plants with bounded Jacobians: the figures of Wang 2014, chapter 5, drawn again",
        summary="The printed oscillator gains converge, and are proved stable here on the whole box, although the lemma they were "
        "found by is false: turned round in one sign, the same inequality certifies a gain that diverges.\n\n"
        "In the fishhook the tyre model decides, not the gain: with brush tyres every estimator beats the linear one, and a Kalman "
        "filter with the same tyres and sensors does better than the certified observer where nobody tunes.",
        assumptions=[
            "Initial states of the oscillator and the whole fishhook are ours; the dissertation prints neither.",
            f"The design trusts slip angles at which the tyres lose up to {LOST:.0%} of their stiffness.",
        ],
        designs={"extended Luenberger, slip angles": design},
        scores=_fishhook_table(),
        tables=[_oscillator_table(list(oscillator_rows()))],
        figures=[portrait(), fishhook_figure()],
        citations=[SOURCE],
        provenance={"luenberger": luenberger.__version__},
    )
    return page.write(path)


def portrait() -> Figure:
    """Return the phase portrait of the oscillator and of both readings of the printed observer."""
    looks = styles(list(NAMES.values()))
    plot = go.Figure()
    for which, name in NAMES.items():
        found = motions(np.array([START]), np.array([GUESS]), which)
        if not plot.data:
            plot.add_trace(_curve(found.states[0], "oscillator", TRUTH, 2.4))
        plot.add_trace(_curve(found.estimates[0], name, looks[name].colour, 1.6))
    plot.update_layout(
        height=520,
        template="plotly_white",
        margin={"l": 64, "r": 32, "t": 56, "b": 48},
        legend={"orientation": "h", "yanchor": "bottom", "y": 1.01, "x": 0},
        xaxis_title="x1",
        yaxis_title="x2",
    )
    caption = (
        f"From ({START[0]:g}, {START[1]:g}), guessed at ({GUESS[0]:g}, {GUESS[1]:g}), with the printed gains; Theorem 7 injects L1 - F K1 L2, "
        "the example L1 alone. Both join the limit cycle before half a turn."
    )
    return Figure("estimates", "Figs. 5.2 and 5.3: oscillator and observer in the plane", plot, caption)


def _curve(x: np.ndarray, name: str, colour: str, width: float) -> go.Scatter:
    kept = x[:SHOWN:5]
    return go.Scatter(x=kept[:, 0], y=kept[:, 1], name=name, mode="lines", line={"color": colour, "width": width})


def _fishhook_table() -> Table:
    truth = double_track_truth()
    errors = {n: root_mean_squares(x, truth) for n, x in everybody(truth).items()}
    rows = [[n, *(round(float(v), 1) for v in e)] for n, e in errors.items()]
    note = "Root mean square errors from two seconds on, double-track truth, no noise, nobody tuned."
    return Table(["estimator", "front slip [mrad]", "rear slip [mrad]"], rows, [note])


def _oscillator_table(rows: list[Row]) -> Table:
    return Table(
        ["item", "printed", "ours", "verdict"],
        [[r.item, r.printed, r.ours, r.verdict.value] for r in rows],
        ["`luenberger reproduce wang-nonlinear` has all rows of the chapter, with the reason of each verdict."],
        "The oscillator, row by row",
    )
