"""The search of gains and fades: the ultimate bound and what attains it, the best fade, the tamest gain, and refusals."""

import math
from dataclasses import replace

import numpy as np
import pytest

from luenberger.core import Infeasible
from luenberger.lmi import Bernstein
from luenberger.methods.unknown_input_inequality import Form
from luenberger.methods.unknown_input_plant import OpenMode
from luenberger.methods.unknown_input_search import best_fade, found_gain, least_supply, no_gain, ultimate_bound
from luenberger.systems import System
from luenberger.systems.discretize import discretize
from luenberger.vehicle import gust_car
from luenberger.vehicle.wind import wind_plant

COMMON = Form("common", "lumped", 4.0, False, False, Bernstein())


def gusty(step: float) -> tuple[OpenMode, ...]:
    """The car in a side wind at three speeds, sampled by Euler's method."""
    plant = discretize(wind_plant(gust_car, (6.0, 19.9), gust_arm=0.4), step, "euler")
    return tuple(OpenMode.of(plant.freeze(speed=v, inverse_speed=1 / v)) for v in (8.5, 13.55, 18.05))


def slow(zero: float) -> tuple[OpenMode, ...]:
    """One mode whose error keeps this zero, whatever the gain."""
    return (OpenMode.of(System.linear([[zero, 0.1], [0.0, 0.5]], C=[[0.0, 1.0]], E=[[0.0], [1.0]], dt=1.0)),)


def random_modes(seed: int) -> tuple[OpenMode, ...]:
    """Two modes with one unknown input and eigenvalues up to the unit circle."""
    rng = np.random.default_rng(seed)
    C = rng.standard_normal((1, 3))
    modes = []
    for _ in range(2):
        A = rng.standard_normal((3, 3))
        modes.append(System.linear(A / np.abs(np.linalg.eigvals(A)).max(), C=C, E=rng.standard_normal((3, 1)), dt=1.0))
    return tuple(map(OpenMode.of, modes))


def bound(modes: tuple[OpenMode, ...], fade: float) -> float:
    return ultimate_bound(least_supply(modes, COMMON, fade), fade)


@pytest.mark.parametrize(("fade", "level"), [(0.3, 2.4086), (0.4543, 2.2012), (0.5, 2.2238)])
def test_the_corrected_bound_of_the_car(fade: float, level: float) -> None:
    assert bound(gusty(0.06), fade) == pytest.approx(level, abs=1e-4)


def test_a_mutated_constant_of_the_bound_is_caught() -> None:
    # A constant input takes the error with z = 0.8 to 5; sqrt(supply / (1 - fade)), as printed, says 2.5.
    level = bound(slow(0.8), 0.2)
    error = 0.0
    for _ in range(200):
        error = 0.8 * error + 1.0
    assert level == pytest.approx(5.0, abs=1e-3)
    assert error <= level * (1 + 1e-6)
    assert error > 0.999 * level
    assert math.sqrt(least_supply(slow(0.8), COMMON, 0.2) / (1 - 0.2)) < 0.51 * error


def test_switches_raise_the_bound_of_what_falls_between_them() -> None:
    # The worst V: growth at every switch, the least dwell, the full supply, against the limit of that very recursion.
    fade, growth, dwell, supply = 0.3, 1.5, 4, 2.0
    V, worst = 0.0, 0.0
    for k in range(400):
        V = (1 - fade) * V + supply
        V *= growth if k % dwell == dwell - 1 else 1.0
        worst = max(worst, V)
    assert ultimate_bound(supply, fade, growth, dwell) == pytest.approx(math.sqrt(worst), rel=1e-9)
    assert ultimate_bound(supply, fade, 1.0, dwell) == pytest.approx(math.sqrt(supply / fade), rel=1e-12)


def test_a_dwell_too_short_for_the_growth_bounds_nothing() -> None:
    assert ultimate_bound(1.0, 0.5, 4.0, 2) == math.inf
    assert math.isfinite(ultimate_bound(1.0, 0.5, 4.0, 3))


