"""Numbers survive the way through text to the last bit, and text that is no double is refused."""

import json
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from luenberger.algebra import Polynomial
from luenberger.certify.rational_text import (
    from_text,
    matrix_from_text,
    matrix_text,
    polynomial_as_text,
    polynomial_from_text,
    to_text,
)
from luenberger.core import BadInput


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_every_finite_double_is_written_as_what_it_is(number: float) -> None:
    text = to_text(number)
    assert Fraction(text) == Fraction(number)
    assert from_text(text) == number


@pytest.mark.parametrize("text", ["", "x", "1/0", "1.5", "nan", "1/2/3", "1e3", "9" * 400])
def test_what_is_no_rational_is_refused(text: str) -> None:
    with pytest.raises(BadInput, match='is not a rational; numbers in a certificate need the form "p/q"'):
        from_text(text)


@pytest.mark.parametrize("text", ["1/3", f"{2**53 + 1}", f"1/{2**1080}"])
def test_a_rational_that_no_double_holds_is_refused_instead_of_rounded(text: str) -> None:
    with pytest.raises(BadInput, match="is not exactly a double"):
        from_text(text)


def test_a_fraction_that_is_not_reduced_is_the_same_number() -> None:
    assert from_text("6/8") == 0.75


@pytest.mark.parametrize("shape", [(0, 0), (1, 1), (2, 3), (3, 0)])
def test_matrices_keep_shape_and_bits(shape: tuple[int, int]) -> None:
    matrix = np.random.default_rng(0).normal(size=shape)
    np.testing.assert_array_equal(matrix_from_text(json.loads(json.dumps(matrix_text(matrix)))), matrix)


@pytest.mark.parametrize("shape", [(0, 0), (0, 2), (2, 0), (2, 3)])
def test_polynomials_keep_names_shape_and_terms(shape: tuple[int, int]) -> None:
    rng = np.random.default_rng(1)
    wanted = Polynomial(("a", "b"), {(0, 0): rng.normal(size=shape), (1, 2): rng.normal(size=shape)})
    found = polynomial_from_text(json.loads(json.dumps(polynomial_as_text(wanted))))
    assert (found.names, found.shape, set(found.terms)) == (wanted.names, wanted.shape, set(wanted.terms))
    for exponents, coefficient in wanted:
        np.testing.assert_array_equal(found.terms[exponents], coefficient)


@pytest.mark.parametrize("power", [0.5, float("nan"), "1", None])
def test_exponents_are_whole_numbers(power: object) -> None:
    data = polynomial_as_text(Polynomial(("a",), {(1,): np.eye(2)}))
    data["terms"][0]["exponents"] = [power]
    with pytest.raises(TypeError):
        polynomial_from_text(data)
