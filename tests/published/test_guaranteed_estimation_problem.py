"""Reading the stored problems: the table of half widths, and plain words where the folder is missing."""

from pathlib import Path

import pytest

from luenberger.core import BadInput
from luenberger.experiment.published.guaranteed_estimation_problem import data_folder, half_widths, stored

PAGE = """
Some words.

| method | first | second |
|---|---|---|
| A-1 (predictor) | 0.50, 0.1 | 1, 2.25 |
| B-2 (uses current y) | 0.25, 3 | 4, 5 |
"""


def test_the_table_keeps_the_digits_that_are_stored() -> None:
    assert half_widths(PAGE, "first") == {"A-1 (predictor)": ("0.50", "0.1"), "B-2 (uses current y)": ("0.25", "3")}
    assert half_widths(PAGE, "second")["A-1 (predictor)"] == ("1", "2.25")


def test_a_table_that_cannot_be_read_is_refused() -> None:
    with pytest.raises(BadInput, match="a column `third` is needed"):
        half_widths(PAGE, "third")
    with pytest.raises(BadInput, match=r"holds \"narrow\" for B-2"):
        half_widths(PAGE.replace("0.25, 3", "narrow"), "first")
    with pytest.raises(BadInput, match="a column `first` is needed"):
        half_widths("no table at all", "first")


def test_a_missing_folder_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LUENBERGER_DATA", str(tmp_path))
    with pytest.raises(BadInput, match="guaranteed-estimation"):
        data_folder()
    folder = tmp_path / "guaranteed-estimation"
    folder.mkdir()
    assert data_folder() == folder
    with pytest.raises(BadInput, match=r"vehicle2d\.json` does not exist"):
        stored("vehicle2d")
