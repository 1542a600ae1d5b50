"""The drive of Ifqir et al. 2020 as it was chosen here, and many cars on it: every stiffness and noise the bounds allow."""

import numpy as np

from luenberger.experiment.gust_drive import Choices, Drive, choices, windy_road
from luenberger.experiment.gust_runs import Cars
from luenberger.experiment.published.ifqir_car import NOISE, SHARE, SPEEDS, START, STEP, Axles
from luenberger.vehicle.cars import gust_car

__all__ = ["GUST", "Cars", "Choices", "Drive", "cars", "choices", "drive"]

SAMPLES = 500
# Steering amplitude [rad] and period [s], gust force [N] and how long one gust and the pause before it last [s].
STEERING, STEERING_PERIOD = 0.031, 7.5
GUST, GUST_PERIOD = 800.0, 10.0
_SLOWEST, _FASTEST = 6.05, 19.85
_DROPPED = 5


def drive(samples: int = SAMPLES) -> Drive:
    """Return the drive: up and down through the modes once, steering from side to side, a gust from either side in turn.

    Args:
        samples: length; the speed profile is stretched to it.
    """
    return windy_road(
        samples,
        STEP,
        speed=(_SLOWEST, _FASTEST),
        modes=SPEEDS,
        ends=(6.0, 11.0, 16.0, 20.0),
        steering=STEERING,
        steering_period=STEERING_PERIOD,
        gust=GUST,
        gust_period=GUST_PERIOD,
    )


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
