"""The fishhook: tyre curve, look-up tables, certified gain, and who finds the slip angles."""

import numpy as np
import pytest

from luenberger.experiment.published.row import Verdict
from luenberger.experiment.published.wang_fishhook import (
    beyond_row,
    certified_row,
    curve_row,
    matched_row,
    quick_row,
    table_rows,
)
from luenberger.experiment.published.wang_fishhook_runs import (
    COPY,
    LINEAR,
    NONLINEAR,
    OURS,
    brush_plant,
    estimates,
    everybody,
    matched_truth,
    printed_pair,
    root_mean_squares,
    slip_limit,
    slip_observers,
)
from luenberger.experiment.published.wang_gains import printed_gain
from luenberger.experiment.published.wang_runs import slip_truth
from luenberger.systems.error_system import ErrorSystem
from luenberger.systems.jacobian_box import jacobian_corners
from luenberger.vehicle import wang_car


def test_tyre_curve_and_tables() -> None:
    curve, (tables, steady) = curve_row(), tuple(table_rows())
    # By hand: x = 4.5 a, and a linear tyre misses x - x^2 / 3 of the force.
    assert "21 % of the force at 0.05 rad" in curve.ours
    assert curve.verdict is Verdict.CORRECTED
    # 72.1241 (1 / 4.1667 - 1 / 41.667) over 0.4527 times 16 / 4.1667.
    assert "L1 front 9.0x" in tables.ours
    assert tables.verdict is Verdict.REPRODUCED
    assert "17 %" in steady.ours
    assert steady.verdict is Verdict.CORRECTED


def test_our_gain_is_proved_up_to_what_the_neutral_car_allows() -> None:
    # 1 - 8 M / (Cf + Cr) = 0.94980: there the mode (1, 1), which y does not show, stops decaying under braking.
    assert certified_row().verdict is Verdict.REPRODUCED
    assert 1 - 8 * wang_car.mass / (wang_car.front_stiffness + wang_car.rear_stiffness) == pytest.approx(
        0.94980, abs=1e-5
    )
    assert slip_limit() == pytest.approx(0.1368, abs=5e-5)


def test_our_gain_is_stable_at_every_frozen_corner() -> None:
    """Eigenvalues, which need no storage: a plain look at what the certificate says for arbitrarily fast changes."""
    worst = -np.inf
    for corner in jacobian_corners(brush_plant()):
        loop = ErrorSystem.of(corner, printed_gain(OURS, flipped=False)).A
        for s in (0.024, 0.24):
            for a in (-8.0, 8.0):
                for slopes in ((0, 0), (0, 1), (1, 0), (1, 1)):
                    point = {"inverse_speed": s, "acceleration": a}
                    free = [n for n in loop.names if n not in point]
                    lower, upper = (getattr(corner.nonlinearity, f"jacobian_{e}") for e in ("lower", "upper"))
                    ends = [(lower, upper)[k][i, i] for i, k in enumerate(slopes)]
                    point |= dict(zip(free, ends, strict=False))
                    worst = max(worst, float(np.linalg.eigvals(np.asarray(loop(point), dtype=float)).real.max()))
    assert worst < 0


def test_injected_gain_of_the_print_holds_the_lower_slopes() -> None:
    """L1 - Bf K1 L2 entry by entry at one point, with (5.65) written out."""
    vx, ax, lost = 20.0, -3.0, 0.5
    m, Iz, a, b = wang_car.mass, wang_car.yaw_inertia, wang_car.front_axle_distance, wang_car.rear_axle_distance
    cross = a * b / Iz - 1 / m
    Bf = np.array([[-(1 / m + a**2 / Iz), cross], [cross, -(1 / m + b**2 / Iz)]]) / vx
    K1 = -lost * np.diag([76500.0, 51000.0])
    L1 = np.array([9.6103 - 72.1241 / vx - 0.4527 * ax / vx, 10.1651 - 84.5006 / vx - 0.5227 * ax / vx])
    L2 = np.array([0.5307 + 0.5170 / vx - 0.018 * ax / vx, 0.4693 - 0.5154 / vx + 0.0187 * ax / vx])
    point = {"inverse_speed": 1 / vx, "acceleration": ax}
    injected, second = printed_pair(lost)
    np.testing.assert_allclose(np.asarray(second(point)).ravel(), L2, rtol=1e-12)
    np.testing.assert_allclose(np.asarray(injected(point)).ravel(), L1 - Bf @ K1 @ L2, rtol=1e-10)


def test_the_observer_that_knows_the_tyres_finds_the_truth() -> None:
    truth = matched_truth()
    found = everybody(truth)
    errors = {n: root_mean_squares(x, truth) for n, x in found.items()}
    # What is left is the start, 0.1 rad away, and samples held over a millisecond.
    assert errors[NONLINEAR].max() < 0.3
    assert errors[NONLINEAR].max() < errors[COPY].max()
    assert errors[LINEAR].min() > 10
    # The same tyres in a Kalman filter, at a tenth of the rate.
    assert errors["EKF"].max() < 1.0
    assert matched_row(truth, found).verdict is Verdict.REPRODUCED
    assert quick_row(truth, found).verdict is Verdict.REPRODUCED
    assert beyond_row(truth, found).verdict is Verdict.REPRODUCED


def test_observers_start_late_and_wrong() -> None:
    truth = matched_truth()
    found = estimates({NONLINEAR: slip_observers()[NONLINEAR]}, truth)[NONLINEAR]
    np.testing.assert_allclose(found[0], (0.05, -0.03), atol=1e-12)
    assert np.abs(found[0] - slip_truth(truth)[0]).max() > 0.02
