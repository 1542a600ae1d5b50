"""Definiteness of symmetric matrices of exact rationals or balls, by LDL^T with three outcomes."""

from typing import Any

import numpy as np
from flint import arb, arb_mat, fmpq, fmpq_mat, fmpz

from luenberger.algebra.ball import Ball
from luenberger.algebra.endpoint import at_working_precision, number, rational
from luenberger.core import BadInput, Outcome


def exact(array: Any) -> np.ndarray:
    """Return an object array of flint rationals, each the exact value of the float, integer or rational given.

    Args:
        array: numbers in any nesting; a float means exactly that binary double.

    Raises:
        BadInput: an entry that is no finite number.
    """
    given: np.ndarray = np.asarray(array, dtype=object)
    out = np.empty(given.shape, dtype=object)
    for index, value in np.ndenumerate(given):
        out[index] = rational(value)
    return out


def positive_definite(matrix: np.ndarray) -> Outcome:
    """Decide whether a symmetric matrix is positive definite; rationals are always decided.

    Balls are factored as they are, then once more after a congruence with the Cholesky factor of the midpoint, which
    keeps the intervals from growing during the elimination.

    Args:
        matrix: object array (n, n) of `fmpq`, or with `Ball` entries, of which the lower triangle is read.

    Returns:
        PROVED: every matrix with entries in the balls is positive definite. REFUTED: none is. Else UNDECIDED.

    Raises:
        BadInput: not square, or rational entries that are not symmetric.
    """
    has_balls = _check(matrix)
    entries = [[_as_arb(x) for x in row] for row in matrix]
    outcome = _pivots_in_balls(entries)
    if outcome is not Outcome.UNDECIDED:
        return outcome
    if has_balls:
        return _scaled(entries)
    return Outcome.PROVED if _first_failure(_integers(matrix)) is None else Outcome.REFUTED


def definite(matrix: np.ndarray) -> Outcome:
    """Decide whether a symmetric matrix is definite of either sign; see `positive_definite`."""
    outcomes = (positive_definite(matrix), positive_definite(-matrix))
    if Outcome.PROVED in outcomes:
        return Outcome.PROVED
    return Outcome.REFUTED if outcomes == (Outcome.REFUTED, Outcome.REFUTED) else Outcome.UNDECIDED


def direction_of_failure(matrix: np.ndarray) -> np.ndarray:
    """Return a rational vector v, not zero, with v^T M v <= 0 exactly, for a matrix that is not positive definite.

    Args:
        matrix: symmetric object array (n, n) of `fmpq`.

    Returns:
        object array (n,) of `fmpq`: the eigenvector in doubles where that serves, else the exact solution of the first
        leading block that fails.

    Raises:
        BadInput: not square, not symmetric, entries that are not rational, or positive definite.
    """
    if _check(matrix):
        raise BadInput("`matrix` holds balls; a direction of failure needs exact rationals, e.g. `exact(midpoints)`.")
    scale = max((abs(x) for x in matrix.flat), default=fmpq(1)) or fmpq(1)
    floats = np.array([[_as_float(x / scale) for x in row] for row in matrix]).reshape(matrix.shape)
    v = exact(np.linalg.eigh(floats)[1][:, 0]) if floats.size else np.empty(0, dtype=object)
    if floats.size and v @ matrix @ v <= 0:
        return v
    k = _first_failure(_integers(matrix))
    if k is None:
        raise BadInput("`matrix` is positive definite; no direction of failure exists.")
    v = np.array([fmpq(0)] * len(matrix), dtype=object)
    v[k] = fmpq(1)
    if k:
        block = fmpq_mat(k, k, list(matrix[:k, :k].flat)).solve(fmpq_mat(k, 1, list(-matrix[:k, k])))
        v[:k] = block.entries()
    return v


def _check(matrix: np.ndarray) -> bool:
    """Refuse what is not a symmetric matrix; return True where balls are inside."""
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1] or matrix.dtype != object:
        raise BadInput(
            f"`matrix` has shape {matrix.shape} and type {matrix.dtype}; a square object array of rationals or balls "
            "is needed. `exact(array)` makes one from floats."
        )
    has_balls = any(isinstance(x, Ball) for x in matrix.flat)
    if not has_balls and (matrix != matrix.T).any():
        i, j = np.argwhere(matrix != matrix.T)[0]
        raise BadInput(
            f"`matrix` holds {matrix[i, j]} at ({i}, {j}) but {matrix[j, i]} at ({j}, {i}); "
            "a symmetric matrix is needed. Use (M + M.T) / 2."
        )
    return has_balls


def _as_float(value: fmpq) -> float:
    return int(value.p) / int(value.q)


@at_working_precision
def _as_arb(value: Any) -> arb:
    return value.as_arb() if isinstance(value, Ball) else number(value)


@at_working_precision
def _pivots_in_balls(entries: list[list[arb]]) -> Outcome:
    """LDL^T with midpoint-radius balls: all pivots above zero prove; the first one at or below zero refutes."""
    rows = [list(row) for row in entries]
    for k, row in enumerate(rows):
        pivot = row[k]
        if not pivot > 0:
            return Outcome.REFUTED if pivot <= 0 else Outcome.UNDECIDED
        for i in range(k + 1, len(rows)):
            factor = rows[i][k] / pivot
            for j in range(k + 1, i + 1):
                rows[i][j] -= factor * rows[j][k]
    return Outcome.PROVED


@at_working_precision
def _scaled(entries: list[list[arb]]) -> Outcome:
    """Prove after a congruence that turns the midpoint into nearly the identity, or refute along one direction."""
    n = len(entries)
    full = [[entries[max(i, j)][min(i, j)] for j in range(n)] for i in range(n)]
    middle = np.array([[float(x.mid()) for x in row] for row in full])
    if not np.isfinite(middle).all():
        return Outcome.UNDECIDED
    values, vectors = np.linalg.eigh(middle)
    if values[0] <= 0:
        v = arb_mat(1, n, vectors[:, 0].tolist())
        return Outcome.REFUTED if (v * arb_mat(full) * v.transpose())[0, 0] <= 0 else Outcome.UNDECIDED
    try:
        scaling = arb_mat(np.linalg.inv(np.linalg.cholesky(middle)).tolist())
    except np.linalg.LinAlgError:
        return Outcome.UNDECIDED
    outcome = _pivots_in_balls((scaling * arb_mat(full) * scaling.transpose()).tolist())
    return outcome if outcome is Outcome.PROVED else Outcome.UNDECIDED


def _integers(matrix: np.ndarray) -> list[list[fmpz]]:
    """Clear the common denominator, which leaves definiteness as it is."""
    return fmpq_mat(len(matrix), len(matrix), list(matrix.flat)).numer_denom()[0].tolist()


def _first_failure(rows: list[list[fmpz]]) -> int | None:
    """Index of the first leading minor that is not positive, by fraction-free elimination; None where all are."""
    previous = fmpz(1)
    for k, row in enumerate(rows):
        pivot = row[k]
        if not pivot > 0:
            return k
        for i in range(k + 1, len(rows)):
            lower, factor = rows[i], rows[i][k]
            for j in range(k + 1, i + 1):
                lower[j] = (lower[j] * pivot - factor * rows[j][k]) // previous
        previous = pivot
    return None
