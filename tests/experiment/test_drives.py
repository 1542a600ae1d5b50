"""Simulated drives stand where a log would."""

from pathlib import Path

import numpy as np
import pytest

from luenberger.core import BadInput
from luenberger.experiment.drives import (
    FISHHOOK_SPEED,
    GRIPPY,
    simulated_drive,
    two_fishhooks,
)
from luenberger.experiment.specification import CHANNELS, read_specification
from luenberger.vehicle import braking_lane_changes, carmaker_car, slip_angle_channels, wang_car
from luenberger.vehicle.parameters import GRAVITY

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


def test_the_fishhook_takes_both_axles_beyond_the_linear_range_while_it_slows() -> None:
    log = slip_angle_channels(simulated_drive("fishhook", wang_car, 0.02), wang_car, time_constant=0.02)
    assert set(CHANNELS) <= set(log.names)
    assert log["speed"].values[[0, -1]] == pytest.approx(FISHHOOK_SPEED, abs=0.05)
    front, rear = (np.abs(log[n].values).max() for n in ("front_slip", "rear_slip"))
    # Beyond 0.1 rad as in the dissertation, and below 0.2 rad: the car holds the road.
    assert 0.1 < rear < front < 0.2
    # To the left first, then to the right.
    turning = log["yaw_rate"].values
    assert turning[log.time < 1.0].max() > 0.3
    assert turning.min() < -0.5
    assert np.abs(turning[-1]) < 0.05


def test_the_road_of_the_fishhook_gives_the_printed_peaks() -> None:
    # Axles carry the weight by their distances, 0.6 in front, as the loads 6000 N and 4000 N of the dissertation do.
    weight = wang_car.mass * GRAVITY
    front = wang_car.rear_axle_distance / wang_car.wheelbase * weight
    assert GRIPPY * front == pytest.approx(0.85 * 6000, rel=1e-9)
    assert GRIPPY * (weight - front) == pytest.approx(0.85 * 4000, rel=1e-9)


def test_two_fishhooks_turn_to_either_side() -> None:
    manoeuvre = two_fishhooks(0.1, 0.08)
    time = np.linspace(0.0, manoeuvre.duration, 18001)
    steering, speed = np.asarray(manoeuvre.steering(time)), np.asarray(manoeuvre.speed(time))
    first, second = time < 9.0, time >= 9.0
    assert (steering[first].max(), steering[first].min()) == pytest.approx((0.1, -0.1))
    assert (steering[second].max(), steering[second].min()) == pytest.approx((0.08, -0.08))
    # The one begins to the left, the other to the right, both at the speed from which the brakes take it.
    one, two = (part[np.flatnonzero(np.abs(steering[part]) > 0.01)[0]] for part in map(np.flatnonzero, (first, second)))
    assert steering[one] > 0 > steering[two]
    # The second follows the brakes by a sixth of a second, at 2.8 m/s^2.
    assert speed[[one, two]] == pytest.approx([FISHHOOK_SPEED[0]] * 2, abs=0.6)
    assert speed[[0, -1]] == pytest.approx(FISHHOOK_SPEED, abs=1e-9)
    # The wheel turns as fast as in the fishhook of the agency.
    assert np.abs(np.diff(steering) / np.diff(time)).max() == pytest.approx(np.deg2rad(720) / 16, rel=1e-3)
