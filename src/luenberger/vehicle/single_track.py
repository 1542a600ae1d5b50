"""Single-track (bicycle) plants from first principles, in slip-angle states and in lateral speed and yaw rate.

Axes ISO (x forward, y left, yaw to the left), states at the centre of gravity, small slip angles:

    m (dvy/dt + vx r) = Ff + Fr         Iz dr/dt = a Ff - b Fr
    alpha_f = delta - (vy + a r) / vx   alpha_r = -(vy - b r) / vx        F = C alpha

Differentiating the slips, and using (vy + a r)/vx = delta - alpha_f and (vy - b r)/vx = -alpha_r, gives

    dalpha_f = -(1/vx) [(1/m + a^2/Iz) Ff + (1/m - a b/Iz) Fr] - (ax/vx) alpha_f + (ax/vx) delta + ddelta + r
    dalpha_r = -(1/vx) [(1/m - a b/Iz) Ff + (1/m + b^2/Iz) Fr] - (ax/vx) alpha_r + r

with ax = dvx/dt, which is not what an accelerometer reads (that is dvx/dt - r vy). The yaw rate enters both rows with +1.
"""

from collections.abc import Callable, Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np

from luenberger.algebra import Polynomial
from luenberger.core.checks import known_keys
from luenberger.systems import Parameter, System
from luenberger.vehicle.parameters import VehicleParameters

Force = Callable[[Any], Any]


def slip_angle_plant(
    car: VehicleParameters, speed: tuple[float, float], acceleration: tuple[float, float]
) -> System:
    """Return the plant in slip angles (alpha_f, alpha_r), scheduled by 1/vx and dvx/dt.

    Choose it to estimate slip angles from steering, speed and yaw rate alone. ax/vx is the product of the two scheduling
    parameters, so their box is exactly the trapezoid of reachable (1/vx, ax/vx), not a box around it.

    Assumes: linear tyres; inputs (delta, ddelta, r); output alpha_f - alpha_r = delta - (a + b) r / vx.

    Args:
        car: parameters.
        speed: interval of vx [m/s], positive.
        acceleration: interval of dvx/dt [m/s^2].

    Reference: Y. Wang, dissertation 2014, (3.16)-(3.21), derived again above.
    """
    m, Iz, a, b = car.mass, car.yaw_inertia, car.front_axle_distance, car.rear_axle_distance
    mobility = np.array([[1 / m + a * a / Iz, 1 / m - a * b / Iz], [1 / m - a * b / Iz, 1 / m + b * b / Iz]])
    names = ("inverse_speed", "acceleration")
    A = Polynomial(names, {(1, 0): -mobility * [car.front_stiffness, car.rear_stiffness], (1, 1): -np.eye(2)})
    B = Polynomial(names, {(0, 0): np.array([[0.0, 1.0, 1.0], [0.0, 0.0, 1.0]]), (1, 1): np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])})
    return System.lpv(
        A,
        B,
        [[1.0, -1.0]],
        parameters=[
            Parameter("inverse_speed", 1 / speed[1], 1 / speed[0], "s/m"),
            Parameter("acceleration", *acceleration, unit="m/s^2"),
        ],
        states=("front_slip", "rear_slip"),
        inputs=("steering", "steering_rate", "yaw_rate"),
        outputs=("slip_difference",),
        units={
            "front_slip": "rad",
            "rear_slip": "rad",
            "steering": "rad",
            "steering_rate": "rad/s",
            "yaw_rate": "rad/s",
            "slip_difference": "rad",
        },
        name=f"{car.name}, slip angles",
    )


def lateral_plant(car: VehicleParameters, speed: tuple[float, float], outputs: Sequence[str] = ("yaw_rate",)) -> System:
    """Return the plant in lateral speed and yaw rate (vy, r), scheduled by vx and 1/vx.

    Choose it where yaw rate, or yaw rate and lateral acceleration, are measured. vx and 1/vx are two parameters with a box
    of their own; the true curve lies in it, so claims on the box are sound, and conservative over wide speed ranges.

    Assumes: linear tyres; input delta.

    Args:
        car: parameters.
        speed: interval of vx [m/s], positive.
        outputs: any of "yaw_rate", "lateral_acceleration" (Ff + Fr) / m.
    """
    rows = {"yaw_rate": 0, "lateral_acceleration": 1}
    known_keys("`outputs`", outputs, tuple(rows))
    m, Iz, a, b = car.mass, car.yaw_inertia, car.front_axle_distance, car.rear_axle_distance
    Cf, Cr = car.front_stiffness, car.rear_stiffness
    force = np.array([-(Cf + Cr), -(a * Cf - b * Cr)]) / m
    moment = np.array([-(a * Cf - b * Cr), -(a * a * Cf + b * b * Cr)]) / Iz
    names = ("speed", "inverse_speed")
    A = Polynomial(names, {(0, 1): np.stack([force, moment]), (1, 0): np.array([[0.0, -1.0], [0.0, 0.0]])})
    picked = [rows[o] for o in outputs]
    C = Polynomial(names, {(0, 0): np.array([[0.0, 1.0], [0.0, 0.0]])[picked], (0, 1): np.stack([0 * force, force])[picked]})
    return System.lpv(
        A,
        [[Cf / m], [a * Cf / Iz]],
        C,
        np.array([[0.0], [Cf / m]])[picked],
        parameters=[Parameter("speed", *speed, unit="m/s"), Parameter("inverse_speed", 1 / speed[1], 1 / speed[0], "s/m")],
        states=("lateral_speed", "yaw_rate"),
        inputs=("steering",),
        outputs=tuple(f"measured_{o}" for o in outputs),
        units={
            "lateral_speed": "m/s",
            "yaw_rate": "rad/s",
            "steering": "rad",
            **{f"measured_{o}": {"yaw_rate": "rad/s", "lateral_acceleration": "m/s^2"}[o] for o in outputs},
        },
        name=f"{car.name}, lateral",
    )


def lateral_forces(car: VehicleParameters, x: Any, steering: Any, speed: Any, front: Force, rear: Force) -> tuple[Any, Any]:
    """Return the axle forces (Ff, Fr) [N] of any tyre at a state.

    Args:
        car: parameters.
        x: (vy [m/s], r [rad/s]).
        steering: road-wheel angle [rad].
        speed: vx [m/s].
        front: slip [rad] -> front axle force [N].
        rear: slip [rad] -> rear axle force [N].
    """
    a, b = car.front_axle_distance, car.rear_axle_distance
    return front(steering - (x[0] + a * x[1]) / speed), rear(-(x[0] - b * x[1]) / speed)


def single_track_dynamics(car: VehicleParameters, front: Force, rear: Force) -> Callable[[Any, Any, Any, Any], Any]:
    """Return the nonlinear motion (t, x, u, r) -> dx with x = (vy, r), u = (steering,), r = (speed, ...), any tyres.

    Args:
        car: parameters.
        front: slip [rad] -> front axle force [N].
        rear: slip [rad] -> rear axle force [N].
    """

    def motion(t: Any, x: Any, u: Any, r: Any) -> Any:
        Ff, Fr = lateral_forces(car, x, u[0], r[0], front, rear)
        yaw = (car.front_axle_distance * Ff - car.rear_axle_distance * Fr) / car.yaw_inertia
        return jnp.stack([(Ff + Fr) / car.mass - r[0] * x[1], yaw])

    return motion
