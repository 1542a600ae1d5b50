"""One-sample checks of guaranteed estimates, by hand: what sets and readings contradict, and what they cannot."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from luenberger.observers.set_consistency import (
    boxes_apart,
    current_set,
    dwell_start,
    dwell_step,
    factors_at,
    not_finite,
    output_disagreement,
    reading_excess,
    step_disagreement,
    within_bound,
)
from luenberger.observers.unknown_input import UnknownInputObserver
from luenberger.observers.zonotopic import ZonotopicLuenberger
from luenberger.observers.zonotopic_plant import factors_of
from luenberger.sets import Interval, Zonotope
from luenberger.systems import System
from observers import gust_drive as gust

ZERO = np.zeros(2)


def test_excess_by_hand() -> None:
    assert float(boxes_apart(Interval.of([0, 0], [1, 1]), Interval.of([1.5, -3], [2, -1]))) == pytest.approx(1.0)
    assert float(boxes_apart(Interval.of([0, 0], [1, 1]), Interval.of([0.8, 0], [2, 1]))) == pytest.approx(-0.2)
    assert float(not_finite(np.array([1.0, np.nan]), np.array([np.inf]))) == 2
    np.testing.assert_allclose(reading_excess(2.0, np.array([2.5, 1.5]), 0.1, (0.9, 1.1)), [0.2, 0.2])
    np.testing.assert_allclose(reading_excess(-2.0, -2.5, 0.1, (0.9, 1.1)), 0.2)
    held = within_bound(Interval.of([0.5, 3.0], [4.0, 4.0]), [1.0, 2.0])
    np.testing.assert_allclose([held.lower, held.upper], [[0.5, 3.0], [1.0, 4.0]])


@pytest.mark.parametrize("dwell", [1, 3])
def test_dwell_inside_a_scan(dwell: int) -> None:
    modes = jnp.array([0, 1, 1, 1, 0, 0, 2, 1, 1, 1])
    start = dwell_start(modes[0], dwell)
    _, excess = jax.lax.scan(lambda carry, mode: dwell_step(carry, mode, dwell), start, modes)
    # Of three samples: 0 lasts two, 2 lasts one.
    np.testing.assert_array_equal(excess, np.zeros(10) if dwell == 1 else [0, 0, 0, 0, 0, 0, 1, 2, 0, 0])


def two_outputs(bound: float | None = None) -> UnknownInputObserver:
    """Two states that are both measured, the first pushed by an unknown input; the second halves at every sample."""
    options: dict[str, Any] = {} if bound is None else {"disturbance_bound": [bound]}
    system = System.linear(
        [[0.5, 0.0], [0.0, 0.5]], E=[[1.0], [0.0]], noise_bound=[0.01, 0.01], dt=0.1, name="two tanks", **options
    )
    return UnknownInputObserver(
        system, np.zeros((2, 2)), [[-1.0, 0.0], [0.0, 0.0]], initial_half_width=[0.1, 0.2], count=4
    )


def test_disagreement_of_a_second_output_by_hand() -> None:
    observer, r = two_outputs(), jnp.zeros(0)
    state = observer.init(jnp.zeros(2))
    # The start set explains |y| <= 0.1 + 0.01 and 0.2 + 0.01.
    disagreement = eqx.filter_jit(output_disagreement)
    for y, expected in (([0.3, 0.0], 0.19), ([0.0, 0.3], 0.09), ([0.1, 0.1], -0.01)):
        assert float(disagreement(observer, state, jnp.zeros(0), jnp.array(y), r)) == pytest.approx(expected, abs=1e-9)
    after, _ = observer.step(state, jnp.zeros(0), jnp.zeros(2), r)
    # One step on the first output is believed; of the second half of the start set is left.
    for y, expected in (([9.0, 0.1], 0.0), ([9.0, 0.3], 0.19)):
        found = float(disagreement(observer, after, jnp.zeros(0), jnp.array(y), r))
        assert found == pytest.approx(expected, abs=1e-9)
        assert (found > 0) == (expected > 0)


def test_disagreement_of_two_sets_by_hand() -> None:
    r = jnp.zeros(0)
    before, now = Zonotope.of(ZERO, 0.2 * np.eye(2)), Zonotope.of([3.0, 0.15], 0.01 * np.eye(2))
    # From [-0.2, 0.2] comes [-0.1, 0.1], and the first state is free; with |d| <= 1 it is not.
    assert float(step_disagreement(two_outputs(), before, now, jnp.zeros(0), r)) == pytest.approx(0.04, abs=1e-9)
    assert float(step_disagreement(two_outputs(1.0), before, now, jnp.zeros(0), r)) == pytest.approx(1.89, abs=1e-9)


def test_the_set_of_a_sample_is_what_the_observer_reports() -> None:
    runs, observer = gust.cars(3, random=0), gust.observer(gust.three_modes())
    state, held_set = observer.init(jnp.zeros(2)), eqx.filter_jit(current_set)
    for u, y, r in zip(runs.u[0], runs.y[0], runs.speed[0, :, None], strict=True):
        held = held_set(observer, state, y, r).interval()
        state, estimate = eqx.filter_jit(type(observer).step)(observer, state, u, y, r)
        np.testing.assert_allclose(held.lower, np.asarray(estimate.lower), rtol=1e-12)
        np.testing.assert_allclose(held.upper, np.asarray(estimate.upper), rtol=1e-12)


def test_a_predictor_inside_a_scan() -> None:
    plant = System.linear([[0.5]], noise_bound=[0.1], dt=0.1, name="tank")
    observer = ZonotopicLuenberger(plant, [[0.5]], initial_half_width=[1.0], count=3)

    def step(state: Any, y: Any) -> Any:
        excess = output_disagreement(observer, state, jnp.zeros(0), y, jnp.zeros(0))
        return observer.step(state, jnp.zeros(0), y, jnp.zeros(0))[0], excess

    # L = A forgets the state: x+ = 0.5 y within 0.05, so the next y within 0.15.
    _, excess = jax.lax.scan(step, observer.init(jnp.zeros(1)), jnp.array([[1.2], [0.4], [0.36]]))
    np.testing.assert_allclose(excess, [0.1, 0.2 - 0.15, 0.16 - 0.15], atol=1e-9)


def test_factors_of_the_mode_that_holds() -> None:
    plant = gust.three_modes()
    factors = factors_of(plant)
    assert factors is not None
    for mode, speed in enumerate(gust.SPEEDS):
        directions, rows = factors_at(plant, factors, jnp.array([speed]))
        moved = np.asarray(directions) @ np.asarray(rows)
        soft = plant.modes[mode]
        # Both stiffnesses at their upper ends.
        stiff = soft.freeze(**{p.name: p.upper for p in soft.parameters})
        middle = soft.freeze(**soft.uncertainty)
        np.testing.assert_allclose(moved[:, :2], stiff.at("A") - middle.at("A"), rtol=1e-9)
