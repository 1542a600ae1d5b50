"""One HTML page of an experiment: it holds everything it shows and needs no network."""

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path
from typing import Any, get_args

from jinja2 import Environment, StrictUndefined
from markupsafe import Markup, escape
from plotly.offline import get_plotlyjs

from luenberger.algebra import Polynomial
from luenberger.core import BadInput, Outcome
from luenberger.design import Design, SwitchedDesign
from luenberger.report.figures import Figure, Kind
from luenberger.report.tables import Table, gain_table
from luenberger.systems import Switched

# Drag zooms, a double click shows all again; without the logo and the buttons nobody needs. The button that uploads a chart
# to a web service is on by default and must not be: what stands on the page stays with its reader.
_CONFIG = {
    "displaylogo": False,
    "showSendToCloud": False,
    "displayModeBar": True,
    "responsive": True,
    "modeBarButtonsToRemove": ["lasso2d", "select2d", "autoScale2d"],
    "toImageButtonOptions": {"format": "svg"},
}


@dataclass(frozen=True, eq=False)
class Page:
    """What one page of results says.

    Args:
        title: headline.
        summary: what stands where, plainly; paragraphs are separated by an empty line.
        assumptions: what was taken as true, one sentence each, beyond what the certificates list themselves.
        designs: entrant -> design with its certificate.
        scores: one row an entrant, its name in the first column.
        figures: plots; each stands in the section of its kind.
        citations: papers and sources, one string each.
        tables: further tables below the scores, e.g. how long each assumption held.
        provenance: what to name when asked where a number comes from, e.g. version, log, sha256 of the log.
    """

    title: str
    summary: str
    assumptions: Sequence[str]
    designs: Mapping[str, Design | SwitchedDesign]
    scores: Table
    figures: Sequence[Figure]
    citations: Sequence[str] = ()
    provenance: Mapping[str, str] = field(default_factory=dict)
    tables: Sequence[Table] = ()

    def write(self, path: str | Path) -> Path:
        """Write the page as one file and return its path.

        Args:
            path: file to write; its folder is made where it lacks.

        Raises:
            BadInput: the file cannot be written.
        """
        target = Path(path)
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_text(self.as_html(), encoding="utf-8")
        except OSError as cause:
            raise BadInput(f"`{target}` cannot be written ({cause.strerror}); give another path.") from None
        return target

    def as_html(self) -> str:
        """Return the page as text."""
        colours = {name: colour for figure in self.figures for name, colour in figure.colours.items()}
        places = {figure: f"figure-{k}" for k, figure in enumerate(self.figures)}
        template = _environment().from_string(
            (files("luenberger.report") / "page.html.jinja").read_text(encoding="utf-8")
        )
        return template.render(
            page=self,
            paragraphs=[p for p in self.summary.split("\n\n") if p.strip()],
            scores=Markup(self.scores.as_html(colours)),
            tables=[Markup(table.as_html()) for table in self.tables],
            certified=[_certified(name, design, colours.get(name)) for name, design in self.designs.items()],
            unclaimed=[str(row[0]) for row in self.scores.rows if str(row[0]) not in self.designs],
            drawn={kind: [(f, places[f]) for f in self.figures if f.kind == kind] for kind in get_args(Kind)},
            plots=Markup(_as_script([_plot(places[f], f) for f in self.figures])),
            config=Markup(_as_script(_CONFIG)),
            plotly=Markup(get_plotlyjs() if self.figures else ""),
        )


def _environment() -> Environment:
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.filters["prose"] = _prose
    return environment


def _prose(sentence: str) -> Markup:
    """Return a sentence escaped, with what stands between backticks set as code."""
    return Markup(re.sub(r"`([^`]+)`", r"<code>\1</code>", str(escape(sentence))))


def _plot(place: str, figure: Figure) -> dict[str, Any]:
    # What cannot be zoomed needs no buttons.
    layout: Any = figure.plot.layout
    config = {"displayModeBar": False} if layout.dragmode is False else {}
    return {"place": place, "config": config, **json.loads(str(figure.plot.to_json()))}


def _as_script(data: Any) -> str:
    """Return JSON that cannot end the script element it stands in, whatever text it holds."""
    text = json.dumps(data, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026").replace("\u2028", "\\u2028")


def _certified(name: str, design: Design | SwitchedDesign, colour: str | None) -> dict[str, Any]:
    """Return what the template shows of one design."""
    plant = Switched.of(design.system).first
    proofs = [
        {
            "sentence": proof.sentence,
            "kind": proof.claim.kind.replace("_", " "),
            "level": f"{proof.claim.level:.6g}",
            "margin": f"{proof.margin:.2g}" if proof.margin else "–",
            "outcome": proof.outcome.value,
            "reason": proof.reason,
        }
        for proof in design.certificate.proofs
    ]
    return {
        "name": name,
        "colour": colour,
        "method": design.method,
        "options": _options_text(design.options),
        "outcome": design.certificate.outcome.value,
        "whole": design.certificate.outcome is Outcome.PROVED,
        "proofs": proofs,
        "assumptions": design.certificate.assumptions,
        "gains": [(heading, Markup(gain_table(gain, plant).as_html())) for heading, gain in _gains(design)],
    }


def _gains(design: Design | SwitchedDesign) -> list[tuple[str, Polynomial]]:
    """Heading and matrix of every gain."""
    if isinstance(design, SwitchedDesign):
        modes = enumerate(zip(design.gains, design.decoupling, strict=True), start=1)
        parts = [(k, what, M) for k, pair in modes for what, M in zip(("gain", "decoupling matrix"), pair, strict=True)]
        where = "" if len(design.gains) == 1 else ", mode {}"
        return [(f"Its {what}{where.format(k)}", M) for k, what, M in parts]
    named = {
        "Its gain": design.gain,
        "Its gain in the argument of f": design.argument_gain,
        "Its gain on the current output": design.filter_gain,
    }
    return [(heading, gain) for heading, gain in named.items() if gain is not None]


def _options_text(options: Mapping[str, Any]) -> str:
    """Return options as people read them: "decay_rate = 3, relaxation (parts = 1)"."""
    parts = [
        f"{k} ({_options_text(v)})" if isinstance(v, Mapping) else f"{k} = {_option_text(v)}"
        for k, v in options.items()
    ]
    return ", ".join(parts)


def _option_text(value: Any) -> str:
    if isinstance(value, list | tuple):
        return f"[{', '.join(_option_text(v) for v in value)}]"
    return f"{value:.6g}" if isinstance(value, float) else str(value)
