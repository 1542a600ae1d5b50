"""The two plants of the fifth chapter of the dissertation, with Jacobian boxes stated in full digits."""

import jax
import jax.numpy as jnp
import numpy as np

from luenberger.systems import Nonlinearity, System
from luenberger.vehicle import brush_tyres, slip_angle_plant, wang_car

SPEED, ACCELERATION = (15 / 3.6, 150 / 3.6), (-8.0, 8.0)


def damping(z: jax.Array, u: jax.Array) -> jax.Array:
    return (1.0 - z[0] ** 2) * z[1]


def oscillator(reach: float, flip: float = 1.0) -> System:
    """Van der Pol on [-reach, reach]^2 with d on the speed; `flip` = -1 writes the position with the other sign."""
    S = np.diag([flip, 1.0])
    steep = 2 * reach**2
    f = Nonlinearity.bounded(
        lambda z, u: damping(S @ z, u),
        np.eye(2),
        jacobian=([[-steep, 1 - reach**2]], [[steep, 1.0]]),
        domain=([-reach, -reach], [reach, reach]),
    )
    A, C = S @ np.array([[0.0, 1.0], [-1.0, 0.0]]) @ S, np.array([[1.0, 0.0]]) @ S
    column = [[0.0], [1.0]]
    return System.nonlinear(A, C=C, F=column, E=column, nonlinearity=f, name="Van der Pol")


def slipping_car(share: float) -> System:
    """Slip angles of the dissertation's car on its trapezoid, the slope of the tyres falling by `share` of the stiffness."""
    plant = slip_angle_plant(
        wang_car, SPEED, ACCELERATION, tyres=brush_tyres(wang_car), slip_limit=0.1, disturbance=True
    )
    assert plant.nonlinearity is not None
    stiffness = np.diag([wang_car.front_stiffness, wang_car.rear_stiffness])
    f = Nonlinearity.bounded(
        plant.nonlinearity.function, np.eye(2), size=2, jacobian=(-share * stiffness, 0 * stiffness)
    )
    return plant.replace(nonlinearity=f)


def mixed_plant() -> System:
    """Three states, the first measured; one slope in [0.5, 2], which holds no zero, and a constant one beside it."""
    f = Nonlinearity.bounded(
        lambda z, u: jnp.array([1.25 * z[0] + 0.75 * jnp.sin(z[0]) + 0.7 * z[1]]),
        [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        jacobian=([[0.5, 0.7]], [[2.0, 0.7]]),
    )
    A, last = [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [-1.0, -1.0, -2.0]], [[0.0], [0.0], [1.0]]
    return System.nonlinear(A, C=[[1.0, 0.0, 0.0]], F=last, E=last, nonlinearity=f, name="mixed")
