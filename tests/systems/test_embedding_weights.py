"""Weighted Lipschitz sets hold the Jacobians they were made for, and are no larger than plain ones."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from luenberger.core import NotAccepted
from luenberger.systems import Nonlinearity, System
from luenberger.systems.embedding_weights import WeightedNorm, lipschitz_plant


def function(z: Any, u: Any) -> jax.Array:
    return jnp.stack([100.0 * jnp.sin(z[0]) + 0.1 * z[1] ** 2])


BOUNDED = Nonlinearity.bounded(function, np.eye(2), jacobian=([[50.0, -0.2]], [[100.0, 0.2]]))


@pytest.mark.parametrize("weighted", [True, False])
def test_corners_of_the_box_lie_in_the_set(weighted: bool) -> None:
    norm = WeightedNorm.around(BOUNDED, weighted=weighted)
    for J in ([50.0, -0.2], [50.0, 0.2], [100.0, -0.2], [100.0, 0.2]):
        scaled = (np.array([J]) - norm.centre) / np.outer(norm.rows, norm.columns)
        assert np.linalg.norm(scaled, 2) <= norm.constant


def test_the_best_ellipse_around_a_box_has_half_pi_times_its_area() -> None:
    varying = np.ones((1, 2), dtype=bool)
    # Weights are rounded to four digits.
    assert WeightedNorm.around(BOUNDED).volume(varying) == pytest.approx(np.pi / 2 * 50.0 * 0.4, rel=1e-3)
    assert WeightedNorm.around(BOUNDED, weighted=False).volume(varying) > 50.0 * WeightedNorm.around(BOUNDED).volume(
        varying
    )


def test_the_scaled_plant_is_the_plant() -> None:
    plant = System.nonlinear([[0.0, 1.0], [-1.0, 0.0]], C=[[1.0, 0.0]], F=[[0.0], [1.0]], nonlinearity=BOUNDED)
    scaled = lipschitz_plant(plant)
    x, u = np.array([0.3, -0.4]), np.zeros(0)
    # Terms of size 30 cancel in part.
    np.testing.assert_allclose(scaled.dynamics(0.0, x, u), plant.dynamics(0.0, x, u), rtol=1e-12, atol=1e-12)
    with pytest.raises(NotAccepted, match="no nonlinearity"):
        lipschitz_plant(System.linear([[0.0]]))
