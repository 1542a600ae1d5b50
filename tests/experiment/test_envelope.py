"""The envelope learns its box, holds the truth where its assumptions hold, and names the one that broke."""

import numpy as np
import pytest

from luenberger.core import BadInput, Trajectory
from luenberger.experiment.entrant import Setting
from luenberger.experiment.entrants import build
from luenberger.experiment.results import replayed
from luenberger.simulate import TruthModel, simulate
from luenberger.vehicle import BrushTyre, SingleTrack, slip_angle_channels, wang_car

DT = 0.01


def drive(peaks: tuple[float, float], seconds: float = 12.0, start: float = 0.0) -> Trajectory:
    truth = SingleTrack(wang_car, BrushTyre(76500.0, peaks[0]), BrushTyre(51000.0, peaks[1]))
    model = TruthModel(
        truth, truth.output, truth.states, inputs=truth.inputs, outputs=truth.outputs, scheduling_names=("speed",)
    )
    time = start + DT * np.arange(round(seconds / DT))
    steering = 0.05 * np.sin(2 * np.pi * 0.4 * time)
    run = simulate(
        model, time=time, x0=np.zeros(2), u=steering[:, None], r=np.full((time.size, 1), 20.0), interpolation="linear"
    )
    return slip_angle_channels(run, wang_car, time_constant=0.005)


@pytest.fixture(scope="module")
def learned() -> Setting:
    return Setting(wang_car, (15.0, 25.0), (-1.0, 1.0), DT, drive((4500.0, 3000.0)))


OPTIONS = {"kind": "interval", "slip_floor": 0.005, "share": 1.0, "tail": 0.001, "steering_rate_noise": 0.02}


def test_same_tyres_stay_inside(learned: Setting) -> None:
    entrant = build(learned, OPTIONS)
    log = drive((4500.0, 3000.0))
    run = replayed({"envelope": entrant}, log, timing=False)
    lower, upper = run.bounds["envelope"]
    truth = log["sideslip"].values
    assert np.all((lower <= truth) & (truth <= upper))
    # Wide enough to hold, narrow enough to be of use: the sideslip itself swings by several degrees.
    assert np.rad2deg((upper - lower)[200:].mean()) < 2.5
    assert "identified on the first 12 s" in entrant.notes[0]
    assert entrant.watch is not None
    table = entrant.watch("envelope", log, run.estimates["envelope"])
    assert table.column("of violations [%]") == (None,) * len(table.rows)


def test_other_tyres_break_an_assumption_that_is_named(learned: Setting) -> None:
    entrant = build(learned, OPTIONS)
    log = drive((2600.0, 1700.0))
    run = replayed({"envelope": entrant}, log, timing=False)
    lower, upper = run.bounds["envelope"]
    truth = log["sideslip"].values
    assert np.any((truth < lower) | (truth > upper))
    assert entrant.watch is not None
    table = entrant.watch("envelope", log, run.estimates["envelope"])
    blame = dict(zip(table.column("assumption"), table.column("of violations [%]"), strict=True))
    assert blame["range of inverse speed"] == 0.0
    axles = [v for k, v in blame.items() if "axle force" in k]
    assert max(axles) > 95.0


def test_a_box_is_stated_whole_or_learned() -> None:
    setting = Setting(wang_car, (15.0, 25.0), (-1.0, 1.0), DT)
    with pytest.raises(BadInput, match="state all of"):
        build(setting, {"kind": "interval", "front_lower": 6e4})
    with pytest.raises(BadInput, match="no stiffness box"):
        build(setting, {"kind": "interval"})
