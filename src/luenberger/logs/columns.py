"""Raw number columns out of CSV, gzipped CSV and Parquet; only the wanted columns are parsed."""

import csv
import gzip
import warnings
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from luenberger.core import BadInput, MissingExtra
from luenberger.core.checks import nearest

try:
    import pyarrow
    from pyarrow import parquet
except ImportError:
    pyarrow = parquet = None

_TEXT_ENDINGS = (".csv", ".csv.gz", ".txt", ".txt.gz", ".tsv", ".tsv.gz")
_PARQUET_ENDINGS = (".parquet", ".pq")
_SEPARATORS = (",", ";", "\t", "|")


def read_columns(
    path: Path,
    wanted: Sequence[str],
    separator: str | None = None,
    decimal: str = ".",
    skip_lines: Sequence[int] = (),
) -> dict[str, np.ndarray]:
    """Return the wanted columns of a table file as float64, NaN where a cell is empty.

    Args:
        path: .csv, .txt or .tsv, plain or with .gz, or .parquet.
        wanted: column names as in the header.
        separator: between cells; None takes the commonest of comma, semicolon, tab and bar in the header.
        decimal: decimal mark of the text.
        skip_lines: numbers of lines to leave out, from 1 as an editor counts (titles, a line of units).

    Raises:
        BadInput: no such file, unknown ending, empty, no header, missing column, a cell that is no number.
        MissingExtra: Parquet without pyarrow.
    """
    if not path.is_file():
        near = nearest(path.name, [p.name for p in path.parent.iterdir()]) if path.parent.is_dir() else ""
        raise BadInput(f"There is no log `{path}`; give the path of a log file.{near}")
    name = path.name.lower()
    if name.endswith(_PARQUET_ENDINGS):
        return _parquet_columns(path, wanted)
    if not name.endswith(_TEXT_ENDINGS):
        raise BadInput(
            f"`{path.name}` has an ending that is not read; give one of {', '.join(_TEXT_ENDINGS + _PARQUET_ENDINGS)}."
        )
    try:
        return _text_columns(path, wanted, separator, decimal, skip_lines)
    except (gzip.BadGzipFile, EOFError, zlib.error) as cause:
        raise BadInput(f"`{path.name}` is a damaged gzip file ({cause}); fetch it again.") from None
    except UnicodeDecodeError as cause:
        raise BadInput(f"`{path.name}` is not UTF-8 text ({cause.reason}); save it as UTF-8.") from None


def _text_columns(
    path: Path, wanted: Sequence[str], separator: str | None, decimal: str, skip_lines: Sequence[int]
) -> dict[str, np.ndarray]:
    skipped = {line - 1 for line in skip_lines}
    header, separator = _header(path, separator, skipped)
    places = {column: _place(path, column, header) for column in wanted}
    options: dict[str, Any] = {
        "sep": separator,
        "decimal": decimal,
        "skiprows": sorted(skipped),
        "usecols": sorted(set(places.values())),
        "header": 0,
        "index_col": False,
        "encoding": "utf-8-sig",
    }
    try:
        with warnings.catch_warnings():
            # Pandas only warns where a line has more cells than the header, and then shifts or drops them.
            warnings.simplefilter("error", pd.errors.ParserWarning)
            table = pd.read_csv(path, dtype=np.float64, **options)
    except (pd.errors.ParserError, pd.errors.ParserWarning) as cause:
        raise BadInput(f"`{path.name}` is no regular table: {str(cause).strip()}. Correct that line.") from None
    except ValueError as cause:
        raise _text_cell(path, places, options, cause) from None
    if len(table) == 0:
        raise BadInput(f"`{path.name}` has a header but no samples; give a log with at least two.")
    order = sorted(set(places.values()))
    return {column: table.iloc[:, order.index(place)].to_numpy() for column, place in places.items()}


