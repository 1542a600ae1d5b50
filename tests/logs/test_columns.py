"""Columns of text and Parquet files: found by name, parsed as printed, refused with the place."""

import gzip
from pathlib import Path

import numpy as np
import pyarrow
import pytest
from pyarrow import parquet

from luenberger.core import BadInput, MissingExtra
from luenberger.logs import columns
from luenberger.logs.columns import read_columns


def written(folder: Path, text: str, name: str = "log.csv") -> Path:
    path = folder / name
    content = text.encode()
    path.write_bytes(gzip.compress(content) if name.endswith(".gz") else content)
    return path


def test_only_the_wanted_columns_are_read_in_the_wanted_order(tmp_path: Path) -> None:
    found = read_columns(written(tmp_path, "t,a,note,b\n0,1,x,2\n1,3,y,4\n"), ["b", "t"])
    assert list(found) == ["b", "t"]
    np.testing.assert_array_equal(found["b"], [2.0, 4.0])


@pytest.mark.parametrize("separator", [",", ";", "\t", "|"])
@pytest.mark.parametrize("name", ["log.csv", "log.csv.gz", "LOG.TXT"])
def test_separators_and_compression_are_recognised(tmp_path: Path, separator: str, name: str) -> None:
    text = "t,a\n0,1.5\n1,2.5\n".replace(",", separator)
    np.testing.assert_array_equal(read_columns(written(tmp_path, text, name), ["a"])["a"], [1.5, 2.5])


def test_numbers_are_read_as_printed(tmp_path: Path) -> None:
    values = np.random.default_rng(1).standard_normal(300)
    text = "x\n" + "\n".join(repr(float(v)) for v in values)
    # Parsers of older pandas are off by one unit in the last place.
    np.testing.assert_allclose(read_columns(written(tmp_path, text), ["x"])["x"], values, rtol=2.3e-16)


def test_headers_lose_blanks_quotes_and_byte_order_mark(tmp_path: Path) -> None:
    path = written(tmp_path, '\ufeff"t, raw", speed \n0,1\n1,2\n')
    assert list(read_columns(path, ["t, raw", "speed"])) == ["t, raw", "speed"]


def test_titles_and_a_line_of_units_are_skipped(tmp_path: Path) -> None:
    path = written(tmp_path, "made by X\n\nt;v\ns;m/s\n0;1,5\n1;2,5\n")
    found = read_columns(path, ["v"], decimal=",", skip_lines=[1, 4])
    np.testing.assert_array_equal(found["v"], [1.5, 2.5])


def test_empty_cells_are_holes(tmp_path: Path) -> None:
    found = read_columns(written(tmp_path, "t,a\n0,\n1,nan\n2,7\n"), ["a"])
    np.testing.assert_array_equal(found["a"], [np.nan, np.nan, 7.0])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is empty"),
        ("\n\n", "is empty"),
        ("0,1\n1,2\n", "has no header: its first line is `0,1`"),
        ("t,a\n", "has a header but no samples"),
        ("t,b\n0,1\n", "has no column `a`"),
        ("t,aa\n0,1\n", "has no column `a`. Did you mean `aa`"),
        ("t,a,a\n0,1,2\n", "has 2 columns called `a`"),
        ("t,a\n0,1\n1,x7\n2,y\n", "Column `a` of `log.csv` holds `x7` in sample 1, 2 such cells"),
        ('t;a\n0;"1,5"\n', "holds `1,5` in sample 0"),
        ("t,a\n0,1\n1,2,3\n", "Line 3 of `log.csv` has 3 cells but the header has 2"),
        ('t,a\n0,"1\n1,2\n', "no regular table"),
    ],
)
def test_a_faulty_text_file_is_refused(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(BadInput, match=message):
        read_columns(written(tmp_path, text), ["a"])


def test_surplus_empty_cells_and_quoted_separators_are_fine(tmp_path: Path) -> None:
    found = read_columns(written(tmp_path, 't,a,note\n0,1,"x,y"\n1,2,,,\n'), ["a"])
    np.testing.assert_array_equal(found["a"], [1.0, 2.0])


def test_a_missing_file_gets_the_nearest(tmp_path: Path) -> None:
    written(tmp_path, "t\n0\n", "drive_7.csv")
    with pytest.raises(BadInput, match=r"There is no log .* Did you mean `drive_7.csv`"):
        read_columns(tmp_path / "drive7.csv", ["t"])


def test_an_unknown_ending_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=r"`log\.mat` has an ending that is not read"):
        read_columns(written(tmp_path, "t\n0\n", "log.mat"), ["t"])


@pytest.mark.parametrize(
    "content", [b"no gzip at all", gzip.compress(b"t,a\n0,1\n" * 500, mtime=0)[:30]], ids=["not gzip", "cut short"]
)
def test_a_damaged_gzip_file_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "log.csv.gz"
    path.write_bytes(content)
    with pytest.raises(BadInput, match="damaged gzip file"):
        read_columns(path, ["a"])


def test_text_that_is_not_utf8_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_bytes("t,größe\n0,1\n".encode("latin-1"))
    with pytest.raises(BadInput, match="not UTF-8"):
        read_columns(path, ["t"])


def parquet_file(folder: Path) -> Path:
    table = pyarrow.table(
        {
            "t": pyarrow.array([0, 1, 2]),
            "v": pyarrow.array([1.5, None, 2.5]),
            "on": [True, False, True],
            "note": ["a", "b", "c"],
        }
    )
    parquet.write_table(table, folder / "log.parquet")
    return folder / "log.parquet"


def test_parquet_numbers_booleans_and_holes(tmp_path: Path) -> None:
    found = read_columns(parquet_file(tmp_path), ["v", "t", "on"])
    np.testing.assert_array_equal(found["v"], [1.5, np.nan, 2.5])
    np.testing.assert_array_equal(found["t"], [0.0, 1.0, 2.0])
    np.testing.assert_array_equal(found["on"], [1.0, 0.0, 1.0])


@pytest.mark.parametrize(
    ("column", "message"),
    [("note", "Column `note` of `log.parquet` holds string"), ("w", "has no column `w`")],
)
def test_parquet_columns_are_checked(tmp_path: Path, column: str, message: str) -> None:
    with pytest.raises(BadInput, match=message):
        read_columns(parquet_file(tmp_path), [column])


def test_a_file_that_is_no_parquet_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="not a readable Parquet file"):
        read_columns(written(tmp_path, "t,a\n0,1\n", "log.parquet"), ["a"])


def test_parquet_without_its_package_names_the_pip_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = parquet_file(tmp_path)
    monkeypatch.setattr(columns, "parquet", None)
    with pytest.raises(MissingExtra, match=r"pip install 'luenberger\[parquet\]'"):
        read_columns(path, ["t"])
