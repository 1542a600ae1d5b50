"""Errors of the printed observers and of the filters, and what became of the claims."""

import importlib.util

import numpy as np
import pytest

from luenberger.experiment.published import wang_estimates
from luenberger.experiment.published.row import Row, Verdict
from luenberger.experiment.published.wang_estimates import (
    ABSENT,
    CASES,
    deviation,
    estimate_rows,
    largest_gap,
    root_mean_squares,
    slip_estimates,
    tenth_time,
)
from luenberger.experiment.published.wang_filters import filter_errors
from luenberger.experiment.published.wang_gains import printed_observers
from luenberger.experiment.published.wang_manoeuvre import STEP, linear_truth
from luenberger.experiment.published.wang_runs import slip_truth

DRIFT = importlib.util.find_spec("vehiclemodels") is not None


@pytest.fixture(scope="module")
def found() -> list[Row]:
    return list(estimate_rows())


def test_every_line_of_the_tables_within_five_percent(found: list[Row]) -> None:
    lines = [row for row in found if "rms errors" in row.item]
    assert len(lines) == (10 if DRIFT else 7)
    assert {row.verdict for row in lines} == {Verdict.REPRODUCED}


def test_claims(found: list[Row]) -> None:
    verdicts = {row.item.split(":")[0]: row.verdict for row in found if "rms errors" not in row.item}
    assert verdicts["sign of the second state in the printed gains"] is Verdict.CORRECTED
    assert verdicts["estimates converge quickly"] is Verdict.CORRECTED
    assert verdicts["estimates become biased when the scheduling is read wrongly"] is Verdict.REPRODUCED
    assert verdicts["Luenberger better for small errors, unstructured better at the extremes"] is Verdict.CORRECTED


def test_exact_readings_leave_nothing_and_times_to_a_tenth() -> None:
    truth = linear_truth()
    true = slip_truth(truth)
    found = {n: x[0] for n, x in slip_estimates(printed_observers(STEP), truth, CASES).items()}
    assert root_mean_squares(found["H-infinity Luenberger"], true).max() < 0.01
    # An independent implementation says 0.33 s and 2.2 s.
    assert tenth_time(found["no correction"], true) == pytest.approx(0.33, abs=0.005)
    assert tenth_time(found["feasibility gain"], true) == pytest.approx(2.2, abs=0.05)
    assert tenth_time(found["H-infinity Luenberger"], true) <= 0.005


def test_an_absent_package_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(wang_estimates, "drift_truth", lambda: None)
    last = list(estimate_rows())[-1]
    assert last.ours == ABSENT
    assert last.verdict is Verdict.NOT_REPRODUCIBLE


def test_gaps_allow_half_a_digit_and_no_more() -> None:
    assert largest_gap(".10/1.6", np.array([0.1049, 1.64])) == 0.0
    assert largest_gap(".10/1.6", np.array([0.115, 1.6])) == pytest.approx(0.1)
    assert deviation(".10/1.6", np.array([0.115, 1.5])) == pytest.approx(0.1)


def test_filters_agree_with_each_other_and_err_with_the_speed() -> None:
    errors = filter_errors([(linear_truth(), 0.0), (linear_truth(), -0.1)])
    # The same sensors and tyre: EKF and UKF differ by less than half a percent.
    np.testing.assert_allclose(errors[:, 4], errors[:, 2], rtol=5e-3)
    # A linear tyre is exact here; what is left is the hold of the inputs over 10 ms.
    assert errors[0, :2].max() < 0.05
    np.testing.assert_allclose(
        errors[1], np.array([[1.45, 0.40], [0.76, 0.88], [0.57, 1.08], [1.29, 0.46], [0.57, 1.08]]), rtol=0.05
    )
