"""A log becomes a trajectory in SI, or is refused with the channel and the sample."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from luenberger.core import BadInput, Trajectory
from luenberger.logs import read_log

SPEED = {"speed": {"column": "v", "unit": "km/h"}}


def log(folder: Path, text: str, channels: dict[str, Any] | None = None, **options: Any) -> Trajectory:
    path = folder / "drive.csv"
    path.write_text(text)
    return read_log(path, channels or SPEED, **({"time": "t"} | options))


def test_channels_arrive_in_si_with_their_source(tmp_path: Path) -> None:
    channels = {
        "speed": {"column": "v", "unit": "km/h"},
        "yaw_rate": {"column": "r", "unit": "deg/s", "sign": -1, "description": "gyro"},
        "steering": {"column": ["l", "r"], "unit": "rad"},
    }
    found = log(tmp_path, "t,v,r,l\n0,36,90,0\n10,72,-90,2\n", channels, time={"column": "t", "unit": "ms"})
    np.testing.assert_allclose(found.time, [0.0, 0.01])
    np.testing.assert_allclose(found["speed"].values, [10.0, 20.0])
    np.testing.assert_allclose(found["yaw_rate"].values, [-np.pi / 2, np.pi / 2])
    np.testing.assert_allclose(found["steering"].values, [45.0, -44.0])
    assert [s.unit for s in found] == ["m/s", "rad/s", "rad"]
    assert found["yaw_rate"].description == "gyro"
    assert found["speed"].description == "column v"
    assert (found.name, found.source) == ("drive.csv", "drive.csv")


def test_name_and_source_can_be_given(tmp_path: Path) -> None:
    found = log(tmp_path, "t,v\n0,1\n1,2\n", name="lap 3", source="test track")
    assert (found.name, found.source) == ("lap 3", "test track")


def test_stamps_since_1970_keep_their_digits_from_zero(tmp_path: Path) -> None:
    text = "t,v\n1700000000000000000,1\n1700000000010000128,2\n"
    found = log(tmp_path, text, time={"column": "t", "unit": "ns"}, from_zero=True)
    # A double near 1.7e18 counts in steps of 256 ns.
    np.testing.assert_allclose(found.time, [0.0, 0.01], atol=3e-7)


def test_holes_are_refused_with_first_sample_and_number(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=r"Channel `speed` \(column `v`\) .* at sample 1, t = 0.5 s, and 2 of 4 values"):
        log(tmp_path, "t,v\n0,1\n0.5,\n1,inf\n1.5,4\n")


def test_holes_are_filled_by_straight_lines_in_time(tmp_path: Path) -> None:
    found = log(tmp_path, "t,v\n0,\n1,36\n2,\n4,144\n5,\n", missing="interpolate")
    np.testing.assert_allclose(found["speed"].values, [10.0, 10.0, 20.0, 40.0, 40.0])


def test_holes_are_kept_as_nan(tmp_path: Path) -> None:
    found = log(tmp_path, "t,v\n0,36\n1,\n2,inf\n", missing="keep")
    np.testing.assert_array_equal(found["speed"].values, [10.0, np.nan, np.nan])


def test_an_empty_column_cannot_be_interpolated(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="3 of 3 values are missing; the column is empty"):
        log(tmp_path, "t,v\n0,\n1,\n2,\n", missing="interpolate")


def test_a_clock_that_runs_back_is_refused_or_dropped(tmp_path: Path) -> None:
    text = "t,v\n0,1\n1,2\n1,3\n0.5,4\n2,5\n1.5,6\n3,7\n"
    with pytest.raises(BadInput, match=r'backwards at samples 3, 5; .*still at sample 2; .*clock="drop"'):
        log(tmp_path, text)
    found = log(tmp_path, text, clock="drop")
    np.testing.assert_array_equal(found.time, [0.0, 1.0, 2.0, 3.0])
    np.testing.assert_allclose(found["speed"].values * 3.6, [1.0, 2.0, 5.0, 7.0])


def test_a_sample_without_time_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=r"time column of `drive\.csv` holds nan in sample 1"):
        log(tmp_path, "t,v\n0,1\n,2\n2,3\n")


def test_one_sample_is_not_enough(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="holds 1 sample"):
        log(tmp_path, "t,v\n0,1\n")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"time": {"column": "t", "unit": "m"}}, "time column has unit `m`; a unit of time"),
        ({"time": "time"}, "no column `time`"),
        ({"missing": "zero"}, "`missing` is 'zero'"),
        ({"clock": "sort"}, "`clock` is 'sort'"),
    ],
)
def test_wrong_options_are_refused(tmp_path: Path, options: dict[str, Any], message: str) -> None:
    path = tmp_path / "drive.csv"
    path.write_text("t,v\n0,1\n1,2\n")
    # Past the type checker of the tests, which would stop an unknown word first.
    reader = getattr(read_log, "__wrapped__", read_log)
    with pytest.raises(BadInput, match=message):
        reader(path, SPEED, **({"time": "t"} | options))
