"""A drive through side winds, and what is unknown on many runs of it: random, constant, and pushing against the bounds."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

RANDOM, CONSTANT, ADVERSARIES = 40, 8, 4


@dataclass(frozen=True, eq=False)
class Drive:
    """What the driver and the wind do.

    Args:
        time: sample times [s], (nt,).
        speed: measured speed [m/s], (nt,).
        mode: number of the mode, (nt,).
        local: speed of the mode [m/s], (nt,).
        steering: steering angle [rad], (nt,).
        gust: gust force [N], (nt,).
    """

    time: np.ndarray
    speed: np.ndarray
    mode: np.ndarray
    local: np.ndarray
    steering: np.ndarray
    gust: np.ndarray


def windy_road(
    samples: int,
    step: float,
    *,
    speed: tuple[float, float],
    modes: Sequence[float],
    ends: Sequence[float],
    steering: float,
    steering_period: float,
    gust: float,
    gust_period: float,
) -> Drive:
    """Return a drive: up and down through all speeds once, steering from side to side, a gust from either side in turn.

    Args:
        samples: length; the speed profile is stretched to it.
        step: sample time [s].
        speed: slowest and fastest speed [m/s].
        modes: speed of each mode [m/s].
        ends: limits of the modes [m/s].
        steering: amplitude [rad].
        steering_period: of the steering [s].
        gust: force [N].
        gust_period: how long one gust and the pause before it last [s].
    """
    time = step * np.arange(samples)
    middle, swing = 0.5 * (speed[0] + speed[1]), 0.5 * (speed[1] - speed[0])
    pace = middle - swing * np.cos(2 * np.pi * np.arange(samples) / (samples - 1))
    mode = np.sum([pace >= end for end in ends[1:-1]], axis=0, dtype=int) + np.zeros(samples, dtype=int)
    phase = time % gust_period
    # Rises within half a second, holds, and falls.
    shape = np.clip(np.minimum(phase - 0.4 * gust_period, 0.7 * gust_period - phase) / 0.5, 0.0, 1.0)
    side = np.where((time // gust_period) % 2 == 0, 1.0, -1.0)
    turned = steering * np.sin(2 * np.pi * time / steering_period)
    return Drive(time, pace, mode, np.array(modes)[mode], turned, gust * side * shape)


@dataclass(frozen=True, eq=False)
class Choices:
    """What is unknown on every run, in units of its bound.

    Args:
        start: first error, (runs, 2).
        stiffness: of front and rear axle, (nt, runs, 2).
        noise: of gyro and steering angle, (nt, runs, 2).
        adversary: direction +1 or -1 in which a run is pushed at every sample, 0 for runs that follow the above, (runs,).
        drops: True for adversaries whose noise turns at every fifth sample, (runs,).
    """

    start: np.ndarray
    stiffness: np.ndarray
    noise: np.ndarray
    adversary: np.ndarray
    drops: np.ndarray


def choices(samples: int = 500, *, random: int = RANDOM, adversaries: bool = True, seed: int = 0) -> Choices:
    """Return runs: random ones, half of them at vertices, eight that stay at one vertex, and four adversaries.

    Args:
        samples: length of the drive.
        random: number of random runs.
        adversaries: with adversaries.
        seed: of the random numbers.
    """
    rng = np.random.default_rng(seed)
    count = random + CONSTANT + (ADVERSARIES if adversaries else 0)
    inside = rng.uniform(-1, 1, (samples, count, 4))
    inside[:, : random // 2] = np.sign(inside[:, : random // 2])
    corners = np.array([[f, r, v, -v] for f in (-1, 1) for r in (-1, 1) for v in (-1, 1)], dtype=float)
    inside[:, random : random + CONSTANT] = corners
    adversary, drops = np.zeros(count), np.zeros(count, dtype=bool)
    if adversaries:
        adversary[-ADVERSARIES:], drops[-ADVERSARIES // 2 :] = (1, -1, 1, -1), True
    return Choices(rng.uniform(-1, 1, (count, 2)), inside[..., :2], inside[..., 2:], adversary, drops)
