"""The three forms of a plant matrix, and what is refused."""

import jax.numpy as jnp
import numpy as np
import pytest

from luenberger.algebra import Polynomial
from luenberger.core import BadInput, NotAccepted
from luenberger.systems import MatrixFunction
from luenberger.systems.matrix import plant_matrix, polynomial

TURN = MatrixFunction(lambda v: jnp.array([[0.0, 1 / v["vx"]], [-1.0, 0.0]]), ("vx",), (2, 2))


def made(value: object, rows: int = 2, columns: int = 2) -> object:
    return plant_matrix("A", value, rows, columns, ["vx"], "the system has 2 states")


def test_constants_are_lifted_and_nothing_is_zero() -> None:
    lifted, zero = made([[1, 2], [3, 4]]), made(None)
    assert isinstance(lifted, Polynomial)
    assert isinstance(zero, Polynomial)
    np.testing.assert_array_equal(lifted({}), [[1.0, 2.0], [3.0, 4.0]])
    np.testing.assert_array_equal(zero({}), np.zeros((2, 2)))


def test_every_coefficient_is_checked() -> None:
    with pytest.raises(BadInput, match=r"`A` holds nan at index \(0, 1\)"):
        made(Polynomial.affine(np.eye(2), vx=[[0.0, np.nan], [0.0, 0.0]]))


def test_the_shape_is_checked_with_its_reason() -> None:
    with pytest.raises(BadInput, match=r"`A` has shape \(3, 2\) but the system has 2 states; `A` needs shape \(2, 2\)"):
        made(np.zeros((3, 2)))
    with pytest.raises(BadInput, match="needs shape"):
        made(TURN, 3, 3)


@pytest.mark.parametrize(
    "value", [Polynomial.affine(np.eye(2), vy=np.eye(2)), MatrixFunction(lambda v: jnp.eye(2), ("vy",), (2, 2))]
)
def test_undeclared_parameters_are_refused(value: Polynomial | MatrixFunction) -> None:
    with pytest.raises(BadInput, match=r"`A` depends on \['vy'\]"):
        made(value)


def test_a_function_has_to_return_the_shape_it_declares() -> None:
    with pytest.raises(BadInput, match=r"returns shape \(2, 1\) but declares \(2, 2\)"):
        made(MatrixFunction(lambda v: jnp.ones((2, 1)) * v["vx"], ("vx",), (2, 2)))


def test_a_function_sees_only_its_own_parameters() -> None:
    seen = []
    MatrixFunction(lambda v: seen.append(tuple(v)) or jnp.eye(1), ("vx",), (1, 1))({"vx": 2.0, "mu": 1.0})
    assert seen == [("vx",)]


def test_only_polynomials_pass_as_polynomials() -> None:
    p = Polynomial.constant(np.eye(2))
    assert polynomial("A", p) is p
    with pytest.raises(NotAccepted, match=r"`A` is given as a function of \('vx',\)"):
        polynomial("A", TURN)
