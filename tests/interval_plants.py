"""Plants for interval observers: the car of the dissertation with uncertain stiffness, in two choices of states."""

from typing import Any

import numpy as np

from luenberger.algebra import Polynomial
from luenberger.systems import Parameter, System
from luenberger.vehicle import slip_angle_plant, wang_car

FLIP = np.diag([1.0, -1.0])
STIFFNESS = ((60e3, 90e3), (35e3, 65e3))


def thesis_car(slow: float = 15.0, fast: float = 150.0, **options: Any) -> System:
    """Wang 2014, equations (4.36) to (4.46): slip angles, hidden axle stiffness, speed in km/h."""
    return slip_angle_plant(wang_car, (slow / 3.6, fast / 3.6), (-8.0, 8.0), stiffness=STIFFNESS, **options)


def printed_gain(flipped: bool) -> Polynomial:
    """Wang 2014, (4.47), in 1/vx and ax; row 2 with the sign of the state (front, rear) where flipped."""
    turn = FLIP if flipped else np.eye(2)
    terms = {
        (0, 0): turn @ [[1.7127], [1.3431]],
        (1, 0): turn @ [[-58.5902], [-42.9510]],
        (1, 1): turn @ [[-0.5579], [-0.4398]],
    }
    return Polynomial(("inverse_speed", "acceleration"), terms)


def lateral_car(speed: float = 20.0) -> System:
    """The same car with lateral speed and yaw rate as states, at one speed [m/s], yaw rate measured."""
    m, Iz, a, b = wang_car.mass, wang_car.yaw_inertia, wang_car.front_axle_distance, wang_car.rear_axle_distance
    front = -np.array([[1 / m, a / m], [a / Iz, a**2 / Iz]]) / speed
    rear = -np.array([[1 / m, -b / m], [-b / Iz, b**2 / Iz]]) / speed
    A = Polynomial.affine(np.array([[0.0, -speed], [0.0, 0.0]]), front_stiffness=front, rear_stiffness=rear)
    B = Polynomial.affine(np.zeros((2, 1)), front_stiffness=np.array([[1 / m], [a / Iz]]))
    names = ("front_stiffness", "rear_stiffness")
    hidden = [Parameter(n, *ends, "N/rad", measured=False) for n, ends in zip(names, STIFFNESS, strict=True)]
    return System.lpv(A, B, [[0.0, 1.0]], parameters=hidden, states=("lateral_speed", "yaw_rate"), name="lateral car")


def slip_transform(speed: float = 20.0) -> np.ndarray:
    """Slip angles (less the steering) from lateral speed and yaw rate."""
    return np.array([[-1.0, -wang_car.front_axle_distance], [-1.0, wang_car.rear_axle_distance]]) / speed


def uncertain_pair(**options: Any) -> System:
    """Two coupled states with one hidden coupling, first state measured, input of unknown strength."""
    A = Polynomial.affine(np.array([[-1.0, 0.5], [0.4, -2.0]]), q=np.array([[0.1, 0.2], [0.1, 0.3]]))
    B = Polynomial.affine(np.array([[0.0], [1.0]]), q=np.array([[0.0], [0.2]]))
    hidden = [Parameter("q", -1.0, 1.0, measured=False)]
    return System.lpv(A, B, [[1.0, 0.0]], parameters=hidden, name="uncertain pair", **options)
