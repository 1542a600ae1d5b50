"""Plants for the tests of the Lipschitz methods."""

import jax.numpy as jnp

from luenberger.systems import Nonlinearity, System

POINT_THREE = (1.0, 0.3)


def pendulum(lipschitz: float = 1.0, disturbed: bool = False) -> System:
    """Pendulum with measured angle; in coordinates diag(1, 0.3) its Lipschitz constant is 0.3."""
    sine = Nonlinearity.bounded(lambda z, u: -lipschitz * jnp.sin(z), [[1.0, 0.0]], lipschitz=lipschitz)
    return System.nonlinear(
        [[0.0, 1.0], [0.0, -0.1]],
        [[0.0], [1.0]],
        [[1.0, 0.0]],
        E=[[0.0], [1.0]] if disturbed else None,
        F=[[0.0], [1.0]],
        nonlinearity=sine,
        name="pendulum",
    )


def integrator(disturbed: bool = False) -> System:
    """x' = d, y = x, for which every number is known in closed form."""
    return System.linear([[0.0]], C=[[1.0]], E=[[1.0]] if disturbed else None, name="integrator")
