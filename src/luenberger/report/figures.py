"""Figures of a page: estimates against truth, how large the errors are, and what a step costs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from luenberger.core import BadInput
from luenberger.report.decimation import decimated
from luenberger.report.palette import TRUTH, Style, faded, styles

Kind = Literal["comparison", "estimates", "errors", "cost"]
_FONT = "system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', Arial, sans-serif"
_GRID = "#e6e8eb"
# What people read on a screen, for each SI unit that is written differently there.
_SHOWN = {
    "rad": ("deg", 180 / np.pi),
    "rad/s": ("deg/s", 180 / np.pi),
    "rad/s^2": ("deg/s²", 180 / np.pi),
    "m/s^2": ("m/s²", 1.0),
}


@dataclass(frozen=True, eq=False)
class Figure:
    """A plot with its place on the page.

    Args:
        kind: section of the page it belongs to.
        title: heading.
        plot: the plotly figure.
        caption: what is to be seen, one or two sentences.
        colours: entrant -> colour, for the marks in tables.
    """

    kind: Kind
    title: str
    plot: go.Figure
    caption: str = ""
    colours: Mapping[str, str] = field(default_factory=dict)


def shown(values: Any, unit: str) -> tuple[np.ndarray, str]:
    """Return values and unit as they are shown: angles in degrees, all else in SI.

    Args:
        values: numbers in SI.
        unit: their SI unit.
    """
    text, factor = _SHOWN.get(unit, (unit, 1.0))
    return np.asarray(values, dtype=np.float64) * factor, text


def estimate_figure(
    time: np.ndarray,
    truth: np.ndarray,
    estimates: Mapping[str, Any],
    *,
    name: str,
    unit: str,
    truth_name: str = "truth",
    bounds: Mapping[str, tuple[Any, Any]] | None = None,
    caption: str = "",
) -> Figure:
    """Return every estimate of one quantity over time against the truth, and below it the errors.

    A click in the legend hides or shows an entrant in both panels.

    Args:
        time: sample times [s], shape (nt,).
        truth: what is to be estimated, in SI, shape (nt,).
        estimates: entrant -> estimate in SI, an array of NumPy or JAX of shape (nt,).
        name: the quantity in words, e.g. "sideslip".
        unit: its SI unit; angles are shown in degrees.
        truth_name: what stands for the truth, e.g. "optical sensor".
        bounds: entrant -> (lower, upper) guaranteed or 95 % bounds in SI, each of shape (nt,).
        caption: sentence below the figure.

    Raises:
        BadInput: an estimate or bound of another length than `time`.
    """
    looks = styles(tuple(estimates))
    true, text = shown(truth, unit)
    plot = make_subplots(rows=2, cols=1, shared_xaxes=True, row_heights=[0.64, 0.36], vertical_spacing=0.06)
    _line(plot, time, true, truth_name, Style(TRUTH, "solid"), 1, width=2.2)
    for entrant, (lower, upper) in (bounds or {}).items():
        _band(plot, time, shown(lower, unit)[0], shown(upper, unit)[0], entrant, looks[entrant].colour)
    for entrant, estimate in estimates.items():
        values = shown(estimate, unit)[0]
        if values.shape != np.shape(time):
            raise BadInput(
                f"The estimate of `{entrant}` has shape {values.shape}; `time` has {np.shape(time)} and both need one length."
            )
        _line(plot, time, values, entrant, looks[entrant], 1)
        _line(plot, time, values - true, entrant, looks[entrant], 2, legend=False)
    plot.update_yaxes(title_text=f"{name} [{text}]" if text else name, row=1)
    plot.update_yaxes(title_text=f"error [{text}]" if text else "error", row=2)
    reach, outside = _first_view({n: shown(e, unit)[0] - true for n, e in estimates.items()})
    if outside:
        plot.update_yaxes(range=[-reach, reach], row=2)
    plot.update_xaxes(title_text="time [s]", row=2)
    title = f"{name[:1].upper()}{name[1:]}"
    words = _with_absent(caption, "the error panel", outside)
    return Figure("estimates", title, dressed(plot, 620), words, {n: s.colour for n, s in looks.items()})


def error_bars(errors: Mapping[str, float], *, name: str, unit: str, caption: str = "") -> Figure:
    """Return one bar an entrant, e.g. its root-mean-square error.

    Args:
        errors: entrant -> error in SI.
        name: what the bar shows, e.g. "RMSE of the sideslip".
        unit: SI unit; angles are shown in degrees.
        caption: sentence below the figure.
    """
    values, text = shown(list(errors.values()), unit)
    return _bars("errors", tuple(errors), values, name, text, caption)


def error_shares(
    errors: Mapping[str, np.ndarray], *, name: str, unit: str, points: int = 400, caption: str = ""
) -> Figure:
    """Return for each entrant the share of samples whose error is below a bound: a histogram, summed up.

    Curves of many entrants stay readable where their histograms would hide each other.

    Args:
        errors: entrant -> errors in SI, shape (nt,).
        name: the quantity in words.
        unit: SI unit; angles are shown in degrees.
        points: quantiles drawn.
        caption: sentence below the figure.
    """
    looks = styles(tuple(errors))
    share = np.linspace(0.0, 1.0, points)
    plot = go.Figure()
    text = shown([], unit)[1]
    sizes = {n: np.abs(shown(e, unit)[0][np.isfinite(e)]) for n, e in errors.items()}
    for entrant, values in sizes.items():
        if values.size:
            _line(plot, np.quantile(values, share), 100 * share, entrant, looks[entrant], None)
    reach, outside = _first_view(sizes)
    plot.update_xaxes(title_text=f"|error| of the {name} [{text}]" if text else f"|error| of the {name}")
    plot.update_xaxes(range=[0, reach])
    plot.update_yaxes(title_text="share of samples [%]", range=[0, 101])
    plot.update_layout(hovermode="closest")
    return Figure(
        "errors",
        "Share of samples within an error",
        dressed(plot, 380),
        _with_absent(caption, "this view", outside),
        {n: s.colour for n, s in looks.items()},
    )


def cost_bars(seconds: Mapping[str, float], caption: str = "") -> Figure:
    """Return the computing time of one step of each entrant.

    Args:
        seconds: entrant -> time of a step [s].
        caption: sentence below the figure.
    """
    values = 1e6 * np.asarray(list(seconds.values()), dtype=np.float64)
    return _bars("cost", tuple(seconds), values, "Computing time of a step", "µs", caption)


def comparison_figures(
    time: np.ndarray,
    truth: np.ndarray,
    estimates: Mapping[str, np.ndarray],
    *,
    name: str,
    unit: str,
    truth_name: str = "truth",
    errors: Mapping[str, float] | None = None,
    seconds: Mapping[str, float] | None = None,
    bounds: Mapping[str, tuple[np.ndarray, np.ndarray]] | None = None,
) -> tuple[Figure, ...]:
    """Return the figures of a comparison of one quantity: estimates, error shares, bars of RMSE, computing time.

    Args:
        time: sample times [s], shape (nt,).
        truth: what is to be estimated, in SI, shape (nt,).
        estimates: entrant -> estimate in SI, shape (nt,).
        name: the quantity in words, e.g. "sideslip".
        unit: its SI unit; angles are shown in degrees.
        truth_name: what stands for the truth.
        errors: entrant -> RMSE in SI as scored elsewhere; by default that of all finite samples.
        seconds: entrant -> time of a step [s]; no such figure where nothing is given.
        bounds: entrant -> guaranteed (lower, upper) in SI, drawn as bands.
    """
    differences = {n: np.asarray(e) - truth for n, e in estimates.items()}
    scored = errors or {n: float(np.sqrt(np.nanmean(np.square(d)))) for n, d in differences.items()}
    made = [
        estimate_figure(time, truth, estimates, name=name, unit=unit, truth_name=truth_name, bounds=bounds),
        error_bars(scored, name=f"RMSE of the {name}", unit=unit),
        error_shares(differences, name=name, unit=unit),
    ]
    return (*made, cost_bars(seconds)) if seconds else tuple(made)


def _first_view(errors: Mapping[str, np.ndarray]) -> tuple[float, tuple[str, ...]]:
    """Return how far an error axis reaches at first, and whose errors leave it.

    One entrant that is several times worse than most (a trivial estimate, say) would press all others on the zero line.
    """
    finite = {n: np.abs(e[np.isfinite(e)]) for n, e in errors.items()}
    finite = {n: e for n, e in finite.items() if e.size}
    sizes = {n: float(np.sqrt(np.mean(np.square(e)))) for n, e in finite.items()}
    usual = 3 * float(np.median(list(sizes.values()))) if sizes else 0.0
    reach = 1.05 * max((float(e.max()) for n, e in finite.items() if sizes[n] <= usual), default=0.0)
    outside = tuple(n for n, e in finite.items() if float(e.max()) > reach)
    return (reach, outside) if reach > 0 else (1.0, ())


def _with_absent(caption: str, where: str, outside: Sequence[str]) -> str:
    if not outside:
        return caption
    names = ", ".join(f"`{name}`" for name in outside)
    return f"{caption} The errors of {names} leave {where}; a double click in it shows them.".strip()


def _line(
    plot: go.Figure,
    x: np.ndarray,
    y: np.ndarray,
    name: str,
    style: Style,
    row: int | None,
    *,
    width: float = 1.4,
    legend: bool = True,
) -> None:
    x, y = decimated(np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64))
    # Single precision is finer than any screen and halves the page; time keeps its digits.
    trace = go.Scatter(
        x=x, y=y.astype(np.float32), name=name, legendgroup=name, showlegend=legend, mode="lines",
        line={"color": style.colour, "dash": style.dash, "width": width}, hovertemplate="%{y:.4g}",
    )  # fmt: skip
    if row is None:
        plot.add_trace(trace)
    else:
        plot.add_trace(trace, row=row, col=1)


def _band(plot: go.Figure, time: np.ndarray, lower: np.ndarray, upper: np.ndarray, name: str, colour: str) -> None:
    for values, fill in ((lower, None), (upper, "tonexty")):
        x, y = decimated(np.asarray(time, dtype=np.float64), values)
        plot.add_trace(
            go.Scatter(
                x=x, y=y.astype(np.float32), legendgroup=name, showlegend=False, mode="lines", line={"width": 0},
                fill=fill, fillcolor=faded(colour, 0.16), hoverinfo="skip",
            ),
            row=1, col=1,
        )  # fmt: skip


def _bars(kind: Kind, names: Sequence[str], values: np.ndarray, title: str, unit: str, caption: str) -> Figure:
    looks = styles(names)
    bars = go.Bar(
        x=values, y=list(names), orientation="h", marker={"color": [looks[n].colour for n in names]},
        text=[f"{v:.3g}" for v in values], textposition="outside", cliponaxis=False, hovertemplate="%{y}: %{x:.4g}<extra></extra>",
    )  # fmt: skip
    plot = dressed(go.Figure(bars), 110 + 34 * len(names))
    # Room for the numbers beside the bars.
    top = float(np.nanmax(values)) if values.size else 1.0
    plot.update_xaxes(title_text=f"{title} [{unit}]" if unit else title, range=[0, 1.18 * top if top > 0 else 1.0])
    plot.update_yaxes(autorange="reversed", showgrid=False)
    plot.update_layout(showlegend=False, hovermode="closest", dragmode=False, margin={"t": 8})
    return Figure(kind, title, plot, caption, {n: looks[n].colour for n in names})


def dressed(plot: go.Figure, height: int) -> go.Figure:
    """Give a plot the look of all plots of a page, and return it.

    Args:
        plot: the plotly figure; changed.
        height: in pixels.
    """
    plot.update_layout(
        # Without this plotly writes its own long theme into every figure.
        template="none",
        height=height,
        font={"family": _FONT, "size": 13, "color": "#30343a"},
        paper_bgcolor="white",
        plot_bgcolor="white",
        margin={"l": 64, "r": 16, "t": 30, "b": 48},
        hovermode="x unified",
        # The buttons lie above the plot, so the legend lies below: a fixed distance in pixels whatever the height.
        legend={"orientation": "h", "x": 0, "y": -70 / (height - 100), "yanchor": "top", "font": {"size": 13}},
        hoverlabel={"font": {"family": _FONT, "size": 12}},
    )
    plot.update_xaxes(
        gridcolor=_GRID,
        zeroline=False,
        linecolor="#b6bbc2",
        ticks="outside",
        tickcolor="#b6bbc2",
        automargin=True,
        title_standoff=4,
    )
    plot.update_yaxes(gridcolor=_GRID, zeroline=True, zerolinecolor="#c9cdd2", zerolinewidth=1, automargin=True)
    return plot
