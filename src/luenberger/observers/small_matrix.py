"""Factorisations of small symmetric matrices, unrolled column by column when the step is traced.

LAPACK calls are slow to start inside a compiled loop and cannot be written as C; up to about ten rows these forms
are faster and hold nothing but additions, products, one division and one root a column.
"""

import math

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from luenberger.systems.exponential import product

__all__ = ["cholesky", "product", "solve_lower", "solve_positive", "solve_upper", "symmetrised"]


def cholesky(A: Float[Array, "n n"]) -> Float[Array, "n n"]:
    """Return the lower triangular L with L L' = A.

    A pivot that is zero within rounding gives a zero column, so singular covariances (a state known exactly, perfectly
    correlated states) are allowed; a pivot below -sqrt(eps) of its diagonal entry gives NaN, so a clearly indefinite
    matrix is never repaired in silence.

    Args:
        A: symmetric positive semidefinite matrix; only its lower triangle counts.
    """
    n = A.shape[0]
    eps = float(jnp.finfo(A.dtype).eps)
    rows = np.arange(n)
    columns = []
    rest = A
    for j in range(n):
        pivot = rest[j, j]
        positive = pivot > n * eps * A[j, j]
        zero = jnp.abs(pivot) <= math.sqrt(eps) * jnp.abs(A[j, j])
        inverse_root = jnp.where(
            positive, 1.0 / jnp.sqrt(jnp.where(positive, pivot, 1.0)), jnp.where(zero, 0.0, jnp.nan)
        )
        column = jnp.where(rows >= j, rest[:, j] * inverse_root, 0.0)
        columns.append(column)
        if j + 1 < n:
            rest = rest - column[:, None] * column[None, :]
    return jnp.stack(columns, axis=1)


def solve_lower(L: Float[Array, "n n"], b: Float[Array, "n k"]) -> Float[Array, "n k"]:
    """Return X with L X = b for lower triangular L with a diagonal free of zeros.

    Args:
        L: lower triangular matrix.
        b: right-hand sides side by side.
    """
    rest, rows = b, []
    for j in range(L.shape[0]):
        rows.append(rest[j] / L[j, j])
        rest = rest - L[:, j, None] * rows[-1]
    return jnp.stack(rows)


def solve_upper(L: Float[Array, "n n"], b: Float[Array, "n k"]) -> Float[Array, "n k"]:
    """Return X with L' X = b for lower triangular L with a diagonal free of zeros.

    Args:
        L: lower triangular matrix, used transposed.
        b: right-hand sides side by side.
    """
    rest, rows = b, []
    for j in reversed(range(L.shape[0])):
        rows.append(rest[j] / L[j, j])
        rest = rest - L[j, :, None] * rows[-1]
    return jnp.stack(rows[::-1])


def solve_positive(A: Float[Array, "n n"], b: Float[Array, "n k"]) -> Float[Array, "n k"]:
    """Return X with A X = b for symmetric positive definite A.

    Args:
        A: symmetric positive definite matrix.
        b: right-hand sides side by side; the identity gives the inverse.
    """
    if A.shape[0] == 1:
        return b / A
    L = cholesky(A)
    return solve_upper(L, solve_lower(L, b))


def symmetrised(A: Float[Array, "n n"]) -> Float[Array, "n n"]:
    """Return (A + A')/2, which removes the asymmetry that rounding builds up in a covariance.

    Args:
        A: nearly symmetric matrix.
    """
    return 0.5 * (A + A.T)
