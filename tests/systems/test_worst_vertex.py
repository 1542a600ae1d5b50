"""Vertex maxima against a dense look at the box."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from luenberger.algebra import Polynomial
from luenberger.algebra.definiteness import exact
from luenberger.core import NotAccepted
from luenberger.systems.worst_vertex import entry, entrywise, largest, size, spread, undominated, vertices

BOX = {"m": (-1.0, 2.0), "p": (-0.5, 1.0), "q": (0.25, 3.0)}
numbers = st.lists(st.integers(-8, 8).map(float), min_size=8, max_size=8)


def scalar(coefficients: list[float]) -> Polynomial:
    keys = [(i, j, k) for i in (0, 1) for j in (0, 1) for k in (0, 1)]
    return Polynomial(("m", "p", "q"), {e: np.array([[c]]) for e, c in zip(keys, coefficients, strict=True)})


def best(values: list[Polynomial], m: float) -> float:
    return max(float(v({n: {"m": m}[n] for n in v.names})[0, 0]) for v in values)


@given(numbers, st.floats(0, 1), st.floats(0, 1), st.floats(0, 1))
def test_no_point_beats_the_candidates(coefficients: list[float], i: float, j: float, k: float) -> None:
    value = scalar(coefficients)
    point = {n: lo + s * (hi - lo) for (n, (lo, hi)), s in zip(BOX.items(), (i, j, k), strict=True)}
    here = float(value(point)[0, 0])
    room = 1e-9 * (1 + sum(map(abs, coefficients)))  # roundoff of eight products of numbers up to 72
    top, bottom = best(largest(value, ("p", "q"), BOX), point["m"]), -best(largest(-value, ("p", "q"), BOX), point["m"])
    assert bottom - room <= here <= top + room
    assert best(size(value, ("p", "q"), BOX), point["m"]) == pytest.approx(max(top, -bottom), abs=room)
    assert best(spread(value, ("p", "q"), BOX), point["m"]) == pytest.approx(top - bottom, abs=room)


@given(numbers)
def test_floats_and_rationals_agree(coefficients: list[float]) -> None:
    value = scalar(coefficients)
    for m in (-1.0, 0.0, 2.0):
        rational = max(
            v({n: exact(np.array([m]))[0] for n in v.names})[0, 0] for v in largest(value.map(exact), ("p", "q"), BOX)
        )
        assert float(rational.p) / float(rational.q) == pytest.approx(
            best(largest(value, ("p", "q"), BOX), m), abs=1e-9
        )


def test_a_vertex_that_never_wins_is_dropped() -> None:
    low, high = (Polynomial.affine(np.array([[c]]), m=np.array([[1.0]])) for c in (0.0, 1.0))
    assert undominated([low, high, low], BOX) == [high]
    crossing = Polynomial.affine(np.array([[0.5]]), m=np.array([[-1.0]]))
    assert set(map(id, undominated([high, crossing], BOX))) == {id(high), id(crossing)}


def test_sign_of_the_product_decides_the_vertex() -> None:
    # m p on m of both signs: both ends of p are needed; on m > 0 one.
    value = Polynomial(("m", "p"), {(1, 1): np.array([[1.0]])})
    assert len(largest(value, ("p",), BOX)) == 2
    assert len(largest(value, ("p",), {**BOX, "m": (0.0, 2.0)})) == 1


def test_entries_are_put_back_where_they_were() -> None:
    matrix = Polynomial.affine(np.arange(6.0).reshape(2, 3), q=np.ones((2, 3)))
    (found,) = entrywise(matrix, lambda one: largest(one, ("q",), BOX))
    np.testing.assert_allclose(found(dict.fromkeys(found.names, 0.0)), np.arange(6.0).reshape(2, 3) + 3.0)
    np.testing.assert_allclose(entry(matrix, 1, 2)({"q": 1.0}), [[6.0]])


def test_a_square_of_a_hidden_parameter_is_refused() -> None:
    with pytest.raises(NotAccepted, match="'q'"):
        vertices(Polynomial(("q",), {(2,): np.eye(1)}), ("q",), BOX)


def test_too_many_candidates_are_refused() -> None:
    crossing = [Polynomial.affine(np.zeros((1, 1)), m=np.array([[s]])) for s in (1.0, -1.0)]
    with pytest.raises(NotAccepted, match="cut the scheduling box"):
        entrywise(Polynomial.constant(np.zeros((4, 4))), lambda one: crossing)
