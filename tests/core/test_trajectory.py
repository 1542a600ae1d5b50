"""A trajectory with a fault in its times or names is refused where it is made, not where it is used."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from luenberger.core import BadInput, Signal, Trajectory


def drive(time: object = (0.0, 0.1, 0.2, 0.3), **options: str) -> Trajectory:
    t = np.asarray(time, dtype=float)
    return Trajectory(t, [Signal("yaw_rate", "rad/s", 2 * t), Signal("speed", "m/s", 10 - t)], **options)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_times_need_to_be_finite(bad: float) -> None:
    with pytest.raises(BadInput, match=r"`time` holds .* at index \(2,\)"):
        drive([0.0, 0.1, bad, 0.3])


def test_a_repeated_time_is_named_as_plain_numbers() -> None:
    with pytest.raises(BadInput, match=r"repeats at sample 2: 0\.1 s is followed by 0\.1 s \(1 such places\)"):
        drive([0.0, 0.1, 0.1, 0.3])


def test_a_backward_time_is_named_with_their_number() -> None:
    with pytest.raises(BadInput, match=r"`log 7` runs backwards at sample 2: 0\.5 s is followed by 0\.2 s \(2 such"):
        drive([0.0, 0.5, 0.2, 0.1], name="log 7")


@pytest.mark.parametrize("time", [[], [1.0], [[0.0, 1.0]], 3.0])
def test_two_samples_on_one_axis_are_needed(time: object) -> None:
    with pytest.raises(BadInput, match="at least two samples"):
        Trajectory(np.asarray(time, dtype=float), [])


def test_lengths_have_to_agree() -> None:
    with pytest.raises(BadInput, match="`speed` has 3 samples but `trajectory` has 2 time stamps"):
        Trajectory(np.array([0.0, 1.0]), [Signal("speed", "m/s", np.zeros(3))])


def test_a_name_given_twice_is_refused() -> None:
    with pytest.raises(BadInput, match="`speed` is given twice"):
        Trajectory(np.array([0.0, 1.0]), [Signal("speed", "m/s", np.zeros(2)), Signal("speed", "km/h", np.zeros(2))])


def test_a_signal_has_one_axis() -> None:
    with pytest.raises(BadInput, match=r"Signal `speed` has shape \(2, 2\)"):
        Signal("speed", "m/s", np.zeros((2, 2)))


def test_missing_samples_are_kept() -> None:
    assert np.isnan(Signal("speed", "m/s", np.array([1.0, np.nan])).values[1])


def test_a_missing_channel_gets_the_nearest_hint() -> None:
    with pytest.raises(BadInput, match=r"no channel `yawrate`\. Did you mean `yaw_rate`"):
        drive()["yawrate"]


def test_every_missing_channel_of_a_table_is_named() -> None:
    with pytest.raises(BadInput, match=r"lacks `sped`, `brake`; 3 channels are needed.*Did you mean `speed`"):
        drive().table(["sped", "yaw_rate", "brake"])


def test_table_keeps_the_order_asked_for() -> None:
    table = drive().table(["speed", "yaw_rate"])
    np.testing.assert_array_equal(table[:, 0], drive()["speed"].values)
    np.testing.assert_array_equal(table[:, 1], drive()["yaw_rate"].values)
    assert drive().table([]).shape == (4, 0)


def test_nothing_inside_can_be_changed() -> None:
    trajectory = drive()
    with pytest.raises(ValueError, match="read-only"):
        trajectory.time[0] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        trajectory["speed"].values[0] = 1.0
    with pytest.raises(dataclasses.FrozenInstanceError):
        trajectory.name = "other"  # type: ignore[misc]


def test_the_arrays_given_stay_the_caller_s_own() -> None:
    time, values = np.array([0.0, 1.0]), np.array([3.0, 4.0])
    trajectory = Trajectory(time, [Signal("speed", "m/s", values)])
    time[0], values[0] = -1.0, -1.0
    assert trajectory.time[0] == 0.0
    assert trajectory["speed"].values[0] == 3.0


def test_container_habits() -> None:
    trajectory = drive()
    assert len(trajectory) == 4
    assert [s.name for s in trajectory] == ["yaw_rate", "speed"] == list(trajectory.names)
    assert "speed" in trajectory
    assert "brake" not in trajectory
    # Equality is identity: comparing arrays inside would be ambiguous.
    assert trajectory == trajectory
    assert trajectory != drive()


def test_with_signals_replaces_in_place_and_appends() -> None:
    fresh = drive().with_signals(Signal("yaw_rate", "rad/s", np.ones(4)), Signal("brake", "Pa", np.zeros(4)))
    assert fresh.names == ("yaw_rate", "speed", "brake")
    assert fresh["yaw_rate"].values[2] == 1.0
    assert drive()["yaw_rate"].values[2] == pytest.approx(0.4)


def test_between_keeps_the_start_and_drops_the_stop() -> None:
    cut = drive([0.0, 1.0, 2.0, 3.0], source="a log").between(1.0, 3.0)
    np.testing.assert_array_equal(cut.time, [1.0, 2.0])
    np.testing.assert_array_equal(cut["yaw_rate"].values, [2.0, 4.0])
    assert cut.source == "a log"


@pytest.mark.parametrize(("start", "stop"), [(0.25, 0.35), (5.0, 6.0), (0.3, 0.1), (np.nan, 1.0)])
def test_between_refuses_cuts_without_two_samples(start: float, stop: float) -> None:
    with pytest.raises(BadInput, match=r"covers 0 to 0\.3 s; the cut .* and two are needed"):
        drive().between(start, stop)


@pytest.mark.parametrize("dt", [0.0, -0.1, np.nan, np.inf])
def test_resample_needs_a_positive_step(dt: float) -> None:
    with pytest.raises(BadInput, match="a positive step in seconds is needed"):
        drive().resample(dt)


def test_resample_refuses_a_step_longer_than_the_log() -> None:
    with pytest.raises(BadInput, match=r"lasts 0\.3 s, less than one step dt = 1 s"):
        drive().resample(1.0)


@pytest.mark.parametrize("dt", [1e-12, 1e-320])
def test_resample_refuses_what_no_memory_holds(dt: float) -> None:
    with pytest.raises(BadInput, match=r"more than 100000000 steps of dt = .* take a coarser one"):
        drive().resample(dt)


def test_resample_does_not_invent_a_value_for_a_missing_sample() -> None:
    gap = Trajectory(np.array([0.0, 1.0, 2.0]), [Signal("speed", "m/s", np.array([1.0, np.nan, 3.0]))])
    assert np.isnan(gap.resample(0.5)["speed"].values[1:4]).all()


@given(
    steps=st.lists(st.floats(0.01, 1.0), min_size=2, max_size=30),
    slope=st.floats(-5, 5),
    dt=st.floats(0.01, 0.02),
)
def test_resample_is_exact_on_straight_lines(steps: list[float], slope: float, dt: float) -> None:
    time = np.concatenate([[0.0], np.cumsum(steps)])
    line = Trajectory(time, [Signal("position", "m", 1 + slope * time)])
    if time[-1] < dt:
        return
    again = line.resample(dt)
    assert again.time[-1] <= time[-1] + 1e-9 * dt
    assert again.time[-1] > time[-1] - dt
    # Interpolation between neighbours at least 0.01 s apart loses a few digits of values up to 151.
    np.testing.assert_allclose(again["position"].values, 1 + slope * again.time, atol=1e-9)


def test_sample_time_is_the_median() -> None:
    assert drive([0.0, 0.1, 0.2, 5.0]).sample_time == pytest.approx(0.1)
