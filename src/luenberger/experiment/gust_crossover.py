"""Decouple the gust or bound it: how wide either guarantee is over the bound of the gust, and where they cross."""

from collections.abc import Callable

import numpy as np
import plotly.graph_objects as go

from luenberger.experiment.gust_entrants import FILTERS, KINDS, SOURCES, bounding, local_schedule
from luenberger.experiment.gust_runs import Enclosure, driven, enclosed
from luenberger.experiment.gust_specification import GustSpecification
from luenberger.experiment.gust_study import Study
from luenberger.methods import UnknownInputGain
from luenberger.report.figures import Figure, dressed
from luenberger.report.palette import styles
from luenberger.report.tables import Table
from luenberger.synthesize import synthesize
from luenberger.systems import Switched

OURS = "decoupled"


def crossover_study(spec: GustSpecification, progress: Callable[[str, float], None]) -> Study:
    """Run the study.

    Args:
        spec: the experiment; `bounds` are tried one by one, the true gusts growing with them up to `force`.
        progress: called with what is being done and the share done.
    """
    progress("designing", 0.0)
    plant, road = Switched.of(spec.scheduled()), spec.road()
    schedule = local_schedule(road.speed)
    design = synthesize(plant.first, UnknownInputGain(fade=spec.fade))
    observer = design.observer(**spec.options)
    widths: dict[str, list[float]] = {n: [] for n in (OURS, *FILTERS)}
    left = dict.fromkeys(widths, 0)
    count = 0
    for k, bound in enumerate(spec.bounds):
        progress(f"a gust of at most {bound:g} N", (k + 0.5) / len(spec.bounds))
        # A stronger gust than the drive's would take the car out of its admissible states.
        calm = spec.with_force(min(bound, spec.force)).road()
        runs = driven(plant, design.gains, design.decoupling, calm, schedule, spec.unknown(), spec.initial_half_width)
        found: dict[str, Enclosure] = {OURS: enclosed(observer, runs, schedule)}
        found |= {n: bounding(spec, n, bound, runs, schedule) for n in FILTERS}
        for name, each in found.items():
            widths[name].append(each.width)
            left[name] += int(each.left(runs.states).sum())
        count += len(runs.states)
    flat = float(np.mean(widths[OURS]))
    crossings = {n: crossing(spec.bounds, widths[n], flat) for n in FILTERS}
    rows = [[n, min(w), max(w), crossings.get(n), left[n]] for n, w in widths.items()]
    escapes = sum(left.values())
    notes = [
        "Mean width of the guaranteed bounds of the lateral speed, over the bounds of the gust that were tried; where it becomes that of "
        "the decoupled observer. All carry the same structured uncertainty and are scheduled by the speed.",
        f"The bounds were left on {escapes or 'none'} of {count * len(widths)} runs.",
    ]
    return Study(
        _summary(spec, flat, crossings, escapes),
        Table(
            ["entrant", "least [m/s]", "most [m/s]", "crosses at [N]", "runs left"], rows, notes, "Decouple or bound"
        ),
        [_figure(spec.bounds, widths, flat, crossings)],
        {OURS: design},
        {"gust_bound": np.array(spec.bounds), **{n: np.array(w) for n, w in widths.items()}},
        [_widths(spec.bounds, widths)],
        assumptions=_assumptions(spec),
        citations=SOURCES[:1],
    )


def crossing(bounds: tuple[float, ...], widths: list[float], flat: float) -> float | None:
    """Return the gust bound at which a rising curve of widths meets a flat one, None where it does not within the bounds.

    Args:
        bounds: gust bounds, rising [N].
        widths: width at each [m/s].
        flat: width of the other [m/s].
    """
    above = np.asarray(widths) >= flat
    if above.all() or not above.any():
        return None
    k = int(above.argmax())
    if k == 0:
        return None
    share = (flat - widths[k - 1]) / (widths[k] - widths[k - 1])
    low, high = np.log(bounds[k - 1]), np.log(bounds[k])
    return float(np.exp(low + share * (high - low)))


def _assumptions(spec: GustSpecification) -> list[str]:
    return [
        "Stiffness and noise within their bounds, the speed read exactly; the car is the plant, sampled by Euler's rule "
        f"with {spec.sample_time:g} s.",
        f"The true gust reaches the bound that is tried, and {spec.force:g} N at most; a bound larger than the wind is caution, and costs width.",
    ]


def _widths(bounds: tuple[float, ...], widths: dict[str, list[float]]) -> Table:
    rows = [
        [f"{b:g} N", *(w[k] for w in widths.values()), min(widths, key=lambda n: widths[n][k])]
        for k, b in enumerate(bounds)
    ]
    return Table(["gust bound", *widths, "narrowest"], rows, [], "Mean width for each bound [m/s]")


def _summary(spec: GustSpecification, flat: float, crossings: dict[str, float | None], escapes: int) -> str:
    lines = [f"Decoupled by an unknown-input observer, the gust costs {flat:.3f} m/s of width whatever its size."]
    for name, bound in crossings.items():
        if bound is None:
            lines.append(
                f"Bounded by a {KINDS[name]} it does not cross that between {spec.bounds[0]:g} and {spec.bounds[-1]:g} N."
            )
        else:
            lines.append(f"Bounded by a {KINDS[name]} it costs less below a gust bound of some {bound:.0f} N.")
    best = [b for b in crossings.values() if b is not None]
    if best:
        force = max(best)
        lines.append(
            f"So: where you can swear that no gust exceeds {force:.0f} N ({force / spec.vehicle.mass:.2f} m/s² on this car), bound it; else decouple."
        )
    lines.append("No bound was left on any run." if escapes == 0 else f"BOUNDS WERE LEFT ON {escapes} RUNS.")
    return " ".join(lines)


def _figure(
    bounds: tuple[float, ...], widths: dict[str, list[float]], flat: float, crossings: dict[str, float | None]
) -> Figure:
    looks = styles(tuple(widths))
    plot = go.Figure()
    for name, values in widths.items():
        plot.add_trace(
            go.Scatter(
                x=list(bounds), y=values, name=name, mode="lines+markers", line={"color": looks[name].colour, "width": 2},
                hovertemplate="%{y:.3f} m/s",
            )
        )  # fmt: skip
    for name, bound in crossings.items():
        if bound is not None:
            plot.add_vline(x=bound, line={"color": looks[name].colour, "dash": "dot", "width": 1.4})
            plot.add_annotation(
                x=np.log10(bound), y=flat, text=f"{bound:.0f} N", showarrow=True, ax=-44, ay=-44, arrowcolor=looks[name].colour,
                font={"color": looks[name].colour, "size": 13},
            )  # fmt: skip
    dressed(plot, 440)
    best = max((b for b in crossings.values() if b is not None), default=None)
    if best is not None:
        for end, advice in ((bounds[0], "bound the gust"), (bounds[-1], "decouple it")):
            plot.add_annotation(
                x=0.5 * np.log10(end * best), y=0.02, yref="paper", yanchor="bottom", text=f"<b>{advice}</b>", showarrow=False
            )  # fmt: skip
    plot.update_xaxes(
        type="log",
        title_text="bound of the gust that is trusted [N]",
        tickvals=list(bounds),
        ticktext=[f"{b:g}" for b in bounds],
    )
    plot.update_yaxes(title_text="mean width, lateral speed [m/s]", range=[0, 2.5 * flat])
    words = "Left of a crossing the gust is better bounded, right of it better decoupled. Curves may leave the picture at the top."
    return Figure("comparison", "Decouple the gust or bound it", plot, words, {n: s.colour for n, s in looks.items()})
