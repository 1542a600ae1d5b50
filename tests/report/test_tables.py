"""A table says the same in the terminal, in JSON and in HTML."""

import json
import math

import pytest
from rich.console import Console

from luenberger.core import BadInput
from luenberger.report.tables import Table

TABLE = Table(["name", "value [deg]"], [["a [b]", 0.125], ["<c>", math.nan]], ["note"], "title")


def test_terminal_shows_brackets() -> None:
    console = Console(width=80, record=True, file=open("/dev/null", "w"))  # noqa: SIM115
    console.print(TABLE.as_rich())
    shown = console.export_text()
    assert "value [deg]" in shown
    assert "a [b]" in shown
    assert "note" in shown
    console.file.close()


def test_json_has_no_nan() -> None:
    data = json.loads(json.dumps(TABLE.as_json(), allow_nan=False))
    assert data["rows"][0] == {"name": "a [b]", "value [deg]": 0.125}
    assert data["rows"][1]["value [deg]"] is None


def test_html_is_escaped() -> None:
    html = TABLE.as_html()
    assert "&lt;c&gt;" in html
    assert "<c>" not in html


def test_columns_and_ragged_rows() -> None:
    assert TABLE.column("name") == ("a [b]", "<c>")
    with pytest.raises(BadInput):
        TABLE.column("nmae")
    with pytest.raises(BadInput):
        Table(["a", "b"], [["only one"]])
