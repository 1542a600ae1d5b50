"""Intervals of vectors and matrices: everything between two bounds, entry by entry."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from luenberger.core import BadInput


class Interval(eqx.Module):
    """All arrays between two bounds, entry by entry: a box where the array is a vector.

    Choose it for bounds on parameters, inputs and noise; a set that is carried along by a map wants `Zonotope`, since boxes
    grow when they are turned. Bounds are JAX arrays, so intervals pass through jit, vmap and scan; they are rounded to
    nearest, so an inclusion is exact up to rounding (`algebra.ball` rounds outward).

    Args:
        lower: lower bounds, any shape.
        upper: upper bounds, the same shape.
    """

    # NumPy arrays on the left hand side must leave the operation to us.
    __array_ufunc__ = None

    lower: jax.Array
    upper: jax.Array

    @staticmethod
    def of(lower: Any, upper: Any) -> "Interval":
        """Check two bounds and put them together.

        Args:
            lower: lower bounds, nested numbers.
            upper: upper bounds, the same shape.

        Raises:
            BadInput: shapes that differ, NaN, or a lower bound above its upper bound.
        """
        low, high = np.asarray(lower, dtype=float), np.asarray(upper, dtype=float)
        if low.shape != high.shape:
            raise BadInput(f"An interval has bounds of shapes {low.shape} and {high.shape}; both need one shape.")
        if np.isnan(low).any() or np.isnan(high).any() or (low > high).any():
            where = tuple(int(i) for i in np.argwhere(~(low <= high))[0])
            raise BadInput(
                f"An interval has [{low[where]}, {high[where]}] at entry {where}; lower <= upper is needed, without NaN."
            )
        return Interval(jnp.asarray(low), jnp.asarray(high))

    @staticmethod
    def around(center: Any, radius: Any) -> "Interval":
        """Return center ± radius.

        Args:
            center: midpoints, any shape.
            radius: half widths >= 0, a shape that broadcasts to it.

        Raises:
            BadInput: a negative radius or NaN.
        """
        middle, half = np.broadcast_arrays(np.asarray(center, dtype=float), np.asarray(radius, dtype=float))
        if not (half >= 0).all():
            raise BadInput(f"`radius` is {np.asarray(radius).tolist()}; half widths >= 0 are needed.")
        return Interval.of(middle - half, middle + half)

    @property
    def center(self) -> jax.Array:
        """Midpoints."""
        return 0.5 * (self.lower + self.upper)

    @property
    def radius(self) -> jax.Array:
        """Half widths."""
        return 0.5 * (self.upper - self.lower)

    @property
    def magnitude(self) -> jax.Array:
        """Largest absolute value of each entry."""
        return jnp.maximum(jnp.abs(self.lower), jnp.abs(self.upper))

    def __add__(self, other: Any) -> "Interval":
        other = as_interval(other)
        return Interval(self.lower + other.lower, self.upper + other.upper)

    __radd__ = __add__

    def __neg__(self) -> "Interval":
        return Interval(-self.upper, -self.lower)

    def __sub__(self, other: Any) -> "Interval":
        return self + -as_interval(other)

    def __rsub__(self, other: Any) -> "Interval":
        return as_interval(other) - self

    def __mul__(self, other: Any) -> "Interval":
        """Entrywise product: least and greatest of the four products of bounds, the exact range of each entry."""
        other = as_interval(other)
        corners = [_corner(a, b) for a in (self.lower, self.upper) for b in (other.lower, other.upper)]
        low, high = corners[0], corners[0]
        for corner in corners[1:]:
            low, high = jnp.minimum(low, corner), jnp.maximum(high, corner)
        return Interval(low, high)

    __rmul__ = __mul__

    def __matmul__(self, other: Any) -> "Interval":
        """Product of an interval matrix and an interval vector or matrix: the smallest box around all products.

        Each entry is a sum of products of entries that vary freely, so the sum of their exact ranges is exact.
        """
        return _product(self, as_interval(other))

    def __rmatmul__(self, other: Any) -> "Interval":
        return _product(as_interval(other), self)

    def intersection(self, other: "Interval") -> "Interval":
        """Return what both hold. Where they do not meet the bounds are the wrong way round, see `is_empty`.

        Args:
            other: interval of the same shape.
        """
        return Interval(jnp.maximum(self.lower, other.lower), jnp.minimum(self.upper, other.upper))

    def hull(self, other: "Interval") -> "Interval":
        """Return the smallest interval that holds both.

        Args:
            other: interval of the same shape.
        """
        return Interval(jnp.minimum(self.lower, other.lower), jnp.maximum(self.upper, other.upper))

    @property
    def is_empty(self) -> jax.Array:
        """True where some entry has its bounds the wrong way round; a JAX scalar."""
        return jnp.any(self.lower > self.upper)

    def contains(self, point: Any, tolerance: float = 0.0) -> jax.Array:
        """Return whether every entry of a point lies between its bounds; a JAX scalar.

        Args:
            point: array of the same shape.
            tolerance: how far outside still counts as inside.

        Raises:
            BadInput: a point of another shape.
        """
        x = jnp.asarray(point)
        if x.shape != self.lower.shape:
            raise BadInput(f"`point` has shape {x.shape}; that of the interval, {self.lower.shape}, is needed.")
        return jnp.all((x >= self.lower - tolerance) & (x <= self.upper + tolerance))


def as_interval(value: Any) -> Interval:
    """Return an interval as it is, and a number or array as the interval that holds only it.

    Args:
        value: interval, number or array.
    """
    if isinstance(value, Interval):
        return value
    array = jnp.asarray(value)
    return Interval(array, array)


def _corner(a: jax.Array, b: jax.Array) -> jax.Array:
    """a b, with zero times infinity zero: an end at infinity stands for numbers without bound, each finite."""
    unbounded = ((a == 0) & jnp.isinf(b)) | ((b == 0) & jnp.isinf(a))
    return jnp.where(unbounded, 0.0, a * b)


def _product(A: Interval, x: Interval) -> Interval:
    if A.lower.ndim != 2 or x.lower.ndim not in (1, 2) or A.lower.shape[1] != x.lower.shape[0]:
        raise BadInput(
            f"A product of interval shapes {A.lower.shape} and {x.lower.shape} does not exist; (m, n) and (n,) or (n, k) are needed."
        )
    vector = x.lower.ndim == 1
    right = Interval(x.lower[:, None], x.upper[:, None]) if vector else x
    terms = Interval(A.lower[:, :, None], A.upper[:, :, None]) * Interval(right.lower[None], right.upper[None])
    low, high = terms.lower.sum(axis=1), terms.upper.sum(axis=1)
    return Interval(low[:, 0], high[:, 0]) if vector else Interval(low, high)
