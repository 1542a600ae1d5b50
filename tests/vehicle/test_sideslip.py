"""Sideslip from either pair of states, and back."""

import jax
import numpy as np
import pytest

from luenberger.vehicle import (
    carmaker_car,
    lateral_speed_from_front_slip,
    lateral_speed_from_rear_slip,
    sideslip_from_lateral_speed,
    sideslip_from_rear_slip,
    slip_angles,
)

DRAW = np.random.default_rng(2)
VY, R, VX, DELTA = (DRAW.uniform(*ends, 40) for ends in ((-3, 3), (-1, 1), (5, 40), (-0.3, 0.3)))


def test_states_go_to_slip_angles_and_back() -> None:
    front, rear = slip_angles(VY, R, VX, DELTA, carmaker_car)
    # Speeds near 3 m/s through a division and a product by up to 40 m/s.
    np.testing.assert_allclose(lateral_speed_from_rear_slip(rear, VX, R, carmaker_car), VY, atol=1e-14)
    np.testing.assert_allclose(lateral_speed_from_front_slip(front, VX, R, DELTA, carmaker_car), VY, atol=1e-13)
    beta = np.arctan2(VY, VX)
    np.testing.assert_allclose(sideslip_from_rear_slip(rear, VX, R, carmaker_car), beta, atol=1e-15)
    np.testing.assert_allclose(sideslip_from_lateral_speed(VY, VX), beta, atol=1e-15)


def test_a_car_that_rolls_without_slip_drifts_with_its_rear_axle() -> None:
    # No rear slip: the velocity at the rear axle points ahead, so vy = b r.
    assert float(lateral_speed_from_rear_slip(0.0, 10.0, 0.2, carmaker_car)) == pytest.approx(1.602 * 0.2)


def test_steering_left_at_rest_slips_the_front_tyre_to_the_left() -> None:
    front, rear = slip_angles(0.0, 0.0, 10.0, 0.05, carmaker_car)
    assert (float(front), float(rear)) == (0.05, 0.0)


def test_they_run_under_jax() -> None:
    batched = jax.jit(jax.vmap(lambda a, v, r: sideslip_from_rear_slip(a, v, r, carmaker_car)))
    np.testing.assert_allclose(
        batched(np.zeros(3), np.full(3, 10.0), np.array([0.0, 0.1, 0.2])),
        np.arctan(1.602 * np.array([0.0, 0.01, 0.02])),
    )
