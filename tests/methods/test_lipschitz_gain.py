"""L2 gains from a disturbance to the error."""

import numpy as np
import pytest

from lipschitz_plants import POINT_THREE, integrator, pendulum
from luenberger.core import BadInput, Infeasible, NotAccepted, NotCertified
from luenberger.methods.hamiltonian import hinf_peak
from luenberger.methods.lipschitz_gain import (
    disturbance_bound,
    disturbance_gain,
    disturbance_solution,
    least_disturbance_gain,
    least_squared,
    require_norm,
    weight_size,
)
from luenberger.methods.lipschitz_plant import LumpedPlant

GAIN = [[6.0], [12.0]]


def test_linear_gain_is_the_norm_of_the_transfer_function() -> None:
    plant = pendulum(1e-9, disturbed=True)
    lumped = LumpedPlant.of(plant)
    norm = hinf_peak(lumped.loop(GAIN), lumped.E, np.eye(2)).level
    assert disturbance_gain(plant, GAIN) == pytest.approx(norm, rel=1e-5)
    assert disturbance_gain(integrator(disturbed=True), [[4.0]]) == pytest.approx(0.25, rel=1e-6)


@pytest.mark.parametrize("norm", ["transformed", "original"])
def test_bound_is_proved_close_above(norm: str) -> None:
    plant = pendulum(1.0, disturbed=True)
    kappa = disturbance_gain(plant, GAIN, POINT_THREE, norm)
    proved = float(disturbance_bound(plant, GAIN, POINT_THREE, norm)) ** 0.5
    # The level is backed off by 1e-3 on the square.
    assert kappa < proved < kappa * (1 + 1e-3)


def test_norms_differ_by_the_coordinates() -> None:
    plant = pendulum(1.0, disturbed=True)
    inner, outer = (disturbance_gain(plant, GAIN, POINT_THREE, norm) for norm in ("transformed", "original"))
    # |T e| <= |e| <= |T e| / 0.3.
    assert inner <= outer <= inner / 0.3
    assert weight_size(LumpedPlant.of(plant, POINT_THREE), "original") == pytest.approx(1 / 0.09)


def test_least_gain_is_between_feasible_and_infeasible() -> None:
    plant = pendulum(1.0, disturbed=True)
    lumped = LumpedPlant.of(plant, POINT_THREE)
    for norm in ("transformed", "original"):
        least = least_disturbance_gain(plant, 0.005, POINT_THREE, norm)
        squared = least**2 / weight_size(lumped, norm)
        solution = disturbance_solution(lumped, 0.005, norm)
        assert solution(squared * (1 + 1e-6)) is not None
        assert solution(squared * (1 - 1e-6)) is None


def test_least_squared_of_a_step() -> None:
    step = lambda k: np.eye(1) if k > 0.037 else None  # noqa: E731
    assert least_squared(step) == pytest.approx(0.037, rel=1e-9)
    assert least_squared(lambda k: None) is None


def test_refusals() -> None:
    with pytest.raises(NotAccepted, match="no unknown input"):
        disturbance_gain(pendulum(), GAIN)
    with pytest.raises(BadInput, match="`norm` is 'euclid'"):
        require_norm("euclid")
    with pytest.raises(Infeasible, match="margin lies below the Lipschitz constant"):
        disturbance_gain(pendulum(50.0, disturbed=True), GAIN)
    with pytest.raises(NotCertified, match="No L2 gain"):
        disturbance_bound(pendulum(50.0, disturbed=True), GAIN)
    with pytest.raises(Infeasible, match="lower `epsilon`"):
        least_disturbance_gain(pendulum(1.0, disturbed=True), 100.0, POINT_THREE)
