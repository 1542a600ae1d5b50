"""Observers of the slip-angle plant over a manoeuvre, with the speed and its derivative read wrongly: one scan for all."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from luenberger.core import Trajectory
from luenberger.experiment.published.wang_manoeuvre import STEP
from luenberger.observers import Estimate, Observer
from luenberger.vehicle import wang_car

# The estimators start one second late and away from the truth, as in figure 3.9; errors count from two seconds on.
START_TIME, START, SCORED_FROM = 1.0, (0.05, -0.03), 2.0
SLIPS = ("front_slip", "rear_slip")
INPUTS = ("steering", "steering_rate", "yaw_rate")
FIRST, SCORED = round(START_TIME / STEP), round((SCORED_FROM - START_TIME) / STEP)


@dataclass(frozen=True)
class Case:
    """One way of reading the sensors.

    Args:
        speed_error: e1, the speed is read as (1 + e1) vx.
        acceleration_error: e2, its derivative is read as (1 + e2) ax.
        exact_output: y = alpha_f - alpha_r as it is; otherwise delta - (a + b) r / vx with what is read.
    """

    speed_error: float = 0.0
    acceleration_error: float = 0.0
    exact_output: bool = True

    @property
    def words(self) -> str:
        """The case as rows call it."""
        if self.speed_error == self.acceleration_error == 0:
            return "eps 0"
        how = "y exact" if self.exact_output else "y from vx as read"
        return f"eps ({self.speed_error:+.2f}, {self.acceleration_error:+.2f}), {how}"


EXACT = Case()


@dataclass(frozen=True)
class Readings:
    """What observers are given over each step from `START_TIME` on.

    The estimators of the dissertation run in continuous time, so each step holds the mean of its two samples; the first
    sample alone would add up to 0.015 mrad.

    Args:
        u: steering, its rate, yaw rate, shape (nt, 3).
        y: difference of the slip angles, shape (nt, 1).
        r: 1/vx and ax, shape (nt, 2).
    """

    u: np.ndarray
    y: np.ndarray
    r: np.ndarray

    @staticmethod
    def of(
        truth: Trajectory, case: Case = EXACT, noise: np.ndarray | None = None, sampled_output: bool = False
    ) -> "Readings":
        """Read a trajectory with the channels of `slip_angle_channels`.

        Args:
            truth: the manoeuvre from time zero.
            case: errors of the scheduling.
            noise: added to the inputs, held over the step, shape (nt, 3); y is computed from noisy inputs then.
            sampled_output: y at the sample, for observers that count how it moves from there, instead of the mean.
        """
        channel = {name: truth[name].values[FIRST:] for name in truth.names}
        u = np.stack([channel[n] for n in INPUTS], axis=1)
        vx = (1 + case.speed_error) * channel["speed"]
        ax = (1 + case.acceleration_error) * channel["acceleration"]
        computed = u[:, 0] - wang_car.wheelbase * u[:, 2] / vx
        y = (channel["slip_difference"] if case.exact_output else computed)[:, None]
        y = y if sampled_output else _middle(y)
        # The theory schedules by (1/vx, ax/vx), the plant by 1/vx and ax; means are taken of the former.
        ratios = _middle(np.stack([1 / vx, ax / vx], axis=1))
        u = _middle(u)
        if noise is not None:
            u = u + noise
            y = y + noise[:, :1] - wang_car.wheelbase * noise[:, 2:] * ratios[:, :1]
        return Readings(u, y, np.stack([ratios[:, 0], ratios[:, 1] / ratios[:, 0]], axis=1))


def run(observers: Mapping[str, Observer], readings: list[Readings], start: Any = None) -> dict[str, Estimate]:
    """Run all observers over all readings in one scan; return name -> estimates with axes (readings, nt).

    Args:
        observers: name -> observer of the slip-angle plant.
        readings: of one length.
        start: handed to `init` of every observer; left out: the guess of the manoeuvre.
    """
    first = jnp.asarray(START) if start is None else start
    held = [jnp.asarray(np.stack([getattr(r, name) for r in readings])) for name in "uyr"]
    found = _scan(tuple(observers.values()), first, *held)
    return dict(zip(observers, jax.tree.map(np.asarray, found), strict=True))


def slip_truth(truth: Trajectory) -> np.ndarray:
    """Return the slip angles from `START_TIME` on, shape (nt, 2).

    Args:
        truth: trajectory with the channels of `slip_angle_channels`.
    """
    return truth.table(SLIPS)[FIRST:]


@eqx.filter_jit
def _scan(observers: tuple[Observer, ...], start: Any, u: jax.Array, y: jax.Array, r: jax.Array) -> Any:
    def single(u: jax.Array, y: jax.Array, r: jax.Array) -> Any:
        def advance(states: Any, now: Any) -> tuple[Any, Any]:
            done = [o.step(s, *now) for o, s in zip(observers, states, strict=True)]
            return tuple(s for s, _ in done), tuple(e for _, e in done)

        return jax.lax.scan(advance, tuple(o.init(start) for o in observers), (u, y, r))[1]

    return jax.vmap(single)(u, y, r)


def _middle(samples: np.ndarray) -> np.ndarray:
    """Mean of each sample and the next, the last one alone."""
    return 0.5 * (samples + np.concatenate([samples[1:], samples[-1:]]))
