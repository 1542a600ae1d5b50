"""Rows and verdicts of the comparison with published papers."""

import pytest

from luenberger.experiment.published.row import Row, Verdict, collected, judged


@pytest.mark.parametrize(
    ("reproduced", "corrected", "verdict"),
    [
        (True, False, Verdict.REPRODUCED),
        (True, True, Verdict.REPRODUCED),
        (False, True, Verdict.CORRECTED),
        (False, False, Verdict.NOT_REPRODUCIBLE),
    ],
)
def test_verdict_follows_from_what_holds(reproduced: bool, corrected: bool, verdict: Verdict) -> None:
    row = judged("x", "(1)", "1", "2", "because.", reproduced=reproduced, corrected=corrected, deviation=1.0)
    assert row == Row("x", "(1)", "1", "2", verdict, "because.", 1.0)


def test_every_verdict_has_its_sentence() -> None:
    sentences = {v.sentence for v in Verdict}
    assert len(sentences) == 3
    assert all(s.endswith(".") for s in sentences)


def test_rows_are_told_as_they_come() -> None:
    one = Row("a", "(1)", "1", "1", Verdict.REPRODUCED, "same")
    heard: list[Row] = []
    assert collected(iter([one, one]), heard.append) == [one, one]
    assert heard == [one, one]
