"""An experiment file is checked whole before anything is computed; every refusal names what to change."""

from pathlib import Path

import pytest

from luenberger.core import BadInput
from luenberger.experiment.specification import read_specification

GOOD = """
title = "T"
[log]
path = "log.csv"
time = { column = "t", unit = "s" }
sample_time = 0.02
[log.channels]
speed = { column = "a", unit = "m/s" }
lateral_speed = { column = "b", unit = "m/s" }
yaw_rate = { column = "c", unit = "rad/s" }
steering = { column = "d", unit = "rad" }
lateral_acceleration = { column = "e", unit = "m/s^2" }
[vehicle]
parameters = "carmaker_car"
[domain]
speed = [4.0, 6.0]
acceleration = [-1, 1]
[sensors]
seed = 3
yaw_rate = 0.01
[score]
skip = 1.0
[fit]
share = 0.4
evaluations = 7
[entrants.zero]
kind = "zero"
"""


def written(folder: Path, text: str) -> Path:
    (folder / "log.csv").write_text("t\n")
    path = folder / "experiment.toml"
    path.write_text(text)
    return path


def test_everything_is_read(tmp_path: Path) -> None:
    spec = read_specification(written(tmp_path, GOOD))
    assert spec.title == "T"
    assert spec.path == tmp_path / "log.csv"
    assert spec.sample_time == 0.02
    assert spec.speed == (4.0, 6.0)
    assert spec.noise == {"yaw_rate": 0.01}
    assert (spec.seed, spec.skip, spec.fit_share, spec.evaluations) == (3, 1.0, 0.4, 7)
    assert dict(spec.entrants) == {"zero": {"kind": "zero"}}


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('title = "T"', 'titel = "T"', "unknown key `titel`.*`title`"),
        ("sample_time", "sampletime", "unknown key `sampletime`.*`sample_time`"),
        ('speed = { column = "a"', 'sped = { column = "a"', r"lacks \['speed'\]"),
        ('path = "log.csv"', 'path = "lag.csv"', "`lag.csv` is neither beside"),
        ("speed = [4.0, 6.0]", "speed = [6.0, 4.0]", "increasing positive numbers"),
        ("speed = [4.0, 6.0]", "speed = [0.0, 4.0]", "increasing positive numbers"),
        ("acceleration = [-1, 1]", "acceleration = 3", "acceleration is 3"),
        ("sample_time = 0.02", "sample_time = -1", "`sample_time` is -1"),
        ("share = 0.4", "share = 1.0", "share is 1.0"),
        ("yaw_rate = 0.01", "yaw_rate = -0.01", "sensors.yaw_rate"),
        ("[domain]", "[domain", "is not TOML"),
        ('[vehicle]\nparameters = "carmaker_car"', "", "has no `vehicle`"),
        ('title = "T"', 'notes = "one"', "`notes` of `experiment.toml` is 'one'; a list of texts"),
        ('title = "T"', "notes = [1]", r"is \[1\]; a list of texts"),
        ("sample_time = 0.02", "sample_time = inf", "`sample_time` is inf"),
        ("sample_time = 0.02", "sample_time = true", "`sample_time` is True"),
        ("sample_time = 0.02", f"sample_time = {10**400}", "`sample_time` is 1000"),
        ("sample_time = 0.02", "sample_time = 0.02\nstart = 'x'", r"\[log\] start is 'x'; a time in s"),
        ("speed = [4.0, 6.0]", "speed = [4.0, inf]", "increasing positive numbers"),
        ("seed = 3", "seed = 'x'", "`sensors.seed` is 'x'; a whole number >= 0"),
        ("evaluations = 7", "evaluations = inf", "`fit.evaluations` is inf; a whole number >= 1"),
        ('speed = { column = "a"', 'speed = "a" #', r"\[log.channels.speed\] of `experiment.toml` is 'a'; a table"),
        ('parameters = "carmaker_car"', 'parameters = "carmaker_car"\nmass = "heavy"', "`vehicle.mass` is 'heavy'"),
        (
            '[entrants.zero]\nkind = "zero"',
            "[entrants]\nzero = 1",
            r"\[entrants.zero\] of `experiment.toml` is 1; a table",
        ),
    ],
)
def test_refusals(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in GOOD
    with pytest.raises(BadInput, match=message):
        read_specification(written(tmp_path, GOOD.replace(old, new, 1)))


def test_missing_file(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="cannot be read"):
        read_specification(tmp_path / "none.toml")
