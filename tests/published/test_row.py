"""Rows and verdicts of the comparison with published papers."""

import pytest

from luenberger.experiment.published.row import Row, Verdict, collected, judged


@pytest.mark.parametrize(
    ("holds", "verdict"),
    [
        ({"reproduced"}, Verdict.REPRODUCED),
        ({"reproduced", "bettered", "corrected"}, Verdict.REPRODUCED),
        ({"bettered", "corrected"}, Verdict.BETTERED),
        ({"corrected"}, Verdict.CORRECTED),
        (set(), Verdict.NOT_REPRODUCIBLE),
    ],
)
def test_verdict_follows_from_what_holds(holds: set[str], verdict: Verdict) -> None:
    facts = {name: name in holds for name in ("reproduced", "bettered", "corrected")}
    row = judged("x", "(1)", "1", "2", "because.", **facts, deviation=1.0)
    assert row == Row("x", "(1)", "1", "2", verdict, "because.", 1.0)


def test_every_verdict_has_its_sentence() -> None:
    sentences = {v.sentence for v in Verdict}
    assert len(sentences) == len(Verdict)
    assert all(s.endswith(".") for s in sentences)


def test_rows_are_told_as_they_come() -> None:
    one = Row("a", "(1)", "1", "1", Verdict.REPRODUCED, "same")
    heard: list[Row] = []
    assert collected(iter([one, one]), heard.append) == [one, one]
    assert heard == [one, one]
