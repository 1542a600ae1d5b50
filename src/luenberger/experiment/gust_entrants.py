"""Who stands beside the unknown-input observer in side wind: filters that take the gust as bounded, and one that takes it as noise."""

from typing import Any

import numpy as np

from luenberger.experiment.gust_runs import Cars, Enclosure, enclosed, estimates
from luenberger.experiment.gust_specification import GustSpecification
from luenberger.observers import KalmanFilter, ZonotopicFilter, ZonotopicKalmanFilter

# Generators that a set keeps: ten times the states; more narrows it by less than a hundredth.
COUNT = 20
SOURCES = (
    "C. Combastel, Zonotopes and Kalman observers: gain optimality under distinct uncertainty paradigms and robust convergence, "
    "Automatica 55 (2015) 265-273",
    "R. Kalman, A new approach to linear filtering and prediction problems, J. Basic Eng. 82 (1960) 35-45",
)
FILTERS = {"bounded": ZonotopicFilter, "bounded, predictor": ZonotopicKalmanFilter}
KINDS = {"bounded": "zonotopic filter that uses y_k", "bounded, predictor": "zonotopic Kalman filter that predicts"}


def bounding(
    spec: GustSpecification, kind: str, bound: float, runs: Cars, schedule: np.ndarray, **options: Any
) -> Enclosure:
    """Run a zonotopic filter that takes the gust as bounded.

    Args:
        spec: the car and its uncertainty.
        kind: key of `FILTERS`.
        bound: largest gust that is trusted [N].
        runs: inputs and outputs.
        schedule: speed and its inverse, (nt, 2).
        options: of the plant, see `GustSpecification.scheduled`.
    """
    plant = spec.scheduled(gust_bound=bound, **options)
    return enclosed(FILTERS[kind](plant, count=COUNT, **spec.options), runs, schedule)


def gaussian(spec: GustSpecification, bound: float, runs: Cars, schedule: np.ndarray) -> Enclosure:
    """Run a Kalman filter with the same plant, and return three standard deviations either way as its bounds.

    Gust, gyro and steering are white noise to it, with the variance that a uniform distribution within their bounds has;
    the stiffness sits at its middle.

    Args:
        spec: the car and its uncertainty.
        bound: of the gust [N].
        runs: inputs and outputs.
        schedule: speed and its inverse, (nt, 2).
    """
    plant = spec.scheduled()
    E, B = (np.asarray(plant.at(letter, schedule[0])) for letter in "EB")
    drive = E @ E.T * bound**2 / 3 + B @ B.T * spec.steering_error**2 / 3
    filter_ = KalmanFilter(
        plant,
        measurement_covariance=[[max(spec.yaw_rate_noise, 1e-6) ** 2 / 3]],
        initial_covariance=np.eye(2) * spec.initial_half_width**2 / 3,
        process_covariance=drive,
    )
    found = estimates(filter_, runs, schedule)
    x = np.asarray(found.x)
    wide = 3 * np.sqrt(np.diagonal(np.asarray(found.covariance), axis1=2, axis2=3))
    return Enclosure(x, x - wide, x + wide)


def local_schedule(speed: np.ndarray) -> np.ndarray:
    """Return speed and its inverse, what the scheduled plant reads, (nt, 2).

    Args:
        speed: [m/s], (nt,).
    """
    return np.stack([speed, 1 / speed], axis=1)
