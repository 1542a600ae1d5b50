"""Derived channels: exact identities, honest smoothing, clear refusals."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from luenberger.core import BadInput, Signal, Trajectory
from luenberger.vehicle import carmaker_car, rate_of_change, slip_angle_channels

TIME = np.arange(0.0, 5.0, 0.01)


def drive(**changes: np.ndarray) -> Trajectory:
    channels = {
        "speed": 20.0 - 2.0 * TIME,
        "steering": 0.05 * np.sin(3 * TIME),
        "yaw_rate": 0.2 * np.sin(3 * TIME - 0.3),
        "lateral_speed": 0.3 * np.cos(2 * TIME),
    } | changes
    return Trajectory(TIME, [Signal(name, "", values) for name, values in channels.items()], "drive")


def test_slips_speeds_and_truth_fit_together() -> None:
    found = slip_angle_channels(drive(), carmaker_car)
    value = {s.name: s.values for s in found}
    np.testing.assert_allclose(value["slip_difference"], value["front_slip"] - value["rear_slip"], atol=1e-15)
    np.testing.assert_allclose(value["inverse_speed"] * value["speed"], 1.0, rtol=1e-15)
    np.testing.assert_allclose(value["sideslip"], np.arctan2(value["lateral_speed"], value["speed"]), atol=1e-15)
    # Constant braking: the smoothing starts on the right slope and stays there.
    np.testing.assert_allclose(value["acceleration"], -2.0, atol=1e-11)
    units = {s.name: s.unit for s in found}
    assert (units["inverse_speed"], units["acceleration"], units["steering_rate"]) == ("s/m", "m/s^2", "rad/s")
    assert "causal" in found["acceleration"].description


def test_without_lateral_speed_there_is_no_truth() -> None:
    log = drive()
    log = Trajectory(log.time, [s for s in log if s.name != "lateral_speed"])
    assert "rear_slip" not in slip_angle_channels(log, carmaker_car)


def test_a_measured_steering_rate_is_kept() -> None:
    rate = np.full(TIME.size, 7.0)
    found = slip_angle_channels(drive(steering_rate=rate), carmaker_car)
    np.testing.assert_array_equal(found["steering_rate"].values, rate)


def test_it_can_be_applied_twice() -> None:
    once = slip_angle_channels(drive(), carmaker_car)
    twice = slip_angle_channels(once, carmaker_car)
    assert twice.names == once.names
    np.testing.assert_array_equal(twice.table(twice.names), once.table(once.names))


@settings(max_examples=30)
@given(cut=st.integers(2, 400), jump=st.floats(-50, 50))
def test_the_causal_rate_does_not_look_ahead(cut: int, jump: float) -> None:
    values = np.sin(TIME)
    later = np.where(np.arange(TIME.size) >= cut, values + jump, values)
    np.testing.assert_array_equal(rate_of_change(TIME, values, 0.05)[:cut], rate_of_change(TIME, later, 0.05)[:cut])


@pytest.mark.parametrize("frequency", [0.5, 5.0, 20.0])
def test_a_sine_is_passed_as_the_stated_transfer_function(frequency: float) -> None:
    T, t = 0.05, np.arange(0.0, 10.0, 1e-4)
    s = 1j * frequency
    settled = t > 2.0
    late = slice(None, -20000)
    expected = np.imag(s / (T * s + 1) * np.exp(s * t))
    # The broken line through samples 0.1 ms apart lags by half a step: w^2 h / 2 = 0.02 at most.
    np.testing.assert_allclose(rate_of_change(t, np.sin(frequency * t), T)[settled], expected[settled], atol=0.025)
    centred = np.imag(s / (1 - (T * s) ** 2) * np.exp(s * t))
    found = rate_of_change(t, np.sin(frequency * t), T, centred=True)
    # No delay: the half steps of both directions cancel, (w h)^2 w / 6 is left.
    np.testing.assert_allclose(found[settled][late], centred[settled][late], atol=1e-4)


def test_steps_may_differ() -> None:
    t = np.cumsum(np.random.default_rng(6).uniform(0.005, 0.05, 500))
    np.testing.assert_allclose(rate_of_change(t, 3.0 * t, 0.1), 3.0, atol=1e-9)
    np.testing.assert_allclose(rate_of_change(t, 3.0 * t, 0.1, centred=True), 3.0, atol=1e-9)


def test_a_step_of_slope_is_followed_with_the_time_constant() -> None:
    t = np.arange(0.0, 1.0, 0.01)
    found = rate_of_change(t, np.maximum(t - 0.5, 0.0), 0.1)
    expected = np.where(t > 0.5, 1 - np.exp(-(t - 0.5) / 0.1), 0.0)
    np.testing.assert_allclose(found, expected, atol=1e-12)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"speed": np.where(TIME > 4.0, 0.0, 5.0)}, r"`speed` of `drive` is 0 m/s at t = 4.01 s \(99 samples <= 0\)"),
        (
            {"yaw_rate": np.where(TIME > 4.985, np.nan, 0.0)},
            r"`yaw_rate` of `drive` has no value at t = 4.99 s \(1 such",
        ),
    ],
)
def test_unusable_samples_are_refused(change: dict[str, np.ndarray], message: str) -> None:
    with pytest.raises(BadInput, match=message):
        slip_angle_channels(drive(**change), carmaker_car)


def test_a_missing_channel_and_a_wrong_time_constant_are_refused() -> None:
    with pytest.raises(BadInput, match="no channel `steering`"):
        slip_angle_channels(Trajectory(TIME, [Signal("speed", "m/s", TIME + 1)]), carmaker_car)
    with pytest.raises(BadInput, match="`time_constant` is 0"):
        slip_angle_channels(drive(), carmaker_car, time_constant=0.0)
