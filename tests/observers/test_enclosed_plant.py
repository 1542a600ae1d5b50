"""A plant written for an interval observer: entries, unknowns and ranges against values at random points."""

from typing import Any

import numpy as np
import pytest

from luenberger.algebra import Polynomial
from luenberger.core import BadInput
from luenberger.observers.enclosed_plant import Enclosed
from luenberger.systems import Parameter, System
from luenberger.vehicle import slip_angle_plant, wang_car

STIFFNESS, SCALE = ((60e3, 90e3), (35e3, 65e3)), ((-0.1, 0.1), (-0.2, 0.15))
ON = {"noise": True, "offset": True, "scheduling_error": True}
GAIN = Polynomial(("inverse_speed",), {(1,): np.array([[7.0], [-9.0]])})


def car(**options: Any) -> System:
    return slip_angle_plant(wang_car, (15 / 3.6, 150 / 3.6), (-8.0, 4.0), stiffness=STIFFNESS, **options)


def test_largest_entries_bound_the_loop_everywhere() -> None:
    plant, T = car(scale_error=SCALE), np.array([[1.0, 0.5], [-0.2, 2.0]])
    entries = Enclosed.of(plant, T, True, ON).largest_entries(GAIN)
    rng, Ti, reached = np.random.default_rng(0), np.linalg.inv(T), np.zeros((3, 3))
    for _ in range(500):
        s, a = rng.choice([3.6 / 150, 3.6 / 15]), rng.choice([-8.0, 4.0])
        true = {
            "inverse_speed": s,
            "acceleration": a,
            "front_stiffness": rng.choice(STIFFNESS[0]),
            "rear_stiffness": rng.choice(STIFFNESS[1]),
        }
        A, C = (np.asarray(plant.polynomial(letter)(true)) for letter in "AC")
        L = T @ np.asarray(GAIN({"inverse_speed": s * rng.choice([1 / 1.1, 1 / 0.9])}))
        whole = np.block([[T @ A @ Ti - L @ C @ Ti, L], [C @ A @ Ti, np.zeros((1, 1))]])
        reached = np.maximum(reached, np.abs(whole))
    assert np.all(reached <= entries * (1 + 1e-12))
    # Taken apart, true and read speed reach a little further than together.
    assert np.all(reached >= 0.7 * entries)


def test_unknowns_are_tyres_and_scheduling_read_with_error() -> None:
    enclosed = Enclosed.of(car(scale_error=SCALE), None, True, ON)
    assert {n for n, _ in enclosed.hidden} == {"front_stiffness", "rear_stiffness", "inverse_speed", "acceleration"}
    exact = Enclosed.of(car(scale_error=SCALE), None, True, ON | {"scheduling_error": False})
    assert {n for n, _ in exact.hidden} == {"front_stiffness", "rear_stiffness"}


def test_outputs_of_random_states_lie_in_their_range() -> None:
    box = [Parameter("p", 0.5, 1.5, error=0.1, factor=(0.9, 1.1))]
    C = Polynomial(("p",), {(0,): np.array([[1.0, 0.0]]), (1,): np.array([[0.5, -0.2]])})
    plant = System.lpv(-np.eye(2), [[1.0], [0.0]], C, [[0.3]], parameters=box, noise_bound=[0.01])
    enclosed = Enclosed.of(plant, None, False, ON)
    rng, lower, upper = np.random.default_rng(0), np.array([-1.0, 0.5]), np.array([0.5, 2.0])
    for _ in range(100):
        p, u, x = rng.uniform(0.5, 1.5), rng.normal(size=1), rng.uniform(lower, upper)
        y = np.asarray(C({"p": p})) @ x + 0.3 * u + rng.uniform(-0.01, 0.01)
        low, high = enclosed.outputs(lower, upper, u, np.array([p * rng.uniform(0.9, 1.1) + rng.uniform(-0.1, 0.1)]))
        assert low[0] <= y[0] <= high[0]


def test_singular_coordinates_are_refused() -> None:
    with pytest.raises(BadInput, match="no inverse"):
        Enclosed.of(car(), np.ones((2, 2)), True, ON)
