"""The comparison as one picture: how far each design gets on the drawn plants, and on each published one."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

import luenberger
from luenberger.experiment.published.conservatism_entrants import ENTRANTS
from luenberger.experiment.published.conservatism_findings import (
    SECOND,
    VERTICES,
    costs,
    is_random,
    percent,
    reach,
    sentences,
    shares,
)
from luenberger.experiment.published.conservatism_plants import SOURCES
from luenberger.experiment.published.conservatism_table import GAIN_LIMIT, HIGHEST, LOWEST, Entry, table
from luenberger.experiment.published.lipschitz_conservatism import SOURCE
from luenberger.report.figures import Figure
from luenberger.report.page import Page
from luenberger.report.palette import COLOURS, TRUTH, faded
from luenberger.report.tables import Table

_FONT = "system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', Arial, sans-serif"
_SHOWN = tuple(e for e in ENTRANTS if e.on_random or e.view == "hull")
# Names of the columns, broken where they are long.
_SHORT = {
    "flexible-joint robot": "robot",
    "slip angles": "slip<br>angles",
    "FitzHugh nerve": "nerve",
    "moving object": "moving<br>object",
    "tunnel diode": "tunnel<br>diode",
}
_FLOOR = 0.01


def conservatism_plot(entries: Sequence[Entry]) -> go.Figure:
    """Return the picture: a row for each design, drawn plants as points on the left, published ones as columns on the right.

    Args:
        entries: of the comparison.
    """
    part = shares(entries)
    plot = make_subplots(
        rows=1,
        cols=2,
        shared_yaxes=True,
        column_widths=[0.46, 0.54],
        horizontal_spacing=0.02,
        subplot_titles=(
            f"{len({e.plant for e in entries if is_random(e)})} random plants (points) and their median (bar)",
            "published plants: largest strength with a proof",
        ),
    )
    names = [e.name for e in _SHOWN]
    for place, entrant in enumerate(_SHOWN):
        _points(plot, place, [v for p, v in part.get(entrant.name, {}).items() if p.startswith("random ")])
    columns = [p for p in dict.fromkeys(e.plant for e in entries) if not p.startswith("random ")]
    _cells(plot, names, columns, entries, part)
    labels = [e.short for e in _SHOWN]
    plot.update_yaxes(
        tickvals=list(range(len(names))),
        ticktext=labels,
        range=[len(names) - 0.5, -0.5],
        showgrid=False,
        zeroline=False,
        ticks="",
    )
    plot.update_xaxes(
        type="log",
        range=[np.log10(_FLOOR) - 0.05, 0.06],
        tickvals=[0.01, 0.03, 0.1, 0.3, 1.0],
        ticktext=["≤ 1 %", "3 %", "10 %", "30 %", "100 %"],
        gridcolor="#e6e8eb",
        ticks="outside",
        zeroline=False,
        title_text="strength over the best that any design proves on that plant",
        row=1,
        col=1,
    )
    plot.update_xaxes(
        tickvals=list(range(len(columns))),
        ticktext=[_SHORT.get(c, c.replace("Van der Pol, ", "VdP<br>")) for c in columns],
        range=[-0.5, len(columns) - 0.5],
        showgrid=False,
        zeroline=False,
        ticks="",
        tickangle=0,
        title_text="factor of the nonlinearity [-]; darker: nearer to the best of the column",
        row=1,
        col=2,
    )
    plot.update_layout(
        template="none",
        height=620,
        font={"family": _FONT, "size": 13, "color": "#30343a"},
        margin={"l": 10, "r": 16, "t": 96, "b": 70},
        title={"text": headline(entries), "x": 0.01, "y": 0.97, "font": {"size": 17}},
        showlegend=False,
        dragmode=False,
    )
    plot.update_yaxes(automargin=True, col=1)
    return plot


def headline(entries: Sequence[Entry]) -> str:
    """Return the finding in one line.

    Args:
        entries: of the comparison.
    """
    part = shares(entries)
    typical = {
        m: float(np.median([v for p, v in part.get(m, {"": 0.0}).items() if p.startswith("random ")] or [0.0]))
        for m in (VERTICES, SECOND)
    }
    return (
        "Vertices decide with one gain, a second gain often goes further: half of the random plants reach at least<br>"
        f"{percent(typical[VERTICES])} and {percent(typical[SECOND])} of the best strength that any design proves"
    )


def _points(plot: go.Figure, place: int, values: list[float]) -> None:
    """One point a plant, spread by rank and not at random, with the median as a bar."""
    if not values:
        return
    ordered = np.sort(np.maximum(values, _FLOOR))
    spread = 0.28 * np.sin(2.4 * np.arange(len(ordered)))
    dots = {"size": 6, "color": faded(COLOURS[0], 0.5), "line": {"width": 0}}
    plot.add_trace(
        go.Scatter(x=ordered, y=place + spread, mode="markers", marker=dots, hovertemplate="%{x:.1%}<extra></extra>"),
        1,
        1,
    )
    middle = float(np.median(ordered))
    bar = {"color": COLOURS[1], "width": 4}
    plot.add_trace(
        go.Scatter(x=[middle, middle], y=[place - 0.36, place + 0.36], mode="lines", line=bar, hoverinfo="skip"), 1, 1
    )


def _cells(
    plot: go.Figure, names: list[str], columns: list[str], entries: Sequence[Entry], part: dict[str, dict[str, float]]
) -> None:
    """A coloured cell for each published plant and design, with the strength written in it."""
    known = {(e.method, e.plant): e for e in entries}
    depth = np.full((len(names), len(columns)), np.nan)
    for i, name in enumerate(names):
        for j, column in enumerate(columns):
            entry = known.get((name, column))
            if entry is None:
                continue
            if entry.status != "not accepted":
                share = part.get(name, {}).get(column, 0.0)
                depth[i, j] = 1 - np.log10(max(share, _FLOOR)) / np.log10(_FLOOR)
            plot.add_annotation(
                x=j,
                y=i,
                text=reach(entry).replace(">= ", "≥ ").replace("-", "–"),
                showarrow=False,
                font={"size": 12, "color": "white" if np.nan_to_num(depth[i, j]) > 0.6 else TRUTH},
                row=1,
                col=2,
            )
    shade = [[0.0, "#f3f6fa"], [1.0, COLOURS[0]]]
    plot.add_trace(
        go.Heatmap(z=depth, zmin=0, zmax=1, colorscale=shade, showscale=False, xgap=2, ygap=2, hoverinfo="skip"), 1, 2
    )


def conservatism_figure(entries: Sequence[Entry]) -> Figure:
    """Return the picture with its place on a page and what is to be read from it.

    Args:
        entries: of the comparison.
    """
    caption = (
        f"Points: the drawn plants; bar: their median. Numbers: the largest factor of the nonlinearity for which a design with |L| <= "
        f"{GAIN_LIMIT:g} was proved, searched from {10**LOWEST:g} to {10**HIGHEST:g} to one percent; – not accepted, none: nothing found, "
        "?: beyond it a gain may exist that was not proved."
    )
    return Figure("comparison", "How strong a nonlinearity each design admits", conservatism_plot(entries), caption)


def method_table(entries: Sequence[Entry]) -> Table:
    """Return one row for each design: how far it gets, and what it costs.

    Args:
        entries: of the comparison.
    """
    part, made = shares(entries), []
    for entrant in ENTRANTS:
        drawn = [v for p, v in part.get(entrant.name, {}).items() if p.startswith("random ")]
        seconds, size = costs(entries, entrant.name)
        best = sum(v > 0.975 for v in drawn)
        made.append(
            [
                entrant.name,
                100 * float(np.median(drawn)) if drawn else None,
                f"{best} of {len(drawn)}" if drawn else None,
                None if np.isnan(size) else round(size),
                None if np.isnan(seconds) else 1e3 * seconds,
            ]
        )
    heads = ["design", "median share of the best [%]", "within 2.5 % of the best", "unknowns", "solver [ms]"]
    return Table(
        heads, made, ["Shares and counts on random plants that the design accepts; cost: medians over all plants."]
    )


def gain_table_of(entries: Sequence[Entry]) -> Table:
    """Return the proved bounds of |L| at the nominal strength of each published plant.

    Args:
        entries: of the comparison.
    """
    columns = list(dict.fromkeys(e.plant for e in entries if not is_random(e)))
    known = {(e.method, e.plant): e.gain for e in entries}
    made = [[e.name, *(_text(known.get((e.name, c))) for c in columns)] for e in ENTRANTS]
    strength = {e.plant: e.strength for e in entries if e.strength is not None}
    note = (
        "Strengths: "
        + ", ".join(f"{c} {strength[c]:g}" for c in columns if c in strength)
        + ". A dash: no design is proved there."
    )
    return Table(["design", *columns], made, [note], "Smallest gain that was found, |L|")


def _text(gain: float | None) -> str | None:
    return None if gain is None else "0" if gain < 1e-4 else f"{gain:.3g}"


def write_page(path: str | Path, entries: Sequence[Entry] | None = None) -> Path:
    """Write picture and tables as one HTML page and return its path.

    Args:
        path: file to write.
        entries: of the comparison; left out: computed.

    Raises:
        BadInput: the file cannot be written.
    """
    found = table() if entries is None else entries
    page = Page(
        title="Which Lipschitz or Jacobian observer inequality is least conservative",
        summary="\n\n".join(sentences(found)),
        assumptions=[
            "The strength multiplies the whole nonlinearity; the Jacobian box at one strength lies in that at any larger one.",
            f"A gain counts while |L| <= {GAIN_LIMIT:g}: where derivatives are nearly measured, almost any strength is met by some gain.",
            *(f"{name}: {SOURCES[name]}." for name in dict.fromkeys(e.plant for e in found) if name in SOURCES),
        ],
        designs={},
        scores=method_table(found),
        tables=[gain_table_of(found)],
        figures=[conservatism_figure(found)],
        citations=[SOURCE],
        provenance={"luenberger": luenberger.__version__},
    )
    return page.write(path)
