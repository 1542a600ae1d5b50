"""Finitely many matrix inequalities that stand for one inequality on a whole box."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any, Protocol, runtime_checkable

import numpy as np

from luenberger.algebra import Polynomial
from luenberger.core import BadInput, NotAccepted
from luenberger.lmi.relaxed import Relaxed, plain

Box = Mapping[str, tuple[float, float]]


@runtime_checkable
class Relaxation(Protocol):
    """Replaces `matrix(r) <= level I for all r in the box` by finitely many conditions that imply it."""

    def relaxed(self, matrix: Polynomial, box: Box) -> list[Relaxed]:
        """Return conditions that together imply the inequality; each element stands for a part of the box.

        Args:
            matrix: polynomial whose coefficients are the numeric forms K of symmetric matrices, vec(F) = K @ [x; 1].
            box: parameter name -> interval.
        """
        ...


class ConstantMatrices(ABC):
    """A relaxation by matrices that are combinations of the coefficients, without unknowns of its own."""

    @abstractmethod
    def matrices(self, matrix: Polynomial, box: Box) -> list[Any]:
        """Return the matrices that must be negative definite; the coefficients may be of any arithmetic.

        Args:
            matrix: symmetric polynomial.
            box: parameter name -> interval.
        """
        ...

    def relaxed(self, matrix: Polynomial, box: Box) -> list[Relaxed]:
        """Return one condition for each matrix; see `Relaxation`.

        Args:
            matrix: polynomial of numeric forms.
            box: parameter name -> interval.
        """
        return [plain(K) for K in self.matrices(matrix, box)]


@dataclass(frozen=True)
class Bernstein(ConstantMatrices):
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
class Vertices(ConstantMatrices):
    """The corners of the box; refused unless the matrix is multi-affine, where they decide exactly."""

    def matrices(self, matrix: Polynomial, box: Box) -> list[Any]:
        """Return the values at the corners.

        Raises:
            NotAccepted: a parameter enters with a power above one, so that vertices prove nothing.
        """
        if not matrix.is_multi_affine:
            raise NotAccepted(
                f"The inequality has degrees {matrix.degree}; vertices are unsound above 1. Use `Planned` or `Bernstein`."
            )
        return list(matrix.bernstein(box).values())


@dataclass(frozen=True)
class Grid(ConstantMatrices):
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
