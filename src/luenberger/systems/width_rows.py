"""The rows that bound how the width of an enclosure changes, entry by entry."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

from luenberger.algebra import Polynomial

# Row, column, candidates.
Cells = list[list[list[Polynomial]]]


@dataclass(frozen=True)
class WidthRows:
    """Candidates of every entry: at every point of the box one of them is the maximum.

    Args:
        loop: of Mbar, (nx, nx).
        states: of R, (nx, nx).
        inputs: of U, (nx, nu).
        noise: of twice the slack of every noise, (nx, nv).
        disturbance: of twice the slack of every unknown input, (nx, nd).
    """

    loop: Cells
    states: Cells
    inputs: Cells
    noise: Cells
    disturbance: Cells

    def totals(self, i: int, v: Sequence[Any], x: Sequence[Any], u: Sequence[Any]) -> list[Polynomial]:
        """Return every candidate of row i of Mbar v + R x + U u + 2 slack, as scalars.

        Args:
            i: row.
            v: widths, in the arithmetic of the coefficients.
            x: bounds of |x|.
            u: bounds of |u|.
        """
        parts = [[p * c for p in choices] for choices, c in zip(self.loop[i], v, strict=True)]
        return [_total(choice) for choice in product(*parts, self.drive(i, x, u))]

    def drive(self, i: int, x: Sequence[Any], u: Sequence[Any]) -> list[Polynomial]:
        """Return every candidate of row i of R x + U u + 2 slack, what widens the enclosure; arguments as in `totals`."""
        parts = [
            [p * c for p in choices]
            for row, factors in ((self.states[i], x), (self.inputs[i], u))
            for choices, c in zip(row, factors, strict=True)
        ]
        return [_total(choice) for choice in product(*parts, *self.noise[i], *self.disturbance[i])]


def _total(parts: Sequence[Polynomial]) -> Polynomial:
    total = parts[0]
    for part in parts[1:]:
        total = total + part
    return total
