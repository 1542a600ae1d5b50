"""A clock report counts what is wrong and says where."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from luenberger.core import BadInput
from luenberger.logs import inspect_clock


def test_a_good_clock_has_one_sentence() -> None:
    report = inspect_clock(np.arange(100) * 0.01)
    assert report.is_increasing
    assert report.is_uniform()
    assert report.gaps == ()
    # Rounding of k * 0.01 is below one unit in the last place of 1.
    assert report.jitter < 1e-15
    assert report.step == pytest.approx(0.01, rel=1e-12)
    assert len(report.sentences()) == 1
    assert "100 samples from 0 to 0.99 s, median step 0.01 s (100 Hz)" in report.sentences()[0]


@given(lost=st.sets(st.integers(1, 98), min_size=1, max_size=40))
def test_lost_samples_are_counted(lost: set[int]) -> None:
    kept = [k for k in range(100) if k not in lost]
    report = inspect_clock(np.array(kept) * 0.5)
    if report.step == 0.5:
        assert sum(gap.missing for gap in report.gaps) == len(lost)
        for gap in report.gaps:
            assert kept[gap.index + 1] - kept[gap.index] == gap.missing + 1
            assert gap.length == (gap.missing + 1) * 0.5
        assert not report.is_uniform()


def test_duplicates_and_reversals_are_named_apart() -> None:
    report = inspect_clock([0.0, 1.0, 1.0, 2.0, 1.5, 3.0, 4.0])
    assert report.duplicates == (2,)
    assert report.reversals == (4,)
    assert not report.is_increasing
    text = " ".join(report.sentences())
    assert "runs backwards at sample 4;" in text
    assert "stands still at sample 2;" in text


def test_many_places_are_shortened() -> None:
    report = inspect_clock([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 2.0])
    assert "samples 1, 2, 3 and 2 more" in " ".join(report.sentences())


def test_jitter_is_the_spread_without_gaps() -> None:
    steps = np.array([0.01, 0.011, 0.009, 0.01, 0.5, 0.01])
    report = inspect_clock(np.concatenate([[0.0], np.cumsum(steps)]))
    # Two steps of five are off by 1 ms; differences of sums near 0.5 are good to 1e-16.
    assert report.jitter == pytest.approx(1e-3 * np.sqrt(2 / 5), rel=1e-9)
    assert [gap.index for gap in report.gaps] == [4]
    assert "the longest lasts 0.5 s after t = 0.04 s" in " ".join(report.sentences())
    assert any(".resample(0.01)" in line for line in report.sentences())


@pytest.mark.parametrize(
    ("time", "factor", "message"),
    [
        ([1.0], 1.5, "at least two"),
        ([0.0, float("nan")], 1.5, "finite number"),
        ([3.0, 2.0, 2.0], 1.5, "None of the 3 time stamps lies after"),
        ([0.0, 1.0], 1.0, "`gap_factor` is 1.0"),
    ],
)
def test_a_clock_that_says_nothing_is_refused(time: list[float], factor: float, message: str) -> None:
    with pytest.raises(BadInput, match=message):
        inspect_clock(time, factor)
