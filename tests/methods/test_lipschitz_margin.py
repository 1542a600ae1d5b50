"""Stability margins by semidefinite programmes and by their oracles."""

import numpy as np
import pytest

from lipschitz_plants import POINT_THREE, integrator, pendulum
from luenberger.core import BadInput
from luenberger.methods.lipschitz_margin import (
    margin_at,
    quadratic_storage,
    squared_margin,
    stability_margin,
    storage_at,
    thau_bound,
)
from luenberger.methods.lipschitz_plant import LumpedPlant

GAIN = [[3.0], [4.0]]


def test_integrator_has_its_pole_as_margin() -> None:
    for route in ("norm", "maximise", "minimise"):
        # Solver tolerance 1e-10 on the square.
        assert stability_margin(integrator(), [[3.0]], None, route) == pytest.approx(3.0, rel=1e-6)


@pytest.mark.parametrize("transform", [None, POINT_THREE, [[1.0, 0.2], [-0.3, 0.5]]])
def test_three_routes_agree(transform: object) -> None:
    found = [stability_margin(pendulum(), GAIN, transform, route) for route in ("norm", "maximise", "minimise")]
    assert found[1:] == pytest.approx([found[0]] * 2, rel=1e-6)


def test_unstable_gain_has_no_margin() -> None:
    assert stability_margin(pendulum(), [[-3.0], [4.0]]) == 0.0
    assert thau_bound(pendulum(), [[-3.0], [4.0]]) == 0.0


def test_margin_at_of_the_integrator() -> None:
    # p^2 + a - 1/epsilon = 0 has a root p > 0 for a < 1/epsilon.
    assert margin_at(integrator(), 0.25) == pytest.approx(2.0, rel=1e-9)
    assert margin_at(integrator(), 0.25, None, "sdp") == pytest.approx(2.0, rel=1e-6)


def test_margin_falls_with_epsilon_and_both_routes_agree() -> None:
    found = [margin_at(pendulum(), e, POINT_THREE) for e in (0.01, 0.1, 1.0)]
    assert found == sorted(found, reverse=True)
    sdp = [margin_at(pendulum(), e, POINT_THREE, "sdp") for e in (0.01, 0.1, 1.0)]
    assert sdp == pytest.approx(found, rel=1e-5)


def test_margin_is_zero_without_any_storage() -> None:
    assert squared_margin(np.eye(1), np.zeros((1, 1))) == 0.0
    with pytest.raises(BadInput, match="positive finite"):
        margin_at(integrator(), -1.0)


def test_storage_solves_the_equation_and_bounds_every_other() -> None:
    plant = LumpedPlant.of(pendulum(), POINT_THREE)
    P = storage_at(plant, 0.05)
    assert P is not None
    Q = plant.lipschitz**2 * np.eye(2) - plant.C.T @ plant.C / 0.05
    np.testing.assert_allclose(P @ plant.A + plant.A.T @ P + P @ P + Q, 0, atol=1e-12)
    loop = plant.loop(plant.gain(P, 0.05))
    # The gain turns the equation into the stability inequality, met as an equation.
    np.testing.assert_allclose(P @ loop + loop.T @ P + P @ P + plant.lipschitz**2 * np.eye(2), 0, atol=1e-12)
    assert storage_at(plant, 1e3) is None


def test_thau_is_more_cautious() -> None:
    for gain in ([[1.0], [1.0]], GAIN, [[10.0], [30.0]]):
        assert 0 < thau_bound(pendulum(), gain) <= stability_margin(pendulum(), gain)


def test_quadratic_storage_in_both_forms() -> None:
    gain = [[3.0], [6.0]]
    margin = stability_margin(pendulum(), gain, POINT_THREE)
    for form in ("multiplier", "unit"):
        for lipschitz, found in ((0.99 * margin / 0.3, True), (1.01 * margin / 0.3, False)):
            plant = pendulum(lipschitz)
            P = quadratic_storage(plant, gain, POINT_THREE, form)
            assert (P is not None) == found
            if P is not None:
                loop = LumpedPlant.of(plant, POINT_THREE).loop(gain)
                assert np.linalg.eigvalsh(P)[0] > 0
                assert np.linalg.eigvalsh(P @ loop + loop.T @ P)[-1] < 0
