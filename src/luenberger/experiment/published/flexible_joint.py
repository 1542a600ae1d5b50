"""The single-link robot arm with a flexible joint on which Lipschitz observers are compared since 1994."""

from typing import Any, Literal

import jax
import jax.numpy as jnp
import numpy as np

from luenberger.systems import Nonlinearity, System

Direction = Literal["printed", "motor_angle", "none"]

# Diagonal of the coordinates z = T x in which the printed designs live (Rajamani and Cho 1998).
TRANSFORM = (1.0, 1.0, 1.0, 0.1)

# Gains as printed by Song and Hedrick 2011, four decimals or five digits.
PRINTED_GAINS: dict[str, np.ndarray] = {
    "L1": np.array([[1.6477, 0.1965], [0.1965, 11.5338], [1.5185, 3.1468], [2.9224, 10.8291]]),
    "L2": np.array([[0.8155, 0.4422], [0.4422, 6.1759], [0.8080, 1.2933], [0.6979, 2.5587]]),
    "L3": np.array([[44727.0, -27.15], [-27.15, 63.058], [0.0496, 17.314], [11.092, 39.441]]),
    "L4": np.array([[4.5906, -1.312], [-1.312, 16.197], [3.1660, 3.8467], [9.1013, 9.6936]]),
}


def gravity(z: Any, u: Any) -> jax.Array:
    """Return the angular acceleration of the link by gravity, -3.33 sin(link angle) [rad/s^2].

    Args:
        z: link angle [rad], shape (1,).
        u: input, not used.
    """
    return -3.33 * jnp.sin(z)


def flexible_joint(disturbance: Direction = "printed") -> System:
    """Return the robot arm: motor and link joined by a torsion spring, motor angle and rate measured.

    The Lipschitz constant 3.33 of gravity holds for all states since |cos| <= 1. The printed input and nonlinearity have
    three entries for four states; the zero they lack is put back so that torque enters at the motor and gravity at the link.

    Args:
        disturbance: "printed" is E = (0, 2, 0, 0), "motor_angle" is E = (1, 0, 0, 0), which reproduces the
            printed fourth gain, "none" leaves the plant undisturbed.

    Reference: B. Song, J. K. Hedrick, ACC 2011, section V, (35); S. Raghavan, J. K. Hedrick, Int. J. Control 59 (1994)
    515-528; R. Rajamani, Y. M. Cho, Int. J. Control 69 (1998) 717-731.

    Example:
        >>> from luenberger.experiment.published.flexible_joint import flexible_joint
        >>> flexible_joint("none").nd
        0
    """
    directions = {"printed": [[0.0], [2.0], [0.0], [0.0]], "motor_angle": [[1.0], [0.0], [0.0], [0.0]], "none": None}
    return System.nonlinear(
        [[0.0, 1.0, 0.0, 0.0], [-48.6, -1.25, 48.6, 0.0], [0.0, 0.0, 0.0, 1.0], [19.5, 0.0, -19.5, 0.0]],
        [[0.0], [21.6], [0.0], [0.0]],
        [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]],
        E=directions[disturbance],
        F=[[0.0], [0.0], [0.0], [1.0]],
        nonlinearity=Nonlinearity.bounded(gravity, [[0.0, 0.0, 1.0, 0.0]], lipschitz=3.33),
        states=("motor_angle", "motor_rate", "link_angle", "link_rate"),
        inputs=("motor_voltage",),
        outputs=("motor_angle_sensor", "motor_rate_sensor"),
        units={
            "motor_angle": "rad",
            "motor_rate": "rad/s",
            "link_angle": "rad",
            "link_rate": "rad/s",
            "motor_voltage": "V",
        },
        name="flexible joint robot",
    )
