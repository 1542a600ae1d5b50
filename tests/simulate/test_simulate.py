"""Simulated trajectories against exact solutions, with the model's names, and failures that say where and why."""

import diffrax
import jax.numpy as jnp
import numpy as np
import pytest

from luenberger.core import BadInput, LuenbergerError
from luenberger.simulate import Sensor, TruthModel, simulate
from luenberger.systems.discretize import discretize, one_step
from observers.plants import DT, car, two_mass

TIME = DT * np.arange(101)


def decay(**changes: object) -> TruthModel:
    parts = {
        "dynamics": lambda t, x, u, r: -x + u,
        "output": lambda t, x, u, r: 2 * x,
        "states": ("x",),
        "inputs": ("u",),
        "outputs": ("y",),
    }
    return TruthModel(**(parts | changes))


def test_held_inputs_equal_the_exact_hold() -> None:
    plant, u = two_mass(), np.random.default_rng(0).normal(size=(101, 1))
    found = simulate(plant, time=TIME, x0=np.ones(4), u=u)
    sampled, x = discretize(plant, DT), np.ones(4)
    for k in range(101):
        # Relative tolerance 1e-10 a step.
        np.testing.assert_allclose(found.table(plant.states)[k], x, atol=1e-9)
        np.testing.assert_allclose(found.table(plant.outputs)[k], plant.output(0.0, x, u[k]), atol=1e-9)
        x = np.asarray(sampled.dynamics(0.0, x, u[k]))
    assert np.array_equal(found["u1"].values, u[:, 0])
    assert found.names == ("x1", "x2", "x3", "x4", "u1", "y1", "y2")
    assert found.name == "two mass"


def test_linear_interpolation_and_functions_follow_the_closed_form() -> None:
    # x' = -x + t from 0: x = t - 1 + e^-t.
    expected = TIME - 1 + np.exp(-TIME)
    for u, interpolation in ((TIME, "linear"), (lambda t: t, "held")):
        found = simulate(decay(), time=TIME, x0=[0.0], u=u, interpolation=interpolation)
        np.testing.assert_allclose(found["x"].values, expected, atol=1e-10)
        np.testing.assert_allclose(found["y"].values, 2 * expected, atol=2e-10)


def test_known_jumps_of_functions_are_met() -> None:
    u = lambda t: jnp.where(t < 0.5, 0.0, 1.0)  # noqa: E731
    found = simulate(decay(), time=[0.0, 1.0], x0=[0.0], u=u, jump_times=[0.5])
    assert found["x"].values[-1] == pytest.approx(1 - np.exp(-0.5), abs=1e-11)


def test_stiff_models_take_another_solver() -> None:
    stiff = decay(dynamics=lambda t, x, u, r: -1e4 * (x - jnp.cos(t)) + u)
    found = simulate(stiff, time=TIME[:11], x0=[0.0], u=lambda t: 0.0, solver=diffrax.Kvaerno5(), rtol=1e-8, atol=1e-10)
    # After the transient x lags cos t by 1e-4 seconds.
    np.testing.assert_allclose(found["x"].values[1:], np.cos(TIME[1:11] - 1e-4), atol=1e-6)


def test_scheduled_plants_take_r() -> None:
    vx = 20 + np.sin(TIME)
    found = simulate(car(), time=TIME, x0=[0.0, 0.0], u=0.05 * np.sin(3 * TIME), r=np.stack([vx, 1 / vx], axis=1))
    assert np.array_equal(found["vx"].values, vx)
    x = jnp.zeros(2)
    for k in range(20):
        x = one_step(car(), DT, "exact")(x, found.table(["delta"])[k], found.table(["vx", "inverse_vx"])[k])
    np.testing.assert_allclose(found.table(["vy", "yaw_rate"])[20], x, atol=1e-9)


def test_discrete_plants_are_iterated() -> None:
    plant, u = discretize(two_mass(), DT), np.sin(TIME)
    found, x = simulate(plant, time=TIME, x0=np.ones(4), u=u), np.ones(4)
    for k in range(101):
        # The compiled loop may contract products and sums.
        np.testing.assert_allclose(found.table(plant.states)[k], x, rtol=1e-10, atol=1e-12)
        x = np.asarray(plant.dynamics(0.0, x, u[k : k + 1]))


def test_sensors_add_their_readings() -> None:
    found = simulate(
        decay(units={"x": "m"}),
        time=TIME,
        x0=[1.0],
        u=np.zeros(101),
        sensors=[Sensor("x", bias=1.0, name="seen")],
        seed=4,
    )
    np.testing.assert_allclose(found["seen"].values, found["x"].values + 1)
    assert found["seen"].unit == found["x"].unit == "m"


def test_an_output_may_share_the_name_of_its_state() -> None:
    found = simulate(decay(output=lambda t, x, u, r: x, outputs=("x",)), time=TIME, x0=[1.0], u=np.zeros(101))
    assert found.names == ("x", "u")
    with pytest.raises(BadInput, match="`x` of `truth` names two different signals"):
        simulate(decay(outputs=("x",)), time=TIME, x0=[1.0], u=np.zeros(101))


def test_finite_escape_is_named() -> None:
    with pytest.raises(
        LuenbergerError, match=r"came to t = 0.98 s of 2 s with 400 solver steps \(400 allowed\).*max_steps"
    ):
        simulate(decay(dynamics=lambda t, x, u, r: x**2), time=TIME, x0=[1.0], u=np.zeros(101), max_steps=400)


def test_an_output_outside_its_domain_is_named() -> None:
    with pytest.raises(LuenbergerError, match=r"The output `y` of `truth` is nan at t = 0.7 s"):
        simulate(decay(output=lambda t, x, u, r: jnp.sqrt(x - 0.5)), time=TIME, x0=[1.0], u=np.zeros(101))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"time": [0.0, 0.0]}, "at least two strictly increasing times"),
        ({"time": [0.0]}, r"`time` has shape \(1,\)"),
        ({"x0": [1.0, 2.0]}, r"`x0` has shape \(2,\) but the model has 1 states"),
        ({"u": None}, "`u` is not given"),
        (
            {"model": decay(outputs=("a", "b"))},
            r"`output` of `truth` returns shape \(1,\) but its names are \['a', 'b'\]",
        ),
        ({"model": decay(dynamics=lambda t, x, u, r: 0.0 * x[0])}, r"`dynamics` of `truth` returns shape \(\)"),
        ({"model": decay(dt=0.1)}, "`time` steps by 0.02 s at sample .* but `truth` is discrete with dt = 0.1 s"),
    ],
)
def test_what_does_not_fit_is_refused(changes: dict, message: str) -> None:
    with pytest.raises(BadInput, match=message):
        simulate(**({"model": decay(), "time": TIME, "x0": [1.0], "u": np.zeros(101)} | changes))
