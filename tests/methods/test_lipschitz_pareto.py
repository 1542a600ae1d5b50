"""Lipschitz design on the Pareto front."""

import numpy as np
import pytest

from lipschitz_plants import POINT_THREE, pendulum
from luenberger.core import BadInput, Infeasible, Outcome
from luenberger.methods.lipschitz_margin import storage_at
from luenberger.methods.lipschitz_pareto import LipschitzPareto, slope_of_smallest
from luenberger.methods.lipschitz_plant import LumpedPlant
from luenberger.synthesize import synthesize


def value(plant: LumpedPlant, delta: float, sigma: float) -> float:
    P = storage_at(plant, 1 / sigma)
    return -np.inf if P is None else delta * np.linalg.eigvalsh(P)[0] - (1 - delta) * sigma


def test_both_routes_give_one_point() -> None:
    riccati, sdp = (LipschitzPareto(0.97, 0.0, POINT_THREE, route).design(pendulum()) for route in ("riccati", "sdp"))
    assert sdp.statistics["optimum"] == pytest.approx(riccati.statistics["optimum"], rel=1e-6)
    # The objective is flat at its top: sigma carries the square root of the solver's accuracy.
    assert sdp.statistics["sigma"] == pytest.approx(riccati.statistics["sigma"], rel=1e-2)


def test_point_is_the_best_on_a_fine_scan() -> None:
    plant = LumpedPlant.of(pendulum(), POINT_THREE)
    for delta in (0.95, 0.97, 0.99):
        found = LipschitzPareto(delta, 0.0, POINT_THREE).design(pendulum()).statistics
        scan = max(value(plant, delta, s) for s in found["sigma"] * np.linspace(0.5, 2.0, 301))
        assert found["optimum"] >= scan - 1e-9


def test_design_is_proved() -> None:
    design = synthesize(pendulum(), LipschitzPareto(0.97, 0.0, POINT_THREE))
    assert design.certificate.outcome is Outcome.PROVED
    assert design.statistics["epsilon"] == pytest.approx(1 / design.statistics["sigma"])


def test_sigma_min_is_kept_where_it_binds() -> None:
    free = LipschitzPareto(0.97, 0.0, POINT_THREE).design(pendulum()).statistics["sigma"]
    for route in ("riccati", "sdp"):
        bound = LipschitzPareto(0.97, 2 * free, POINT_THREE, route).design(pendulum()).statistics["sigma"]
        assert bound == pytest.approx(2 * free, rel=1e-5)
        slack = LipschitzPareto(0.97, 0.5 * free, POINT_THREE, route).design(pendulum()).statistics["sigma"]
        assert slack == pytest.approx(free, rel=1e-2)


def test_slope_is_the_derivative() -> None:
    plant = LumpedPlant.of(pendulum(), POINT_THREE)
    h = 1e-4
    P, up, down = (storage_at(plant, 1 / s) for s in (20.0, 20.0 + h, 20.0 - h))
    assert P is not None
    difference = (np.linalg.eigvalsh(up)[0] - np.linalg.eigvalsh(down)[0]) / (2 * h)
    # Central difference: rounding 1e-12 / h and h^2.
    assert slope_of_smallest(plant, P) == pytest.approx(difference, rel=1e-6)


def test_edge_of_feasibility_is_refused_with_the_nearest_weight() -> None:
    with pytest.raises(Infeasible, match="edge of feasibility") as refusal:
        LipschitzPareto(0.01, 0.0, POINT_THREE).design(pendulum())
    assert refusal.value.nearest is not None
    LipschitzPareto(refusal.value.nearest * 1.02, 0.0, POINT_THREE).design(pendulum())


def test_refusals() -> None:
    for delta in (0.0, 1.0):
        with pytest.raises(BadInput, match="strictly between 0 and 1"):
            synthesize(pendulum(), LipschitzPareto(delta))
    with pytest.raises(BadInput, match="`sigma_min` is -1"):
        synthesize(pendulum(), LipschitzPareto(0.5, -1.0))
    with pytest.raises(Infeasible, match="No epsilon"):
        synthesize(pendulum(50.0), LipschitzPareto(0.5))
