"""Static plants compare by content; sample times and first guesses are checked."""

import jax.numpy as jnp
import numpy as np
import pytest

from luenberger.core import BadInput
from luenberger.observers.plant import Fixed, sample_time, state_vector
from luenberger.systems.discretize import discretize, one_step
from observers.plants import car, pendulum, two_mass


def test_equal_plants_are_one_value() -> None:
    assert Fixed(car()) == Fixed(car())
    assert hash(Fixed(car())) == hash(Fixed(car()))
    assert Fixed(one_step(car(), 0.1)) == Fixed(one_step(car(), 0.1))


def test_any_difference_in_numbers_names_or_functions_counts() -> None:
    fixed = Fixed(two_mass())
    assert fixed != Fixed(two_mass().replace(B=[[0], [0], [2.0 + 4e-16], [0]]))
    assert fixed != Fixed(two_mass().replace(states=("a", "b", "c", "d")))
    assert Fixed(one_step(car(), 0.1)) != Fixed(one_step(car(), 0.1, "exact"))
    # Two lambdas are two functions, whatever they compute.
    assert Fixed(pendulum()) != Fixed(pendulum())
    assert fixed != "two mass"
    assert "two mass" in repr(fixed)


def test_cast_changes_the_precision_of_numbers_only() -> None:
    plant = Fixed(car()).cast(np.float32)
    assert {np.asarray(c).dtype for _, c in plant.A} == {np.dtype("float32")}
    assert plant.states == ("vy", "yaw_rate")


def test_sample_time_comes_from_the_plant_or_the_caller() -> None:
    assert sample_time(two_mass(), 0.1) == 0.1
    assert sample_time(discretize(two_mass(), 0.1), None) == 0.1
    for plant, dt, message in (
        (two_mass(), None, "continuous and `dt` is not given"),
        (two_mass(), float("nan"), "`dt` is nan; a positive step"),
        (discretize(two_mass(), 0.1), 0.2, r"`dt` is 0.2 s but .* with dt = 0.1 s"),
    ):
        with pytest.raises(BadInput, match=message):
            sample_time(plant, dt)


def test_first_guess_keeps_float32_and_lifts_integers() -> None:
    assert state_vector([1, 2], 2).dtype == jnp.float64
    assert state_vector(np.ones(2, np.float32), 2).dtype == jnp.float32
    with pytest.raises(BadInput, match=r"`x0` has shape \(3,\) but the plant has 2 states"):
        state_vector(np.zeros(3), 2)