def _header(path: Path, separator: str | None, skipped: set[int]) -> tuple[list[str], str]:
    """Return the column names and the separator, from the first line that is neither skipped nor blank."""
    with (gzip.open if path.name.lower().endswith(".gz") else open)(path, "rt", encoding="utf-8-sig") as file:
        lines = ((k, line) for k, line in enumerate(file) if k not in skipped and line.strip())
        _, first = next(lines, (0, None))
        if first is None:
            raise BadInput(f"`{path.name}` is empty; give a log with a header line and at least two samples.")
        if separator is None:
            separator = max(_SEPARATORS, key=first.count)
        names = [cell.strip() for cell in next(csv.reader([first.rstrip("\r\n")], delimiter=separator))]
        if all(_is_number(name) for name in names if name):
            raise BadInput(
                f"`{path.name}` has no header: its first line is `{first.strip()[:60]}`. Put a line with the column names on top."
            )
        # Pandas drops surplus cells in silence: a decimal comma, or two lines run together, would pass as numbers.
        for k, line in lines:
            if line.count(separator) >= len(names):
                cells = next(csv.reader([line.rstrip("\r\n")], delimiter=separator))
                if any(cell.strip() for cell in cells[len(names) :]):
                    raise BadInput(
                        f"Line {k + 1} of `{path.name}` has {len(cells)} cells but the header has {len(names)}; every line needs as "
                        "many. Name the right `separator` and `decimal` mark, or leave the line out with `skip_lines`."
                    )
    return names, separator


def _place(path: Path, column: str, header: list[str]) -> int:
    found = [k for k, name in enumerate(header) if name == column]
    if not found:
        raise BadInput(f"`{path.name}` has no column `{column}`.{nearest(column, [h for h in header if h])}")
    if len(found) > 1:
        raise BadInput(f"`{path.name}` has {len(found)} columns called `{column}`; rename all but one.")
    return found[0]


def _text_cell(path: Path, places: dict[str, int], options: dict[str, Any], cause: ValueError) -> BadInput:
    """Find the first cell that is no number, which the fast parser does not tell."""
    order = options["usecols"]
    texts = pd.read_csv(path, dtype=str, **options)
    for column, place in places.items():
        cells = texts.iloc[:, order.index(place)].str.strip()
        plain = cells if options["decimal"] == "." else cells.str.replace(options["decimal"], ".", regex=False)
        numbers = np.asarray(pd.to_numeric(plain, errors="coerce"), dtype=np.float64)
        bad = np.flatnonzero(cells.notna() & np.isnan(numbers))
        if bad.size:
            return BadInput(
                f"Column `{column}` of `{path.name}` holds `{cells.iloc[bad[0]]}` in sample {bad[0]}, {bad.size} such cells in all; "
                "every cell needs to be a number or empty. Name lines of text in `skip_lines`, or the decimal mark in `decimal`."
            )
    return BadInput(f"`{path.name}` cannot be read as numbers ({cause}); correct the file.")


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _parquet_columns(path: Path, wanted: Sequence[str]) -> dict[str, np.ndarray]:
    if parquet is None or pyarrow is None:
        raise MissingExtra(
            f"`{path.name}` is a Parquet file, which needs pyarrow. Run `pip install 'luenberger[parquet]'`."
        )
    try:
        file = parquet.ParquetFile(path)
    except (pyarrow.ArrowInvalid, OSError) as cause:
        raise BadInput(f"`{path.name}` is not a readable Parquet file ({cause}); fetch it again.") from None
    with file:
        places = [_place(path, column, file.schema_arrow.names) for column in wanted]
        for column, place in zip(wanted, places, strict=True):
            kind = file.schema_arrow.types[place]
            good = (pyarrow.types.is_integer, pyarrow.types.is_floating, pyarrow.types.is_boolean)
            if not any(is_kind(kind) for is_kind in good):
                raise BadInput(f"Column `{column}` of `{path.name}` holds {kind}; a column of numbers is needed.")
        if file.metadata.num_rows == 0:
            raise BadInput(f"`{path.name}` has columns but no samples; give a log with at least two.")
        table = file.read(columns=list(dict.fromkeys(wanted)))
    return {c: table.column(c).to_pandas().to_numpy(dtype=np.float64, na_value=np.nan) for c in dict.fromkeys(wanted)}
