"""A replay is the plain loop over the steps, of several observers side by side, and says who failed where."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from luenberger.core import BadInput, ReplayFailed, Signal
from luenberger.observers import AlgebraicEstimate, CorrectionObserver, Estimate, KalmanFilter, Observer, zero_estimate
from luenberger.replay import Channels, replay
from observers.plants import DT, car, drive

READ = Channels(("delta",), ("yaw",), ("vx", "inverse_vx"))
TUNING = {"measurement_covariance": [[0.01]], "process_density": np.eye(2), "initial_covariance": np.eye(2)}
LOG = drive(car())


class Counted(Observer):
    """Adds gain a step to its state; counts how often it is traced, and can go astray."""

    gain: jax.Array
    traces: list = eqx.field(static=True)
    dt: float = eqx.field(static=True, default=DT)

    def init(self, x0: Any) -> Any:
        return jnp.asarray(x0, float)

    def step(self, state: Any, u: Any, y: Any, r: Any) -> tuple[Any, Estimate]:
        self.traces.append(1)
        return state + self.gain, Estimate(state)


class Interval(Observer):
    """Bounds around y, the lower one as given."""

    low: float = eqx.field(static=True)
    dt: float = eqx.field(static=True, default=DT)

    def init(self, x0: Any) -> Any:
        return ()

    def step(self, state: Any, u: Any, y: Any, r: Any) -> tuple[Any, Estimate]:
        return (), Estimate(y, lower=jnp.full_like(y, self.low), upper=y + 1.0)


def test_equals_the_plain_loop() -> None:
    observers = {"fixed": CorrectionObserver(car(), [[0.5], [10.0]], DT), "kalman": KalmanFilter(car(), DT, **TUNING)}
    done = replay(observers, LOG, READ, np.array([0.5, 0.1]))
    u, y, r = (LOG.table(names) for names in (READ.inputs, READ.outputs, READ.scheduling))
    for name, observer in observers.items():
        state = observer.init(np.array([0.5, 0.1]))
        step = eqx.filter_jit(lambda o, s, *sample: o.step(s, *sample))
        for k in range(len(LOG)):
            state, estimate = step(observer, state, u[k], y[k], r[k])
            # The scan may contract products and sums differently.
            np.testing.assert_allclose(done[name].x[k], estimate.x, rtol=1e-10, atol=1e-12)
    assert done["fixed"].covariance is None
    assert done["kalman"].covariance.shape == (200, 2, 2)
    assert done.states == {"fixed": ("vy", "yaw_rate"), "kalman": ("vy", "yaw_rate")}
    assert done.seconds_per_step is None


def test_entrants_may_read_their_own_channels_and_start_on_their_own() -> None:
    log = LOG.with_signals(Signal("other", "", LOG["yaw"].values + 1.0))
    anchor = AlgebraicEstimate(lambda u, y, r: 2 * y, DT)
    observers = {"a": anchor, "b": anchor, "zero": zero_estimate(2, DT)}
    channels = {"a": Channels(outputs=("yaw",)), "b": Channels(outputs=("other",)), "zero": Channels()}
    done = replay(observers, log, channels, dict.fromkeys(observers))
    assert np.array_equal(done["a"].x[:, 0], 2 * LOG["yaw"].values)
    assert np.array_equal(done["b"].x[:, 0], 2 * (LOG["yaw"].values + 1.0))
    assert not done["zero"].x.any()
    assert done.states["zero"] == ("x1", "x2")


def test_tunings_share_one_compiled_scan() -> None:
    traces: list = []
    for gain in (1.0, 2.0, 3.0):
        done = replay({"a": Counted(jnp.asarray(gain), traces)}, LOG, Channels(), [0.0])
        assert done["a"].x[:, 0].tolist() == [gain * k for k in range(len(LOG))]
    assert len(traces) == 1


def test_timing_is_by_observer() -> None:
    observers = {"a": zero_estimate(1, DT), "b": CorrectionObserver(car(), [[0.5], [10.0]], DT)}
    done = replay(observers, LOG, {"a": Channels(), "b": READ}, {"a": None, "b": np.zeros(2)}, timing=True)
    seconds = done.seconds_per_step
    assert list(seconds) == ["a", "b"]
    assert all(s > 0 for s in seconds.values())


def test_divergence_names_observer_sample_and_time() -> None:
    observers = {"calm": zero_estimate(1, DT), "wild": CorrectionObserver(car(), [[0.5], [1e30]], DT, substeps=1)}
    with pytest.raises(
        ReplayFailed, match=r"`wild` gives an estimate that is not finite at sample [1-9] \(t = 0.\d+ s\).*last finite"
    ):
        replay(observers, LOG, {"calm": Channels(), "wild": READ}, {"calm": None, "wild": np.zeros(2)})
    with pytest.raises(ReplayFailed, match=r"`now`.*at sample 0 \(t = 0 s\)\. Check"):
        replay({"now": AlgebraicEstimate(lambda u, y, r: y / 0.0, DT)}, LOG, READ, None)


def test_missing_outputs_reach_only_those_who_skip_them() -> None:
    yaw = np.where(np.arange(len(LOG)) % 3 == 1, np.nan, LOG["yaw"].values)
    log = LOG.with_signals(Signal("yaw", "", yaw))
    done = replay({"kalman": KalmanFilter(car(), DT, **TUNING)}, log, READ, np.zeros(2), missing_outputs=True)
    variance = done["kalman"].covariance[:, 1, 1]
    # Without a measurement the variance of the yaw rate is larger than after one.
    assert (variance[4::3] > variance[3:-1:3]).all()
    with pytest.raises(ReplayFailed, match=r"`fixed`.*at sample 2 "):
        replay({"fixed": CorrectionObserver(car(), [[0.5], [10.0]], DT)}, log, READ, np.zeros(2), missing_outputs=True)


def test_bounds_may_be_infinite_but_never_nan() -> None:
    done = replay({"open": Interval(-np.inf)}, LOG, READ, None)
    assert np.isinf(done["open"].lower).all()
    with pytest.raises(ReplayFailed, match=r"`lost`.*sample 0"):
        replay({"lost": Interval(np.nan)}, LOG, READ, None)


def test_estimates_become_a_trajectory_with_deviations_and_bounds() -> None:
    log = LOG.with_signals(Signal("yaw_rate", "rad/s", LOG["yaw"].values))
    done = replay(
        {"kalman": KalmanFilter(car(), DT, **TUNING), "open": Interval(-2.0)},
        log,
        READ,
        {"kalman": np.zeros(2), "open": None},
    )
    found = done.trajectory_of("kalman")
    assert found.names == ("vy", "vy_deviation", "yaw_rate", "yaw_rate_deviation")
    assert found["yaw_rate"].unit == "rad/s"
    np.testing.assert_allclose(found["vy_deviation"].values ** 2, done["kalman"].covariance[:, 0, 0], rtol=1e-14)
    assert done.trajectory_of("open").names == ("x1", "x1_lower", "x1_upper")


def test_functions_of_the_estimate() -> None:
    done = replay({"kalman": KalmanFilter(car(), DT, **TUNING)}, LOG, READ, np.zeros(2))
    beta = done.outputs("kalman", lambda x, u, r: jnp.arctan(x[0] * r[1]), ("sideslip",))
    np.testing.assert_allclose(
        beta["sideslip"].values, np.arctan(done["kalman"].x[:, 0] / LOG["vx"].values), rtol=1e-12
    )
    assert done.outputs("kalman", lambda x, u, r: x).names == ("z1", "z2")
    with pytest.raises(BadInput, match="`function` returns 2 values but `names` has 1"):
        done.outputs("kalman", lambda x, u, r: x, ("one",))
    with pytest.raises(BadInput, match=r"no observer `kalmann`. Did you mean `kalman`"):
        done.outputs("kalmann", lambda x, u, r: x)


def test_nothing_to_replay_is_refused() -> None:
    with pytest.raises(BadInput, match="`observers` is empty"):
        replay({}, LOG, READ, None)
    with pytest.raises(BadInput, match=r"`x0` has no entry for \['a'\]"):
        replay({"a": zero_estimate(1, DT)}, LOG, READ, {})
