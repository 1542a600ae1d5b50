"""Friction and tyre stiffness that change with the place on the road."""

from collections.abc import Sequence
from math import inf

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Array, Float

from luenberger.core import BadInput
from luenberger.core.checks import finite_array


class Road(eqx.Module):
    """Friction and stiffness factor by place; each region lies on those before it, edges are smooth.

    Build roads with `uniform`, `lanes` or `patches`. The stiffness factor scales all tyre stiffnesses and leaves the peak
    force alone, as a change of surface or of tyre temperature does; the friction moves the peak and leaves the stiffness.

    Args:
        regions: (least x, greatest x, least y, greatest y) [m] of each region, infinite where it does not end.
        frictions: friction coefficient of the ground, then of each region.
        stiffness_factors: factor on the tyre stiffness of the ground, then of each region.
        transition: width over which an edge is crossed [m].
    """

    regions: Float[Array | np.ndarray, "nk 4"]
    frictions: Float[Array | np.ndarray, "nk+1"]
    stiffness_factors: Float[Array | np.ndarray, "nk+1"]
    transition: float | Array | np.ndarray

    @staticmethod
    def uniform(friction: float, stiffness_factor: float = 1.0) -> "Road":
        """Return a road that is the same everywhere.

        Args:
            friction: mu.
            stiffness_factor: factor on the stiffness of the tyres.

        Raises:
            BadInput: a number that is not positive.
        """
        return _road([], [friction], [stiffness_factor], 1.0)

    @staticmethod
    def lanes(
        edges: Sequence[float],
        frictions: Sequence[float],
        stiffness_factors: Sequence[float] | None = None,
        *,
        along: str = "y",
        transition: float = 0.5,
    ) -> "Road":
        """Return strips side by side (`along="y"`, lanes) or one after the other (`along="x"`, stretches).

        Args:
            edges: increasing positions [m] where one strip meets the next.
            frictions: mu of each strip, one more than edges.
            stiffness_factors: factor of each strip; left out: 1.
            along: axis that is crossed, "y" from right to left or "x" in the direction of travel.
            transition: width over which an edge is crossed [m].

        Raises:
            BadInput: numbers that do not fit together, not increasing or not positive.
        """
        places = finite_array("edges", edges)
        if places.ndim != 1 or (np.diff(places) <= 0).any():
            raise BadInput(f"`edges` is {list(edges)} m; positions that increase are needed.")
        if along not in ("x", "y"):
            raise BadInput(f'`along` is `{along}`; "y" for lanes side by side or "x" for stretches is needed.')
        bounds = [(edge, inf, -inf, inf) if along == "x" else (-inf, inf, edge, inf) for edge in places]
        factors = [1.0] * len(frictions) if stiffness_factors is None else stiffness_factors
        return _road(bounds, frictions, factors, transition)

    @staticmethod
    def patches(
        friction: float,
        regions: Sequence[tuple[float, float, float, float]],
        frictions: Sequence[float],
        stiffness_factors: Sequence[float] | None = None,
        *,
        transition: float = 0.5,
    ) -> "Road":
        """Return a uniform road with rectangular patches, such as ice under the right wheels.

        Args:
            friction: mu beside the patches.
            regions: (least x, greatest x, least y, greatest y) [m] of each patch; later ones lie on earlier ones.
            frictions: mu of each patch.
            stiffness_factors: factor on the tyre stiffness of each patch; left out: 1.
            transition: width over which an edge is crossed [m].

        Raises:
            BadInput: numbers that do not fit together, empty patches, or numbers that are not positive.
        """
        factors = [1.0] * len(frictions) if stiffness_factors is None else list(stiffness_factors)
        return _road(regions, [friction, *frictions], [1.0, *factors], transition)

    def friction(self, x: ArrayLike, y: ArrayLike) -> jax.Array:
        """Return mu at positions x, y [m] of one shape."""
        return self._laid(self.frictions, x, y)

    def stiffness_factor(self, x: ArrayLike, y: ArrayLike) -> jax.Array:
        """Return the factor on the tyre stiffness at positions x, y [m] of one shape."""
        return self._laid(self.stiffness_factors, x, y)

    def _laid(self, values: Array | np.ndarray, x: ArrayLike, y: ArrayLike) -> jax.Array:
        x, y = jnp.asarray(x), jnp.asarray(y)
        found = jnp.broadcast_to(jnp.asarray(values[0]), jnp.broadcast_shapes(x.shape, y.shape))
        for k in range(self.regions.shape[0]):
            left, right, low, high = (jnp.asarray(self.regions)[k, i] for i in range(4))
            inside = self._step(x - left) * self._step(right - x) * self._step(y - low) * self._step(high - y)
            found = found + inside * (values[k + 1] - found)
        return found

    def _step(self, distance: jax.Array) -> jax.Array:
        """Return 0 before the edge, 1 behind it, a smooth rise between, 1/2 on it."""
        z = jnp.clip(distance / self.transition + 0.5, 0.0, 1.0)
        return z * z * (3.0 - 2.0 * z)


def _road(
    regions: Sequence[tuple[float, float, float, float]],
    frictions: Sequence[float],
    factors: Sequence[float],
    transition: float,
) -> Road:
    mu, factor = finite_array("frictions", frictions), finite_array("stiffness_factors", factors)
    bounds = np.array(regions, dtype=float).reshape(-1, 4)
    if mu.shape != (bounds.shape[0] + 1,) or factor.shape != mu.shape:
        raise BadInput(
            f"{bounds.shape[0]} regions beside the ground need {bounds.shape[0] + 1} frictions and stiffness factors; "
            f"{mu.size} and {factor.size} are given."
        )
    for name, values in (("friction", mu), ("stiffness_factor", factor), ("transition", np.array([transition]))):
        if not (np.isfinite(values) & (values > 0)).all():
            raise BadInput(f"`{name}` holds {values.min():g}; positive finite numbers are needed.")
    empty = np.flatnonzero(~((bounds[:, 0] < bounds[:, 1]) & (bounds[:, 2] < bounds[:, 3])))
    if empty.size:
        raise BadInput(
            f"Region {int(empty[0])} spans {bounds[empty[0]].tolist()} m; (least x, greatest x, least y, greatest y) is needed."
        )
    return Road(jnp.asarray(bounds), jnp.asarray(mu), jnp.asarray(factor), float(transition))
