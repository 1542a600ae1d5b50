"""The numbers of the sets, and that each maps to a `Sensor` without a rest."""

import dataclasses
from typing import Any

import numpy as np
import pytest

from luenberger.core import BadInput, Signal, Trajectory
from luenberger.simulate import Sensor, measure
from luenberger.vehicle.sensor_sets import SENSOR_SETS, SensorData, car_sensors, faulty_car_sensors, sensors_on


def test_the_numbers_are_the_chosen_ones() -> None:
    noise = {data.channel: data.noise for data in car_sensors}
    assert noise == {
        "yaw_rate": 3e-3,
        "steering": 1e-3,
        "steering_rate": 2e-2,
        "speed": 0.05,
        "acceleration": 0.1,
        "lateral_acceleration": 0.1,
    }
    bounds = {data.channel: data.bound for data in car_sensors if data.bound is not None}
    assert bounds == {"yaw_rate": 5e-3, "steering": 1e-3, "steering_rate": 0.02}


@pytest.mark.parametrize("data", [d for sensors in SENSOR_SETS.values() for d in sensors], ids=lambda d: d.channel)
def test_every_sensor_maps_one_to_one(data: SensorData) -> None:
    sensor = Sensor(**data.arguments())
    for field in data.arguments():
        assert getattr(sensor, field) == getattr(data, field)
    # What a sensor can do and the data cannot say: only how its channel is called, and its hard bound.
    assert {f.name for f in dataclasses.fields(Sensor)} - set(data.arguments()) <= {"name", "bound"}
    assert data.source != "not stated"


def test_a_set_measures_a_trajectory() -> None:
    time = 0.01 * np.arange(4000)
    units = {data.channel: data.unit for data in car_sensors}
    drive = Trajectory(time, [Signal(name, unit, np.sin(time)) for name, unit in units.items()])
    seen = measure(drive, [Sensor(**data.arguments()) for data in car_sensors], seed=1)
    for data in car_sensors:
        error = seen[f"{data.channel}_measured"].values - np.sin(time)
        # 4000 samples: the deviation is known to 1.1 %; five of those.
        assert error.std() == pytest.approx(data.noise, rel=0.056)


def test_faults_come_on_top_and_promise_no_bound() -> None:
    for plain, faulty in zip(car_sensors, faulty_car_sensors, strict=True):
        assert (plain.channel, plain.unit, plain.noise) == (faulty.channel, faulty.unit, faulty.noise)
        assert faulty.delay > 0
        assert faulty.quantum > 0
        assert faulty.bound is None


def test_bounded_arguments_hold_the_bound_alone() -> None:
    assert car_sensors[0].bounded_arguments() == {"channel": "yaw_rate", "bound": 5e-3}
    with pytest.raises(BadInput, match="promises no `bound`"):
        car_sensors[3].bounded_arguments()


def test_sensors_are_picked_by_channel() -> None:
    assert [d.channel for d in sensors_on(car_sensors, "steering", "yaw_rate")] == ["steering", "yaw_rate"]
    with pytest.raises(BadInput, match="Did you mean `yaw_rate`"):
        sensors_on(car_sensors, "yaw_rates")


@pytest.mark.parametrize("wrong", [{"noise": -1.0}, {"bound": -1e-3}, {"delay": float("nan")}, {"bias": float("inf")}])
def test_impossible_numbers_are_refused(wrong: Any) -> None:
    with pytest.raises(BadInput, match="finite number"):
        SensorData(channel="yaw_rate", unit="rad/s", **wrong)
