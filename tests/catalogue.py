"""Methods times systems: every law in tests/laws runs over every row. A new method adds one row."""

from collections.abc import Callable
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np

from luenberger.algebra import Polynomial
from luenberger.methods import Method, PolytopicLuenberger, StructuredLipschitz
from luenberger.systems import Nonlinearity, Parameter, System


@dataclass(frozen=True)
class Row:
    """A method on a plant, and how far initial errors and inputs of the laws reach."""

    name: str
    system: Callable[[], System]
    method: Method
    reach: float = 1.0


def oscillator() -> System:
    """Lightly damped oscillator, position measured."""
    return System.linear([[0.0, 1.0], [-4.0, -0.2]], [[0.0], [1.0]], [[1.0, 0.0]], E=[[0.0], [1.0]], name="oscillator")


def scheduled_oscillator() -> System:
    """Oscillator whose stiffness and damping are scheduled, with a product of the two parameters."""
    A = Polynomial(
        ("stiffness", "damping"),
        {
            (0, 0): np.array([[0.0, 1.0], [0.0, 0.0]]),
            (1, 0): np.array([[0.0, 0.0], [-1.0, 0.0]]),
            (1, 1): np.array([[0.0, 0.0], [0.0, -1.0]]),
        },
    )
    parameters = [Parameter("stiffness", 1.0, 4.0), Parameter("damping", 0.05, 0.5)]
    return System.lpv(A, [[0.0], [1.0]], [[1.0, 0.0]], parameters=parameters, name="scheduled oscillator")


def robot(bound: str = "lipschitz") -> System:
    """Flexible-joint robot of Song and Hedrick, motor angle and speed measured."""
    A = [[0.0, 1.0, 0.0, 0.0], [-48.6, -1.25, 48.6, 0.0], [0.0, 0.0, 0.0, 1.0], [19.5, 0.0, -19.5, 0.0]]
    limits = {"lipschitz": {"lipschitz": 3.33}, "jacobian": {"jacobian": ([[-3.33]], [[3.33]])}}[bound]
    f = Nonlinearity.bounded(lambda z, u: -3.33 * jnp.sin(z), [[0.0, 0.0, 1.0, 0.0]], **limits)
    C = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]]
    B = [[0.0], [21.6], [0.0], [0.0]]
    E = [[0.0], [2.0], [0.0], [0.0]]
    return System.nonlinear(A, B, C, F=[[0.0], [0.0], [0.0], [1.0]], E=E, nonlinearity=f, name="flexible joint")


ROWS = (
    Row("polytopic, linear", oscillator, PolytopicLuenberger(decay_rate=1.0)),
    Row("polytopic, scheduled", scheduled_oscillator, PolytopicLuenberger(decay_rate=0.5)),
    Row("polytopic, one gain", scheduled_oscillator, PolytopicLuenberger(decay_rate=0.3, schedule="constant")),
    Row("polytopic, Jacobian box", lambda: robot("jacobian"), PolytopicLuenberger(decay_rate=1.0)),
    Row("structured Lipschitz", robot, StructuredLipschitz(decay_rate=1.0)),
    Row("structured Lipschitz, no decay asked", robot, StructuredLipschitz()),
)
