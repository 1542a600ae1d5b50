"""The print as it stands: its faults are there, and what is right in it is right."""

import numpy as np
import pytest

from luenberger.experiment.published.ifqir_car import NOISE, SPEEDS, STATE_BOUND, STEP, Axles, printed_mode
from luenberger.experiment.published.ifqir_preliminaries import exact_product, random_boxes, unsound
from luenberger.experiment.published.ifqir_printed import (
    Bounds,
    PrintedMode,
    delta_printed,
    errors_printed,
    lemma_corrected,
    lemma_printed,
    lumped_printed,
    theorem_printed,
)
from luenberger.experiment.published.ifqir_theorem import car_modes


def test_the_corrected_lemma_never_cuts_and_the_printed_ones_do() -> None:
    A, x = random_boxes(10_000, seed=7)
    exact = exact_product(A, x)
    assert not unsound(lemma_corrected(A, x), exact).any()
    # 84 % and 91 % of drawn boxes; a tenth of that would already say that the print is wrong.
    assert unsound(lemma_printed(A, x), exact).mean() == pytest.approx(0.84, abs=0.02)
    assert unsound(delta_printed(A, x), exact).mean() == pytest.approx(0.915, abs=0.02)


def test_the_exact_product_is_met_by_a_vertex_and_never_passed() -> None:
    A, x = random_boxes(200, seed=3)
    exact = exact_product(A, x)
    rng = np.random.default_rng(0)
    for _ in range(50):
        a = rng.choice([0.0, 1.0], A.lower.shape)
        b = rng.choice([0.0, 1.0], x.lower.shape)
        value = (A.lower + a * (A.upper - A.lower)) @ (x.lower + b * (x.upper - x.lower))
        # Sums of two products: a few roundings.
        assert (value >= exact.lower - 1e-14).all()
        assert (value <= exact.upper + 1e-14).all()


def test_both_factors_changing_sign_doubles_the_lemma() -> None:
    one = Bounds(-np.ones((1, 1)), np.ones((1, 1)))
    loose = lemma_corrected(one, one)
    assert (loose.lower.item(), loose.upper.item()) == (-2.0, 2.0)


def test_printed_bounds_of_delta_stand_the_wrong_way_round() -> None:
    mode = printed_mode(SPEEDS[2])
    bounds = lumped_printed(mode, Bounds.around(STATE_BOUND), Bounds.around(np.zeros(1)), np.array([NOISE]))
    assert bounds.lower[0] > bounds.upper[0]
    # Symmetric x: P+ dl - P- du with du = 2 D X and dl = -D X, and (H - K) V in both.
    size = mode.dA.upper @ STATE_BOUND
    expected = -size[0] + mode.P[0, 1] * 2 * size[1] + (mode.H - mode.K)[0, 0] * NOISE
    assert bounds.upper[0] == pytest.approx(expected, rel=1e-12)


def test_the_recursion_takes_the_wrong_bound_for_the_radius_and_drops_the_centre() -> None:
    one = np.eye(1)
    u, x = Bounds(np.ones(1), np.ones(1)), Bounds.around(np.ones(1))
    # dA = 0 and u = 1, so Delta lies in the interval dB; the print is left with its lower bound.
    for low, high in ((0.0, 1.0), (-1.0, 0.0)):
        mode = PrintedMode(0.5 * one, one, 0 * one, 0 * one, Bounds.around(0 * one), Bounds(low * one, high * one))
        lumped = lumped_printed(mode, x, u, np.zeros(1))
        assert (lumped.lower.item(), lumped.upper.item()) == (high, low)
        center, radius = errors_printed([mode] * 5, x, [u] * 5, np.zeros(1), 0 * one)
        assert not center.any()
        # The sum of 0.5^k |low| after four steps.
        assert radius[-1, 0] == pytest.approx(abs(low) * 1.875)


def test_gamma_scales_with_the_level_of_the_storage_matrix() -> None:
    modes = car_modes()
    found = [theorem_printed(modes, 0.5, alpha) for alpha in (1.0, 0.01)]
    assert found[0] is not None
    assert found[1] is not None
    # The solver is asked for nine digits.
    assert found[0].gamma == pytest.approx(2.47274, abs=1e-4)
    assert found[1].gamma == pytest.approx(0.01 * found[0].gamma, rel=1e-4)
    tied = theorem_printed(modes, 0.5, 1.0, slack=False)
    assert tied is not None
    assert tied.gamma == pytest.approx(found[0].gamma, rel=1e-6)
    # Flat where the gain has no effect; the first entry is what takes the yaw rate out of the error.
    assert found[0].gains[0][0, 0] == pytest.approx(Axles.at(SPEEDS[0]).decoupled(STEP).K[0, 0], rel=1e-3)


@pytest.mark.parametrize(("step", "gamma"), [(0.1, 3.83063), (0.05, 4.39233), (0.6, None), (0.02, None), (0.01, None)])
def test_sample_times(step: float, gamma: float | None) -> None:
    found = theorem_printed(car_modes(step), 0.5, 1.0)
    if gamma is None:
        assert found is None
    else:
        assert found is not None
        # The solver is asked for nine digits, the expected value has six.
        assert found.gamma == pytest.approx(gamma, abs=1e-4)