def test_the_bound_counts_in_units_of_the_storage() -> None:
    assert ultimate_bound(8.0, 0.5, alpha=4.0) == pytest.approx(2.0, rel=1e-12)


def test_the_best_fade_of_the_car_is_what_its_slowest_zero_leaves() -> None:
    fade = best_fade(lambda share: bound(gusty(0.06), share), 1 - 0.545706**2)
    # The bound is flat there: 1 / (1 - z) to a millionth within a hundredth of the fade.
    assert fade == pytest.approx(1 - 0.545706, abs=5e-3)
    assert bound(gusty(0.06), fade) == pytest.approx(1 / (1 - 0.545706), rel=1e-5)


@pytest.mark.parametrize("wanted", [0.003, 0.11, 0.52, 0.89])
def test_the_best_fade_is_found_wherever_it_lies(wanted: float) -> None:
    assert best_fade(lambda fade: (fade - wanted) ** 2, 0.9) == pytest.approx(wanted, abs=4e-3)


def test_no_fade_at_all_is_a_refusal() -> None:
    with pytest.raises(Infeasible, match=r"for any `fade` between 0\.01 and 0\.48"):
        best_fade(lambda fade: math.inf, 0.5)


def test_the_tamest_gain_leaves_nothing_but_the_zeros() -> None:
    # The worst mode sets the level; the others and the measured state would be left to chance.
    modes = gusty(0.06)
    found = found_gain(modes, COMMON, 0.5)
    assert found is not None
    for mode, K, H, zero in zip(modes, found.K, found.H, (0.035294, 0.394834, 0.545706), strict=True):
        np.testing.assert_allclose(np.asarray(mode.error(K, H)({})), np.diag([zero, 0.0]), atol=2e-5)
        gain = mode.projection(H) @ np.asarray(mode.A({}))
        np.testing.assert_allclose(np.asarray(K({})), [[gain[0, 1]], [0.0]], atol=2e-5)
        # As many outputs as unknown inputs: K then drops out of what a noise sample does in two steps.
        N, P = np.asarray(mode.error(K, H)({})), mode.projection(H)
        np.testing.assert_allclose(N @ H - np.asarray(K({})), P @ np.asarray(mode.A({})) @ H, atol=1e-12)
    assert found.supply == pytest.approx(2.47274, abs=1e-4)


def test_what_was_given_away_for_it_is_a_thousandth() -> None:
    modes = random_modes(33)
    found = found_gain(modes, COMMON, 0.1)
    assert found is not None
    assert found.supply == pytest.approx(least_supply(modes, COMMON, 0.1), rel=1e-6)
    assert found.solution.values["supply"] <= found.supply * (1 + 2e-3)


def test_a_fade_that_only_the_modes_together_rule_out_is_refused_with_the_largest() -> None:
    modes = random_modes(225)
    refusal = no_gain(modes, COMMON, 0.1, 0.9)
    assert refusal.nearest is not None
    assert 0.005 < refusal.nearest < 0.1
    assert math.isfinite(least_supply(modes, COMMON, 0.99 * refusal.nearest))
    assert math.isinf(least_supply(modes, COMMON, 1.01 * refusal.nearest))
    assert 'storage="mode", "last" or "dwell"' in str(refusal)
    assert f"{refusal.nearest:.6g}" in str(refusal)


def test_modes_that_no_fade_helps_are_refused_without_one() -> None:
    turns = [[[0.0, 1.2], [-1.2, 0.0]], [[0.0, 1.2], [1.2, 0.0]]]
    modes = tuple(OpenMode.of(System.linear(A, C=[[0.0, 0.0]], dt=1.0)) for A in turns)
    refusal = no_gain(modes, replace(COMMON, storage="dwell"), 0.1, 0.9)
    assert refusal.nearest is None
    assert "nor for a smaller one" in str(refusal)
    assert "a larger `growth`" in str(refusal)
