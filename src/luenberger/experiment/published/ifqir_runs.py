"""Guaranteed estimates along many runs of the drive: how wide they are and how often they are left."""

from dataclasses import dataclass
from functools import cache
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from luenberger.experiment.published.ifqir_car import NOISE, SHARE, SPEEDS, START, STATE_BOUND, STEP, Axles, switched
from luenberger.experiment.published.ifqir_drive import Cars
from luenberger.experiment.published.ifqir_estimates import ROUNDING, runs
from luenberger.observers.observer import Estimate, Observer
from luenberger.observers.unknown_input import UnknownInputObserver

# Name -> what of the recursion is on: how uncertainty is bounded, noise reused, the estimate used to bound the state.
VARIANTS: dict[str, tuple[str, bool, bool]] = {
    "c0": ("lemma", False, False),
    "c1": ("interval", False, False),
    "c2": ("structured", False, False),
    "c3": ("structured", True, False),
    "c4": ("structured", True, True),
}
WORDS = {
    "c0": "corrected, Lemma 1",
    "c1": "exact interval product",
    "c2": "structured uncertainty",
    "c3": "noise used once",
    "c4": "state bounded by the estimate",
}


@dataclass(frozen=True, eq=False)
class Enclosure:
    """Bounds of the states of many runs, each array of shape (runs, nt, nx).

    Args:
        estimate: point estimate.
        lower: lower bounds.
        upper: upper bounds.
    """

    estimate: np.ndarray
    lower: np.ndarray
    upper: np.ndarray

    @property
    def width(self) -> float:
        """Mean width of the bounds of the lateral speed [m/s]."""
        return float((self.upper - self.lower)[..., 0].mean())

    def left(self, states: np.ndarray) -> np.ndarray:
        """Return for each run whether a state ever leaves its bounds, (runs,).

        Args:
            states: true states, (runs, nt, nx).
        """
        outside = (states < self.lower - ROUNDING) | (states > self.upper + ROUNDING)
        return np.asarray(outside.any(axis=(1, 2)))

    def reach(self, states: np.ndarray) -> float:
        """Return the largest share of the half width that an error of the lateral speed takes.

        Args:
            states: true states, (runs, nt, nx).
        """
        middle, half = 0.5 * (self.lower + self.upper)[..., 0], 0.5 * (self.upper - self.lower)[..., 0]
        return float((np.abs(states[..., 0] - middle) / half)[:, 1:].max())


def enclosed(observer: Observer, runs: Cars, schedule: np.ndarray) -> Enclosure:
    """Run an observer over many runs at once.

    Args:
        observer: with bounds.
        runs: inputs and outputs.
        schedule: scheduling vector of every sample, (nt, nr).
    """
    nx = runs.states.shape[2]
    found = _scanned(observer, observer.init(np.zeros(nx)), runs.steering, runs.outputs, jnp.asarray(schedule))
    return Enclosure(np.asarray(found.x), np.asarray(found.lower), np.asarray(found.upper))


@eqx.filter_jit
def _scanned(observer: Observer, start: Any, u: Any, y: Any, r: Any) -> Estimate:
    def one(inputs: Any, outputs: Any) -> Estimate:
        def advance(state: Any, now: Any) -> tuple[Any, Estimate]:
            return observer.step(state, *now)

        return jax.lax.scan(advance, start, (inputs, outputs, r))[1]

    return jax.vmap(one)(jnp.asarray(u), jnp.asarray(y))


@cache
def observer(
    variant: str = "c4",
    *,
    bounded: bool = True,
    share: float = SHARE,
    noise: float = NOISE,
    steering_error: float = 0.0,
) -> UnknownInputObserver:
    """Return the observer of the printed car with the gain that leaves only the zero; made once, so that a run compiles once.

    Args:
        variant: key of `VARIANTS`.
        bounded: with the printed bounds of the state.
        share: uncertainty of both stiffnesses.
        noise: bound of the error of the gyro [rad/s].
        steering_error: bound of the error of the steering angle [rad].
    """
    uncertainty, reuse, closed = VARIANTS[variant]
    modes = [Axles.at(v).decoupled(STEP) for v in SPEEDS]
    return UnknownInputObserver(
        switched(share, noise, steering_error),
        [m.K for m in modes],
        [m.H for m in modes],
        initial_half_width=[START, START],
        state_bound=STATE_BOUND if bounded else None,
        uncertainty=uncertainty,
        reuse_noise=reuse,
        closed_loop=closed,
    )


@cache
def variant_enclosure(variant: str, steering_error: float = 0.0) -> Enclosure:
    """Return the bounds of one variant along all runs.

    Args:
        variant: key of `VARIANTS`.
        steering_error: bound of the error of the steering angle [rad].
    """
    road, found = runs(steering_error)
    chosen = observer(variant, steering_error=steering_error) if steering_error else observer(variant)
    return enclosed(chosen, found, road.speed[:, None])
