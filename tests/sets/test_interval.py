"""Intervals hold what they must and nothing more: ranges are exact, refused where they make no sense."""

import jax
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from luenberger.core import BadInput
from luenberger.sets import Interval

generator = np.random.default_rng(0)
number = st.floats(-5, 5, allow_nan=False)


def drawn(*shape: int) -> Interval:
    ends = np.sort(generator.normal(size=(2, *shape)), axis=0)
    return Interval.of(ends[0], ends[1])


def inside(box: Interval) -> np.ndarray:
    """A random point, every third one a corner."""
    share = generator.uniform(size=box.lower.shape)
    share = np.round(share) if generator.uniform() < 1 / 3 else share
    return np.asarray(box.lower) + share * np.asarray(box.upper - box.lower)


def test_matrix_product_holds_every_product_and_is_reached() -> None:
    for _ in range(200):
        A, x = drawn(2, 3), drawn(3)
        found = A @ x
        assert found.contains(inside(A) @ inside(x), 1e-12)
        # Entry 0 of the upper bound is met by the corner of A and x that maximises each term by itself.
        corners = np.array([[a * b for a in (A.lower[0], A.upper[0]) for b in (x.lower, x.upper)]])[0]
        assert float(found.upper[0]) == pytest.approx(corners.max(axis=0).sum(), abs=1e-12)


def test_product_of_two_signs_is_exact() -> None:
    # The bound by positive and negative parts gives [-2, 2] here.
    one = Interval.of([[-1.0]], [[1.0]])
    assert float((one @ Interval.of([-1.0], [1.0])).upper[0]) == 1.0


@given(number, number, number, number)
def test_entrywise_arithmetic_holds_all_corners(a: float, b: float, c: float, d: float) -> None:
    x, y = Interval.of([min(a, b)], [max(a, b)]), Interval.of([min(c, d)], [max(c, d)])
    for p in (a, b):
        for q in (c, d):
            assert (x + y).contains([p + q], 1e-12)
            assert (x - y).contains([p - q], 1e-12)
            assert (x * y).contains([p * q], 1e-12)
            assert x.hull(y).contains([p])


def test_numbers_and_arrays_take_part() -> None:
    box = Interval.of([-1.0, 2.0], [1.0, 3.0])
    M = np.array([[1.0, -2.0]])
    np.testing.assert_allclose((M @ box).lower, [-7.0])
    np.testing.assert_allclose((M @ box).upper, [-3.0])
    np.testing.assert_allclose((1.0 - box).lower, [0.0, -2.0])
    np.testing.assert_allclose((box * 2.0).upper, [2.0, 6.0])
    np.testing.assert_allclose(box.magnitude, [1.0, 3.0])


def test_intersection_says_when_it_is_empty() -> None:
    one, two = Interval.around([0.0, 0.0], 1.0), Interval.around([1.5, 0.0], [0.25, 1.0])
    assert bool(one.intersection(two).is_empty)
    assert not bool(one.intersection(Interval.around([1.0, 0.0], 0.5)).is_empty)


def test_passes_through_jit_and_vmap() -> None:
    A, boxes = drawn(2, 2), Interval.of(-np.ones((5, 2)), np.arange(10.0).reshape(5, 2))
    mapped = jax.jit(jax.vmap(lambda box: A @ box))(boxes)
    one = A @ Interval(boxes.lower[3], boxes.upper[3])
    np.testing.assert_allclose(mapped.upper[3], one.upper, rtol=1e-14)


@pytest.mark.parametrize(
    ("lower", "upper", "message"),
    [
        ([1.0], [0.0], r"\[1.0, 0.0\] at entry \(0,\)"),
        ([np.nan], [0.0], "without NaN"),
        ([0.0], [1.0, 2.0], "one shape"),
    ],
)
def test_bounds_that_make_no_sense_are_refused(lower: list[float], upper: list[float], message: str) -> None:
    with pytest.raises(BadInput, match=message):
        Interval.of(lower, upper)


def test_shapes_never_broadcast_to_something_else() -> None:
    with pytest.raises(BadInput, match=r"shapes \(1, 1\) and \(2,\)"):
        np.ones((1, 1)) @ Interval.of([0.0, 1.0], [1.0, 2.0])
    with pytest.raises(BadInput, match=r"`point` has shape \(1,\)"):
        Interval.of([0.0, 0.0], [1.0, 1.0]).contains([0.5])
    with pytest.raises(BadInput, match="half widths >= 0"):
        Interval.around([0.0], -1.0)


def test_what_is_unbounded_times_nothing_is_nothing() -> None:
    free = Interval.around(np.zeros(2), [np.inf, 1.0])
    found = np.array([[0.0, 2.0]]) @ free
    assert (float(found.lower[0]), float(found.upper[0])) == (-2.0, 2.0)
    assert float((np.array([[1.0, 0.0]]) @ free).upper[0]) == np.inf
