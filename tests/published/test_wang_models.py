"""Model, error equation and hulls of chapter 3 against what they are derived from."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from luenberger.experiment.published.row import Verdict
from luenberger.experiment.published.wang_models import consistent_points, model_rows, slip_rates, vertices
from luenberger.experiment.published.wang_plants import X3, X4, scheduling_error, theta_plant
from luenberger.vehicle import slip_angle_plant, wang_car


def test_every_row_is_settled() -> None:
    found = list(model_rows())
    assert [r.verdict for r in found] == [Verdict.CORRECTED] * 5 + [Verdict.REPRODUCED]


def test_plant_is_the_one_of_the_vehicle_room() -> None:
    ours, theirs = theta_plant(), slip_angle_plant(wang_car, (15 / 3.6, 150 / 3.6), (-8.0, 8.0))
    for vx, ax, state, inputs in consistent_points(5):
        there = np.array([1 / vx, ax])
        for letter in "AB":
            one = np.asarray(ours.at(letter, np.array([1 / vx, ax / vx])))
            np.testing.assert_allclose(one, np.asarray(theirs.at(letter, there)), rtol=1e-12, atol=1e-12)
        rates = np.asarray(theirs.dynamics(0.0, state, inputs, there))
        # Central differences over 1e-6 s leave 1e-9 of the rates.
        np.testing.assert_allclose(rates, slip_rates(vx, ax, state, inputs), atol=1e-7)


def test_joint_vertices_are_inside_the_independent_hull() -> None:
    wide, narrow = ConvexHull(vertices("independent")), vertices("joint")
    assert max(float((wide.equations @ np.append(p, 1.0)).max()) for p in narrow) <= 1e-12


def test_intervals_of_the_relative_errors() -> None:
    # (3.71) with e / (1 + e): -1/9, 1/11, 1 - 1.2/0.9, 1 - 0.8/1.1.
    assert (*X3, *X4) == pytest.approx((-1 / 9, 1 / 11, -1 / 3, 3 / 11), rel=1e-12)


def test_readings_swap_true_and_measured() -> None:
    true, measured = scheduling_error("independent"), scheduling_error("independent", "measured")
    assert true.box["f1"] == pytest.approx((1 - X3[1], 1 - X3[0]))
    assert measured.box["f1"] == pytest.approx((1 + X3[0], 1 + X3[1]))
    assert set(true.measured["theta2"].names) == set(measured.true["theta2"].names) == {"s", "a", "f2"}
