"""Files of studies in side wind that ship are read; bad ones are refused before anything is written."""

from pathlib import Path
from typing import Any

import pytest

from experiment.gust_files import written
from luenberger.core import BadInput
from luenberger.experiment import GustSpecification, read_gust, run_gust

ROOT = Path(__file__).parents[2]


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
