"""Which tyres an interval observer must believe in: a box of secant stiffness and a bound of the force beyond it, from a log."""

from dataclasses import dataclass

import numpy as np

from luenberger.core import BadInput, Trajectory
from luenberger.vehicle.parameters import VehicleParameters
from luenberger.vehicle.slip_channels import rate_of_change


@dataclass(frozen=True)
class StiffnessBox:
    """|F - C alpha| <= offset with C in an interval, for either axle.

    Args:
        front: interval of the secant stiffness of the front axle [N/rad].
        rear: the same for the rear axle.
        offset: bounds of the force beyond the box, front and rear [N].
        share: share of the samples of the log that satisfy the bounds, front and rear.
    """

    front: tuple[float, float]
    rear: tuple[float, float]
    offset: tuple[float, float]
    share: tuple[float, float]

    def excess(self, slip: np.ndarray, force: np.ndarray) -> np.ndarray:
        """Return by how much each axle force [N] leaves the box, less the offset: positive where the bound is broken.

        Args:
            slip: front and rear slip angle [rad], shape (nt, 2).
            force: front and rear axle force [N], shape (nt, 2).
        """
        return np.stack(
            [
                _distance(slip[:, k], force[:, k], interval) - self.offset[k]
                for k, interval in enumerate((self.front, self.rear))
            ],
            axis=1,
        )


def axle_forces(trajectory: Trajectory, car: VehicleParameters, time_constant: float = 0.1) -> np.ndarray:
    """Return the axle forces [N], shape (nt, 2), that make the slip-angle equations of the single track exact on a log.

    They are solved from the slip angles and their smoothed derivatives, so bank, roll and whatever else the model leaves out
    count as force; that is what an observer of this plant has to bear. They need the true lateral speed and look ahead.

    Args:
        trajectory: log with the channels of `slip_angle_channels`, truth included.
        car: mass, inertia, axle distances.
        time_constant: of the centred smoothing of the derivatives [s].

    Raises:
        BadInput: a channel is missing.
    """
    slip = trajectory.table(["front_slip", "rear_slip"])
    steering, yaw_rate, inverse_speed = (trajectory[n].values for n in ("steering", "yaw_rate", "inverse_speed"))

    def slope(values: np.ndarray) -> np.ndarray:
        return rate_of_change(trajectory.time, values, time_constant, centred=True)

    acceleration = slope(1.0 / inverse_speed)
    stretched = inverse_speed * acceleration
    front = slope(slip[:, 0] - steering) + stretched * (slip[:, 0] - steering) - yaw_rate
    rear = slope(slip[:, 1]) + stretched * slip[:, 1] - yaw_rate
    m, Iz, a, b = car.mass, car.yaw_inertia, car.front_axle_distance, car.rear_axle_distance
    K = np.array([[-(1 / m + a**2 / Iz), a * b / Iz - 1 / m], [a * b / Iz - 1 / m, -(1 / m + b**2 / Iz)]])
    return np.linalg.solve(K, np.stack([front, rear]) / inverse_speed).T


def stiffness_box(
    trajectory: Trajectory,
    car: VehicleParameters,
    *,
    share: float = 0.99,
    tail: float = 0.01,
    slip_floor: float = 0.0175,
    time_constant: float = 0.1,
) -> StiffnessBox:
    """Identify the box of secant stiffness and the force offset of both axles from a log with known slip angles.

    The interval of C spans all but the tails of F / alpha where |alpha| is above the floor; the offset then covers the given
    share of all samples. A narrow box needs a large offset and the reverse; `tail` trades one for the other.

    Args:
        trajectory: as in `axle_forces`; only the part of the log that may be learned from.
        car: mass, inertia, axle distances.
        share: share of the samples that must satisfy the bound, in (0, 1].
        tail: share of the secants left out at either end, in [0, 0.5).
        slip_floor: smallest |alpha| [rad] whose secant is used: below it F / alpha is noise.
        time_constant: see `axle_forces`.

    Raises:
        BadInput: shares outside their range, no sample above the slip floor, or secants that are not positive.
    """
    if not (0 < share <= 1 and 0 <= tail < 0.5 and slip_floor > 0):
        raise BadInput(
            f"`share` {share}, `tail` {tail}, `slip_floor` {slip_floor}: (0, 1], [0, 0.5) and > 0 are needed."
        )
    slip = trajectory.table(["front_slip", "rear_slip"])
    force = axle_forces(trajectory, car, time_constant)
    intervals, offsets, kept = [], [], []
    for k, axle in enumerate(("front", "rear")):
        large = np.abs(slip[:, k]) > slip_floor
        if not large.any():
            reach = np.rad2deg(np.abs(slip[:, k]).max())
            raise BadInput(
                f"The {axle} slip angle of `{trajectory.name}` reaches {reach:.3g} deg, below the floor of "
                f"{np.rad2deg(slip_floor):.3g} deg; lower `slip_floor` or learn from a livelier drive."
            )
        lower, upper = (float(q) for q in np.quantile(force[large, k] / slip[large, k], [tail, 1 - tail]))
        if not lower > 0:
            raise BadInput(
                f"The {axle} secant stiffness of `{trajectory.name}` falls to {lower:.4g} N/rad; a positive one is needed. Raise "
                "`slip_floor` or `tail`, or check the signs of the log."
            )
        beyond = _distance(slip[:, k], force[:, k], (lower, upper))
        offset = float(np.quantile(beyond, share))
        intervals.append((lower, upper))
        offsets.append(offset)
        kept.append(float(np.mean(beyond <= offset)))
    return StiffnessBox(intervals[0], intervals[1], (offsets[0], offsets[1]), (kept[0], kept[1]))


def _distance(slip: np.ndarray, force: np.ndarray, interval: tuple[float, float]) -> np.ndarray:
    """Distance of a force from {C alpha, C in the interval} [N]."""
    ends = np.stack([interval[0] * slip, interval[1] * slip])
    return np.maximum(np.maximum(ends.min(axis=0) - force, force - ends.max(axis=0)), 0.0)
