"""Definiteness of a parameter-dependent matrix on a whole box, by exact or outward-rounded arithmetic and subdivision."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from luenberger.algebra import Polynomial
from luenberger.algebra.ball import Ball
from luenberger.algebra.definiteness import exact, positive_definite
from luenberger.algebra.polynomial import fraction
from luenberger.core import BadInput, Outcome

ExactBox = Mapping[str, tuple[Fraction, Fraction]]
BallMatrix = Callable[[Mapping[str, Ball]], np.ndarray]


@dataclass(frozen=True)
class Verdict:
    """Answer about a matrix on a box.

    Args:
        outcome: proved, refuted or undecided.
        margin: proved t with matrix <= -t I on the whole box; 0 where none was proved.
        point: parameter values where the matrix is not negative definite (refuted), or the piece where the effort
            ended (undecided).
        pieces: number of sub-boxes examined.
    """

    outcome: Outcome
    margin: float
    point: Mapping[str, float]
    pieces: int


def negative_definite(
    matrix: Polynomial | BallMatrix, box: Mapping[str, tuple[Any, Any]], *, pieces: int = 2000
) -> Verdict:
    """Decide whether a symmetric matrix is negative definite for all parameters in a box.

    A polynomial needs exact rational coefficients: its Bernstein coefficients decide a piece, and its exact values at the
    corners refute. A function of balls is evaluated over the whole piece and at its middle.

    Args:
        matrix: `Polynomial` with exact coefficients, or a function from name -> `Ball` to an object array of balls.
        box: parameter name -> (lower, upper).
        pieces: largest number of sub-boxes to examine.

    Raises:
        BadInput: `pieces` below one.
    """
    if pieces < 1:
        raise BadInput(f"`pieces` is {pieces}; at least one piece is needed.")
    names = matrix.names if isinstance(matrix, Polynomial) else tuple(box)
    start: ExactBox = {n: (fraction(box[n][0]), fraction(box[n][1])) for n in names if n in box}
    queue, done, margin = [start], 0, np.inf
    while queue:
        piece = queue.pop()
        done += 1
        outcome, here, point = (
            _polynomial_piece(matrix, piece) if isinstance(matrix, Polynomial) else _ball_piece(matrix, piece)
        )
        if outcome is Outcome.REFUTED:
            return Verdict(outcome, 0.0, point, done)
        if outcome is Outcome.PROVED:
            margin = min(margin, here)
        elif done + len(queue) >= pieces or not piece:
            return Verdict(Outcome.UNDECIDED, 0.0, _middle(piece), done)
        else:
            queue += _halves(piece, start, _bent(matrix, piece))
    return Verdict(Outcome.PROVED, float(margin), {}, done)


def proved_margin(matrix: np.ndarray) -> tuple[Outcome, float]:
    """Return the outcome of `matrix` > 0 and a t >= 0 for which matrix >= t I is proved.

    Args:
        matrix: symmetric object array of exact rationals or balls.
    """
    n = matrix.shape[0]
    estimate = 0.99 * float(np.linalg.eigvalsh(as_float(matrix)).min())
    if estimate > 0:
        shifted = matrix - exact(estimate * np.eye(n))
        if positive_definite(shifted) is Outcome.PROVED:
            return Outcome.PROVED, estimate
    return positive_definite(matrix), 0.0


def as_float(matrix: np.ndarray) -> np.ndarray:
    """Round an object array of rationals or balls to doubles (midpoints); a guide for the search, never a proof.

    Args:
        matrix: object array of rationals or balls.
    """

    def middle(x: Any) -> float:
        return 0.5 * (x.lower + x.upper) if isinstance(x, Ball) else float(fraction(x))

    return np.vectorize(middle, otypes=[float])(matrix)


def _polynomial_piece(matrix: Polynomial, piece: ExactBox) -> tuple[Outcome, float, dict[str, float]]:
    coefficients = matrix.bernstein(piece)
    degree = matrix.degree
    total, margin = Outcome.PROVED, np.inf
    for index, coefficient in coefficients.items():
        outcome, here = proved_margin(-coefficient)
        margin = min(margin, here)
        if outcome is Outcome.PROVED:
            continue
        total = Outcome.UNDECIDED
        if all(i in (0, degree[n]) for i, n in zip(index, matrix.names, strict=True)):
            corner = {n: float(piece[n][i > 0]) for i, n in zip(index, matrix.names, strict=True) if n in piece}
            return Outcome.REFUTED, 0.0, corner
    return total, float(margin), {}


def _ball_piece(matrix: BallMatrix, piece: ExactBox) -> tuple[Outcome, float, dict[str, float]]:
    outcome, margin = proved_margin(-matrix({n: Ball.hull(lower, upper) for n, (lower, upper) in piece.items()}))
    if outcome is Outcome.PROVED:
        return outcome, margin, {}
    middle = _middle(piece)
    if positive_definite(-matrix({n: Ball.exact(v) for n, v in middle.items()})) is Outcome.REFUTED:
        return Outcome.REFUTED, 0.0, middle
    return Outcome.UNDECIDED, 0.0, {}


def _middle(piece: ExactBox) -> dict[str, float]:
    return {n: float((lower + upper) / 2) for n, (lower, upper) in piece.items()}


def _bent(matrix: Polynomial | BallMatrix, piece: ExactBox) -> list[str]:
    """Axes along which splitting can help: where a polynomial is affine its corners already decide."""
    if isinstance(matrix, Polynomial):
        degree = matrix.degree
        return [n for n in piece if degree[n] > 1] or list(piece)
    return list(piece)


def _halves(piece: ExactBox, start: ExactBox, axes: list[str]) -> list[ExactBox]:
    def share(name: str) -> Fraction:
        whole = start[name][1] - start[name][0]
        return (piece[name][1] - piece[name][0]) / whole if whole else Fraction(0)

    name = max(axes, key=share)
    lower, upper = piece[name]
    middle = (lower + upper) / 2
    return [{**piece, name: (lower, middle)}, {**piece, name: (middle, upper)}]
