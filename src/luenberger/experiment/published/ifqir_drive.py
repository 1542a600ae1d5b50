"""A drive through all three modes with steering and gusts, and many cars on it: every stiffness and noise the bounds allow."""

from dataclasses import dataclass

import numpy as np

from luenberger.experiment.published.ifqir_car import NOISE, SHARE, SPEEDS, START, STEP, Axles
from luenberger.vehicle.cars import gust_car

SAMPLES = 500
# Steering amplitude [rad] and period [s], gust force [N] and how long one gust and the pause before it last [s].
STEERING, STEERING_PERIOD = 0.031, 7.5
GUST, GUST_PERIOD = 800.0, 10.0
_SLOWEST, _FASTEST = 6.05, 19.85
_DROPPED = 5
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


def drive(samples: int = SAMPLES) -> Drive:
    """Return the drive: up and down through the modes once, steering from side to side, a gust from either side in turn.

    Args:
        samples: length; the speed profile is stretched to it.
    """
    time = STEP * np.arange(samples)
    middle, swing = 0.5 * (_SLOWEST + _FASTEST), 0.5 * (_FASTEST - _SLOWEST)
    speed = middle - swing * np.cos(2 * np.pi * np.arange(samples) / (samples - 1))
    mode = (speed >= 11.0).astype(int) + (speed >= 16.0)
    phase = time % GUST_PERIOD
    # Rises within half a second, holds, and falls.
    shape = np.clip(np.minimum(phase - 4.0, 7.0 - phase) / 0.5, 0.0, 1.0)
    side = np.where((time // GUST_PERIOD) % 2 == 0, 1.0, -1.0)
    steering = STEERING * np.sin(2 * np.pi * time / STEERING_PERIOD)
    return Drive(time, speed, mode, np.array(SPEEDS)[mode], steering, GUST * side * shape)


@dataclass(frozen=True, eq=False)
class Cars:
    """Many runs of one drive.

    Args:
        states: lateral speed [m/s] and yaw rate [rad/s], (runs, nt, 2).
        outputs: measured yaw rate [rad/s], (runs, nt, 1).
        steering: measured steering angle [rad], (runs, nt, 1).
    """

    states: np.ndarray
    outputs: np.ndarray
    steering: np.ndarray


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


def choices(samples: int = SAMPLES, *, random: int = RANDOM, adversaries: bool = True, seed: int = 0) -> Choices:
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


def cars(
    drive: Drive,
    unknown: Choices,
    *,
    share: float = SHARE,
    noise: float = NOISE,
    steering_error: float = 0.0,
    varying: bool = False,
    exact: bool = False,
) -> Cars:
    """Run the cars.

    Args:
        drive: what driver and wind do.
        unknown: what stiffness and noise do.
        share: uncertainty of both stiffnesses.
        noise: bound of the error of the gyro [rad/s].
        steering_error: bound of the error of the steering angle [rad].
        varying: the true speed is the measured one; False: that of the mode.
        exact: the continuous car with everything held over a step; False: Euler's rule.
    """
    x, runs = START * unknown.start, len(unknown.start)
    bound = np.array([noise, steering_error])
    stiffness = np.array([gust_car.front_stiffness, gust_car.rear_stiffness])
    states, outputs, steering = [], [], []
    for k in range(len(drive.time)):
        car = Axles.at(float((drive.speed if varying else drive.local)[k]))
        s, v = unknown.stiffness[k].copy(), unknown.noise[k].copy()
        _push(s, v, unknown, k, car, x, drive.steering[k])
        v *= bound
        u = drive.steering[k] - v[:, 1]
        states.append(x)
        outputs.append(x[:, 1:] + v[:, :1])
        steering.append(np.full((runs, 1), drive.steering[k]))
        force = stiffness * (1 + share * s)
        if exact:
            x = _held(car, force, x, u, float(drive.gust[k]))
            continue
        slips = x @ car.slips.T + u[:, None] * np.array([1.0, 0.0])
        slope = (force * slips) @ car.directions.T + car.E[:, 0] * drive.gust[k]
        slope[:, 0] -= (drive.speed if varying else drive.local)[k] * x[:, 1]
        x = x + STEP * slope
    return Cars(*(np.stack(signal, axis=1) for signal in (states, outputs, steering)))


def _push(s: np.ndarray, v: np.ndarray, unknown: Choices, k: int, car: Axles, x: np.ndarray, u: float) -> None:
    """Let the adversaries choose what drives the error of the lateral speed furthest their way."""
    seen = car.decoupled(STEP)
    slips = x @ car.slips.T + np.array([u, 0.0])
    way = unknown.adversary[:, None]
    there = np.broadcast_to(way != 0, s.shape)
    s[there] = (way * np.sign(slips * (seen.P @ car.directions)[0]))[there]
    carried, now = np.sign((seen.N @ seen.H - seen.K)[0, 0]), np.sign(seen.H[0, 0])
    sign = np.where(unknown.drops & (k % _DROPPED == _DROPPED - 1), now, carried)
    v[there] = (way * np.stack([sign, np.full_like(sign, -np.sign((seen.P @ car.B)[0, 0]))], axis=1))[there]


def _held(car: Axles, force: np.ndarray, x: np.ndarray, u: np.ndarray, gust: float) -> np.ndarray:
    """One step of the continuous car, one matrix exponential a run."""
    generator = np.zeros((len(x), 3, 3))
    turn = car.A - (car.directions * [gust_car.front_stiffness, gust_car.rear_stiffness]) @ car.slips
    generator[:, :2, :2] = (car.directions[None] * force[:, None, :]) @ car.slips + turn
    generator[:, :2, 2] = force[:, :1] * car.directions[:, 0] * u[:, None] + car.E[:, 0] * gust
    step = _exponential(STEP * generator)
    return np.einsum("nij,nj->ni", step[:, :2, :2], x) + step[:, :2, 2]


def _exponential(M: np.ndarray) -> np.ndarray:
    """Exponentials of many small matrices of norm near one at once: Taylor polynomials of the eighth part, squared three times."""
    part, eye = M / 8, np.eye(M.shape[-1])
    total = np.broadcast_to(eye, M.shape)
    for k in range(12, 0, -1):
        total = eye + part @ total / k
    for _ in range(3):
        total = total @ total
    return total
