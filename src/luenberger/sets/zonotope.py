"""Zonotopes: images of a unit box, closed under linear maps and sums."""

from collections.abc import Callable
from itertools import combinations
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from scipy.optimize import linprog

from luenberger.core import BadInput
from luenberger.core.checks import finite_array
from luenberger.sets.interval import Interval
from luenberger.sets.reduction import girard


class Zonotope(eqx.Module):
    """The set {center + generators b, |b_k| <= 1}.

    Choose it for a set that linear maps carry along: maps and sums are exact, and only `reduce` widens it. Arrays are JAX
    arrays of fixed shape, so propagation passes through jit, vmap and scan; results hold up to rounding.

    Args:
        center: shape (n,).
        generators: one column a generator, shape (n, ng).

    Reference: W. Kuehn, Computing 61 (1998) 47-67; names of operations as in CORA (M. Althoff, ARCH 2015).
    """

    # NumPy arrays on the left hand side must leave the operation to us.
    __array_ufunc__ = None

    center: jax.Array
    generators: jax.Array

    @staticmethod
    def of(center: Any, generators: Any) -> "Zonotope":
        """Check center and generators and put them together.

        Args:
            center: shape (n,).
            generators: shape (n, ng).

        Raises:
            BadInput: shapes that do not belong together, NaN or infinite entries.
        """
        c, G = finite_array("center", center), finite_array("generators", generators)
        if c.ndim != 1 or G.ndim != 2 or G.shape[0] != c.shape[0]:
            raise BadInput(
                f"A zonotope has a center of shape {c.shape} and generators of shape {G.shape}; (n,) and (n, ng) are needed."
            )
        return Zonotope(jnp.asarray(c), jnp.asarray(G))

    @staticmethod
    def from_interval(box: Interval) -> "Zonotope":
        """Return a box as a zonotope with one generator an axis.

        Args:
            box: interval of shape (n,).
        """
        return Zonotope(box.center, jnp.diag(box.radius))

    @property
    def dimension(self) -> int:
        """n."""
        return int(self.center.shape[0])

    @property
    def order(self) -> float:
        """Generators a dimension."""
        return self.generators.shape[1] / self.generators.shape[0]

    def __rmatmul__(self, matrix: Any) -> "Zonotope":
        """The image under a linear map; exact."""
        M = jnp.asarray(matrix)
        if M.ndim != 2 or M.shape[1] != self.dimension:
            raise BadInput(f"A zonotope of dimension {self.dimension} has no image under a matrix of shape {M.shape}.")
        return Zonotope(M @ self.center, M @ self.generators)

    def __add__(self, other: Any) -> "Zonotope":
        """Minkowski sum with a zonotope, or a shift by a vector; exact."""
        if isinstance(other, Zonotope):
            return Zonotope(self.center + other.center, jnp.concatenate([self.generators, other.generators], axis=1))
        return Zonotope(self.center + jnp.asarray(other), self.generators)

    __radd__ = __add__

    def interval(self) -> Interval:
        """Return the interval hull, the smallest box around it."""
        radius = jnp.abs(self.generators).sum(axis=1)
        return Interval(self.center - radius, self.center + radius)

    def support(self, direction: Any) -> jax.Array:
        """Return the largest value of direction' x over the set.

        Args:
            direction: shape (n,).
        """
        d = jnp.asarray(direction)
        return d @ self.center + jnp.abs(d @ self.generators).sum()

    def reduce(self, count: int, method: Callable[[jax.Array, int], jax.Array] = girard) -> "Zonotope":
        """Return a zonotope around this one with at most `count` generators.

        Args:
            count: largest number of generators, at least n; five times n is a good choice.
            method: one of `girard` (default), `combastel`, `pca`.

        Raises:
            BadInput: `count` below n.
        """
        return Zonotope(self.center, method(self.generators, count))

    def contains(self, point: Any, tolerance: float = 1e-9) -> bool:
        """Return whether a point lies in the set, by a linear programme.

        The smallest s with point = center + generators b, |b_k| <= s is sought; inside means s <= 1 + tolerance.

        Args:
            point: shape (n,).
            tolerance: slack of s.
        """
        return self.depth(point) <= 1.0 + tolerance

    def depth(self, point: Any) -> float:
        """Return how far the set must be scaled about its center to hold a point; infinite where no scale does.

        Args:
            point: shape (n,).

        Raises:
            BadInput: a point of another length, or not finite.
        """
        G = np.asarray(self.generators)
        n, p = G.shape
        given = finite_array("point", point)
        if given.shape != (n,):
            raise BadInput(f"`point` has shape {given.shape}; ({n},) is needed.")
        offset = given - np.asarray(self.center)
        # Row by row: under one scale for all, a state of small numbers would drown in the tolerance of the solver.
        scale = np.abs(G).max(axis=1, initial=0.0)
        if (offset[scale == 0] != 0).any():
            return float("inf")
        scale[scale == 0] = 1.0
        bounds = np.hstack([np.vstack([np.eye(p), -np.eye(p)]), -np.ones((2 * p, 1))])
        answer = linprog(
            np.append(np.zeros(p), 1.0),
            A_ub=bounds,
            b_ub=np.zeros(2 * p),
            A_eq=np.hstack([G / scale[:, None], np.zeros((n, 1))]),
            b_eq=offset / scale,
            bounds=[(None, None)] * p + [(0, None)],
            method="highs",
        )
        return float(answer.fun) if answer.status == 0 else float("inf")

    def volume(self) -> float:
        """Return the volume, 2^n times the sum of |det| over all choices of n generators; cheap in the plane."""
        G = np.asarray(self.generators)
        n, p = G.shape
        if p < n:
            return 0.0
        picked = np.array(list(combinations(range(p), n)))
        return float(2.0**n * np.abs(np.linalg.det(G[:, picked].transpose(1, 0, 2))).sum())

    def vertices(self) -> np.ndarray:
        """Return the corners of a planar zonotope in order around it, shape (2 ng, 2), without repeating the first.

        Raises:
            BadInput: not planar.
        """
        if self.dimension != 2:
            raise BadInput(
                f"`vertices` draws planar zonotopes; this one has dimension {self.dimension}. Project it first."
            )
        G = np.asarray(self.generators).T
        G = np.where((G[:, 1] < 0) | ((G[:, 1] == 0) & (G[:, 0] < 0)), -1.0, 1.0)[:, None] * G
        G = G[np.argsort(np.arctan2(G[:, 1], G[:, 0]))]
        half = np.asarray(self.center) - G.sum(axis=0) + 2 * np.cumsum(G, axis=0)
        return np.vstack([half, 2 * np.asarray(self.center) - half])
