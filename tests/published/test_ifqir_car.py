"""The car written down by hand equals the library's plant, and its fixed eigenvalues are the closed form."""

import numpy as np
import pytest

from luenberger.experiment.published.ifqir_car import (
    NOISE,
    SPEEDS,
    STEP,
    Axles,
    fixed_rate,
    scheduled,
    switched,
)
from luenberger.experiment.published.ifqir_drive import cars, choices, drive
from luenberger.experiment.published.ifqir_example import admissible_steps, held_zero
from luenberger.vehicle.cars import gust_car


def test_fixed_eigenvalues() -> None:
    # Four decimals are known.
    assert [fixed_rate(v) for v in SPEEDS] == pytest.approx([-16.0784, -10.0861, -7.5716], abs=1e-4)
    zeros = [Axles.at(v).decoupled(STEP).zero for v in SPEEDS]
    assert zeros == pytest.approx([0.0353, 0.3948, 0.5457], abs=1e-4)
    assert admissible_steps() == pytest.approx((0.0387, 0.1062), abs=1e-4)


def test_decoupling_of_the_car() -> None:
    for v in SPEEDS:
        seen, (A, _, E) = Axles.at(v).decoupled(STEP), Axles.at(v).sampled(STEP)
        assert seen.H[:, 0] == pytest.approx([-25 / 6, -1.0], abs=1e-12)
        assert np.allclose(seen.P, [[1.0, -25 / 6], [0.0, 0.0]], atol=1e-12)
        # The gust does not reach the error, and K drops out of what the noise does.
        assert np.abs(seen.P @ E).max() < 1e-15
        assert np.abs(seen.N @ seen.H - seen.K - seen.P @ A @ seen.H).max() < 1e-12
        assert np.allclose(seen.N, np.diag([seen.zero, 0.0]), atol=1e-15)


def test_the_plant_of_the_library_is_the_same_car() -> None:
    plant = scheduled()
    for v in SPEEDS:
        frozen = plant.freeze(
            speed=v,
            inverse_speed=1 / v,
            front_stiffness=gust_car.front_stiffness,
            rear_stiffness=gust_car.rear_stiffness,
        )
        for letter, matrix in zip("ABE", Axles.at(v).sampled(STEP), strict=True):
            assert np.allclose(np.asarray(frozen.at(letter)), matrix, atol=1e-14)
    assert [int(switched().mode([v])) for v in SPEEDS] == [0, 1, 2]


def test_exact_sampling_at_the_printed_step_is_harmless() -> None:
    zeros = [held_zero(v, 0.6) for v in SPEEDS]
    assert max(abs(z) for z in zeros) < 0.03
    # Euler's rule is first order, so both meet for short steps.
    assert held_zero(SPEEDS[0], 1e-4) == pytest.approx(1 + 1e-4 * fixed_rate(SPEEDS[0]), abs=1e-5)


def test_the_drive_passes_all_modes_inside_the_admissible_states() -> None:
    road = drive()
    assert np.bincount(road.mode).min() > 0.2 * len(road.time)
    assert road.speed.min() >= 6.0
    assert road.speed.max() < 19.899
    found = cars(road, choices())
    assert (np.abs(found.states).max(axis=(0, 1)) < [0.8, 0.3]).all()
    assert found.states.shape == (52, len(road.time), 2)
    # Outputs are the yaw rate and nothing but bounded noise.
    assert np.abs(found.outputs[..., 0] - found.states[..., 1]).max() <= NOISE + 1e-15


def test_the_continuous_car_is_near_the_sampled_one_for_a_calm_drive() -> None:
    road = drive(60)
    unknown = choices(60, random=2, adversaries=False)
    euler, exact = (cars(road, unknown, exact=e).states for e in (False, True))
    # First order in the step; 0.1 m/s is a third of the largest lateral speed.
    assert 1e-4 < np.abs(euler - exact)[..., 0].max() < 0.1
