"""The comparison with other simulators: rows for everything, and words where nothing is there to compare with."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from luenberger.core import MissingExtra, Signal, Trajectory
from luenberger.experiment.published import truth_models
from luenberger.experiment.published.row import Verdict
from luenberger.experiment.published.truth_models import (
    Reference,
    carmaker_slalom,
    carsim_car,
    carsim_runs,
    compared,
    double_lane,
    followed,
    rows,
    single_track_drift,
    slowing,
)
from luenberger.vehicle import wang_car
from luenberger.vehicle.double_track_parameters import DoubleTrackParameters


def absent(name: str) -> None:
    return None


def run(gain: float) -> Trajectory:
    """Two seconds of gentle steering at 20 m/s; the yaw rate is that of our own model, times a gain."""
    time = np.arange(0.0, 2.0, 0.02)
    driver = [
        Signal("steering", "rad", 0.01 * np.sin(2 * time) ** 2),
        Signal("speed", "m/s", 20.0 + 0.5 * np.cos(time)),
    ]
    ours = followed(DoubleTrackParameters.of(wang_car), Trajectory(time, driver))
    rate = Signal("yaw_rate", "rad/s", gain * ours["yaw_rate"].values)
    return Trajectory(time, [*driver, rate], "a copy", "this test")


def test_steering_and_speed_of_the_log_are_followed() -> None:
    log = run(1.0)
    ours = followed(DoubleTrackParameters.of(wang_car), log)
    # The lead is a gradient over 0.02 s: its error is some 1e-4 of the angle.
    np.testing.assert_allclose(ours["steering"].values, log["steering"].values, atol=1e-5)
    # Cornering drag of some 0.01 m/s^2 is held by a speed error of a fifth of that.
    np.testing.assert_allclose(ours["speed"].values, log["speed"].values, atol=5e-3)


def test_a_difference_is_reported_and_judged_by_its_band() -> None:
    parameters = DoubleTrackParameters.of(wang_car)
    for gain, band, verdict in ((1.0, 1e-4, Verdict.REPRODUCED), (1.25, 0.1, Verdict.NOT_REPRODUCIBLE)):
        log = run(gain)
        (row,) = compared(Reference(log, parameters, "lateral_speed", band, "A gain."))
        assert row.verdict is verdict
        assert row.item == "yaw rate, a copy"
        assert row.deviation == pytest.approx((1 - 1 / gain) * np.sqrt(np.mean(log["yaw_rate"].values ** 2)), abs=1e-6)
    assert "(20.0 %)" in row.ours


def test_the_double_lane_change_is_consistent() -> None:
    time = np.linspace(0.0, 10.0, 20001)
    angle, rate = double_lane(time)
    np.testing.assert_allclose(np.gradient(angle, time), rate, atol=1e-4)
    # The amplitude 0.7698 brings the top of sin - sin(2 .)/2, which is 3 sqrt(3)/4, to one.
    assert np.abs(angle).max() == pytest.approx(0.045 * 0.7698 * 3 * 3**0.5 / 4, rel=1e-6)
    assert float(double_lane(5.0)[0]) == pytest.approx(np.interp(5.0, time, angle))
    speeds = 78 / 3.6 + np.cumsum([slowing(t) * 5e-4 for t in time])
    assert speeds[-1] == pytest.approx(23 / 3.6, abs=1e-2)


def test_the_recorded_slalom_is_met() -> None:
    found = {row.item: row for row in compared(carmaker_slalom())}
    # Measured 2.9 %, 6.0 % and 5.1 % of the rms: 0.0062 rad/s, 0.096 m/s^2, 0.0175 m/s. A tenth more is allowed.
    for channel, limit in (("yaw rate", 0.0068), ("lateral acceleration", 0.105), ("lateral speed", 0.0193)):
        row = found[f"{channel}, CarMaker slalom"]
        assert row.verdict is Verdict.REPRODUCED
        assert row.deviation is not None
        assert row.deviation < limit


def test_what_is_absent_is_said_and_not_guessed(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(truth_models, "find_spec", absent)
    monkeypatch.setattr(truth_models, "CARSIM", tmp_path / "nowhere")
    monkeypatch.setattr(truth_models, "compared", lambda reference: [])
    told: list[Any] = []
    found = rows(told.append)
    assert found == told
    assert [row.ours.split(":")[0] for row in found] == ["skipped"] * 2
    assert found[-1].ours == "skipped: folder absent"
    with pytest.raises(MissingExtra, match="pip install commonroad-vehicle-models"):
        single_track_drift()


@pytest.mark.skipif(not truth_models.CARSIM.is_dir(), reason="the CarSim exports are not here")
def test_carsim_exports_are_read_in_si_with_left_positive() -> None:
    fast, slow = (reference.log for reference in carsim_runs())
    assert fast["speed"].values[0] == pytest.approx(120 / 3.6)
    assert np.corrcoef(fast["steering"].values, fast["lateral_acceleration"].values)[0, 1] > 0.5
    assert "yaw_rate" not in slow
    # Gentle steady cornering tells the understeer gradient, which was not used to choose the parameters.
    ay, v, delta = (slow[name].values[-1] for name in ("lateral_acceleration", "speed", "steering"))
    found = delta / ay - carsim_car.wheelbase / v**2
    # The steering ramps on, and the axles have lost some stiffness at 0.29 g.
    assert found == pytest.approx(carsim_car.understeer_gradient, rel=0.15)
