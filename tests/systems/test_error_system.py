"""The error system and its dissipation inequality, against plain matrices written out here."""

import jax.numpy as jnp
import numpy as np
import pytest

from catalogue import robot, saturating_car, scheduled_oscillator
from luenberger.algebra import Polynomial
from luenberger.core import BadInput, NotAccepted
from luenberger.systems import Nonlinearity, Parameter, System
from luenberger.systems.error_system import ErrorSystem, error_box, jacobian

generator = np.random.default_rng(0)


def spd(n: int) -> np.ndarray:
    half = generator.normal(size=(n, n))
    return half @ half.T + np.eye(n)


def test_closed_loop_at_random_points() -> None:
    system = scheduled_oscillator()
    gain = Polynomial.affine(generator.normal(size=(2, 1)), stiffness=generator.normal(size=(2, 1)))
    error = ErrorSystem.of(system, gain)
    for _ in range(10):
        point = {n: generator.uniform(*i) for n, i in system.scheduling_box.items()}
        r = np.array([point[n] for n in system.scheduling_names])
        expected = np.asarray(system.at("A", r)) - gain(point) @ np.asarray(system.at("C", r))
        np.testing.assert_allclose(error.A(point), expected, atol=1e-14)
        np.testing.assert_allclose(error.noise({n: point[n] for n in error.noise.names}), -gain(point), atol=1e-14)


def test_jacobian_entries_are_parameters() -> None:
    system = saturating_car()
    box = error_box(system)
    assert {"df1_dz1", "df2_dz2"} <= set(box)
    assert "df1_dz2" not in box  # fixed at zero
    values = {n: float(np.mean(i)) for n, i in box.items()}
    J = jacobian(system)({n: values[n] for n in jacobian(system).names})
    np.testing.assert_allclose(J, np.diag([values["df1_dz1"], values["df2_dz2"]]))
    error = ErrorSystem.of(system, Polynomial.constant(np.zeros((2, 1))))
    r = np.array([values[n] for n in system.scheduling_names])
    np.testing.assert_allclose(
        error.A(values), np.asarray(system.at("A", r)) + np.asarray(system.at("F", r)) @ J, rtol=1e-12
    )


def test_continuous_inequality_written_out() -> None:
    system = robot()
    L, P, s, a, k2 = generator.normal(size=(4, 2)), spd(4), 0.7, 0.3, 2.5
    weight = generator.normal(size=(2, 4))
    error = ErrorSystem.of(system, Polynomial.constant(L))
    ours = error.dissipation(
        P, rate=a, weight=Polynomial.constant(weight), inputs=error.disturbance, gain_squared=k2, multiplier=s
    )({})
    A = np.asarray(system.at("A")) - L @ np.asarray(system.at("C"))
    F, E, H = np.asarray(system.at("F")), np.asarray(system.at("E")), system.nonlinearity.H  # type: ignore[union-attr]
    corner = P @ A + A.T @ P + 2 * a * P + s * 3.33**2 * H.T @ H + weight.T @ weight
    plain = np.block(
        [
            [corner, P @ F, P @ E],
            [F.T @ P, -s * np.eye(1), np.zeros((1, 1))],
            [E.T @ P, np.zeros((1, 1)), -k2 * np.eye(1)],
        ]
    )
    np.testing.assert_allclose(ours, plain, atol=1e-12)


def test_discrete_inequality_is_the_schur_complement() -> None:
    A, L, P, rho = 0.3 * generator.normal(size=(2, 2)), generator.normal(size=(2, 1)) * 0.1, spd(2), 0.9
    plant = System.linear(A, C=[[1.0, 0.0]], E=[[1.0], [0.5]], dt=0.1)
    error = ErrorSystem.of(plant, Polynomial.constant(L))
    wide = np.asarray(error.dissipation(P, rate=rho, inputs=error.disturbance, gain_squared=4.0)({}))
    closed, E = A - L @ np.array([[1.0, 0.0]]), np.array([[1.0], [0.5]])
    both = np.hstack([closed, E])
    small = both.T @ P @ both - np.block([[rho**2 * P, np.zeros((2, 1))], [np.zeros((1, 2)), 4.0 * np.eye(1)]])
    top, right, last = wide[:3, :3], wide[:3, 3:], wide[3:, 3:]
    np.testing.assert_allclose(top - right @ np.linalg.solve(last, right.T), small, atol=1e-12)


def test_refusals() -> None:
    system = robot()
    with pytest.raises(BadInput, match=r"\(4, 2\)"):
        ErrorSystem.of(system, Polynomial.constant(np.zeros((2, 4))))
    with pytest.raises(BadInput, match="does not measure"):
        ErrorSystem.of(system, Polynomial.affine(np.zeros((4, 2)), vx=np.zeros((4, 2))))
    with pytest.raises(NotAccepted, match="Jacobian box"):
        jacobian(system)
    f = Nonlinearity.bounded(lambda z, u: jnp.sin(z), [[1.0]], lipschitz=1.0)
    F = Polynomial.affine(np.ones((1, 1)), q=np.ones((1, 1)))
    hidden = System.nonlinear(
        [[-1.0]], C=[[1.0]], F=F, nonlinearity=f, parameters=[Parameter("q", 0.0, 1.0, measured=False)]
    )
    with pytest.raises(NotAccepted, match="'q'"):
        ErrorSystem.of(hidden, Polynomial.constant([[0.0]]))
