"""The polytopic LPV design against plants whose answer is known by hand, and its refusals."""

import numpy as np
import pytest

from catalogue import saturating_car, scheduled_oscillator, slip_angle_car
from luenberger.algebra import Polynomial
from luenberger.core import BadInput, Infeasible, NotAccepted, Outcome
from luenberger.lmi import Bernstein, Vertices
from luenberger.methods import PolytopicLuenberger
from luenberger.synthesize import synthesize
from luenberger.systems import MatrixFunction, Parameter, System
from luenberger.vehicle import slip_angle_plant, wang_car


def integrator() -> System:
    return System.linear([[0.0]], C=[[1.0]])


@pytest.mark.parametrize("rate", [0.5, 2.0, 10.0])
def test_scalar_integrator_needs_exactly_the_rate(rate: float) -> None:
    design = synthesize(integrator(), PolytopicLuenberger(rate))
    # e' = -L e decays at L: the smallest gain is the rate; one percent of its square is given away.
    assert rate <= design.gain_at()[0, 0] <= rate * 1.006
    assert design.statistics["optimum"] == pytest.approx(rate**2, rel=1e-6)


def test_plant_that_is_fast_enough_gets_no_gain() -> None:
    design = synthesize(System.linear([[-3.0]], C=[[1.0]]), PolytopicLuenberger(1.0))
    # The squared bound may rise to the negligible 1e-4, no further.
    assert abs(design.gain_at()[0, 0]) < 0.011


def test_gain_is_scheduled_like_the_plant() -> None:
    scheduled = synthesize(scheduled_oscillator(), PolytopicLuenberger(0.5))
    assert set(scheduled.gain.names) == {"stiffness", "damping"}
    constant = synthesize(scheduled_oscillator(), PolytopicLuenberger(0.3, schedule="constant"))
    assert all(not any(exponents) for exponents, _ in constant.gain)


def test_scheduling_never_costs_gain() -> None:
    one = synthesize(scheduled_oscillator(), PolytopicLuenberger(0.4))
    other = synthesize(scheduled_oscillator(), PolytopicLuenberger(0.4, schedule="constant"))
    # The constant gain is one of the scheduled ones, so its optimum cannot be smaller.
    assert one.statistics["optimum"] <= other.statistics["optimum"] * (1 + 1e-6)


def test_relaxations_agree_where_all_is_affine() -> None:
    levels = [
        synthesize(scheduled_oscillator(), PolytopicLuenberger(0.5, relaxation=r)).statistics["optimum"]
        for r in (Bernstein(), Vertices(), Bernstein(2))
    ]
    assert max(levels) - min(levels) <= 1e-6 * max(levels)


def test_decay_on_a_grid_of_frozen_plants() -> None:
    system, design = slip_angle_car(), synthesize(slip_angle_car(), PolytopicLuenberger(3.0))
    for s in np.linspace(*system.scheduling_box["inverse_speed"], 7):
        for a in np.linspace(*system.scheduling_box["acceleration"], 7):
            r = np.array([s, a])
            closed = np.asarray(system.at("A", r)) - design.gain_at(inverse_speed=s, acceleration=a) @ np.asarray(
                system.at("C", r)
            )
            assert np.linalg.eigvals(closed).real.max() <= -3.0


def test_neutral_steer_car_has_a_mode_no_gain_moves() -> None:
    plant = slip_angle_plant(wang_car, (15 / 3.6, 150 / 3.6), (-8.0, 4.0))
    # (Cf + Cr)/(m vx) - |ax|/vx at 150 km/h and -8 m/s^2: 127500/800/41.67 - 8/41.67 = 3.633 1/s.
    with pytest.raises(BadInput, match=r"3\.63"):
        synthesize(plant, PolytopicLuenberger(3.7))
    assert synthesize(plant, PolytopicLuenberger(3.0)).certificate.outcome is Outcome.PROVED


def test_infeasible_names_the_nearest_decay() -> None:
    # Saturating tyres leave little slope at the edge of the slip box, so the car decays slowly whatever the gain.
    with pytest.raises(Infeasible, match=r"decay_rate = 2 1/s; the closest found was 0\.\d+ 1/s") as caught:
        synthesize(saturating_car(), PolytopicLuenberger(2.0))
    assert caught.value.nearest is not None
    assert (
        synthesize(saturating_car(), PolytopicLuenberger(0.9 * caught.value.nearest)).certificate.outcome
        is Outcome.PROVED
    )


def test_function_matrices_are_refused_by_name() -> None:
    A = MatrixFunction(lambda p: -np.eye(1) * p["r"], ("r",), (1, 1))
    with pytest.raises(NotAccepted, match="`A`"):
        synthesize(System.lpv(A, C=[[1.0]], parameters=[Parameter("r", 1.0, 2.0)]), PolytopicLuenberger())


def test_hidden_parameters_are_refused_by_name() -> None:
    A = Polynomial.affine(-np.eye(1), q=np.eye(1))
    plant = System.lpv(A, C=[[1.0]], parameters=[Parameter("q", -0.1, 0.1, measured=False)])
    with pytest.raises(NotAccepted, match="'q'"):
        synthesize(plant, PolytopicLuenberger())
