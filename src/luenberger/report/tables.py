"""One neutral table for the terminal, for JSON and for the page, and the tables that a certificate fills."""

import html
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from numbers import Integral, Real
from typing import Any

import numpy as np
from rich.markup import escape
from rich.table import Table as RichTable

from luenberger.algebra import Polynomial
from luenberger.certify import Certificate
from luenberger.core import BadInput
from luenberger.systems import System

NOTHING = "–"
# Longest text [characters] that is kept in one line on a page.
_SHORT = 24


@dataclass(frozen=True)
class Table:
    """Rows under named columns, still numbers; every door turns them into text its own way.

    Args:
        columns: heading of each column, the unit in brackets, e.g. "RMSE [deg]".
        rows: cells of each row: text, number, True/False, or None where there is nothing.
        notes: sentences below the table.
        title: heading, may be empty.

    Raises:
        BadInput: a row with more or fewer cells than columns, a column name given twice.
    """

    columns: Sequence[str]
    rows: Sequence[Sequence[Any]]
    notes: Sequence[str] = ()
    title: str = ""

    def __post_init__(self) -> None:
        if len(set(self.columns)) != len(self.columns):
            raise BadInput(f"The table columns {list(self.columns)} repeat a name; give each column its own.")
        for k, row in enumerate(self.rows):
            if len(row) != len(self.columns):
                raise BadInput(
                    f"Row {k} of the table has {len(row)} cells for {len(self.columns)} columns ({', '.join(self.columns)}); "
                    "give one cell a column, None where there is nothing."
                )

    def column(self, name: str) -> tuple[Any, ...]:
        """Return the cells of one column.

        Args:
            name: its heading.

        Raises:
            BadInput: no such column.
        """
        if name not in self.columns:
            raise BadInput(f"The table has no column `{name}`; its columns are {', '.join(self.columns)}.")
        place = list(self.columns).index(name)
        return tuple(row[place] for row in self.rows)

    def texts(self) -> list[list[str]]:
        """Return the rows as text, with one number of decimals down each column."""
        columns = [column_texts([row[k] for row in self.rows]) for k in range(len(self.columns))]
        return [list(row) for row in zip(*columns, strict=True)]

    def numeric(self) -> list[bool]:
        """Return for each column whether it holds numbers alone, and so stands to the right."""
        return [_is_numeric([row[k] for row in self.rows]) for k in range(len(self.columns))]

    def as_rich(self, styles: Mapping[str, str] | None = None) -> RichTable:
        """Return a table for the terminal.

        Args:
            styles: cell text -> rich style, e.g. {"proved": "green"}.
        """
        marks = styles or {}
        table = RichTable(
            title=escape(self.title) or None, caption=escape("\n".join(self.notes)) or None, caption_justify="left"
        )
        for name, right in zip(self.columns, self.numeric(), strict=True):
            # Numbers cut in two lines cannot be read; sentences may be folded.
            table.add_column(
                escape(name),
                justify="right" if right else "left",
                no_wrap=right,
                overflow="fold",
                min_width=None if right else 10,
            )
        for row in self.texts():
            table.add_row(*(f"[{marks[c]}]{escape(c)}[/]" if c in marks else escape(c) for c in row))
        return table

    def as_json(self) -> dict[str, Any]:
        """Return plain data: columns, one object a row, notes; numbers that JSON lacks become None."""
        rows = [{name: _plain(cell) for name, cell in zip(self.columns, row, strict=True)} for row in self.rows]
        return {"title": self.title, "columns": list(self.columns), "rows": rows, "notes": list(self.notes)}

    def as_html(self, colours: Mapping[str, str] | None = None) -> str:
        """Return an HTML table, numbers to the right, everything escaped.

        Args:
            colours: text of a first cell -> colour of the mark before it.
        """
        marks = colours or {}
        texts = self.texts()
        kinds = [
            "number" if right else "short" if all(len(row[k]) <= _SHORT for row in texts) else "long"
            for k, right in enumerate(self.numeric())
        ]
        head = "".join(
            f'<th scope="col" class="{k}">{html.escape(c)}</th>' for c, k in zip(self.columns, kinds, strict=True)
        )
        body = "".join(f"<tr>{_html_row(cells, kinds, marks)}</tr>" for cells in texts)
        caption = f"<caption>{html.escape(self.title)}</caption>" if self.title else ""
        notes = "".join(f'<p class="note">{html.escape(n)}</p>' for n in self.notes)
        return f'<div class="wide"><table>{caption}<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>{notes}'


