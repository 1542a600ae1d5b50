"""The page: every section is there, it loads and sends nothing, and its numbers are those of the design."""

import json
import re
from collections.abc import Sequence
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from plotly.offline import get_plotlyjs

from catalogue import robot
from luenberger.algebra import Polynomial
from luenberger.core import BadInput
from luenberger.design import Design
from luenberger.methods import StructuredLipschitz
from luenberger.report.citations import citations
from luenberger.report.figures import Figure, comparison_figures
from luenberger.report.page import Page
from luenberger.report.tables import Table
from luenberger.synthesize import synthesize

EVIL = "</script><script>alert(1)</script>"
SECTIONS = ["scores", "assumed", "certified", "estimates", "errors", "cost", "sources"]


class Reader(HTMLParser):
    """What a browser would see: tags with attributes, and the text outside scripts."""

    def __init__(self, text: str):
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.text = ""
        self.styles = ""
        self.inside = ""
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: Sequence[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        self.inside = tag

    def handle_endtag(self, tag: str) -> None:
        self.inside = ""

    def handle_data(self, data: str) -> None:
        if self.inside == "style":
            self.styles += data
        elif self.inside != "script":
            self.text += data


@pytest.fixture(scope="module")
def design() -> Design:
    return synthesize(robot(), StructuredLipschitz(decay_rate=1.0))


def drawn() -> tuple[Figure, ...]:
    time = np.linspace(0, 10, 50_000)
    truth = np.sin(time)
    estimates = {"ours": truth + 0.01, EVIL: truth - 0.05}
    return comparison_figures(time, truth, estimates, name="link angle", unit="rad", seconds={"ours": 1e-6, EVIL: 2e-6})


@pytest.fixture(scope="module")
def html(design: Design) -> str:
    scores = Table(["entrant", "RMSE [deg]"], [["ours", 0.573], [EVIL, 2.865]], ["A note."], "Angle")
    spoiled = design.with_gain(np.zeros((4, 2)))
    designs = {"ours": design, "spoiled": spoiled}
    source = {"log": "x.csv", "sha256 of the log": "abc"}
    summary = "Ours wins & nobody else.\n\nSecond `paragraph`."
    page = Page("A <title>", summary, ["Nobody moved."], designs, scores, drawn(), citations([design]), source)
    return page.as_html()


@pytest.fixture(scope="module")
def read(html: str) -> Reader:
    return Reader(html)


def test_nothing_is_loaded_from_outside(read: Reader) -> None:
    addresses = [a[k] for _, a in read.tags for k in ("src", "href", "srcset", "action", "data", "poster") if k in a]
    assert addresses
    assert all((a or "").startswith("#") for a in addresses)
    assert not {tag for tag, _ in read.tags} & {"link", "iframe", "img", "object", "embed", "form", "base"}
    assert "url(" not in read.styles
    assert "@import" not in read.styles


def test_nothing_is_sent_anywhere(html: str) -> None:
    # plotly.js offers a button that uploads the chart to a web service unless told otherwise.
    assert '"showSendToCloud":false' in html


def test_sections_stand_in_order_and_the_links_find_them(read: Reader) -> None:
    assert [a["id"] for tag, a in read.tags if tag == "section"] == SECTIONS
    assert [a["href"] for tag, a in read.tags if tag == "a"] == [f"#{name}" for name in SECTIONS]
    assert sum(tag == "h1" for tag, _ in read.tags) == 1


def test_every_number_is_there(read: Reader, design: Design) -> None:
    for text in (
        "A <title>",
        "Ours wins & nobody else.",
        "Second paragraph.",
        "Nobody moved.",
        "A note.",
        "x.csv",
        "0.573",
    ):
        assert text in read.text
    for proof in design.certificate.proofs:
        assert proof.sentence in read.text
        assert f"{proof.margin:.2g}" in read.text
        assert proof.reason.replace("`", "") in read.text
    for sentence in (*design.certificate.assumptions, *design.references):
        assert sentence.replace("`", "") in read.text
    assert f"Nothing is claimed about {EVIL}." in read.text


def test_a_refuted_claim_is_shown_as_such(read: Reader) -> None:
    assert "✗ refuted" in read.text
    assert "✓ proved" in read.text


def test_names_cannot_leave_their_place(read: Reader) -> None:
    # plotly.js and the lines that call it; a third script would be the one smuggled in by a name.
    assert [tag for tag, _ in read.tags].count("script") == 2


def test_plots_have_places_and_the_code_is_there_once(html: str, read: Reader) -> None:
    plots = json.loads(re.search(r"var plots = (\[.*?\]), config = ", html, re.S).group(1))  # type: ignore[union-attr]
    ids = {a.get("id") for _, a in read.tags}
    assert len(plots) == 4
    assert all(plot["place"] in ids for plot in plots)
    assert html.count(get_plotlyjs()[:2000]) == 1


def test_long_curves_do_not_make_a_long_page(html: str) -> None:
    # Five curves of 50 000 samples would be 3 MB; 4000 points of 12 bytes in base64 are 64 kB each, axes shared or not.
    assert len(html) - len(get_plotlyjs()) < 600_000


def test_a_page_without_anything_says_so(tmp_path: Path) -> None:
    path = Page("T", "S", [], {}, Table(["entrant"], [["a"]]), []).write(tmp_path / "new/page.html")
    text = path.read_text(encoding="utf-8")
    for sentence in ("no entrant of this page comes with a certificate", "Nothing beyond the log itself", "None named"):
        assert sentence in text
    assert "<script" not in text


def test_write_names_a_folder_that_cannot_be(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    page = Page("T", "S", [], {}, Table(["entrant"], [["a"]]), [])
    with pytest.raises(BadInput, match="cannot be written"):
        page.write(tmp_path / "file/page.html")


def test_both_gains_of_two_degrees_of_freedom_are_shown(design: Design) -> None:
    second = replace(design, argument_gain=Polynomial.constant(np.full((4, 2), 0.123456)))
    read = Reader(Page("t", "s", [], {"one": design, "two": second}, Table(["a"], [[1]]), (), (), {}).as_html())
    assert read.text.count("Its gain in the argument of f") == 1
    assert read.text.count("0.123456") == 8
