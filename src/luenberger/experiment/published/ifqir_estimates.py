"""The point estimates of Ifqir et al. 2020 and the printed bounds of their errors, in plain loops along the drive."""

from functools import cache

import numpy as np

from luenberger.experiment.gust_runs import ROUNDING
from luenberger.experiment.published.ifqir_car import (
    NOISE,
    SHARE,
    SPEEDS,
    START,
    STATE_BOUND,
    STEP,
    Axles,
    printed_mode,
)
from luenberger.experiment.published.ifqir_drive import Cars, Drive, cars, choices, drive
from luenberger.experiment.published.ifqir_printed import Bounds, errors_printed


@cache
def runs(steering_error: float = 0.0, varying: bool = False, exact: bool = False) -> tuple[Drive, Cars]:
    """Return the drive and all cars on it with the printed uncertainty.

    Args:
        steering_error: bound of the error of the steering angle [rad].
        varying: the true speed is the measured one.
        exact: the continuous car.
    """
    road = drive()
    return road, cars(road, choices(), steering_error=steering_error, varying=varying, exact=exact)


def printed_errors(
    road: Drive, share: float = SHARE, noise: float = NOISE, input_error: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """Return centre and radius of the errors by the printed recursion, each (nt, nx).

    Args:
        road: the drive.
        share: uncertainty of both stiffnesses.
        noise: bound of the error of the gyro [rad/s].
        input_error: what u is taken to be uncertain by [rad].
    """
    modes = [printed_mode(v, share) for v in SPEEDS]
    inputs = [Bounds(np.array([u - input_error]), np.array([u + input_error])) for u in road.steering]
    return errors_printed(
        [modes[i] for i in road.mode], Bounds.around(STATE_BOUND), inputs, np.array([noise]), START * np.eye(2)
    )


def point_estimates(road: Drive, found: Cars) -> np.ndarray:
    """Return the estimates of (8) started at zero, in plain loops, (runs, nt, nx).

    Args:
        road: the drive.
        found: inputs and outputs.
    """
    estimate, listed = np.zeros((len(found.states), 2)), []
    for k in range(len(road.time)):
        listed.append(estimate)
        if k + 1 == len(road.time):
            break
        car = Axles.at(float(road.local[k]))
        seen, B = car.decoupled(STEP), car.sampled(STEP)[1]
        estimate = (
            estimate @ seen.N.T
            + found.outputs[:, k] @ seen.K.T
            + found.steering[:, k] @ (seen.P @ B).T
            - found.outputs[:, k + 1] @ seen.H.T
        )
    return np.stack(listed, axis=1)


def printed_left(share: float, noise: float) -> tuple[int, int, float]:
    """Return on how many runs the errors leave the printed bounds, of how many, and the mean width [m/s].

    Args:
        share: uncertainty of both stiffnesses.
        noise: bound of the error of the gyro [rad/s].
    """
    road = drive()
    found = cars(road, choices(), share=share, noise=noise)
    center, radius = printed_errors(road, share, noise)
    outside = np.abs(found.states - point_estimates(road, found) - center) > radius + ROUNDING
    return int(outside.any(axis=(1, 2)).sum()), len(outside), float(2 * radius[:, 0].mean())