def column_texts(cells: Sequence[Any]) -> list[str]:
    """Return the cells of one column as text, floats with a common number of decimals where their sizes allow it.

    Args:
        cells: text, numbers, True/False or None.
    """
    floats = [abs(float(c)) for c in cells if _is_float(c) and math.isfinite(c) and c != 0]
    if floats and min(floats) >= 1e-4 and max(floats) < 1e6:
        decimals = min(max(2 - math.floor(math.log10(min(floats))), 0), 5)
        # One tiny entry must not drag long tails behind every other number of the column.
        decimals = min(decimals, max(5 - math.floor(math.log10(max(floats))), 0))
        return [_cell_text(c, f".{decimals}f") for c in cells]
    return [_cell_text(c, ".3g") for c in cells]


def certificate_table(certificate: Certificate, *, seconds: Sequence[float] = ()) -> Table:
    """Return what is certified: one row a claim with level, outcome and margin; statements and reasons are its notes.

    Args:
        certificate: claims with proofs.
        seconds: time each proof took [s]; a column is left out where nothing is given.
    """
    columns = ["claim", "level", "outcome", "margin", *(["time [ms]"] if seconds else [])]
    rows, notes = [], []
    for k, proof in enumerate(certificate.proofs):
        time = [1e3 * seconds[k]] if seconds else []
        level = f"{proof.claim.level:.6g}"
        margin = f"{proof.margin:.2g}" if proof.margin else None
        rows.append([proof.claim.kind, level, proof.outcome.value, margin, *time])
        notes.append(f"{proof.claim.kind}: {proof.sentence} {proof.reason}")
    return Table(columns, rows, notes)


def gain_table(gain: Polynomial, system: System) -> Table:
    """Return a gain as people write it: a row a state, a column an output, each entry a polynomial in the parameters.

    Args:
        gain: L(r), shape (nx, ny).
        system: plant that names states and outputs.
    """
    rows = [
        [state, *(entry_text(gain, i, j) for j in range(gain.shape[1]))]
        for i, state in enumerate(system.states[: gain.shape[0]])
    ]
    names = [system.outputs[j] if j < len(system.outputs) else f"output {j + 1}" for j in range(gain.shape[1])]
    return Table(["state", *(f"from {name}" for name in names)], rows)


def entry_text(gain: Polynomial, row: int, column: int) -> str:
    """Return one entry of a matrix polynomial as text, e.g. "1.25 − 0.3·speed + 2·speed²".

    Args:
        gain: matrix polynomial with float coefficients.
        row: row of the entry.
        column: column of the entry.
    """
    text = ""
    for exponents, coefficient in sorted(gain, key=lambda term: (sum(term[0]), [-e for e in term[0]])):
        value = float(np.asarray(coefficient)[row, column])
        if value == 0.0:
            continue
        powers = [_power(n, e) for n, e in zip(gain.names, exponents, strict=True) if e]
        size = "·".join([f"{abs(value):.6g}", *powers])
        sign = ("−" if value < 0 else "") if not text else (" − " if value < 0 else " + ")
        text += sign + size
    return text or "0"


def _power(name: str, exponent: int) -> str:
    return name if exponent == 1 else name + str(exponent).translate(str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹"))


def _html_row(cells: Sequence[str], kinds: Sequence[str], marks: Mapping[str, str]) -> str:
    parts = []
    for k, (cell, kind) in enumerate(zip(cells, kinds, strict=True)):
        colour = marks.get(cell) if k == 0 else None
        mark = f'<span class="mark" style="background:{html.escape(colour)}"></span>' if colour else ""
        parts.append(f'<td class="{kind}">{mark}{html.escape(cell)}</td>')
    return "".join(parts)


def _is_float(cell: Any) -> bool:
    return isinstance(cell, Real) and not isinstance(cell, Integral | np.bool_)


def _is_numeric(cells: Sequence[Any]) -> bool:
    given = [c for c in cells if c is not None]
    return bool(given) and all(isinstance(c, Real) and not isinstance(c, bool | np.bool_) for c in given)


def _cell_text(cell: Any, style: str) -> str:
    if cell is None or (_is_float(cell) and math.isnan(cell)):
        return NOTHING
    if isinstance(cell, bool | np.bool_):
        return "yes" if cell else "no"
    if _is_float(cell):
        text = format(float(cell), style) if math.isfinite(cell) else str(float(cell))
        return text.replace("-", "−", 1) if text.startswith("-") else text
    return str(cell)


def _plain(cell: Any) -> Any:
    if cell is None or isinstance(cell, str | bool):
        return cell
    if isinstance(cell, np.bool_):
        return bool(cell)
    if isinstance(cell, Integral):
        return int(cell)
    if isinstance(cell, Real):
        return float(cell) if math.isfinite(cell) else None
    return str(cell)
