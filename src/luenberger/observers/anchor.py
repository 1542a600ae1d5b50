"""Estimates without memory: the trivial anchors that every observer has to beat."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from luenberger.core import BadInput
from luenberger.observers.observer import Estimate, Observer


class AlgebraicEstimate(Observer):
    """A function of the samples of one instant, e.g. the kinematic sideslip from speed and steering angle.

    Choose it as the anchor of a comparison: an observer that does not beat it earns nothing by its dynamics.

    Args:
        function: JAX function (u, y, r) -> x, shape (nx,).
        dt: sample time [s].
        states: names of the estimated states; left out: x1, x2, ... at replay.

    Raises:
        BadInput: dt not positive.
    """

    function: Callable[[Any, Any, Any], Any] = eqx.field(static=True)
    dt: float = eqx.field(static=True)
    states: tuple[str, ...] = eqx.field(static=True)

    def __init__(self, function: Callable[[Any, Any, Any], Any], dt: float, states: tuple[str, ...] = ()):
        if not (np.isfinite(dt) and dt > 0):
            raise BadInput(f"`dt` is {dt}; a positive step in seconds is needed.")
        self.function = function
        self.dt = float(dt)
        self.states = tuple(states)

    def init(self, x0: Any) -> tuple[()]:
        """Return the empty state; the first guess is not used."""
        return ()

    def step(self, state: tuple[()], u: Any, y: Any, r: Any) -> tuple[tuple[()], Estimate]:
        """Evaluate the function at one sample; see `Observer.step`."""
        return (), Estimate(jnp.atleast_1d(self.function(u, y, r)))


def zero_estimate(nx: int, dt: float, states: tuple[str, ...] = ()) -> AlgebraicEstimate:
    """Return the anchor that says zero for every state at all times.

    Args:
        nx: number of states.
        dt: sample time [s].
        states: names of the states.
    """
    return AlgebraicEstimate(_Zeros(nx), dt, states)


@dataclass(frozen=True)
class _Zeros:
    nx: int

    def __call__(self, u: Any, y: Any, r: Any) -> jax.Array:
        return jnp.zeros(self.nx, jnp.result_type(y, float) if not hasattr(y, "dtype") else y.dtype)
