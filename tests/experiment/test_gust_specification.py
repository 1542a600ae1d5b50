"""A [gust] file is read whole and checked before anything is computed."""

from pathlib import Path

import numpy as np
import pytest

from luenberger.core import BadInput
from luenberger.experiment.gust_specification import GustSpecification, read_gust
from luenberger.systems import Switched

ROOT = Path(__file__).parents[2]


def written(folder: Path, text: str) -> Path:
    path = folder / "windy.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_other_experiments_have_no_gust() -> None:
    assert read_gust(ROOT / "experiments/slip_angle_slalom.toml") is None


def test_what_a_file_leaves_out_is_the_drive_of_the_published_comparison(tmp_path: Path) -> None:
    spec = read_gust(written(tmp_path, '[gust]\nstudy = "switched"\n'))
    assert spec == GustSpecification("switched")


def test_lists_and_numbers_are_told_apart(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="a list of numbers is needed"):
        read_gust(written(tmp_path, '[gust]\nstudy = "switched"\nbounds = "50"\n'))
    with pytest.raises(BadInput, match="a number is needed"):
        read_gust(written(tmp_path, '[gust]\nstudy = "switched"\nforce = true\n'))


@pytest.mark.parametrize(
    "line", ["arm = nan", "steering = inf", f"force = {10**400}", "bounds = [50.0, inf]", "state_bound = [true, 1.0]"]
)
def test_numbers_are_those_that_a_double_holds(tmp_path: Path, line: str) -> None:
    with pytest.raises(BadInput, match=rf"\[gust\] {line.split()[0]} is .* is needed"):
        read_gust(written(tmp_path, f'[gust]\nstudy = "switched"\n{line}\n'))


def test_nothing_stands_beside_the_gust(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="entrants"):
        read_gust(written(tmp_path, '[gust]\nstudy = "switched"\n[entrants.zero]\nkind = "zero"\n'))


def test_the_plant_has_the_modes_and_the_uncertainty_that_were_stated() -> None:
    spec = GustSpecification("switched", stiffness_share=0.2, steering_error=0.01)
    plant = spec.switched(dwell=4)
    assert isinstance(plant, Switched)
    assert len(plant.modes) == 3
    assert plant.dwell == 4
    boxes = {p.name: (p.lower, p.upper) for p in plant.first.parameters if not p.measured}
    np.testing.assert_allclose(boxes["front_stiffness"], [0.8 * 60e3, 1.2 * 60e3])
    np.testing.assert_allclose(boxes["rear_stiffness"], [0.8 * 65e3, 1.2 * 65e3])
    np.testing.assert_allclose(np.asarray(plant.first.noise_bound), [0.005, 0.01])
    certain = GustSpecification("switched", stiffness_share=0.0).scheduled(gust_bound=50.0)
    assert [p.name for p in certain.parameters] == ["speed", "inverse_speed"]
    np.testing.assert_allclose(np.asarray(certain.disturbance_bound), [50.0])
