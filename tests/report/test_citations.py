"""A paper is cited once, whoever names it and however it is punctuated."""

from catalogue import oscillator
from luenberger.methods import PolytopicLuenberger
from luenberger.report.citations import citations, numbered
from luenberger.synthesize import synthesize


def test_references_are_listed_once_in_order_of_use() -> None:
    design = synthesize(oscillator(), PolytopicLuenberger(decay_rate=1.0))
    found = citations([design, design], ["Somebody  1999.", "somebody 1999", "", "  "])
    assert found == (*design.references, "Somebody 1999.")
    assert citations([]) == ()


def test_numbered_text() -> None:
    assert numbered(["A 1990", "B 2000"]) == "[1] A 1990\n[2] B 2000"
