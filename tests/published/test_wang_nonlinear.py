"""Chapter 5 of Wang's dissertation row by row: every verdict, and the numbers behind those that decide a design."""

from collections.abc import Callable, Iterator

import numpy as np
import pytest

from luenberger.experiment.published.row import Row, Verdict
from luenberger.experiment.published.wang_nonlinear_car import car_rows
from luenberger.experiment.published.wang_nonlinear_figures import NAMES, portrait
from luenberger.experiment.published.wang_nonlinear_gains import gain_rows, smallest_gains
from luenberger.experiment.published.wang_nonlinear_oscillator import oscillator_rows
from luenberger.experiment.published.wang_nonlinear_printed import printed_rows
from luenberger.experiment.published.wang_nonlinear_sector import (
    FLIPPED,
    FLIPPED_GAIN,
    FLIPPED_STORAGE,
    NO_GAIN,
    sector_rows,
)
from luenberger.experiment.published.wang_nonlinear_slip import level_rows, reach_rows
from luenberger.experiment.published.wang_nonlinear_text import text_rows

R, C, N = Verdict.REPRODUCED, Verdict.CORRECTED, Verdict.NOT_REPRODUCIBLE

PARTS: tuple[tuple[Callable[[], Iterator[Row]], list[Verdict]], ...] = (
    (sector_rows, [C, R, C, C, C, C, C, R, C]),
    (text_rows, [R, C, R, C, C, C, R, C, C, C, R, R, C]),
    (oscillator_rows, [R, R, R, N, R, R, R, R, R]),
    (gain_rows, [R, R, R, R, R, R, R, R, C, R, R]),
    (car_rows, [C, R, N, C, R, R, C, R, C]),
    (printed_rows, [C, N, N, R]),
    (level_rows, [R, R, R, R, R, R]),
)


@pytest.mark.parametrize(("part", "verdicts"), PARTS, ids=lambda p: getattr(p, "__name__", ""))
def test_every_row_has_its_verdict_and_says_why(part: Callable[[], Iterator[Row]], verdicts: list[Verdict]) -> None:
    found = list(part())
    assert [r.verdict for r in found] == verdicts
    assert all(r.reason and r.equation and r.item for r in found)


@pytest.mark.study
def test_reach_on_the_slip_angles() -> None:
    # The same limits stand in the tests of the methods; here every bisection of the rows is run.
    assert [r.verdict for r in reach_rows()] == [R, R, C]


def test_smallest_gains_of_the_oscillator() -> None:
    # Box, hull, multipliers with and without L2 at r = 5: the same optimum of the same convex problem, to its digits.
    found = smallest_gains(5.0, 0.0)
    for value, known in zip(found.norms, (75.805, 22.298, 88.314, 1.819), strict=False):
        assert value == pytest.approx(known, rel=1e-3)


def test_what_the_sector_lemma_calls_stable_is_not() -> None:
    # (5.22) with L2 = 0 and P as stored is negative definite, and yet the error matrix at the origin has a positive eigenvalue.
    P, L = FLIPPED_STORAGE, FLIPPED_GAIN.astype(float)
    K1, K2, F, measured = np.array([[-50.0, -24.0]]), np.array([[50.0, 1.0]]), np.array([[0.0], [1.0]]), np.eye(1, 2)
    closed = FLIPPED + F @ K1 - L @ measured
    corner = closed.T @ P + P @ closed
    side = P @ F + (K2 - K1).T / 2
    assert not NO_GAIN.any()
    assert np.linalg.eigvalsh(np.block([[corner, side], [side.T, -np.eye(1)]]))[-1] < 0
    origin = FLIPPED + F @ np.array([[0.0, 1.0]]) - L @ measured
    assert np.linalg.det(origin) == pytest.approx(-39.0)
    assert np.linalg.eigvals(origin).real.max() > 0


def test_portrait_shows_both_readings_of_the_printed_observer_on_the_limit_cycle() -> None:
    plot = portrait().plot
    assert [t.name for t in plot.data] == ["oscillator", *NAMES.values()]
    # The last drawn points: oscillator and estimates have met.
    ends = np.array([[t.x[-1], t.y[-1]] for t in plot.data])
    assert np.ptp(ends, axis=0).max() < 0.05
