"""Plants that several observer and replay tests share."""

import jax.numpy as jnp
import numpy as np

from luenberger.algebra import Polynomial
from luenberger.core import Signal, Trajectory
from luenberger.systems import MatrixFunction, Nonlinearity, Parameter, System

DT = 0.02


def two_mass() -> System:
    """Two masses, spring and damper, force on the first, both positions measured with feedthrough on one."""
    A = [[0, 0, 1, 0], [0, 0, 0, 1], [-40, 40, -0.6, 0.2], [20, -20, 0.1, -0.4]]
    B = [[0], [0], [2.0], [0]]
    C = [[1, 0, 0, 0], [0, 1, 0, 0]]
    return System.linear(A, B, C, [[0.0], [0.1]], E=[[0], [0], [0], [1.0]], name="two mass")


def car() -> System:
    """Single-track car scheduled by speed and its inverse."""
    slip = np.array([[-150.0, -20.0], [14.0, -140.0]])
    A = Polynomial.affine(np.zeros((2, 2)), vx=np.array([[0.0, -1.0], [0.0, 0.0]]), inverse_vx=slip)
    box = [Parameter("vx", 10.0, 50.0, "m/s"), Parameter("inverse_vx", 0.02, 0.1, "s/m")]
    names = {"states": ("vy", "yaw_rate"), "inputs": ("delta",), "outputs": ("yaw",)}
    return System.lpv(A, [[60.0], [50.0]], [[0.0, 1.0]], parameters=box, name="car", **names)


def car_by_function() -> System:
    """The same car with its state matrix as a function of the speed alone."""
    slip = np.array([[-150.0, -20.0], [14.0, -140.0]])

    def A(values: dict) -> object:
        vx = values["vx"]
        return slip / vx + vx * jnp.array([[0.0, -1.0], [0.0, 0.0]])

    box = [Parameter("vx", 10.0, 50.0, "m/s")]
    return System.lpv(MatrixFunction(A, ("vx",), (2, 2)), [[60.0], [50.0]], [[0.0, 1.0]], parameters=box)


def pendulum() -> System:
    """Driven pendulum, angle measured."""
    sine = Nonlinearity.bounded(lambda z, u: jnp.sin(z), [[1.0, 0.0]], jacobian=([[-1.0]], [[1.0]]))
    return System.nonlinear(
        [[0, 1], [0, -0.3]], [[0], [1.0]], [[1, 0]], F=[[0], [-9.81]], nonlinearity=sine, name="pendulum"
    )


def drive(plant: System, count: int = 200, dt: float = DT) -> Trajectory:
    """Smooth inputs, outputs and scheduling of a plant; no model behind them."""
    t = dt * np.arange(count)
    signals = [Signal(n, "", np.sin((k + 1.0) * t)) for k, n in enumerate(plant.inputs)]
    signals += [Signal(n, "", 0.3 * np.cos((k + 1.5) * t)) for k, n in enumerate(plant.outputs)]
    vx = 25.0 + 10.0 * np.sin(t)
    values = {"vx": vx, "inverse_vx": 1.0 / vx}
    signals += [Signal(n, "", values[n]) for n in plant.scheduling_names]
    return Trajectory(t, signals)
