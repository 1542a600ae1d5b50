"""What a plant leaves out of a drive: none for a car that is the plant, and as much as was put there for others."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import linprog

from luenberger.core import Signal, Trajectory
from luenberger.experiment.gust_drive import Drive
from luenberger.experiment.gust_entrants import local_schedule
from luenberger.experiment.gust_mismatch import across_gust, along_gust
from luenberger.experiment.gust_runs import driven
from luenberger.experiment.gust_specification import GustSpecification
from luenberger.methods import UnknownInputGain
from luenberger.synthesize import synthesize
from luenberger.systems import Switched, System
from luenberger.systems.uncertainty import Uncertain

SPEC = GustSpecification("double_track", samples=80, runs=2, stiffness_share=0.05)


def trajectory(states: np.ndarray, road: Drive) -> Trajectory:
    signals = {"lateral_speed": states[:, 0], "yaw_rate": states[:, 1], "steering": road.steering}
    units = {"lateral_speed": "m/s", "yaw_rate": "rad/s", "steering": "rad"}
    return Trajectory(road.time, [Signal(n, units[n], v) for n, v in signals.items()], "car", "simulation")


@pytest.fixture(scope="module")
def drive() -> tuple[System, Drive, np.ndarray, np.ndarray]:
    """Plant, road, schedule, and states of many cars, vertices of the stiffness among them, (runs, nt, 2)."""
    plant, road = SPEC.scheduled(), SPEC.road()
    schedule = local_schedule(road.speed)
    design = synthesize(plant, UnknownInputGain(fade=0.4))
    found = driven(
        Switched.of(plant), design.gains, design.decoupling, road, schedule, SPEC.unknown(), SPEC.initial_half_width
    )
    return plant, road, schedule, found.states


def test_a_car_that_is_the_plant_has_no_mismatch(drive: tuple[System, Drive, np.ndarray, np.ndarray]) -> None:
    plant, road, schedule, states = drive
    for x in states:
        truth = trajectory(x, road)
        # Vertices use all that the factors can do, but for rounding.
        assert across_gust(plant, road, truth, schedule).max() < 1e-12
        assert along_gust(plant, road, truth, schedule, 1e-12).max() < 1e-6


def test_a_car_that_stands_still_and_errs_in_nothing_is_moved_by_gust_alone(
    drive: tuple[System, Drive, np.ndarray, np.ndarray],
) -> None:
    plant, road, schedule, _ = drive
    calm = replace(road, steering=0 * road.steering, gust=0 * road.gust)
    still = trajectory(np.zeros((len(road.time), 2)), calm)
    assert not along_gust(plant, calm, still, schedule, 0.0).any()


def test_more_gust_is_seen_along_the_gust_alone(drive: tuple[System, Drive, np.ndarray, np.ndarray]) -> None:
    _, road, schedule, states = drive
    certain = replace(SPEC, stiffness_share=0.0).scheduled()
    # Without uncertain factors a step has one explanation.
    A, B, E = (lambda k, m=m: np.asarray(certain.at(m, schedule[k])) for m in "ABE")
    x = [states[0, 0]]
    for k in range(len(road.time) - 1):
        x.append(A(k) @ x[-1] + B(k)[:, 0] * (road.steering[k] + 0.002) + E(k)[:, 0] * (road.gust[k] - 300.0))
    truth = trajectory(np.array(x), road)
    np.testing.assert_allclose(across_gust(certain, road, truth, schedule), 0.002, rtol=1e-6)
    # Steering is known to err by 0.002; what is left is the gust.
    np.testing.assert_allclose(along_gust(certain, road, truth, schedule, 0.002 * (1 + 1e-9)), 300.0, rtol=1e-4)


def test_the_gust_that_is_needed_is_that_of_a_linear_programme(
    drive: tuple[System, Drive, np.ndarray, np.ndarray],
) -> None:
    plant, road, schedule, states = drive
    pushed = states[0] + np.random.default_rng(1).normal(0.0, 0.003, states[0].shape)
    truth = trajectory(pushed, road)
    error = 1.05 * across_gust(plant, road, truth, schedule).max()
    found = along_gust(plant, road, truth, schedule, error)
    assert found.max() > 100
    uncertain = Uncertain.of(plant)
    for k in range(0, len(found), 7):
        A, B, E = (np.asarray(uncertain.nominal.at(m, schedule[k]), dtype=float) for m in "ABE")
        left = pushed[k + 1] - A @ pushed[k] - B[:, 0] * road.steering[k] - E[:, 0] * road.gust[k]
        at = {"speed": schedule[k, 0], "inverse_speed": schedule[k, 1]}
        rows = np.asarray(uncertain.rows({n: at[n] for n in uncertain.rows.names}), dtype=float)
        sides = uncertain.directions * (rows @ [*pushed[k], road.steering[k], road.gust[k]])
        # In kilonewtons and hundredfold states, so that the solver's tolerances mean something.
        M = 100 * np.column_stack([sides, B[:, 0] * error, 1e3 * E[:, 0], -1e3 * E[:, 0]])
        best = linprog([0, 0, 0, 1, 1], A_eq=M, b_eq=100 * left, bounds=[(-1, 1)] * 3 + [(0, None)] * 2)
        assert found[k] == pytest.approx(1e3 * best.fun, abs=1e-2)
