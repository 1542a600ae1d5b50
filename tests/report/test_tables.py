"""A table says the same in the terminal, in JSON and in HTML; gains and certificates are written as people read them."""

import io
import json
import math

import numpy as np
import pytest
from rich.console import Console

from catalogue import robot, scheduled_oscillator
from luenberger.algebra import Polynomial
from luenberger.core import BadInput
from luenberger.methods import StructuredLipschitz
from luenberger.report.tables import NOTHING, Table, certificate_table, column_texts, entry_text, gain_table
from luenberger.synthesize import synthesize

TABLE = Table(["name", "value [deg]"], [["a [b]", 0.125], ["<c>", math.nan]], ["note [bold]x"], "title")


def shown(table: Table, width: int = 80) -> str:
    console = Console(width=width, file=io.StringIO(), record=True)
    console.print(table.as_rich({"proved": "green"}))
    return console.export_text()


def test_terminal_takes_brackets_as_text() -> None:
    text = shown(TABLE)
    for part in ("value [deg]", "a [b]", "note [bold]x", NOTHING):
        assert part in text


def test_json_has_no_nan() -> None:
    table = Table(["a", "b"], [[np.float64(0.125), np.True_], [math.inf, None], [np.int64(3), "x"]])
    data = json.loads(json.dumps(table.as_json(), allow_nan=False))
    assert data["rows"] == [{"a": 0.125, "b": True}, {"a": None, "b": None}, {"a": 3, "b": "x"}]


def test_html_is_escaped_and_numbers_stand_right() -> None:
    text = TABLE.as_html({"<c>": "#123456"})
    assert "&lt;c&gt;" in text
    assert "<c>" not in text
    assert '<td class="number">0.125</td>' in text
    assert text.count("background:#123456") == 1


def test_columns_and_ragged_rows() -> None:
    assert TABLE.column("name") == ("a [b]", "<c>")
    with pytest.raises(BadInput, match="nmae"):
        TABLE.column("nmae")
    with pytest.raises(BadInput, match="1 cells for 2 columns"):
        Table(["a", "b"], [["only one"]])
    with pytest.raises(BadInput, match="repeat"):
        Table(["a", "a"], [])


@pytest.mark.parametrize(
    ("cells", "texts"),
    [
        ([0.286, 3.695], ["0.286", "3.695"]),
        # Three digits of the smallest number, no more than six of the largest.
        ([0.0123, 12.5], ["0.0123", "12.5000"]),
        ([1e-9, 1.0], ["1e-09", "1"]),
        ([-1.5, None, math.nan], ["−1.50", NOTHING, NOTHING]),
        ([3, True, "x"], ["3", "yes", "x"]),
        ([math.inf, 2.0], ["inf", "2.00"]),
        ([0.0, 0.0], ["0", "0"]),
    ],
)
def test_one_number_of_decimals_down_a_column(cells: list, texts: list[str]) -> None:
    assert column_texts(cells) == texts


def test_polynomial_entry_reads_as_written() -> None:
    gain = Polynomial(
        ("speed", "slope"),
        {(0, 0): np.array([[-1.25]]), (2, 0): np.array([[0.5]]), (1, 1): np.array([[-3.0]]), (0, 1): np.array([[0.0]])},
    )
    assert entry_text(gain, 0, 0) == "−1.25 + 0.5·speed² − 3·speed·slope"
    assert entry_text(Polynomial.constant(np.zeros((1, 1))), 0, 0) == "0"


def test_gain_table_names_states_and_outputs() -> None:
    plant = scheduled_oscillator()
    table = gain_table(Polynomial.affine(np.array([[1.0], [2.0]]), damping=np.array([[0.0], [4.0]])), plant)
    assert table.columns == ["state", f"from {plant.outputs[0]}"]
    assert table.rows == [[plant.states[0], "1"], [plant.states[1], "2 + 4·damping"]]


def test_certificate_table_holds_every_claim_with_its_margin() -> None:
    certificate = synthesize(robot(), StructuredLipschitz(decay_rate=1.0)).certificate
    table = certificate_table(certificate, seconds=[0.001] * len(certificate.proofs))
    assert table.column("claim") == tuple(p.claim.kind for p in certificate.proofs)
    assert set(table.column("outcome")) == {"proved"}
    assert all(f"{p.margin:.2g}" == m for p, m in zip(certificate.proofs, table.column("margin"), strict=True))
    assert table.column("time [ms]") == (1.0,) * len(certificate.proofs)
    assert all(p.reason in note for p, note in zip(certificate.proofs, table.notes, strict=True))
    assert "time [ms]" not in certificate_table(certificate).columns
    # No line is wider than a small terminal.
    assert max(map(len, shown(table).splitlines())) <= 80
