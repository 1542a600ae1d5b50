"""The recorded slalom that ships with the package: complete, credited, and in the signs the plants expect."""

from pathlib import Path

import numpy as np
import pytest

import luenberger.experiment
from luenberger.core import Trajectory
from luenberger.logs import inspect_clock, read_log
from luenberger.vehicle import carmaker_car, slip_angle_channels

DATA = Path(luenberger.experiment.__file__).parent / "data"


@pytest.fixture(scope="module")
def slalom() -> Trajectory:
    def wheels(*names: str, unit: str, **more: float) -> dict[str, object]:
        return {"column": [f"Car.{name}" for name in names], "unit": unit, **more}

    channels = {
        "speed": wheels("vx", unit="m/s"),
        "lateral_speed": wheels("vy", unit="m/s"),
        "yaw_rate": wheels("YawRate", unit="rad/s"),
        "lateral_acceleration": wheels("ay", unit="m/s^2"),
        "steering": wheels("SteerAngleFL", "SteerAngleFR", unit="rad"),
        "logged_sideslip": wheels("SideSlipAngle", unit="rad"),
        # The log counts slip the other way round than force.
        "logged_front_slip": wheels("SlipAngleFL", "SlipAngleFR", unit="rad", sign=-1),
        "logged_rear_slip": wheels("SlipAngleRL", "SlipAngleRR", unit="rad", sign=-1),
        # Averaged over two wheels, so twice that is the axle.
        "front_force": wheels("FyFL", "FyFR", unit="N", scale=2.0),
        "rear_force": wheels("FyRL", "FyRR", unit="N", scale=2.0),
    }
    return read_log(DATA / "carmaker_slalom.csv", channels, time="Time")


def test_the_log_is_complete_and_credited(slalom: Trajectory) -> None:
    report = inspect_clock(slalom.time)
    assert (report.samples, report.stop) == (1421, 14.191)
    assert report.step == pytest.approx(0.01)
    assert report.gaps == ()
    # The first step is 1 ms, so a replay has to resample.
    assert report.shortest == pytest.approx(0.001)
    assert not report.is_uniform()
    text = (DATA / "carmaker_slalom.LICENSE.txt").read_text()
    for words in (
        "nastarankhds/KalmanFilter",
        "Copyright (c) 2025 Nastaran Khoshnood Sarabi",
        "MIT License",
        "WARRANTY",
    ):
        assert words in text
    assert (DATA / "carmaker_slalom.csv").stat().st_size < 400_000


def test_forces_follow_the_logged_slip_with_the_sign_of_the_plants(slalom: Trajectory) -> None:
    for axle, stiffness in (("front", 209.7e3), ("rear", 153.6e3)):
        slip, force = slalom[f"logged_{axle}_slip"].values, slalom[f"{axle}_force"].values
        assert np.corrcoef(slip, force)[0, 1] > 0.998
        assert slip @ force / (slip @ slip) == pytest.approx(stiffness, rel=1e-3)


def test_forces_and_accelerometer_agree_in_sign_and_size(slalom: Trajectory) -> None:
    ay = slalom["lateral_acceleration"].values
    total = slalom["front_force"].values + slalom["rear_force"].values
    # Small-angle sum of the wheel forces: 1 % off m ay.
    assert total @ ay / (ay @ ay) == pytest.approx(carmaker_car.mass, rel=0.02)


def test_sideslip_belongs_to_the_lateral_speed(slalom: Trajectory) -> None:
    found = slip_angle_channels(slalom, carmaker_car)
    np.testing.assert_allclose(found["sideslip"].values, slalom["logged_sideslip"].values, atol=7e-4)


def test_the_speed_breaks_off_for_a_moment(slalom: Trajectory) -> None:
    """A brake pulse of a tenth of a second: whoever trusts |d vx/dt| < 1 m/s^2 on this log is wrong once."""
    rate = np.gradient(slalom["speed"].values, slalom.time)
    hard = slalom.time[np.abs(rate) > 1.0]
    assert -7.0 < rate.min() < -6.0
    assert 1.0 < hard.min() < hard.max() < 1.2


def test_slip_from_the_lateral_speed_carries_the_roll_of_the_body(slalom: Trajectory) -> None:
    """vy is that of the body; the wheels lack its roll motion, which is most of the rear slip in this slow slalom."""
    found = slip_angle_channels(slalom, carmaker_car)
    miss = found["rear_slip"].values - slalom["logged_rear_slip"].values
    jerk = np.gradient(slalom["lateral_acceleration"].values, slalom.time)
    assert np.std(miss) > 0.8 * np.std(slalom["logged_rear_slip"].values)
    assert abs(np.corrcoef(miss * slalom["speed"].values, jerk)[0, 1]) > 0.8
