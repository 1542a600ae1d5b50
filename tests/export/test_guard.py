"""The guarded step: untouched where all is well, and a flag for every assumption that breaks."""

from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

from export_plants import running, scheduled
from luenberger.core import BadInput
from luenberger.export import Guarded, Signals
from luenberger.observers import CorrectionObserver, KalmanFilter, ZonotopicKalmanFilter
from luenberger.systems import Nonlinearity, System


def watched(**options: Any) -> Guarded:
    return Guarded.of(running(), scheduled(), **options)


def one(guarded: Guarded, state: Any, u: float = 0.0, y: float = 0.0, r: float = 2.0) -> tuple[Any, Any, set[str]]:
    following, estimate, raised = guarded.step(state, [u], [y], [r])
    return following, estimate, {name for name, flag in raised.items() if bool(flag)}


def test_a_sample_without_faults_passes_untouched() -> None:
    guarded = watched()
    state = guarded.init(np.array([0.1, -0.2]))
    following, estimate, raised = one(guarded, state, 0.3, 0.05, 2.5)
    plain, shown = running().step(jnp.array([0.1, -0.2]), [0.3], [0.05], [2.5])
    assert raised == set()
    np.testing.assert_array_equal(following.observer, plain)
    np.testing.assert_array_equal(estimate.x, shown.x)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_what_is_not_finite_is_held_at_its_last_value(bad: float) -> None:
    guarded = watched()
    state = one(guarded, guarded.init(np.zeros(2)), 0.3, 0.05, 2.5)[0]
    held, _, raised = one(guarded, state, bad, bad, bad)
    again, _, _ = one(guarded, state, 0.3, 0.05, 2.5)
    assert raised == {"not_finite"}
    np.testing.assert_array_equal(held.observer, again.observer)
    np.testing.assert_array_equal(held.r, [2.5])


def test_a_result_that_is_not_finite_keeps_the_state() -> None:
    guarded = watched()
    state = guarded.init(np.array([0.1, 0.2]))
    kept, _, raised = one(guarded, state, 1e308, -1e308, 2.0)
    assert "not_finite" in raised
    np.testing.assert_array_equal(kept.observer, state.observer)


def test_scheduling_is_clipped_and_said() -> None:
    guarded = watched()
    state = one(guarded, guarded.init(np.zeros(2)), r=3.99)[0]
    outside, _, raised = one(guarded, state, 0.1, 0.2, 4.5)
    edge, _, fine = one(guarded, state, 0.1, 0.2, 4.0)
    assert raised == {"scheduling_range"}
    assert fine == set()
    np.testing.assert_array_equal(outside.observer, edge.observer)


def test_a_rate_beyond_the_proved_one_is_said_from_the_second_sample_on() -> None:
    guarded = watched()
    first = one(guarded, guarded.init(np.zeros(2)), r=1.0)
    assert first[2] == set()
    # 2 a second is 0.02 a sample.
    assert one(guarded, first[0], r=1.021)[2] == {"scheduling_rate"}
    assert one(guarded, first[0], r=1.019)[2] == set()


def test_a_residual_beyond_its_bound_is_said() -> None:
    guarded = watched(residual_bound=[0.1])
    state = guarded.init(np.array([0.5, 0.0]))
    assert one(guarded, state, y=0.59)[2] == set()
    assert one(guarded, state, y=0.61)[2] == {"residual"}


def test_a_filter_gets_missing_outputs_masked() -> None:
    plant = scheduled().freeze(stiffness=2.0)
    filter_ = KalmanFilter(
        plant, 0.01, measurement_covariance=np.eye(1), initial_covariance=np.eye(2), process_density=np.eye(2)
    )
    guarded = Guarded.of(filter_, plant)
    state = guarded.init(np.zeros(2))
    following, _, raised = guarded.step(state, [0.1], [np.nan], [])
    plain, _ = filter_.step(filter_.init(np.zeros(2)), np.array([0.1]), np.array([np.nan]), np.zeros(0))
    assert bool(raised["not_finite"])
    np.testing.assert_array_equal(following.observer.x, plain.x)


def test_the_domain_of_the_nonlinearity_is_watched() -> None:
    f = Nonlinearity.bounded(lambda z, u: -(z**3), [[1.0]], jacobian=([[-3.0]], [[0.0]]), domain=([-1.0], [1.0]))
    plant = System.nonlinear([[-1.0]], C=[[1.0]], F=[[1.0]], nonlinearity=f)
    guarded = Guarded.of(CorrectionObserver(plant, [[0.5]], 0.01), plant)
    assert not bool(guarded.step(guarded.init(np.array([0.9])), [], [0.0], [])[2]["nonlinearity_domain"])
    assert bool(guarded.step(guarded.init(np.array([1.1])), [], [0.0], [])[2]["nonlinearity_domain"])


def test_only_flags_that_can_rise_have_a_bit() -> None:
    assert watched().flags == ("not_finite", "scheduling_range", "scheduling_rate")
    plant = System.linear([[0.9]], C=[[1.0]], E=[[1.0]], dt=0.1, disturbance_bound=[0.1], noise_bound=[0.1])
    observer = ZonotopicKalmanFilter(plant, initial_half_width=[1.0], count=5)
    assert Guarded.of(observer, plant).flags == ("not_finite", "bounds_crossed")


def test_refusals() -> None:
    with pytest.raises(BadInput, match="names of its signals"):
        Guarded.of(running())
    with pytest.raises(BadInput, match="1 numbers >= 0"):
        watched(residual_bound=[0.1, 0.2])
    with pytest.raises(BadInput, match="no C identifier"):
        Signals(("two words",))
    with pytest.raises(BadInput, match="`double`"):
        Signals(("double",))
