"""Studies in side wind: a file becomes designs, runs and a page; the runs are those of a car written by hand."""

import dataclasses
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from luenberger.cli import main
from luenberger.core import BadInput
from luenberger.design import SwitchedDesign
from luenberger.experiment import GustSpecification, read_gust, run_gust
from luenberger.experiment.gust_crossover import crossing
from luenberger.experiment.gust_double_track import mismatch, windy_double_track
from luenberger.experiment.gust_entrants import local_schedule
from luenberger.experiment.gust_runs import VARIANTS, driven
from luenberger.experiment.published.ifqir_drive import cars
from luenberger.methods import UnknownInputGain
from luenberger.synthesize import synthesize
from luenberger.systems import Switched

ROOT = Path(__file__).parents[2]
SHORT = {"samples": 120, "runs": 4}


def written(folder: Path, study: str, **options: Any) -> Path:
    lines = [f'title = "{study}"', "[gust]", f'study = "{study}"']
    lines += [f"{k} = {list(v) if isinstance(v, tuple) else v}" for k, v in {**SHORT, **options}.items()]
    path = folder / f"{study}.toml"
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.mark.parametrize("varying", [False, True])
def test_runs_of_the_plant_are_those_of_a_car_written_by_hand(varying: bool) -> None:
    spec = GustSpecification("switched", samples=200, runs=6, steering_error=0.01)
    plant = Switched.of(spec.scheduled()) if varying else spec.switched()
    design = synthesize(plant.first if varying else plant, UnknownInputGain(fade=0.4))
    road, unknown = spec.road(), spec.unknown()
    schedule = local_schedule(road.speed) if varying else road.speed[:, None]
    ours = driven(plant, design.gains, design.decoupling, road, schedule, unknown, spec.initial_half_width)
    theirs = cars(road, unknown, varying=varying, steering_error=0.01)
    # Two hundred steps of a stable car, one rounding each.
    for name in ("states", "outputs", "steering"):
        np.testing.assert_allclose(getattr(ours, name), getattr(theirs, name), rtol=0, atol=1e-12)


def test_the_switched_study_orders_the_recursions_and_keeps_its_guarantees(tmp_path: Path) -> None:
    heard: list[float] = []
    report = run_gust(written(tmp_path, "switched"), tmp_path, lambda _, share: heard.append(share))
    assert heard == sorted(heard)
    assert heard[-1] == 1.0
    rows = {row[0].split(":")[0]: row for row in report.table.rows}
    widths = [rows[name][1] for name in VARIANTS]
    assert all(a > b for a, b in pairwise(widths))
    assert all(rows[name][2] == 0 for name in [*VARIANTS, "gust bounded"])
    # Three standard deviations promise nothing, and adversaries take what is not promised.
    assert rows["Kalman filter"][2] > 0
    assert {row[5] for row in report.table.rows} == {"certificate", "recursion", "nothing"}
    names = {f.name for f in report.files}
    assert {"numbers.csv", "report.html", "one_storage_for_all_modes.json"} <= names
    design = SwitchedDesign.load(next(f for f in report.files if f.name.startswith("one_storage")))
    assert [p.outcome.value for p in design.certify().proofs] == ["proved"] * 4
    numbers = pd.read_csv(next(f for f in report.files if f.suffix == ".csv"))
    lower, upper = (numbers[f"c4: state bounded by the estimate {end}"] for end in ("lower", "upper"))
    assert ((lower <= numbers["lateral_speed"] + 1e-8) & (numbers["lateral_speed"] <= upper + 1e-8)).all()


def test_the_crossover_rises_with_the_bound_and_decoupling_does_not(tmp_path: Path) -> None:
    report = run_gust(written(tmp_path, "crossover", bounds=(50.0, 500.0, 5000.0)), tmp_path)
    rows = {row[0]: np.array(row[1:-1], dtype=float) for row in report.table.rows}
    decoupled, bounded, predictor = (rows[n] for n in ("decoupled", "bounded", "bounded, predictor"))
    # The gust moves the car, and with it what the stiffness can do; not more.
    assert np.ptp(decoupled) < 0.05 * decoupled[0]
    assert (np.diff(predictor) > 0).all()
    assert bounded[0] < 0.5 * decoupled[0]
    assert predictor[-1] > decoupled[-1]
    assert "No bound was left on any run." in report.summary
    crossings = dict(zip(report.table.column("width [m/s]"), report.table.column("crosses at [N]"), strict=True))
    assert crossings["decoupled"] is None
    assert 50 < crossings["bounded, predictor"] < 5000


