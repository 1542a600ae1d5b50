"""Guaranteed slip angles with unknown cornering stiffness: the interval observer of Wang 2014, chapter 4, on two lanes."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import jax.numpy as jnp
import numpy as np

from luenberger.algebra import Polynomial
from luenberger.core import Trajectory
from luenberger.experiment.published.wang_gains import INTERVAL, NONE, printed_gain
from luenberger.experiment.published.wang_manoeuvre import STEP, linear_truth
from luenberger.experiment.published.wang_plants import ACCELERATION, ACCELERATION_ERROR, SPEED, SPEED_ERROR, STIFFNESS
from luenberger.experiment.published.wang_runs import EXACT, SCORED, START, Case, Readings, run, slip_truth
from luenberger.methods.interval import IntervalLuenberger
from luenberger.observers.interval import IntervalObserver
from luenberger.synthesize import synthesize
from luenberger.systems import System
from luenberger.vehicle import slip_angle_plant, wang_car

HALF_WIDTH = 0.06
# When the car is on the lane of low stiffness [s], figure 4.3.
SECOND_LANE = (1.5, 4.5)
# Bounds of the noise of steering [rad], its rate [rad/s] and the yaw rate [rad/s]; the dissertation has no noise.
NOISE = (1e-3, 0.02, 5e-3)
SCALE_ERROR, SCALE_CASE = (SPEED_ERROR, ACCELERATION_ERROR), Case(-0.10, 0.15, exact_output=False)
# Integration of two thousand steps a second costs some 1e-8 rad; what is beyond this is a violation [rad].
TOLERANCE = 1e-6
SAME, TURNED = np.eye(2), np.diag([1.0, -1.0])
GAINS: tuple[str, ...] = (
    "L2-optimal in (front, rear)",
    "mismatch-weighted in (front, rear)",
    "L2-optimal in (front, -rear)",
    "printed",
    "no correction",
)


@dataclass(frozen=True)
class Envelope:
    """How an enclosure did against the truth.

    Args:
        width: mean width from two seconds on [mrad], shape (2,).
        violation: how far the truth was outside at worst [mrad], negative where it never touched.
        samples: number of samples with the truth outside.
        crossing: smallest width [mrad], negative where the bounds crossed.
    """

    width: np.ndarray
    violation: float
    samples: int
    crossing: float


def car(**bounds: Any) -> System:
    """Return the plant of chapter 4: stiffness in its box, and further bounds as `slip_angle_plant` takes them.

    Args:
        bounds: keywords of `slip_angle_plant`.
    """
    return slip_angle_plant(wang_car, SPEED, ACCELERATION, stiffness=STIFFNESS, **bounds)


@cache
def two_lanes(high: tuple[float, float], low: tuple[float, float]) -> Trajectory:
    """Drive with one stiffness, and with another from 1.5 to 4.5 seconds, as figure 4.3 shows.

    Args:
        high: (Cf, Cr) of the first lane [N/rad].
        low: (Cf, Cr) of the second lane [N/rad].
    """

    def stiffness(t: Any) -> tuple[Any, Any]:
        there = (t >= SECOND_LANE[0]) & (t < SECOND_LANE[1])
        return jnp.where(there, low[0], high[0]), jnp.where(there, low[1], high[1])

    return linear_truth(stiffness=stiffness)


@cache
def swinging() -> Trajectory:
    """Drive with both stiffnesses swinging through their boxes at 5 Hz, a quarter of a period apart."""
    (f, F), (r, R) = STIFFNESS

    def stiffness(t: Any) -> tuple[Any, Any]:
        w = 10 * jnp.pi * t
        return 0.5 * (f + F) + 0.5 * (F - f) * jnp.sin(w), 0.5 * (r + R) + 0.5 * (R - r) * jnp.cos(w)

    return linear_truth(stiffness=stiffness)


def bounded_noise(samples: int, seed: int = 0) -> np.ndarray:
    """Return noise uniform within `NOISE`, shape (samples, 3).

    Args:
        samples: number of samples.
        seed: of the generator.
    """
    return np.random.default_rng(seed).uniform(-1.0, 1.0, (samples, 3)) * NOISE


def gains() -> dict[str, tuple[Polynomial, np.ndarray]]:
    """Return gain and coordinates of every column of the table; designed ones carry their certificates elsewhere."""
    designed = {
        GAINS[0]: IntervalLuenberger(coordinates=SAME),
        GAINS[1]: IntervalLuenberger(objective="mismatch", coordinates=SAME),
        GAINS[2]: IntervalLuenberger(coordinates=TURNED),
    }
    found: dict[str, tuple[Polynomial, np.ndarray]] = {}
    for name, method in designed.items():
        found[name] = synthesize(car(), method).gain, np.asarray(method.coordinates)
    return {**found, **known_gains()}


def known_gains() -> dict[str, tuple[Polynomial, np.ndarray]]:
    """Return the printed gain, row two turned, and no correction; both keep order for (front, -rear) only."""
    return {GAINS[3]: (printed_gain(INTERVAL), TURNED), GAINS[4]: (printed_gain(NONE), TURNED)}


def envelopes(
    columns: Mapping[str, tuple[Polynomial, np.ndarray]],
    system: System,
    truths: list[Trajectory],
    *,
    case: Case = EXACT,
    noise: np.ndarray | None = None,
) -> dict[str, list[Envelope]]:
    """Enclose the slip angles of several drives by several gains; return gain -> one result a drive.

    Args:
        columns: name -> gain and coordinates.
        system: plant with the bounds that the observers trust.
        truths: drives.
        case: how the sensors err.
        noise: of the inputs, shape (nt, 3).
    """
    bounds = enclosures(columns, system, truths, case=case, noise=noise)
    found: dict[str, list[Envelope]] = {}
    for name, (lower, upper) in bounds.items():
        found[name] = []
        for k, truth in enumerate(truths):
            out = np.maximum(lower[k] - slip_truth(truth), slip_truth(truth) - upper[k])
            width = 1e3 * (upper[k] - lower[k])
            found[name].append(
                Envelope(
                    width[SCORED:].mean(axis=0),
                    1e3 * float(out.max()),
                    int((out.max(axis=1) > TOLERANCE).sum()),
                    float(width.min()),
                )
            )
    return found


def enclosures(
    columns: Mapping[str, tuple[Polynomial, np.ndarray]],
    system: System,
    truths: list[Trajectory],
    *,
    case: Case = EXACT,
    noise: np.ndarray | None = None,
    guess: Any = START,
    half_width: float = HALF_WIDTH,
) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return gain -> lower and upper bounds from one second on, each of shape (drives, nt, 2).

    Args:
        columns: name -> gain and coordinates.
        system: plant with the bounds that the observers trust.
        truths: drives.
        case: how the sensors err.
        noise: of the inputs, shape (nt, 3).
        guess: middle of the first bounds, shape (2,).
        half_width: of the first bounds [rad].
    """
    observers = {name: IntervalObserver(system, gain, STEP, transform=T) for name, (gain, T) in columns.items()}
    readings = [Readings.of(truth, case, noise, sampled_output=True) for truth in truths]
    if system.outputs == ("slip_constraint",):
        # This plant writes y as a relation that is always zero; an error of the speed is in its output matrix.
        readings = [Readings(r.u, np.zeros_like(r.y), r.r) for r in readings]
    start = jnp.stack([jnp.asarray(guess) - half_width, jnp.asarray(guess) + half_width])
    found = run(observers, readings, start)
    return {name: (np.asarray(e.lower), np.asarray(e.upper)) for name, e in found.items()}


def noise_samples(truth: Trajectory) -> np.ndarray:
    """Return the noise of this study for a drive, shape (nt, 3).

    Args:
        truth: gives the number of samples.
    """
    return bounded_noise(slip_truth(truth).shape[0])
