"""Lipschitz design from the Riccati equation."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from lipschitz_plants import POINT_THREE, integrator, pendulum, random_plant
from luenberger.core import BadInput, Infeasible, NotAccepted, Outcome
from luenberger.lmi import decay_storage
from luenberger.methods.lipschitz_bracket import largest_epsilon
from luenberger.methods.lipschitz_margin import margin_at, stability_margin
from luenberger.methods.lipschitz_plant import LumpedPlant
from luenberger.methods.lipschitz_riccati import LipschitzRiccati, decay_rate, feasible_epsilon, storage_problem
from luenberger.synthesize import synthesize
from luenberger.systems import Nonlinearity, System


def test_both_routes_give_one_gain() -> None:
    riccati, sdp = (synthesize(pendulum(), LipschitzRiccati(0.05, POINT_THREE, route)) for route in ("riccati", "sdp"))
    assert riccati.certificate.outcome is sdp.certificate.outcome is Outcome.PROVED
    # An error t in the programme moves the gain by about its square root at worst.
    np.testing.assert_allclose(sdp.gain_at(), riccati.gain_at(), rtol=2e-3)
    assert riccati.statistics["residual"] < 1e-10
    assert sdp.statistics["smallest_eigenvalue"] == pytest.approx(riccati.statistics["smallest_eigenvalue"], rel=1e-5)


def test_claims_state_decay_and_gain() -> None:
    design = synthesize(pendulum(), LipschitzRiccati(0.05, POINT_THREE))
    kinds = {c.kind: c.level for c in design.certificate.claims}
    assert kinds["decay"] > 0.5
    assert kinds["gain_bound"] == pytest.approx(np.linalg.norm(design.gain_at(), 2), rel=1e-5)
    assert design.with_gain(-design.gain_at()).certificate.outcome is not Outcome.PROVED


def test_decay_rate_is_the_largest_that_a_storage_shows() -> None:
    plant = pendulum()
    design = synthesize(plant, LipschitzRiccati(0.05, POINT_THREE))
    best = decay_rate(plant, design.gain_at())
    assert decay_storage(plant, design.gain, 0.99 * best) is not None
    found = decay_storage(plant, design.gain, 1.01 * best)
    assert found is None or np.linalg.eigvalsh(found[0])[0] < 1e-9


def test_jacobian_box_is_covered_too() -> None:
    plant = pendulum()
    assert plant.nonlinearity is not None
    boxed = Nonlinearity.bounded(plant.nonlinearity.function, [[1.0, 0.0]], jacobian=([[-1.0]], [[1.0]]))
    assert (
        synthesize(plant.replace(nonlinearity=boxed), LipschitzRiccati(0.05, POINT_THREE)).certificate.outcome
        is Outcome.PROVED
    )


def test_infeasible_epsilon_names_the_nearest() -> None:
    plant = pendulum()
    bracket = largest_epsilon(plant, None, POINT_THREE)
    assert bracket.infeasible is not None
    with pytest.raises(Infeasible, match="epsilon") as refusal:
        synthesize(plant, LipschitzRiccati(1.5 * bracket.infeasible, POINT_THREE))
    # The nearest level is found to a relative 1e-4.
    assert refusal.value.nearest == pytest.approx(bracket.feasible, rel=2e-4)
    assert refusal.value.nearest <= bracket.infeasible
    assert refusal.value.block == "stability"
    synthesize(plant, LipschitzRiccati(refusal.value.nearest, POINT_THREE))


def test_no_coordinates_no_design() -> None:
    with pytest.raises(Infeasible, match="StructuredLipschitz"):
        synthesize(pendulum(5.0), LipschitzRiccati(0.1))


def test_feasible_epsilon_of_a_stable_plant_is_the_ceiling() -> None:
    assert feasible_epsilon(LumpedPlant.of(System.linear([[-1.0]], C=[[1.0]]))) == pytest.approx(1e6)


def test_problem_maximises_the_smallest_eigenvalue() -> None:
    problem, P = storage_problem(LumpedPlant.of(pendulum(), POINT_THREE), 0.05)
    assert problem.variables["P"] is P
    assert {b.name for b in problem.blocks} == {"storage", "stability"}


def test_refusals() -> None:
    with pytest.raises(NotAccepted, match="no nonlinearity"):
        synthesize(integrator(), LipschitzRiccati(1.0))
    with pytest.raises(BadInput, match="positive finite"):
        synthesize(pendulum(), LipschitzRiccati(0.0))
    with pytest.raises(BadInput, match="unobservable mode"):
        synthesize(pendulum().replace(A=[[0.0, 0.0], [0.0, 0.1]]), LipschitzRiccati(0.1, POINT_THREE))
    with pytest.raises(NotAccepted, match="discrete"):
        synthesize(pendulum().replace(dt=0.1), LipschitzRiccati(0.1))


def test_options_compare_by_value() -> None:
    assert LipschitzRiccati(0.1, np.diag([1.0, 0.3])) == LipschitzRiccati(0.1, [[1.0, 0.0], [0.0, 0.3]])
    assert len({LipschitzRiccati(0.1, [1.0, 0.3]), LipschitzRiccati(0.1, POINT_THREE)}) == 1


@settings(max_examples=25)
@given(st.integers(0, 10_000))
def test_random_plants_are_proved_where_the_margin_allows(seed: int) -> None:
    plant = random_plant(seed, outputs=2)
    lumped = LumpedPlant.of(plant)
    # The nonlinearity is scaled to four fifths of what epsilon = 0.1 admits.
    margin = margin_at(plant, 0.1)
    assume(margin > 1e-2)
    plant = plant.replace(F=np.asarray(plant.at("F")) * 0.8 * margin / lumped.lipschitz)
    design = synthesize(plant, LipschitzRiccati(0.1))
    assert design.certificate.outcome is Outcome.PROVED
    assert stability_margin(plant, design.gain_at()) > LumpedPlant.of(plant).lipschitz
