"""The posed inequality against the closed-loop error system: what is called L is what is injected."""

import jax.numpy as jnp
import numpy as np
import pytest

from luenberger.algebra import Polynomial
from luenberger.lmi import Bernstein
from luenberger.methods.channels import Channels
from luenberger.methods.two_dof_inequality import Limits, Posing, wanted
from luenberger.systems import Nonlinearity, System
from luenberger.systems.error_system import ErrorSystem

LOWER, UPPER = np.array([[0.5, -1.0], [2.0, 3.0]]), np.array([[0.75, 4.0], [2.0, 5.0]])
H = np.array([[0.0, 2.0, 0.0], [1.0, 0.0, -3.0]])


def plant() -> System:
    generator = np.random.default_rng(3)
    f = Nonlinearity.bounded(lambda z, u: jnp.zeros(2), H, size=2, jacobian=(LOWER, UPPER))
    shapes = {"A": (3, 3), "B": (3, 1), "C": (2, 3), "D": (2, 1), "E": (3, 1), "F": (3, 2), "G": (2, 2), "N": (1, 2)}
    return System.nonlinear(**{k: generator.normal(size=s) for k, s in shapes.items()}, nonlinearity=f)


@pytest.mark.parametrize("shift", ["none", "lower"])
@pytest.mark.parametrize("end", [0, 1])
def test_dissipation_of_the_error_system(shift: str, end: int) -> None:
    # With w_k = g_k p_k put in at an end of the Jacobian box, the inequality is the dissipation of the error plus
    # products (w - l p)(u p - w), which vanish there.
    system, generator = plant(), np.random.default_rng(4)
    channels = Channels.of(system, shift)
    posing = Posing(system, channels, 0.4, np.eye(3), "both", True, Bernstein())
    L, L2 = generator.normal(size=(3, 2)), generator.normal(size=(3, 2))
    root = generator.normal(size=(3, 3))
    P, scale = root @ root.T, 1 / posing.unit
    unknowns = posing.fixed(Polynomial.constant(L2))
    values = {"P": P, "tau": np.ones((len(unknowns.channels.arguments), 1)), "X": P @ L}
    for name, variable in unknowns.variables.items():
        variable.save_value(next(v for k, v in values.items() if name.startswith(k)))
    problem = posing.problem(unknowns, Limits())
    problem.variables["squared"].save_value(2.0)
    matrices = {b.name: np.asarray(next(c for _, c in b.matrix).value) for b in problem.blocks}
    slopes = (unknowns.channels.lower, unknowns.channels.upper)[end]
    e, v = generator.normal(size=3), generator.normal(size=3)
    seen, D = np.asarray(system.at("C")), np.asarray(system.at("D"))
    G = np.asarray(system.at("G")) - D @ np.asarray(system.at("N"))
    J = (LOWER, UPPER)[end]
    corner = system.replace(nonlinearity=system.nonlinearity.at_jacobian(J))
    error = ErrorSystem.of(corner, Polynomial.constant(L), argument_gain=Polynomial.constant(L2))

    def channel_outputs(v: np.ndarray) -> np.ndarray:
        return slopes * (unknowns.channels.arguments @ (e - L2 @ (seen @ e + scale * G @ v[1:])))

    de = np.asarray(error.A({})) @ e
    still = np.concatenate([e, channel_outputs(0 * v)])
    assert _eliminated(matrices["decay"], still) == pytest.approx(2 * e @ P @ (de + 0.4 * e), rel=1e-9)
    driven = de + scale * np.asarray(error.joined("both")({})) @ v
    moved = np.concatenate([e, channel_outputs(v), v])
    assert _eliminated(matrices["l2_gain"], moved) == pytest.approx(2 * e @ P @ driven + e @ e - 2.0 * v @ v, rel=1e-9)


def _eliminated(M: np.ndarray, x: np.ndarray) -> float:
    n = len(x)
    if n == len(M):
        return float(x @ M @ x)
    return float(x @ (M[:n, :n] - M[:n, n:] @ np.linalg.solve(M[n:, n:], M[n:, :n])) @ x)


def test_wanted() -> None:
    assert wanted("both") == ["disturbance", "noise"]
    assert wanted("noise") == ["noise"]
