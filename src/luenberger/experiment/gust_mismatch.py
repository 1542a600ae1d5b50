"""What a plant with all its uncertain factors cannot do of a drive: across the gust, as steering, and along it, as more gust."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from luenberger.core import Trajectory
from luenberger.experiment.gust_drive import Drive
from luenberger.systems.system import System
from luenberger.systems.uncertainty import Uncertain


@dataclass(frozen=True, eq=False)
class _Step:
    """One step of a drive, at the middle of the uncertain factors.

    Args:
        left: what the plant without its factors does not explain, (2,).
        factors: what each factor can do either way, (2, nk).
        steering: what one radian of steering does, (2,).
        gust: what one newton of gust does, (2,).
    """

    left: np.ndarray
    factors: np.ndarray
    steering: np.ndarray
    gust: np.ndarray


def across_gust(plant: System, road: Drive, truth: Trajectory, schedule: np.ndarray) -> np.ndarray:
    """Return what remains across the gust beyond the uncertain factors at their worst, as an error of the steering [rad], (nt - 1,).

    That is all of a mismatch that reaches an observer which decouples the gust.

    Args:
        plant: sampled plant of `wind_plant` with its uncertain factors.
        road: what the wind did.
        truth: states and steering of the car.
        schedule: speed and its inverse, (nt, 2).
    """
    found = []
    for step in _steps(plant, road, truth, schedule):
        P = np.array([step.gust[1], -step.gust[0]])
        able = np.abs(P @ step.factors).sum()
        found.append(max(abs(P @ step.left) - able, 0.0) / abs(P @ step.steering))
    return np.array(found)


def along_gust(
    plant: System, road: Drive, truth: Trajectory, schedule: np.ndarray, steering_error: float
) -> np.ndarray:
    """Return the least gust beyond the true one that explains every step together with factors and steering error [N], (nt - 1,).

    An observer that decouples takes it for gust; a filter that bounds the gust has to bound it too.

    Args:
        plant: see `across_gust`.
        road: see `across_gust`.
        truth: see `across_gust`.
        schedule: see `across_gust`.
        steering_error: bound [rad], no less than what `across_gust` says.
    """
    found = []
    for step in _steps(plant, road, truth, schedule):
        sides = np.column_stack([step.factors, steering_error * step.steering])
        # In the plane a zonotope is an intersection of strips, one along each of its generators.
        normals = np.column_stack([-sides[1], sides[0]])
        reach, middle, slope = np.abs(normals @ sides).sum(axis=1), normals @ step.left, normals @ step.gust
        strip = np.abs(slope) > 0
        if not strip.any():
            # Standing still, nothing but the gust explains anything.
            found.append(abs(step.gust @ step.left) / (step.gust @ step.gust))
            continue
        ends = np.stack([(middle - reach)[strip] / slope[strip], (middle + reach)[strip] / slope[strip]])
        found.append(max(ends.min(axis=0).max(), -ends.max(axis=0).min(), 0.0))
    return np.array(found)


def _steps(plant: System, road: Drive, truth: Trajectory, schedule: np.ndarray) -> Iterator[_Step]:
    uncertain = Uncertain.of(plant)
    nominal = uncertain.nominal
    x, u = truth.table(["lateral_speed", "yaw_rate"]), truth["steering"].values
    for k in range(len(x) - 1):
        at = dict(zip(nominal.scheduling_names, schedule[k], strict=True))
        A, B, E = (np.asarray(nominal.at(letter, schedule[k]), dtype=float) for letter in "ABE")
        rows = np.asarray(uncertain.rows({n: at[n] for n in uncertain.rows.names}), dtype=float)
        size = rows @ [*x[k], u[k], road.gust[k]]
        left = x[k + 1] - A @ x[k] - B[:, 0] * u[k] - E[:, 0] * road.gust[k]
        yield _Step(left, uncertain.directions * size, B[:, 0], E[:, 0])
