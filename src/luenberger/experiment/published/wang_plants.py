"""The plant of Wang 2014, section 3.2, in (theta1, theta2) = (1/vx, ax/vx), with the two hulls of its scheduling error.

Lemma 10 of the dissertation takes the relative errors x3 = e1/(1 + e1) of theta1 and x4 = (e1 - e2)/(1 + e1) of theta2 as
independent, though they share e1. In s = 1/(1 + e1) and t = 1 + e2 the measured scheduling is theta1 s and theta2 s t, which is
multi-affine too: the joint hull has sixteen vertices as well, and less volume.
"""

from typing import Any, Literal

import numpy as np

from luenberger.algebra import Polynomial
from luenberger.systems import Parameter, System
from luenberger.systems.scheduling_error import SchedulingError
from luenberger.vehicle import wang_car

Hull = Literal["independent", "joint"]
Reading = Literal["true", "measured"]

# (3.67): speed [m/s] and d vx/dt [m/s^2]; (3.73): relative errors of both.
SPEED, ACCELERATION = (15 / 3.6, 150 / 3.6), (-8.0, 8.0)
SPEED_ERROR, ACCELERATION_ERROR = (-0.1, 0.1), (-0.2, 0.2)
# Chapter 4: stiffness boxes (4.45) [N/rad]; its vertices of the scheduling are those of (3.67).
STIFFNESS = ((60e3, 90e3), (35e3, 65e3))
# (3.71), with e/(1 + e) for the printed 1/(1 + 1/e), which is undefined at zero error.
X3 = tuple(e / (1 + e) for e in SPEED_ERROR)
X4 = (
    1 - (1 + ACCELERATION_ERROR[1]) / (1 + SPEED_ERROR[0]),
    1 - (1 + ACCELERATION_ERROR[0]) / (1 + SPEED_ERROR[1]),
)
HULLS: tuple[Hull, ...] = ("independent", "joint")
WHEELBASE = wang_car.front_axle_distance + wang_car.rear_axle_distance


def theta_plant(
    hull: Hull = "independent",
    *,
    reading: Reading = "true",
    output: Literal["slip_difference", "slip_constraint"] = "slip_difference",
    noise: float | None = None,
) -> System:
    """Return the plant (3.74) scheduled by theta1 and theta2, with the scheduling error of (3.73).

    Args:
        hull: "independent" is Lemma 10, "joint" keeps x3 and x4 tied.
        reading: what the sixteen vertices are taken for. "true": (theta, theta_D), theta_m = theta - theta_D, as derived in
            (3.70). "measured": (theta_m, theta_D), theta = theta_m + theta_D, as (3.52) and (3.53) read if taken by the letter.
        output: as `slip_angle_plant`.
        noise: weight of a noise on y; left out: none.
    """
    K = stiffness_free()
    C = np.diag([wang_car.front_stiffness, wang_car.rear_stiffness])
    names, zero = ("theta1", "theta2"), (0, 0)
    options = {}
    if output == "slip_constraint":
        steering, yaw = np.array([[-1.0, 0.0, 0.0]]), np.array([[0.0, 0.0, WHEELBASE]])
        options["D"] = Polynomial(names, {zero: steering, (1, 0): yaw})
    return System.lpv(
        Polynomial(names, {(1, 0): K @ C, (0, 1): -np.eye(2)}),
        Polynomial(
            names, {zero: np.array([[0.0, 1.0, 1.0], [0.0, 0.0, 1.0]]), (0, 1): np.diag([1.0, 0.0]) @ np.eye(2, 3)}
        ),
        [[1.0, -1.0]],
        G=None if noise is None else [[noise]],
        parameters=[
            Parameter("theta1", 1 / SPEED[1], 1 / SPEED[0], "s/m"),
            Parameter("theta2", ACCELERATION[0] / SPEED[0], ACCELERATION[1] / SPEED[0], "1/s"),
        ],
        scheduling_error=scheduling_error(hull, reading),
        states=("front_slip", "rear_slip"),
        inputs=("steering", "steering_rate", "yaw_rate"),
        outputs=(output,),
        name=f"{wang_car.name}, {hull} hull",
        **options,
    )


def theta_gain(parts: Any, *, flipped: bool = True) -> Polynomial:
    """Return the printed L0, L1, L2 as L(theta); `flipped` turns row two, into the states (front slip, rear slip).

    Args:
        parts: three columns of shape (2,).
        flipped: as above.
    """
    return _theta(parts, _turn(flipped), np.eye(1))


def theta_model(parts: Any, reading: Reading, *, flipped: bool = True) -> tuple[System, Polynomial, System]:
    """Return plant, gain and copy of a printed unstructured observer (A_o, B_ou, B_oy), three coefficients each.

    Args:
        parts: as printed.
        reading: as `theta_plant`.
        flipped: as `theta_gain`.
    """
    turn, plant = _turn(flipped), theta_plant(reading=reading)
    gain = _theta(parts[2], turn, np.eye(1))
    loop = _theta(parts[0], turn, turn)
    copy = plant.replace(A=loop + gain @ np.array([[1.0, -1.0]]), B=_theta(parts[1], turn, np.eye(3)))
    return plant, gain, copy


def scheduling_error(hull: Hull, reading: Reading = "true") -> SchedulingError:
    """Return true and measured (theta1, theta2) over four free parameters, sixteen vertices.

    Args:
        hull: as `theta_plant`.
        reading: as `theta_plant`.
    """
    box = {"s": (1 / SPEED[1], 1 / SPEED[0]), "a": ACCELERATION}
    one, two = _product("s"), _product("s", "a")
    if hull == "joint":
        box |= {"f1": (1 / (1 + SPEED_ERROR[1]), 1 / (1 + SPEED_ERROR[0]))}
        box |= {"f2": (1 + ACCELERATION_ERROR[0], 1 + ACCELERATION_ERROR[1])}
        first, second = _product("s", "f1"), _product("s", "a", "f1", "f2")
    else:
        side = -1.0 if reading == "true" else 1.0
        box |= {name: _ends(1 + side * x[0], 1 + side * x[1]) for name, x in (("f1", X3), ("f2", X4))}
        first, second = _product("s", "f1"), _product("s", "a", "f2")
    plain, erring = {"theta1": one, "theta2": two}, {"theta1": first, "theta2": second}
    if reading == "true":
        return SchedulingError(plain, erring, box)
    return SchedulingError(erring, plain, box)


def stiffness_free() -> np.ndarray:
    """Return A1 without the stiffnesses, the effect of the axle forces on the slip rates times vx, shape (2, 2)."""
    m, Iz, a, b = wang_car.mass, wang_car.yaw_inertia, wang_car.front_axle_distance, wang_car.rear_axle_distance
    cross = a * b / Iz - 1 / m
    return np.array([[-(1 / m + a**2 / Iz), cross], [cross, -(1 / m + b**2 / Iz)]])


def _theta(parts: Any, left: np.ndarray, right: np.ndarray) -> Polynomial:
    keys = ((0, 0), (1, 0), (0, 1))
    matrices = (left @ np.reshape(np.asarray(p, np.float64), (2, -1)) @ right for p in parts)
    return Polynomial(("theta1", "theta2"), dict(zip(keys, matrices, strict=True)))


def _turn(flipped: bool) -> np.ndarray:
    return np.diag([1.0, -1.0]) if flipped else np.eye(2)


def _product(*names: str) -> Polynomial:
    return Polynomial(names, {(1,) * len(names): np.ones((1, 1))})


def _ends(one: float, other: float) -> tuple[float, float]:
    return (min(one, other), max(one, other))
