"""Block matrices against NumPy's own."""

import cvxpy as cp
import jax.numpy as jnp
import numpy as np
import pytest
from flint import fmpq

from luenberger.algebra import Polynomial, block, symmetric
from luenberger.core import BadInput

GENERATOR = np.random.default_rng(3)
WIDE, TALL, SQUARE = (GENERATOR.normal(size=s) for s in ((2, 3), (3, 2), (2, 2)))


def test_block_is_numpy_block() -> None:
    found = block([[WIDE, 0], [0, TALL]])({})
    np.testing.assert_array_equal(found, np.block([[WIDE, np.zeros((2, 2))], [np.zeros((3, 3)), TALL]]))


def test_symmetric_fills_the_lower_triangle() -> None:
    S, T = SQUARE + SQUARE.T, np.eye(3)
    found = symmetric([[S, WIDE], [T]])({})
    np.testing.assert_array_equal(found, np.block([[S, WIDE], [WIDE.T, T]]))


def test_symmetric_reads_nested_lists_as_blocks() -> None:
    found = symmetric([[[[1.0]], [[2.0]]], [[[3.0]]]])({})
    np.testing.assert_array_equal(found, [[1.0, 2.0], [2.0, 3.0]])


def test_a_zero_on_the_diagonal_takes_the_size_of_its_column() -> None:
    found = symmetric([[SQUARE + SQUARE.T, WIDE], [0]])({})
    np.testing.assert_array_equal(found[2:, 2:], np.zeros((3, 3)))
    np.testing.assert_array_equal(found, found.T)


def test_a_block_diagonal_of_rationals_stays_exact() -> None:
    half = np.array([[fmpq(1, 2)]], dtype=object)
    found = symmetric([[half, 0], [half]])({})
    assert found.tolist() == [[fmpq(1, 2), 0], [0, fmpq(1, 2)]]


def test_parameters_and_foreign_matrices_keep_their_place() -> None:
    a = Polynomial.affine(SQUARE, a=np.eye(2))
    found = block([[a, WIDE]])({"a": 2.0})
    np.testing.assert_allclose(found, np.hstack([SQUARE + 2 * np.eye(2), WIDE]), rtol=1e-15)
    np.testing.assert_array_equal(block([[jnp.asarray(SQUARE), WIDE]])({}), np.hstack([SQUARE, WIDE]))
    X = cp.Variable((2, 2))
    X.value = SQUARE
    np.testing.assert_allclose(block([[X, WIDE]])({}).value, np.hstack([SQUARE, WIDE]), rtol=1e-15)


def test_given_sizes_allow_zero_rows() -> None:
    np.testing.assert_array_equal(block([[0, 0]], [2], [1, 3])({}), np.zeros((2, 4)))


def test_blocks_that_do_not_fit_are_named() -> None:
    with pytest.raises(BadInput, match=r"Block \(1, 0\) has shape \(3, 2\)"):
        block([[WIDE], [TALL]])


def test_an_open_size_is_refused() -> None:
    with pytest.raises(BadInput, match="Row 1 of the block matrix holds zeros only"):
        block([[SQUARE, 0], [0, 0]])
    with pytest.raises(BadInput, match="Column 1"):
        block([[SQUARE, 0], [SQUARE, 0]])


def test_rows_need_to_make_a_triangle() -> None:
    with pytest.raises(BadInput, match="make no triangle"):
        symmetric([[SQUARE, WIDE], [TALL, SQUARE]])
