"""The error system and its dissipation inequality, against plain matrices written out here."""

from typing import Literal

import jax.numpy as jnp
import numpy as np
import pytest

from catalogue import robot, saturating_car, scheduled_oscillator
from luenberger.algebra import Polynomial
from luenberger.core import BadInput, NotAccepted
from luenberger.systems import Nonlinearity, Parameter, System
from luenberger.systems.error_system import ErrorSystem
from luenberger.systems.jacobian_box import error_box, jacobian
from luenberger.vehicle import slip_angle_plant, wang_car

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


def erring_car(output: Literal["slip_difference", "slip_constraint"]) -> System:
    return slip_angle_plant(
        wang_car,
        (5.0, 40.0),
        (-8.0, 8.0),
        noise=(1e-3, 2e-2, 5e-3),
        scale_error=((-0.1, 0.1), (-0.2, 0.2)),
        output=output,
    )


@pytest.mark.parametrize("output", ["slip_difference", "slip_constraint"])
@pytest.mark.parametrize("form", ["plant", "estimate"])
def test_error_under_scheduling_error_is_the_difference_of_plant_and_copy(
    output: Literal["slip_difference", "slip_constraint"], form: Literal["plant", "estimate"]
) -> None:
    plant = erring_car(output)
    names = ("inverse_speed", "acceleration")
    gain = Polynomial(names, {(0, 0): generator.normal(size=(2, 1)), (1, 1): generator.normal(size=(2, 1))})
    error = ErrorSystem.of(plant, gain, form=form)
    for _ in range(10):
        p = {n: generator.uniform(*i) for n, i in error.box.items()}
        true = np.array([p["inverse_speed"], p["acceleration"]])
        read = true * np.array([p["inverse_speed_factor"], p["acceleration_factor"]])
        x, xhat, u, v = (generator.normal(size=n) for n in (2, 2, 3, 3))
        N, G = np.asarray(plant.at("N", true)), np.asarray(plant.at("G", read))
        y = np.asarray(plant.output(0.0, x, u, true)) + G @ v
        seen = u + N @ v
        innovation = y - np.asarray(plant.output(0.0, xhat, seen, read))
        copy = (
            np.asarray(plant.dynamics(0.0, xhat, seen, read)) + gain(dict(zip(names, read, strict=True))) @ innovation
        )
        rate = np.asarray(plant.dynamics(0.0, x, u, true)) - copy
        w = np.concatenate([x if form == "plant" else xhat, u])
        at = {n: m({k: p[k] for k in m.names}) for n, m in [("A", error.A), *error.inputs.items()]}
        found = at["A"] @ (x - xhat) + at["scheduling"] @ w + at["noise"] @ v
        np.testing.assert_allclose(found, rate, rtol=1e-11, atol=1e-11)


def test_a_model_of_its_own_drives_the_error() -> None:
    plant = slip_angle_plant(wang_car, (5.0, 40.0), (-8.0, 8.0))
    model = plant.replace(A=plant.polynomial("A") * 1.1)
    gain = Polynomial.constant(generator.normal(size=(2, 1)))
    error = ErrorSystem.of(plant, gain, model=model, form="estimate")
    p = {n: generator.uniform(*i) for n, i in plant.scheduling_box.items()}
    r, (x, xhat), u = np.array(list(p.values())), generator.normal(size=(2, 2)), generator.normal(size=3)
    copy = np.asarray(model.dynamics(0.0, xhat, u, r)) + gain({}) @ (np.asarray(plant.at("C", r)) @ (x - xhat))
    found = error.A(p) @ (x - xhat) + error.inputs["scheduling"](p) @ np.concatenate([xhat, u])
    np.testing.assert_allclose(found, np.asarray(plant.dynamics(0.0, x, u, r)) - copy, rtol=1e-12, atol=1e-12)


def test_moving_storage_adds_its_derivative() -> None:
    plant = slip_angle_plant(wang_car, (5.0, 40.0), (-8.0, 8.0), jerk=10.0)
    error = ErrorSystem.of(plant, Polynomial.constant(np.zeros((2, 1))))
    P0, P1, P2 = spd(2), spd(2), spd(2)
    P = Polynomial(("inverse_speed", "acceleration"), {(0, 0): P0, (1, 0): P1, (1, 1): P2})
    s, a, jerk = 0.1, -3.0, 7.0
    at = {"inverse_speed": s, "acceleration": a, "acceleration_rate": jerk}
    A = error.A({"inverse_speed": s, "acceleration": a})
    here = P0 + s * P1 + s * a * P2
    # s' = -s^2 a and (s a)' = s jerk - s^2 a^2.
    motion = -(s**2) * a * P1 + (s * jerk - s**2 * a**2) * P2
    found = error.dissipation(P, rate=0.5)
    np.testing.assert_allclose(
        found({n: at[n] for n in found.names}), here @ A + A.T @ here + motion + here, rtol=1e-12, atol=1e-9
    )


def test_moving_storage_needs_a_rate() -> None:
    plant = slip_angle_plant(wang_car, (5.0, 40.0), (-8.0, 8.0))
    error = ErrorSystem.of(plant, Polynomial.constant(np.zeros((2, 1))))
    with pytest.raises(NotAccepted, match="whose rate nobody bounds"):
        error.dissipation(Polynomial(("acceleration",), {(0,): np.eye(2), (1,): np.eye(2)}))
    with pytest.raises(BadInput, match="has no input"):
        error.joined("scheduling")
