"""Bounds of what uncertain factors do: exact at vertices, and ordered."""

from itertools import product as tuples

import jax
import numpy as np

from luenberger.observers.uncertainty_bound import entry_bound, factor_bound, signal_box, split_entry_bound
from luenberger.sets import Interval


def drawn(seed: int) -> tuple[np.ndarray, np.ndarray, Interval, np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    box = Interval.around(rng.normal(size=2), rng.uniform(0, 1.5, 2))
    u, error, disturbance = rng.normal(size=1), rng.uniform(0, 0.5, 1), rng.uniform(0, 2, 1)
    return rng.normal(size=(2, 3)), rng.normal(size=(3, 4)), box, u, error, disturbance


def corners(x: Interval, u: np.ndarray, error: np.ndarray, disturbance: np.ndarray) -> np.ndarray:
    lower = np.concatenate([np.asarray(x.lower), u - error, -disturbance])
    upper = np.concatenate([np.asarray(x.upper), u + error, disturbance])
    return np.array(list(tuples(*zip(lower, upper, strict=True))))


def test_the_bound_of_a_factor_is_met_at_a_vertex() -> None:
    for seed in range(50):
        _, rows, x, u, error, disturbance = drawn(seed)
        expected = np.abs(corners(x, u, error, disturbance) @ rows.T).max(axis=0)
        found = factor_bound(rows, x, u, error, disturbance)
        np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_the_bound_of_an_entry_is_the_exact_interval_product() -> None:
    for seed in range(50):
        directions, rows, x, u, error, disturbance = drawn(seed)
        size = np.abs(directions) @ np.abs(rows)
        box = signal_box(x, u, error, disturbance)
        found = entry_bound(directions, rows, box)
        np.testing.assert_allclose(found, (Interval.of(-size, size) @ box).upper, rtol=1e-12)
        structured = np.abs(directions) @ np.asarray(factor_bound(rows, x, u, error, disturbance))
        assert np.all(structured <= np.asarray(found) + 1e-12)


def test_the_lemma_is_twice_as_wide_for_boxes_about_zero() -> None:
    for seed in range(50):
        directions, rows, x, u, error, disturbance = drawn(seed)
        R, box = np.abs(directions) @ np.abs(rows), signal_box(x, u, error, disturbance)
        low, high = np.asarray(box.lower), np.asarray(box.upper)
        plus, minus = (lambda z: np.maximum(z, 0)), (lambda z: np.maximum(-z, 0))
        # The lemma with its superscripts in order: A^+ of the upper bound R, A^- of the lower bound -R.
        upper = plus(R) @ plus(high) - plus(-R) @ minus(high) - minus(R) @ plus(low) + minus(-R) @ minus(low)
        np.testing.assert_allclose(split_entry_bound(directions, rows, box), upper, rtol=1e-12)
    symmetric = Interval.around([0.0], [3.0])
    one = np.ones((1, 1))
    assert float(split_entry_bound(one, one, symmetric)[0]) == 2 * float(entry_bound(one, one, symmetric)[0]) == 6.0


def test_no_factors_give_no_bounds_and_jit_changes_nothing() -> None:
    _, rows, x, u, error, disturbance = drawn(0)
    assert factor_bound(np.zeros((0, 4)), x, u, error, disturbance).shape == (0,)
    compiled = jax.jit(factor_bound)(rows, x, u, error, disturbance)
    np.testing.assert_allclose(compiled, factor_bound(rows, x, u, error, disturbance), rtol=1e-13)