def test_a_crossing_is_found_between_two_bounds() -> None:
    # In the middle of the widths, and so of the logarithms.
    assert crossing((10.0, 1000.0), [1.0, 3.0], 2.0) == pytest.approx(100.0)
    assert crossing((10.0, 1000.0), [1.0, 1.5], 2.0) is None
    assert crossing((10.0, 1000.0), [2.5, 3.0], 2.0) is None


def test_on_the_double_track_the_mismatch_is_what_has_to_be_covered(tmp_path: Path) -> None:
    slippery = {"sample_time": 0.02, "samples": 800, "steering": 0.06, "friction": 0.4, "fade": 0.2, "state_bound": ()}
    report = run_gust(written(tmp_path, "double_track", **slippery), tmp_path)
    left = dict(zip(report.table.column("entrant"), report.table.column("runs left"), strict=True))
    assert left["decoupled, as stated"] > 0
    assert left["decoupled, mismatch covered"] == 0
    assert "a proof about a plant says nothing about another car" in report.summary


def test_a_car_that_is_the_plant_has_no_mismatch() -> None:
    spec = GustSpecification("double_track", samples=150, runs=1, stiffness_share=0.05)
    plant = spec.scheduled()
    design = synthesize(plant, UnknownInputGain(fade=0.4))
    road, schedule = spec.road(), local_schedule(spec.road().speed)
    runs = driven(
        Switched.of(plant), design.gains, design.decoupling, road, schedule, spec.unknown(), spec.initial_half_width
    )
    truth = windy_double_track(spec, road)
    gains = (design.gains[0], design.decoupling[0])
    gap, covered = mismatch(plant, gains, road, truth, schedule)
    assert gap.max() > 0
    for x in runs.states[:, :, :]:
        named = {"lateral_speed": x[:, 0], "yaw_rate": x[:, 1], "steering": road.steering}
        same = truth.with_signals(*(dataclasses.replace(truth[n], values=v) for n, v in named.items()))
        gap, covered = mismatch(plant, gains, road, same, schedule)
        # Vertices use all that the factors can do, but for rounding.
        assert gap.max() < 1e-12
    assert covered.mean() > 0.2


@pytest.mark.parametrize("name", ["switched", "crossover", "double_track"])
def test_the_experiments_that_ship_are_read(name: str) -> None:
    spec = read_gust(ROOT / "experiments" / f"gust_{name}.toml")
    assert spec is not None
    assert spec.study == name
    assert spec.title != GustSpecification.title


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"stiffnes_share": 0.1}, "stiffness_share"),
        ({"arm": 0.0}, "cannot be decoupled"),
        ({"sample_time": -1.0}, "positive number"),
        ({"samples": 1.5}, "a whole number"),
        ({"runs": "true"}, "a whole number"),
        ({"bounds": (100.0, 50.0)}, "rising"),
        ({"modes": (8.0, 9.0, 18.0)}, "one speed between"),
        ({"speed": (1.0, 19.0)}, "slowest, fastest"),
        ({"state_bound": (0.8,)}, "two positive numbers"),
        ({"yaw_rate_noise": -0.1}, "number >= 0"),
        ({"car": '"gust_cart"'}, "gust_car"),
    ],
)
def test_bad_files_are_refused_before_anything_is_written(
    tmp_path: Path, options: dict[str, Any], message: str
) -> None:
    with pytest.raises(BadInput, match=message):
        run_gust(written(tmp_path, "switched", **options), tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_unknown_studies_and_files_without_wind_are_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="switched"):
        run_gust(written(tmp_path, "swiched"), tmp_path / "out")
    with pytest.raises(BadInput, match=r"no \[gust\] part"):
        run_gust(ROOT / "experiments/slip_angle_slalom.toml", tmp_path / "out")
    (tmp_path / "none.toml").write_text("[gust]\n")
    with pytest.raises(BadInput, match="no `study`"):
        run_gust(tmp_path / "none.toml", tmp_path / "out")


def test_the_command_runs_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = written(tmp_path, "crossover", bounds=(50.0, 5000.0), samples=60)
    with pytest.raises(SystemExit) as stopped:
        main(["run", str(path), "--out", str(tmp_path), "--quiet"])
    assert not stopped.value.code
    assert "bound it; else decouple" in capsys.readouterr().out.replace("\n", " ")
