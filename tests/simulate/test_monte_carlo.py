"""Runs that do not depend on the chunk, and random signals that keep to their box and meet its corners."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from luenberger.core import BadInput
from luenberger.simulate.monte_carlo import monte_carlo, piecewise_signal, run_key

TIME = 0.01 * np.arange(1001)


def draw(key) -> dict[str, jax.Array]:
    return {"x": jax.random.normal(key, (3,)), "sum": jnp.sum(jax.random.normal(key, (3,)))}


@pytest.mark.parametrize("chunk", [1, 4, 5, 20, None])
def test_results_do_not_depend_on_the_chunk(chunk: int | None) -> None:
    found = monte_carlo(draw, 10, seed=3, chunk=chunk)
    assert isinstance(found["x"], np.ndarray)
    assert found["x"].shape == (10, 3)
    for k in range(10):
        # The draw is bit for bit the same; sums may be ordered otherwise in a batch.
        assert np.array_equal(found["x"][k], draw(run_key(3, k))["x"])
    np.testing.assert_allclose(found["sum"], found["x"].sum(axis=1), rtol=1e-13)


def test_fewer_runs_are_the_first_of_more() -> None:
    assert np.array_equal(monte_carlo(draw, 4)["x"], monte_carlo(draw, 9)["x"][:4])


def test_seeds_differ_and_repeat() -> None:
    assert np.array_equal(monte_carlo(draw, 5, seed=1)["x"], monte_carlo(draw, 5, seed=1)["x"])
    assert not np.isclose(monte_carlo(draw, 5, seed=1)["x"], monte_carlo(draw, 5, seed=2)["x"]).any()


def test_the_function_is_traced_once() -> None:
    traced = []

    def run(key):
        traced.append(1)
        return jax.random.uniform(key)

    monte_carlo(run, 11, chunk=4)
    assert len(traced) == 1


def test_mean_of_many_runs() -> None:
    x = monte_carlo(draw, 4000, chunk=1000)["x"]
    # 12 000 draws: the mean is known to 0.009; five of those.
    assert abs(x.mean()) < 0.045


def test_progress_counts_to_the_end() -> None:
    seen: list[tuple[int, int]] = []
    monte_carlo(draw, 10, chunk=4, progress=lambda done, number: seen.append((done, number)))
    assert seen == [(4, 10), (8, 10), (10, 10)]


@pytest.mark.parametrize(("number", "chunk"), [(0, None), (-3, None), (5, 0), (5, -1), (True, None)])
def test_numbers_that_are_not_positive_are_refused(number: int, chunk: int | None) -> None:
    with pytest.raises(BadInput, match="positive whole number"):
        monte_carlo(draw, number, chunk=chunk)


@given(
    seed=st.integers(0, 10**6),
    # Compiled code takes subnormal numbers for zero.
    low=st.tuples(st.floats(-1e5, 1e5, allow_subnormal=False), st.floats(-1.0, 1.0, allow_subnormal=False)),
    width=st.tuples(st.floats(0.0, 1e5, allow_subnormal=False), st.floats(0.0, 1e-3, allow_subnormal=False)),
    smooth=st.booleans(),
    probability=st.floats(0.0, 1.0),
)
def test_signals_stay_in_their_box(seed, low, width, smooth, probability) -> None:
    lower, upper = np.array(low), np.array(low) + np.array(width)
    values = piecewise_signal(
        jax.random.key(seed), TIME[::10], lower, upper, 0.7, smooth=smooth, vertex_probability=probability
    )
    assert values.shape == (101, 2)
    # No tolerance: a containment test downstream has none either.
    assert (np.asarray(values) >= lower).all()
    assert (np.asarray(values) <= upper).all()


@pytest.mark.parametrize("smooth", [False, True])
def test_all_corners_occur(smooth: bool) -> None:
    lower, upper = np.array([-1.0, 2.0]), np.array([1.0, 5.0])
    values = np.asarray(piecewise_signal(jax.random.key(1), TIME, lower, upper, 0.1, smooth=smooth))
    at_corner = ((values == lower) | (values == upper)).all(axis=1)
    assert {tuple(row) for row in values[at_corner]} == {(-1.0, 2.0), (-1.0, 5.0), (1.0, 2.0), (1.0, 5.0)}


def test_the_share_of_corners_is_the_probability() -> None:
    lower, upper = np.zeros(2), np.ones(2)
    for probability in (0.0, 0.25, 1.0):
        levels = np.asarray(
            piecewise_signal(jax.random.key(5), np.arange(4000.0), lower, upper, 1.0, vertex_probability=probability)
        )
        share = ((levels == 0) | (levels == 1)).all(axis=1).mean()
        # 4000 levels: the share is known to 0.7 %; five of those.
        assert share == pytest.approx(probability, abs=0.035)


def test_levels_are_held_and_change() -> None:
    values = np.asarray(piecewise_signal(jax.random.key(2), TIME, -1.0, 1.0, 0.5))[:, 0]
    changes = np.flatnonzero(np.diff(values)) + 1
    assert set(changes) <= set(range(50, 1001, 50))
    # Twenty levels of which half are drawn from two corners: most neighbours differ.
    assert changes.size >= 10


def test_smooth_signals_keep_their_rate_and_pass_their_levels() -> None:
    fine = 0.001 * np.arange(5001)
    values = np.asarray(piecewise_signal(jax.random.key(2), fine, -1.0, 1.0, 0.5, smooth=True))[:, 0]
    # A secant is never steeper than the steepest tangent; 1e-9 for rounding.
    assert np.abs(np.diff(values)).max() / 0.001 <= np.pi / 2 * 2 / 0.5 * (1 + 1e-9)
    held = np.asarray(piecewise_signal(jax.random.key(2), fine, -1.0, 1.0, 0.5))[:, 0]
    # Same key, same levels; the clip at a knot leaves at most rounding.
    np.testing.assert_allclose(values[::500], held[::500], atol=1e-12)


def test_signals_are_batched_over_keys() -> None:
    found = monte_carlo(lambda key: piecewise_signal(key, TIME, [0.0, 1.0], [1.0, 3.0], 0.2), 6)
    assert found.shape == (6, 1001, 2)
    assert not np.array_equal(found[0], found[1])


@pytest.mark.parametrize(
    "wrong",
    [
        {"lower": [1.0]},
        {"upper": [1.0, 2.0]},
        {"hold": 0.0},
        {"hold": float("nan")},
        {"vertex_probability": 1.5},
        {"lower": [float("nan")]},
    ],
)
def test_impossible_boxes_are_refused(wrong) -> None:
    given_ = {"lower": [-1.0], "upper": [0.0], "hold": 0.5, **wrong}
    with pytest.raises(BadInput, match=r"is needed|needs"):
        piecewise_signal(jax.random.key(0), TIME, **given_)
