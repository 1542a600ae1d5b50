"""The page: every section is there, it loads nothing from outside, and its numbers are those of the design."""

import re
from pathlib import Path

import numpy as np
import pytest

from catalogue import robot
from luenberger.core import BadInput
from luenberger.design import Design
from luenberger.methods import StructuredLipschitz
from luenberger.report.citations import citations, numbered
from luenberger.report.figures import comparison_figures
from luenberger.report.page import Page
from luenberger.report.tables import Table
from luenberger.synthesize import synthesize


@pytest.fixture(scope="module")
def design() -> Design:
    return synthesize(robot(), StructuredLipschitz(decay_rate=1.0))


@pytest.fixture(scope="module")
def html(design: Design) -> str:
    time = np.linspace(0, 10, 5000)
    truth = np.sin(time)
    estimates = {"ours": truth + 0.01, "theirs": truth - 0.05}
    errors = {"ours": 0.01, "theirs": 0.05}
    figures = comparison_figures(
        time, truth, estimates, name="link angle", unit="rad", errors=errors, seconds={"ours": 1e-6, "theirs": 2e-6}
    )
    scores = Table(["entrant", "RMSE [deg]"], [["ours", 0.573], ["theirs", 2.865]], ["A note."], "Scores")
    page = Page(
        "A <title>",
        "Ours wins.",
        ["Nobody moved."],
        {"ours": design},
        scores,
        figures,
        citations([design]),
        {"log": "x.csv"},
    )
    return page.as_html()


def test_nothing_is_loaded_from_outside(html: str) -> None:
    loaded = re.findall(r"<(?:script|link|img|iframe)[^>]*(?:src|href)\s*=\s*[\"']?([^\"' >]+)", html)
    assert [u for u in loaded if not u.startswith(("#", "data:"))] == []


def test_every_section_and_number_is_there(html: str, design: Design) -> None:
    for text in ("Ours wins.", "Nobody moved.", "A note.", "x.csv", "Song", "0.573"):
        assert text in html
    for proof in design.certificate.proofs:
        assert f"{proof.claim.level:.6g}" in html
    assert "A &lt;title&gt;" in html
    assert "A <title>" not in html


def test_plotly_is_inlined_once(html: str) -> None:
    assert html.count("plotly.js v") <= 2
    assert len(html) < 8_000_000


def test_write_names_a_folder_that_cannot_be(design: Design, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    page = Page("T", "S", [], {}, Table(["entrant"], [["a"]]), [])
    assert page.write(tmp_path / "new/page.html").is_file()
    with pytest.raises(BadInput, match="cannot be written"):
        page.write(tmp_path / "file/page.html")


def test_references_are_listed_once(design: Design) -> None:
    found = citations([design, design], ["Somebody 1999.", "somebody 1999", ""])
    assert len(found) == len(design.references) + 1
    assert numbered(found).startswith("[1] ")
