"""Runs of the plant are those of a car written by hand; what is said of their bounds; a broken assumption shows."""

from dataclasses import replace

import numpy as np
import pytest

from luenberger.algebra import Polynomial
from luenberger.experiment.gust_entrants import local_schedule
from luenberger.experiment.gust_runs import VARIANTS, Cars, Enclosure, driven, enclosed
from luenberger.experiment.gust_specification import GustSpecification
from luenberger.experiment.published.ifqir_car import SPEEDS, STEP, Axles
from luenberger.experiment.published.ifqir_drive import cars
from luenberger.methods import UnknownInputGain
from luenberger.observers.unknown_input import UnknownInputObserver
from luenberger.synthesize import synthesize
from luenberger.systems import Switched

SPEC = GustSpecification("switched", samples=120, runs=6)


def by_hand() -> tuple[list[np.ndarray], list[np.ndarray]]:
    modes = [Axles.at(v).decoupled(STEP) for v in SPEEDS]
    return [m.K for m in modes], [m.H for m in modes]


def observer(plant_of: GustSpecification, variant: str) -> UnknownInputObserver:
    K, H = by_hand()
    uncertainty, reuse, closed = VARIANTS[variant]
    return UnknownInputObserver(
        plant_of.switched(), K, H, uncertainty=uncertainty, reuse_noise=reuse, closed_loop=closed, **plant_of.options
    )


def runs(spec: GustSpecification) -> Cars:
    K, H = ([Polynomial.constant(M) for M in part] for part in by_hand())
    road = spec.road()
    return driven(
        spec.switched(),
        K,
        H,
        road,
        road.speed[:, None],
        spec.unknown(),
        spec.initial_half_width,
    )


@pytest.mark.parametrize("varying", [False, True])
def test_runs_of_the_plant_are_those_of_a_car_written_by_hand(varying: bool) -> None:
    spec = GustSpecification("switched", samples=200, runs=6, steering_error=0.01)
    plant = Switched.of(spec.scheduled()) if varying else spec.switched()
    design = synthesize(plant.first if varying else plant, UnknownInputGain(fade=0.4))
    road, unknown = spec.road(), spec.unknown()
    schedule = local_schedule(road.speed) if varying else road.speed[:, None]
    ours = driven(plant, design.gains, design.decoupling, road, schedule, unknown, spec.initial_half_width)
    theirs = cars(road, unknown, varying=varying, steering_error=0.01)
    # Two hundred steps of a stable car, one rounding each.
    for name in ("states", "outputs", "steering"):
        np.testing.assert_allclose(getattr(ours, name), getattr(theirs, name), rtol=0, atol=1e-12)


def test_stiffness_beyond_its_bounds_breaks_the_enclosure() -> None:
    bold = replace(SPEC, stiffness_share=0.3)
    found, road = runs(bold), bold.road()
    bounds = enclosed(observer(SPEC, "c4"), found, road.speed[:, None])
    assert bounds.left(found.states).any()


def test_what_is_said_of_bounds_is_counted_by_hand() -> None:
    states = np.zeros((2, 3, 2))
    half = np.full((2, 3, 2), 0.5)
    bounds = Enclosure(states, -half, half)
    assert bounds.width == 1.0
    assert bounds.left(states).tolist() == [False, False]
    moved = states.copy()
    moved[1, 2, 1] = 0.6
    moved[0, 1, 0] = 0.4
    assert bounds.left(moved).tolist() == [False, True]
    assert bounds.reach(moved) == pytest.approx(0.8)


def test_the_schedule_is_the_speed_and_its_inverse() -> None:
    np.testing.assert_allclose(local_schedule(np.array([4.0, 5.0])), [[4.0, 0.25], [5.0, 0.2]])
