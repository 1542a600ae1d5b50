"""Guaranteed estimates by strips: each current output cuts the predicted zonotope, with gains designed beforehand.

An output y_i with |noise| <= s_i says that the state lies in the strip |y_i - D_i u - C_i x| <= s_i. For every vector k the
zonotope  c + k (y_i - D_i u - C_i c),  [(I - k C_i) G, k s_i]  holds the part of {c + G b} inside that strip; the vector only
decides how wide it is.
"""

from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from luenberger.algebra import Polynomial
from luenberger.core import BadInput
from luenberger.observers.small_matrix import product
from luenberger.observers.zonotopic import Reduction, ZonotopicObserver
from luenberger.observers.zonotopic_plant import checked_gains, gain_at
from luenberger.sets import Zonotope, girard
from luenberger.systems.switched import Switched
from luenberger.systems.system import System

STRIPS = ("together", "one by one")


class ZonotopicStripFilter(ZonotopicObserver):
    """Filter with a gain that is given, which cuts the prediction by the strips of the current measurement.

    Choose it for gains of the classes that CORA calls PRad-A (strips one by one) and PRad-C (together), see `PRadiusGain`; the set
    at sample k has used y_k. Without a design at hand take `ZonotopicFilter`, whose gain follows the set.

    Args:
        system: see `ZonotopicObserver`.
        gain: K(r), shape (nx, ny), one column a strip: nested numbers or `Polynomial` in the scheduling parameters; with modes a
            sequence of them.
        strips: "together" cuts by all strips at once, x + K (y - C x); "one by one" by the first, then what is left by the second, and
            so on.
        initial_half_width: see `ZonotopicObserver`.
        count: see `ZonotopicObserver`.
        reduction: see `ZonotopicObserver`.
        state_bound: see `ZonotopicObserver`.

    Raises:
        NotAccepted: see `ZonotopicObserver`.
        BadInput: gain of the wrong shape or with unknown parameters, unknown `strips`; see `ZonotopicObserver`.

    Reference: T. Alamo, J. Bravo, E. Camacho, Guaranteed state estimation by zonotopes, Automatica 41 (2005) 1035-1043, property 1;
        V. Le, C. Stoica, T. Alamo, E. Camacho, D. Dumur, Automatica 49 (2013) 3418-3424.
    """

    gain: Polynomial | tuple[Polynomial, ...]
    strips: str = eqx.field(static=True)

    def __init__(
        self,
        system: System | Switched | Sequence[System],
        gain: Any,
        *,
        strips: str = "together",
        initial_half_width: Any,
        count: int | None = None,
        reduction: Reduction = girard,
        state_bound: Any = None,
    ):
        super().__init__(
            system, initial_half_width=initial_half_width, count=count, reduction=reduction, state_bound=state_bound
        )
        if strips not in STRIPS:
            raise BadInput(f'`strips` is "{strips}"; "together" or "one by one" is needed.')
        self.gain = checked_gains(self.plant.value, gain)
        self.strips = strips

    def _gain(
        self, state: Zonotope, innovation: jax.Array, at: dict[str, jax.Array], seen: jax.Array, r: jax.Array
    ) -> tuple[jax.Array, Zonotope]:
        K = gain_at(self.plant.value, self.gain, r)
        if self.strips == "one by one":
            K = together(K, at["C"])
        cut = state.generators - product(K, product(at["C"], state.generators))
        generators = jnp.concatenate([cut, -product(K, seen)], axis=1)
        return product(at["A"], K), Zonotope(state.center + product(K, innovation), generators)


def together(gain: Any, C: Any) -> jax.Array:
    """Return the one gain that does at once what the columns of a gain do to the strips one after another.

    From I - K C = (I - k_n C_n) ... (I - k_1 C_1): each strip sees what the ones before have left.

    Args:
        gain: one column a strip in the order of the outputs, shape (nx, ny).
        C: output matrix, shape (ny, nx).
    """
    columns, rows = jnp.asarray(gain), jnp.asarray(C)
    total = jnp.zeros_like(columns)
    for k in range(columns.shape[1]):
        # x after the strips so far is x0 + total (y - C x0); strip k corrects by k (y_k - C_k x).
        left = jnp.eye(1, columns.shape[1], k, dtype=columns.dtype) - product(rows[k : k + 1], total)
        total = total + product(columns[:, k : k + 1], left)
    return total
