"""A plant as text and back: every part survives, and what cannot be written is refused."""

import json

import jax.numpy as jnp
import numpy as np
import pytest

from catalogue import robot, saturating_car, scheduled_oscillator, slip_angle_car
from luenberger.certify.rational_text import polynomial_as_text, polynomial_from_text
from luenberger.core import BadInput
from luenberger.design.system_text import system_as_text, system_from_text
from luenberger.systems import System


@pytest.mark.parametrize(
    "plant", [robot, saturating_car, scheduled_oscillator, slip_angle_car], ids=lambda p: p.__name__
)
def test_every_number_survives(plant: type) -> None:
    system: System = plant()
    again = system_from_text(json.loads(json.dumps(system_as_text(system))))
    for letter, matrix in system.matrices.items():
        other = again.polynomial(letter)
        assert other.names == matrix.names
        for (e, one), (g, two) in zip(system.polynomial(letter), other, strict=True):
            assert e == g
            np.testing.assert_array_equal(one, two)
    assert again.parameters == system.parameters
    assert (again.states, again.inputs, again.outputs, again.dt) == (
        system.states,
        system.inputs,
        system.outputs,
        system.dt,
    )
    f, g = system.nonlinearity, again.nonlinearity
    assert (f is None) == (g is None)
    if f is not None and g is not None:
        assert g.lipschitz == f.lipschitz
        assert g.bound_status == f.bound_status
        np.testing.assert_array_equal(g.H, f.H)


def test_the_function_can_be_given_back() -> None:
    again = system_from_text(system_as_text(robot()), lambda z, u: -3.33 * jnp.sin(z))
    x = np.array([0.1, 0.2, 0.3, 0.4])
    np.testing.assert_array_equal(again.dynamics(0.0, x, np.ones(1)), robot().dynamics(0.0, x, np.ones(1)))


def test_empty_matrices_keep_their_shape() -> None:
    plant = System.linear([[-1.0]], C=[[1.0]])
    assert polynomial_from_text(polynomial_as_text(plant.polynomial("B"))).shape == (1, 0)


def test_unknown_and_missing_parts_are_named() -> None:
    data = system_as_text(scheduled_oscillator())
    with pytest.raises(BadInput, match="matrices"):
        system_from_text({k: v for k, v in data.items() if k != "matrices"})
    with pytest.raises(BadInput, match="`colour`"):
        system_from_text({**data, "colour": "red"})
