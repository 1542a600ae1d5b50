"""What an observer reads is checked before anything is compiled, in words that say what to do."""

import numpy as np
import pytest

from luenberger.core import BadInput, Signal, Trajectory
from luenberger.observers import CorrectionObserver, zero_estimate
from luenberger.replay import Channels
from luenberger.replay.channels import channels_of, samples_of, uniform
from observers.plants import DT, car, drive

READ = Channels(("delta",), ("yaw",), ("vx", "inverse_vx"))
OBSERVER = CorrectionObserver(car(), [[0.5], [10.0]], DT)


def spoiled(name: str, value: float, at: int = 7) -> Trajectory:
    log = drive(car())
    values = log[name].values.copy()
    values[at] = value
    return log.with_signals(Signal(name, "", values))


def test_samples_come_in_the_order_of_the_names() -> None:
    u, y, r = samples_of("car", OBSERVER, drive(car()), READ, False)
    assert u.shape == y.shape == (200, 1)
    assert np.array_equal(r[:, 1], drive(car())["inverse_vx"].values)
    assert samples_of("none", zero_estimate(1, DT), drive(car()), Channels(), False)[0].shape == (200, 0)


@pytest.mark.parametrize(("name", "value"), [("delta", np.nan), ("yaw", np.inf), ("vx", np.nan)])
def test_gaps_are_refused_with_their_place(name: str, value: float) -> None:
    with pytest.raises(
        BadInput, match=rf"Channel `{name}` of `trajectory` is {value} at sample 7 \(t = 0.14 s\), 1 such samples"
    ):
        samples_of("car", OBSERVER, spoiled(name, value), READ, False)


def test_missing_outputs_pass_where_they_are_allowed() -> None:
    _, y, _ = samples_of("car", OBSERVER, spoiled("yaw", np.nan), READ, True)
    assert np.isnan(y[7, 0])
    with pytest.raises(BadInput, match=r"Channel `yaw`.*is inf"):
        samples_of("car", OBSERVER, spoiled("yaw", np.inf), READ, True)
    with pytest.raises(BadInput, match="Channel `vx`"):
        samples_of("car", OBSERVER, spoiled("vx", np.nan), READ, True)
    with pytest.raises(BadInput, match="pass `missing_outputs=True`"):
        samples_of("car", OBSERVER, spoiled("yaw", np.nan), READ, False)


@pytest.mark.parametrize(
    ("channels", "message"),
    [
        (Channels(("delta",), (), ("vx", "inverse_vx")), r"reads the outputs \['yaw'\], 1 in all.*name 0"),
        (Channels(("delta",), ("yaw", "vx"), ("vx", "inverse_vx")), r"reads the outputs.*name 2: \['yaw', 'vx'\]"),
        (Channels((), ("yaw",), ("vx", "inverse_vx")), "reads the inputs"),
        (Channels(("delta",), ("yaw",), ("vx",)), r"reads the scheduling.*name 1: \['vx'\]"),
    ],
)
def test_vectors_of_another_length_never_broadcast(channels: Channels, message: str) -> None:
    with pytest.raises(BadInput, match=message):
        samples_of("car", OBSERVER, drive(car()), channels, False)


def test_missing_channels_are_named() -> None:
    with pytest.raises(BadInput, match="lacks `yaw_rate`"):
        samples_of("car", OBSERVER, drive(car()), Channels(("delta",), ("yaw_rate",)), False)


def test_another_step_is_refused_with_the_way_out() -> None:
    with pytest.raises(
        BadInput, match=r"`car` runs at dt = 0.02 s but `trajectory` steps by 0.01 s.*\.resample\(0.02\)"
    ):
        uniform("car", DT, drive(car(), dt=0.01))
    time = drive(car()).time + 0.0
    time[50:] += 0.003
    with pytest.raises(BadInput, match=r"steps by 0.023 s after sample 49 \(t = 0.98 s"):
        uniform("car", DT, Trajectory(time, []))


def test_rounded_time_stamps_of_the_present_century_are_uniform() -> None:
    # Seconds since 1970 in doubles are rounded to 2.4e-7 s, more than 1e-6 of the step.
    uniform("car", DT, Trajectory(1.7e9 + DT * np.arange(1000), []))


def test_channels_go_by_observer() -> None:
    observers = {"a": OBSERVER, "b": OBSERVER}
    assert channels_of(observers, READ) == {"a": READ, "b": READ}
    with pytest.raises(BadInput, match=r"`channels` has no entry for \['b'\]"):
        channels_of(observers, {"a": READ})
    with pytest.raises(BadInput, match="unknown key `c`"):
        channels_of(observers, {"a": READ, "b": READ, "c": READ})


def test_a_lone_text_is_not_a_list_of_names() -> None:
    with pytest.raises(BadInput, match=r"`outputs` is the text `yaw`.*\('yaw',\)"):
        Channels(outputs="yaw")  # pyright: ignore[reportArgumentType]
