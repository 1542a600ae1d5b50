"""Finitely many matrix inequalities that stand for one inequality on a whole box."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any, Protocol, runtime_checkable

import numpy as np

from luenberger.algebra import Polynomial
from luenberger.core import BadInput, NotAccepted

Box = Mapping[str, tuple[float, float]]


@runtime_checkable
class Relaxation(Protocol):
    """Turns `matrix(r) < 0 for all r in the box` into a list of constant matrix inequalities."""

    def matrices(self, matrix: Polynomial, box: Box) -> list[Any]:
        """Return the matrices that must be negative definite."""
        ...


@dataclass(frozen=True)
class Bernstein:
    """Bernstein coefficients: sound always, exact (the vertices) where the matrix is multi-affine.

    Args:
        elevation: degrees added above the true ones; more is tighter and larger.
        parts: number of equal sub-intervals of every axis with degree above one; more is tighter and larger.
    """

    elevation: int = 0
    parts: int = 1

    def __post_init__(self) -> None:
        if self.elevation < 0 or self.parts < 1:
            raise BadInput(
                f"Bernstein has elevation {self.elevation} and parts {self.parts}; >= 0 and >= 1 are needed."
            )

    def matrices(self, matrix: Polynomial, box: Box) -> list[Any]:
        """Return all Bernstein coefficients of all sub-boxes."""
        bent = {n for n, d in matrix.degree.items() if d > 1}
        degree = {n: d + self.elevation * (n in bent) for n, d in matrix.degree.items()}
        return [c for piece in _pieces(matrix, box, self.parts, bent) for c in matrix.bernstein(piece, degree).values()]


@dataclass(frozen=True)
class Vertices:
    """The corners of the box; refused unless the matrix is multi-affine, where they decide exactly."""

    def matrices(self, matrix: Polynomial, box: Box) -> list[Any]:
        """Return the values at the corners.

        Raises:
            NotAccepted: a parameter enters with a power above one, so that vertices prove nothing.
        """
        if not matrix.is_multi_affine:
            raise NotAccepted(
                f"The inequality has degrees {matrix.degree}; vertices are unsound above 1. Use `Bernstein`."
            )
        return list(matrix.bernstein(box).values())


@dataclass(frozen=True)
class Grid:
    """Values at grid points: necessary, never sufficient; a design made with it stands only by its certificate.

    Args:
        points: points on every axis.
    """

    points: int = 5

    def matrices(self, matrix: Polynomial, box: Box) -> list[Any]:
        """Return the values at the grid points."""
        axes = [np.linspace(*box[n], self.points) if matrix.degree[n] else [0.0] for n in matrix.names]
        return [matrix(dict(zip(matrix.names, point, strict=True))) for point in product(*axes)]


def _pieces(matrix: Polynomial, box: Box, parts: int, bent: set[str]) -> Sequence[Box]:
    used = [n for n in matrix.names if n in box]
    cuts = [np.linspace(*box[n], (parts if n in bent else 1) + 1) for n in used]
    ranges = [range(len(c) - 1) for c in cuts]
    return [{n: (c[k], c[k + 1]) for n, c, k in zip(used, cuts, index, strict=True)} for index in product(*ranges)]
