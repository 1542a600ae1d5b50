"""How much an uncertain factor can push, given what is known of state, input and disturbance at a sample.

A plant x+ = A x + B u + E d + sum_k direction_k s_k row_k [x; u; d] with |s_k| <= 1 differs from its nominal by vectors along the
directions, no longer than the largest |row_k [x; u; d]|. Less exact bounds, of the entries of that vector, are here too, because
published observers use them.
"""

from typing import Any

import jax
import jax.numpy as jnp

from luenberger.observers.small_matrix import product
from luenberger.sets import Interval


def factor_bound(rows: Any, x: Interval, u: Any, input_error: Any, disturbance_bound: Any) -> jax.Array:
    """Return the largest |row [x; u; d]| of every row, x, u and d anywhere in their boxes; exact up to rounding.

    Choose it for generators along the directions of uncertain factors: what two entries of the state have in common stays so.

    Args:
        rows: shape (nk, nx + nu + nd).
        x: finite box that holds the state.
        u: measured input, shape (nu,).
        input_error: largest |true - measured input|, shape (nu,).
        disturbance_bound: largest |d|, shape (nd,).

    Returns:
        Shape (nk,).
    """
    box = signal_box(x, u, input_error, disturbance_bound)
    return jnp.abs(product(rows, box.center)) + product(jnp.abs(rows), box.radius)


def entry_bound(directions: Any, rows: Any, box: Interval) -> jax.Array:
    """Return the largest |entry| of M [x; u; d] over all M with |M| <= |directions| |rows|, shape (nx,).

    The product of an interval matrix about zero and a box, entry by entry, so what rank-one factors have in common is lost.

    Args:
        directions: shape (nx, nk).
        rows: shape (nk, nx + nu + nd).
        box: box of [x; u; d].
    """
    return product(product(jnp.abs(directions), jnp.abs(rows)), box.magnitude)


def split_entry_bound(directions: Any, rows: Any, box: Interval) -> jax.Array:
    """Return the bound of `entry_bound` from positive and negative parts, up to twice as large where a box holds zero.

    Choose it only to compare with interval observers that use this lemma. For |M| <= R it reads R (upper^+ + lower^-).

    Args:
        directions: shape (nx, nk).
        rows: shape (nk, nx + nu + nd).
        box: box of [x; u; d].

    Reference: D. Efimov, T. Raissi, S. Chebotarev, A. Zolghadri, Automatica 49 (2013) 200-205, lemma 1.
    """
    parts = jnp.maximum(box.upper, 0.0) + jnp.maximum(-box.lower, 0.0)
    return product(product(jnp.abs(directions), jnp.abs(rows)), parts)


def signal_box(x: Interval, u: Any, input_error: Any, disturbance_bound: Any) -> Interval:
    """Return the box of [x; u; d].

    Args:
        x: box that holds the state.
        u: measured input, shape (nu,).
        input_error: largest |true - measured input|, shape (nu,).
        disturbance_bound: largest |d|, shape (nd,).
    """
    lower = jnp.concatenate([x.lower, u - input_error, -disturbance_bound])
    upper = jnp.concatenate([x.upper, u + input_error, disturbance_bound])
    return Interval(lower, upper)
