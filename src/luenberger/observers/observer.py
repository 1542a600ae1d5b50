"""The contract of everything that runs: two pure functions, `init` and `step`."""

from abc import abstractmethod
from typing import Any

import equinox as eqx
import jax

from luenberger.systems.switched import Switched
from luenberger.systems.system import System


class Estimate(eqx.Module):
    """What an observer says at one sample.

    Args:
        x: state estimate, shape (nx,).
        covariance: error covariance, shape (nx, nx), or None where the observer keeps none.
        lower: guaranteed lower end of the state, shape (nx,), or None.
        upper: guaranteed upper end of the state, shape (nx,), or None.
    """

    x: jax.Array
    covariance: jax.Array | None = None
    lower: jax.Array | None = None
    upper: jax.Array | None = None


class Observer(eqx.Module):
    """A running observer. Arrays are leaves (batched with `vmap`), the rest is static.

    `step` at sample k takes the state predicted for t_k and the samples of t_k; it gives the estimate at t_k and the
    state predicted for t_k + dt, with the samples held over the step.
    """

    dt: eqx.AbstractVar[float]

    @property
    def reads(self) -> System | Switched | None:
        """The plant whose inputs, outputs and scheduling `step` takes, for checks at the door; None where only functions are known."""
        return None

    @abstractmethod
    def init(self, x0: Any) -> Any:
        """Return the start state of the observer from a first guess of the plant state.

        Args:
            x0: first guess, shape (nx,).
        """

    @abstractmethod
    def step(self, state: Any, u: Any, y: Any, r: Any) -> tuple[Any, Estimate]:
        """Advance by one sample.

        Args:
            state: state predicted for this sample.
            u: input, shape (nu,).
            y: measured output, shape (ny,).
            r: measured scheduling, shape (nr,).
        """
