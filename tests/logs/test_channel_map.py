"""A channel map is read whole and refused where a key, unit or value is wrong."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from luenberger.core import BadInput
from luenberger.logs import Channel, channel_map, read_channel_map


def test_scale_and_offset_act_before_the_unit_and_the_sign_turns_both() -> None:
    one = channel_map({"yaw_rate": {"column": "r", "unit": "deg/s", "scale": 2.0, "offset": 10.0, "sign": -1}})
    value = one["yaw_rate"].to_si(np.array([0.0, 40.0]))
    # Written out: -(2 raw + 10) deg/s.
    np.testing.assert_allclose(value, np.deg2rad([-10.0, -90.0]), rtol=1e-15)
    assert one["yaw_rate"].si_unit == "rad/s"


def test_several_columns_make_one_channel() -> None:
    assert channel_map({"steering": {"column": ["FL", "FR"], "unit": "rad"}})["steering"].columns == ("FL", "FR")


def test_a_channel_object_passes_through() -> None:
    ready = Channel(("v",), "km/h")
    assert channel_map({"speed": ready})["speed"] is ready


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"column": "v", "units": "m/s"}, "unknown key `units`. Did you mean `unit`"),
        ({"column": "v"}, "lacks `unit`"),
        ({"unit": "m/s"}, "lacks `column`"),
        ({"column": "v", "unit": "km/hour"}, "`km/hour` is not known. Did you mean `km/h`"),
        ({"column": 3, "unit": "m/s"}, "column = 3; a column name or a list of names"),
        ({"column": [], "unit": "m/s"}, "a column name or a list of names"),
        ({"column": "", "unit": "m/s"}, "names no column"),
        ({"column": "v", "unit": 1}, "unit = 1; a text"),
        ({"column": "v", "unit": "m/s", "scale": "2"}, "scale = '2'; a number"),
        ({"column": "v", "unit": "m/s", "scale": 0}, "scale 0.0 .* scale not zero"),
        ({"column": "v", "unit": "m/s", "offset": float("nan")}, "offset nan; finite numbers"),
        ({"column": "v", "unit": "m/s", "sign": 2}, "it needs to be 1 or -1"),
        ({"column": "v", "unit": "m/s", "sign": -0.5}, "it needs to be 1 or -1"),
        ({"column": "v", "unit": "m/s", "sign": float("nan")}, "it needs to be 1 or -1"),
        ({"column": "v", "unit": "m/s", "scale": 10**400}, "too large"),
        ("v", "is 'v'; a table such as"),
    ],
)
def test_a_wrong_table_is_refused_by_channel_name(table: Any, message: str) -> None:
    with pytest.raises(BadInput, match=message) as caught:
        channel_map({"speed": table})
    assert "`speed`" in str(caught.value)


@pytest.mark.parametrize("name", ["yaw rate", "ψ", "2nd"])
def test_names_are_ascii_words(name: str) -> None:
    with pytest.raises(BadInput, match="no ASCII word"):
        channel_map({name: {"column": "r", "unit": "rad/s"}})


def test_an_empty_map_is_refused() -> None:
    with pytest.raises(BadInput, match="is empty"):
        channel_map({})


def test_a_map_is_read_from_toml(tmp_path: Path) -> None:
    path = tmp_path / "car.toml"
    path.write_text('time = { column = "t", unit = "ms" }\n[channels]\nspeed = { column = "v", unit = "km/h" }\n')
    found = read_channel_map(path)
    assert found.time == Channel(("t",), "ms")
    assert found.channels == {"speed": Channel(("v",), "km/h")}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("speed = ", "is not TOML"),
        ('time = { column = "t", unit = "s" }', r"lacks \[channels\]"),
        ("[channel]\n", "unknown key `channel`. Did you mean `channels`"),
    ],
)
def test_a_faulty_map_file_is_refused(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "car.toml"
    path.write_text(text)
    with pytest.raises(BadInput, match=message):
        read_channel_map(path)


def test_a_missing_map_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="cannot be read"):
        read_channel_map(tmp_path / "none.toml")
