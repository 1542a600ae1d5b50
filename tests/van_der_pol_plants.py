"""The Van der Pol oscillator with its nonlinearity bounded on a square, and gains that suit it."""

import jax
import jax.numpy as jnp
import numpy as np

from luenberger.systems import Nonlinearity, System
from luenberger.systems.discretize import runge_kutta

# The limit cycle reaches 2.009 and 2.67.
OPERATING = (np.array([-2.1, -2.8]), np.array([2.1, 2.8]))
# Stabilises every Jacobian of the square of half side 5, by the vertex inequality.
GAIN = np.array([[11.5], [78.0]])
# With eta = e2 - 1.5 e1 the error is triangular: e1' = -0.5 e1 + eta, eta' = (g - 1.5) eta, g = 1 - x1^2 <= 1.
TWO_GAIN, ARGUMENT_GAIN = np.array([[2.0], [-0.25]]), np.array([[1.0], [1.5]])


def damping(z: jax.Array, u: jax.Array) -> jax.Array:
    return (1.0 - z[0] ** 2) * z[1]


def van_der_pol(reach: float = 5.0, hull: object = None) -> System:
    """Position measured; the Jacobian box is proved on [-reach, reach]^2, or a hull declared there."""
    square = ([-reach, -reach], [reach, reach])
    if hull is None:
        f = Nonlinearity.enclosed(damping, np.eye(2), square)
    else:
        f = Nonlinearity.bounded(damping, np.eye(2), hull=hull, domain=square)
    A, F = [[0.0, 1.0], [-1.0, 0.0]], [[0.0], [1.0]]
    return System.nonlinear(A, None, [[1.0, 0.0]], F=F, nonlinearity=f, name="Van der Pol")


def motions(
    system: System, gain: np.ndarray, argument_gain: np.ndarray, x0: np.ndarray, e0: np.ndarray, step: float, count: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """States, estimates and arguments of f over time, shape (starts, count, 2), integrated from the definition."""
    f, F = system.nonlinearity, jnp.asarray(system.at("F"))
    A, C, L, L2 = (jnp.asarray(M) for M in (system.at("A"), system.at("C"), gain, argument_gain))
    assert f is not None
    none = jnp.zeros(0)

    def slope(z: jax.Array) -> jax.Array:
        x, xhat = z[:2], z[2:]
        zeta = xhat + L2 @ C @ (x - xhat)
        return jnp.concatenate([A @ x + F @ f(x, none), A @ xhat + F @ f(zeta, none) + L @ C @ (x - xhat)])

    def run(x: jax.Array, e: jax.Array) -> jax.Array:
        start = jnp.concatenate([x, x - e])
        return jax.lax.scan(lambda z, _: (runge_kutta(slope, z, step), z), start, None, count)[1]

    z = jax.jit(jax.vmap(run))(jnp.asarray(x0), jnp.asarray(e0))
    x, xhat = z[..., :2], z[..., 2:]
    return np.asarray(x), np.asarray(xhat), np.asarray(xhat + (x - xhat) @ (L2 @ C).T)


def on_the_limit_cycle(count: int, seed: int = 0) -> np.ndarray:
    """Points of the limit cycle, drawn at random in time."""
    plant = van_der_pol()
    x, _, _ = motions(plant, np.zeros((2, 1)), np.zeros((2, 1)), np.array([[2.0, 0.0]]), np.zeros((1, 2)), 0.01, 6000)
    return x[0, np.random.default_rng(seed).integers(5000, 6000, count)]


def on_the_boundary(P: np.ndarray, level: float, count: int, seed: int = 1) -> np.ndarray:
    """Random points with e' P e = level."""
    d = np.random.default_rng(seed).normal(size=(count, len(P)))
    return d * np.sqrt(level / np.einsum("ni,ij,nj->n", d, P, d))[:, None]
