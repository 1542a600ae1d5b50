"""Envelopes of the slip angles: as wide as known, and with the truth inside while the bounds are true."""

import numpy as np
import pytest

from luenberger.experiment.published.row import Row, Verdict
from luenberger.experiment.published.wang_enclosures import (
    NOISE,
    Envelope,
    bounded_noise,
    car,
    envelopes,
    known_gains,
    noise_samples,
    swinging,
    two_lanes,
)
from luenberger.experiment.published.wang_envelopes import (
    HIGH,
    LOW,
    _literal,
    _scheduling,
    nominal_row,
    steady_width_envelopes,
)
from luenberger.experiment.published.wang_interval_designs import interval_design_rows
from luenberger.experiment.published.wang_manoeuvre import linear_truth


@pytest.fixture(scope="module")
def quiet() -> dict[str, list[Envelope]]:
    return envelopes(known_gains(), car(), [linear_truth(), two_lanes(HIGH, LOW), swinging()])


def test_widths_within_five_percent_and_the_truth_inside(quiet: dict[str, list[Envelope]]) -> None:
    expected = {
        "printed": [(4.55, 5.26), (4.70, 5.45), (4.41, 5.16)],
        "no correction": [(2.19, 3.47), (2.25, 3.61), (2.10, 3.36)],
    }
    for name, widths in expected.items():
        np.testing.assert_allclose([e.width for e in quiet[name]], widths, rtol=0.05)
        assert all(e.samples == 0 for e in quiet[name])


def test_noise_is_held_by_its_bound_and_not_without() -> None:
    noise = noise_samples(swinging())
    held = envelopes(known_gains(), car(noise=NOISE), [swinging()], noise=noise)
    np.testing.assert_allclose(held["printed"][0].width, (16.6, 11.7), rtol=0.05)
    np.testing.assert_allclose(held["no correction"][0].width, (6.87, 4.66), rtol=0.05)
    assert all(results[0].samples == 0 for results in held.values())
    one = {"no correction": known_gains()["no correction"]}
    assert envelopes(one, car(), [swinging()], noise=noise)["no correction"][0].samples > 1000


def test_noise_stays_within_its_bounds() -> None:
    noise = bounded_noise(1000)
    assert (np.abs(noise) <= NOISE).all()
    # A uniform sample of a thousand comes within a percent of the bound.
    assert (np.abs(noise).max(axis=0) > 0.99 * np.array(NOISE)).all()


def test_rows_of_the_printed_gain_of_scheduling_errors_and_of_the_nominal_observer() -> None:
    one = {"no correction": known_gains()["no correction"]}
    rows = [_literal(linear_truth()), _scheduling(one, two_lanes(HIGH, LOW)), nominal_row(one)]
    assert [row.verdict for row in rows] == [Verdict.CORRECTED, Verdict.REPRODUCED, Verdict.REPRODUCED]
    assert "118.5 km/h" in rows[0].reason


def test_levels_and_the_plant_that_no_gain_serves() -> None:
    rows: list[Row] = list(interval_design_rows())
    assert {row.verdict for row in rows} == {Verdict.REPRODUCED}
    assert len(rows) == 9


@pytest.mark.parametrize("noisy", [False, True])
def test_the_steady_width_design_is_never_wider_than_the_best_of_the_others(noisy: bool) -> None:
    ours, best = steady_width_envelopes(noisy)
    # Both axles, against five gains: three by the theorem of the dissertation, its printed one, and none.
    assert np.all(ours <= best)
    # Not by a hair: at least one axle gains two percent.
    assert (best / ours).max() > 1.02
