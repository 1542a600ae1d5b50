"""Plants to python-control and back lose no number, name or time base."""

import control
import jax.numpy as jnp
import numpy as np
import pytest

from luenberger.algebra import Polynomial
from luenberger.core import BadInput, MissingExtra
from luenberger.systems import Nonlinearity, Parameter, System, conversion
from luenberger.systems.conversion import from_control, to_control

GENERATOR = np.random.default_rng(5)
A, B, C, D = (GENERATOR.normal(size=s) for s in ((3, 3), (3, 2), (2, 3), (2, 2)))


def named(dt: float | None) -> System:
    return System.linear(
        A,
        B,
        C,
        D,
        dt=dt,
        states=["slip", "yaw_rate", "roll"],
        inputs=["steer", "brake"],
        outputs=["ay", "r"],
        name="car",
    )


@pytest.mark.parametrize("dt", [None, 0.01])
def test_there_and_back(dt: float | None) -> None:
    again = from_control(to_control(named(dt)))
    assert (again.states, again.inputs, again.outputs) == (named(dt).states, named(dt).inputs, named(dt).outputs)
    assert (again.dt, again.name) == (dt, "car")
    for letter, M in zip("ABCD", (A, B, C, D), strict=True):
        np.testing.assert_array_equal(again.at(letter), M)


@pytest.mark.parametrize(("dt", "expected"), [(0, None), (0.02, 0.02)])
def test_definite_time_bases(dt: float, expected: float | None) -> None:
    assert from_control(control.ss(A, B, C, D, dt)).dt == expected


@pytest.mark.parametrize(("dt", "meaning"), [(True, "discrete with an open step"), (None, "open")])
def test_open_time_bases_are_refused(dt: bool | None, meaning: str) -> None:
    with pytest.raises(BadInput, match=f"is dt = {dt}, {meaning}; set"):
        from_control(control.ss(A, B, C, D, dt))


def test_both_sides_compute_the_same_output() -> None:
    plant = control.ss(A, B, C, D, 0.1)
    system = from_control(plant)
    x, u = GENERATOR.normal(size=3), GENERATOR.normal(size=2)
    np.testing.assert_allclose(system.dynamics(0.0, x, u), plant.dynamics(0.0, x, u), rtol=1e-12)
    np.testing.assert_allclose(system.output(0.0, x, u), plant.output(0.0, x, u), rtol=1e-12)


def test_a_state_nobody_uses_stays() -> None:
    idle = System.linear(np.zeros((2, 2)), np.zeros((2, 1)), [[1.0, 0.0]])
    assert to_control(idle).nstates == 2


def test_other_models_are_refused() -> None:
    with pytest.raises(BadInput, match=r"is a TransferFunction; a control\.StateSpace is needed"):
        from_control(control.tf([1.0], [1.0, 1.0]))


def test_scheduled_plants_point_to_freezing() -> None:
    plant = System.lpv(Polynomial.affine(A, vx=A), B, C, parameters=[Parameter("vx", 1.0, 2.0)])
    with pytest.raises(BadInput, match=r"Convert `system\.freeze\(vx=\.\.\.\)`"):
        to_control(plant)
    np.testing.assert_allclose(to_control(plant.freeze(vx=2.0)).A, 3 * A, rtol=1e-15)


def test_nonlinear_plants_are_refused() -> None:
    f = Nonlinearity.bounded(lambda z, u: jnp.sin(z), [[1.0, 0.0, 0.0]], lipschitz=1.0)
    with pytest.raises(BadInput, match="has a nonlinearity"):
        to_control(System.nonlinear(A, B, C, F=[[1.0], [0.0], [0.0]], nonlinearity=f))


def test_a_plant_without_inputs_is_refused() -> None:
    with pytest.raises(BadInput, match="has no input"):
        to_control(System.linear(A, C=C))


def test_the_missing_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(conversion, "control", None)
    with pytest.raises(MissingExtra, match=r'pip install "luenberger\[control\]"'):
        to_control(named(None))
