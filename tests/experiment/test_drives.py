"""Simulated drives stand where a log would."""

from pathlib import Path

import numpy as np
import pytest

from luenberger.core import BadInput
from luenberger.experiment.drives import simulated_drive
from luenberger.experiment.specification import CHANNELS, read_specification
from luenberger.vehicle import braking_lane_changes, carmaker_car, wang_car

FILE = """
title = "drive"
[log]
drive = "two_lanes"
{extra}
[vehicle]
parameters = "wang_car"
[domain]
speed = [5.0, 40.0]
acceleration = [-8.0, 8.0]
[entrants.zero]
kind = "zero"
"""


def test_the_double_track_follows_the_speed_and_crosses_the_lanes() -> None:
    log = simulated_drive("two_lanes", wang_car, 0.02)
    assert set(CHANNELS) <= set(log.names)
    manoeuvre = braking_lane_changes()
    wanted = np.array([float(manoeuvre.speed(t)) for t in log.time])
    # The driver closes gaps at 2 1/s; the drag of a steered tyre and the lag of the actuator leave some tenths of a m/s.
    assert np.abs(log["speed"].values - wanted).max() < 0.5
    position = np.cumsum(log["lateral_speed"].values * 0.02)
    assert np.isfinite(position).all()
    assert 2.0 < np.abs(log["lateral_acceleration"].values).max() < 6.0


def test_an_unknown_drive_names_the_nearest() -> None:
    with pytest.raises(BadInput, match="`two_lanes`"):
        simulated_drive("two_lane", wang_car, 0.01)


def test_a_file_names_a_drive_or_a_log(tmp_path: Path) -> None:
    path = tmp_path / "drive.toml"
    path.write_text(FILE.format(extra=""))
    spec = read_specification(path)
    assert spec.path is None
    assert spec.drive == "two_lanes"
    path.write_text(FILE.format(extra='path = "a.csv"'))
    with pytest.raises(BadInput, match="leave out one or the other"):
        read_specification(path)


def test_a_driver_takes_the_double_track_through_the_lane_change() -> None:
    log = simulated_drive("iso_3888_1", carmaker_car, 0.02)
    assert set(CHANNELS) <= set(log.names)
    # The lane is half a metre wider than the car on either side where it matters; the reference runs through its middle.
    assert np.abs(log["path_error"].values).max() < 0.6
    assert np.abs(log["speed"].values - 80 / 3.6).max() < 1.0
    # 3.5 m to the left and back within 80 m at 22 m/s is a severe manoeuvre on any car.
    assert 4.0 < np.abs(log["lateral_acceleration"].values).max() < 8.5
