"""Plants for the tests of the Lipschitz methods."""

import jax.numpy as jnp
import numpy as np

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


def random_plant(seed: int, states: int = 3, outputs: int = 1) -> System:
    """Plant with random matrices, one disturbance and a saturating nonlinearity of Lipschitz constant one."""
    generator = np.random.default_rng(seed)
    H = generator.normal(size=(2, states))
    f = Nonlinearity.bounded(lambda z, u: jnp.tanh(z) @ jnp.array([[0.6], [0.8]]), H, lipschitz=1.0)
    return System.nonlinear(
        generator.normal(size=(states, states)),
        C=generator.normal(size=(outputs, states)),
        E=generator.normal(size=(states, 1)),
        F=generator.normal(size=(states, 1)),
        nonlinearity=f,
        name=f"random {seed}",
    )
