"""Order reduction: fewer generators whose zonotope holds the given one.

Every method keeps the generators that a box would fit worst and boxes the rest. All keep the number of generators fixed,
whatever the values, so that a propagation compiles once; ranks are found by counting comparisons, plain arithmetic that a
compiled loop runs without a sort and that can be written as C. The order of the columns of the result means nothing.

Reference: C. Combastel, ECC 2003, 3027-3032; A. Girard, HSCC 2005, 291-305; A.-K. Kopetzki, B. Schuermann, M. Althoff, CDC 2017,
5626-5633 (comparison of methods, PCA).
"""

import jax
import jax.numpy as jnp
import numpy as np

from luenberger.core import BadInput

# Up to so many columns cut off, holes are filled one after another; beyond, the program would grow and all columns are moved.
_UNROLLED = 16


def girard(generators: jax.Array, count: int) -> jax.Array:
    """Return at most `count` generators: the least box-like ones, and one box around the rest. The default.

    Choose it always, with `count` at least five times the dimension; in the long run it stays closest to the exact set on
    turning systems. The rest is chosen by |g|_1 - |g|_inf, which is zero for a generator along an axis.

    Args:
        generators: columns, shape (n, p).
        count: largest number of columns to return, at least n.

    Raises:
        BadInput: `count` below n.
    """
    size = jnp.abs(generators)
    return _reduced(generators, count, size.sum(axis=0) - size.max(axis=0))


def combastel(generators: jax.Array, count: int) -> jax.Array:
    """Return at most `count` generators: the longest ones, and one box around the rest.

    Choose it to compare with published results; on turning systems it can be several times as wide as `girard`.

    Args:
        generators: columns, shape (n, p).
        count: largest number of columns to return, at least n.

    Raises:
        BadInput: `count` below n.
    """
    return _reduced(generators, count, (generators**2).sum(axis=0))


def pca(generators: jax.Array, count: int) -> jax.Array:
    """Return at most `count` generators: the least box-like ones, and around the rest a box along its principal axes.

    Choose it where `count` has to stay near the dimension; it needs a singular value decomposition a step.

    Args:
        generators: columns, shape (n, p).
        count: largest number of columns to return, at least n.

    Raises:
        BadInput: `count` below n.
    """
    n, p = generators.shape
    if p <= _checked(count, n):
        return generators
    size = jnp.abs(generators)
    ranked = _ranked(generators, size.sum(axis=0) - size.max(axis=0))
    kept, rest = ranked[:, : count - n], ranked[:, count - n :]
    axes = jnp.linalg.svd(rest, full_matrices=True)[0]
    return jnp.concatenate([kept, axes * jnp.abs(axes.T @ rest).sum(axis=1)], axis=1)


def _reduced(generators: jax.Array, count: int, key: jax.Array) -> jax.Array:
    """Box the columns of least key; most of those that are kept stay where they are."""
    n, p = generators.shape
    if p <= _checked(count, n):
        return generators
    last = count - n
    if p - count > _UNROLLED:
        ranked = _ranked(generators, key)
        return jnp.concatenate([ranked[:, :last], jnp.diag(jnp.abs(ranked[:, last:]).sum(axis=1))], axis=1)
    rank = _ranks(key)
    radius = jnp.where(rank >= last, jnp.abs(generators), 0.0).sum(axis=1)
    # Moving all columns to their ranks would be a product with a p x p matrix, most of the cost. Only the holes are filled
    # instead, numbered by rank: the first n take the sides of the box, the others what is kept of the columns cut off.
    front, back = rank[:count], rank[count:]
    hole, turn = front - last, jnp.asarray(n, front.dtype)
    for k in range(p - count):
        hole = hole - ((back[k] >= last) & (back[k] < front))
    kept = generators[:, :count]
    for k in range(p - count):
        stays = back[k] < last
        kept = jnp.where(stays & (hole == turn), generators[:, count + k, None], kept)
        turn = turn + stays
    sides = jnp.where(hole[None, :] == np.arange(n)[:, None], radius[:, None], 0.0)
    return jnp.where((front >= last) & (hole < n), sides, kept)


def _ranked(generators: jax.Array, key: jax.Array) -> jax.Array:
    """The columns by falling key; equal keys keep their order."""
    place = (_ranks(key)[:, None] == np.arange(key.shape[0])).astype(generators.dtype)
    return generators @ place


def _ranks(key: jax.Array) -> jax.Array:
    """How many columns come before each, by falling key; equal keys keep their order, NaN comes first so that it is kept."""
    p = key.shape[0]
    key = jnp.where(jnp.isnan(key), jnp.inf, key)
    earlier = np.tri(p, k=-1, dtype=bool).T
    before = (key[:, None] > key[None, :]) | ((key[:, None] == key[None, :]) & earlier)
    # Four bytes rather than eight halve the time of many estimators at once.
    return before.sum(axis=0, dtype=jnp.int32)


def _checked(count: int, n: int) -> int:
    if count < n:
        raise BadInput(
            f"`count` is {count}; a zonotope of dimension {n} needs room for at least {n} generators after reduction."
        )
    return count
