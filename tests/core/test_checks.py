"""A refused argument says what was given, what is needed, and where."""

import sys

import numpy as np
import pytest

from luenberger.core import BadInput
from luenberger.core.checks import finite_array, is_number, is_whole, known_keys, matrix, nearest, symmetric_matrix


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_bad_number_is_located(bad: float) -> None:
    with pytest.raises(BadInput, match=r"`P` holds .* at index \(1, 0\)"):
        finite_array("P", [[1.0, 2.0], [bad, 3.0]])


@pytest.mark.parametrize("value", [[["a"]], [[1, 2], [3]], [[1j]], {"a": 1}, [None, object()]])
def test_what_is_no_number_is_refused(value: object) -> None:
    with pytest.raises(BadInput, match="`P` cannot be read"):
        finite_array("P", value)


def test_the_array_is_a_copy_in_float64() -> None:
    given = np.array([1, 2, 3])
    read = finite_array("P", given)
    read[0] = 9.0
    assert read.dtype == np.float64
    assert given[0] == 1


def test_matrix_says_the_wanted_shape_and_why() -> None:
    message = r"`C` has shape \(2, 3\) but the system has 4 states; `C` needs shape \(any, 4\)\."
    with pytest.raises(BadInput, match=message):
        matrix("C", np.zeros((2, 3)), columns=4, because="the system has 4 states")


@pytest.mark.parametrize("value", [[1.0, 2.0], np.zeros((1, 1, 1))])
def test_matrix_needs_two_axes(value: object) -> None:
    with pytest.raises(BadInput, match="needs shape"):
        matrix("C", value)


def test_a_number_is_a_one_by_one_matrix() -> None:
    assert matrix("C", 3.0, 1, 1).tolist() == [[3.0]]
    with pytest.raises(BadInput, match="needs shape"):
        matrix("C", 3.0, rows=2)


@pytest.mark.parametrize("number", [0, -3, 2.5, np.float64(1.0), sys.float_info.max])
def test_what_a_double_holds_is_a_number(number: float) -> None:
    assert is_number(number)
    assert is_whole(number) == isinstance(number, int)


@pytest.mark.parametrize("other", [True, "1", None, [1.0], np.nan, np.inf, -np.inf, 10**400])
def test_what_no_double_holds_is_none(other: object) -> None:
    assert not is_number(other)


def test_a_truth_value_counts_nothing() -> None:
    assert is_whole(10**400)
    assert not is_whole(True)


def test_symmetric_means_to_the_last_digit() -> None:
    assert symmetric_matrix("P", 2.0).tolist() == [[2.0]]
    assert symmetric_matrix("P", [[1, 2], [2, 1]]).tolist() == [[1.0, 2.0], [2.0, 1.0]]
    with pytest.raises(BadInput, match="`P` is not symmetric; give"):
        symmetric_matrix("P", [[1.0, 2.0], [np.nextafter(2.0, 3.0), 1.0]])
    with pytest.raises(BadInput, match="a symmetric matrix is square; `P` needs shape"):
        symmetric_matrix("P", [[1.0, 2.0]])


def test_nearest_guesses_or_lists() -> None:
    assert nearest("yaw_rat", ["yaw_rate", "speed"]) == " Did you mean `yaw_rate`?"
    assert nearest("qqq", ["speed", "brake"]) == " Known: `brake`, `speed`."
    assert nearest("qqq", []) == " There are none to choose from."


def test_known_keys_passes_what_is_known() -> None:
    known_keys("`units`", ["a"], ["a", "b"])
    with pytest.raises(BadInput, match=r"`units` has the unknown key `spede`\. Did you mean `speed`"):
        known_keys("`units`", ["speed", "spede"], ["speed"])
