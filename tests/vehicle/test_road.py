"""Roads: values inside strips and patches, order of overlaps, smooth edges, refusals."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from luenberger.core import BadInput
from luenberger.vehicle.road import Road


def test_a_uniform_road_is_the_same_everywhere() -> None:
    road = Road.uniform(0.7, 0.9)
    x, y = jnp.array([-1e4, 0.0, 3.0]), jnp.array([5.0, 0.0, 1e5])
    np.testing.assert_array_equal(road.friction(x, y), np.full(3, 0.7))
    np.testing.assert_array_equal(road.stiffness_factor(x, y), np.full(3, 0.9))


def test_lanes_hold_their_values_and_meet_in_the_middle() -> None:
    road = Road.lanes([-1.0, 2.0], [0.3, 0.9, 0.6], [0.5, 1.0, 0.8], transition=0.4)
    y = jnp.array([-8.0, -1.21, -1.0, -0.79, 1.0, 2.0, 2.2, 50.0])
    np.testing.assert_allclose(road.friction(0.0, y), [0.3, 0.3, 0.6, 0.9, 0.9, 0.75, 0.6, 0.6], rtol=1e-14)
    np.testing.assert_allclose(road.stiffness_factor(9.0, y), [0.5, 0.5, 0.75, 1.0, 1.0, 0.9, 0.8, 0.8], rtol=1e-14)


def test_stretches_change_along_the_way() -> None:
    road = Road.lanes([30.0], [0.9, 0.2], along="x", transition=2.0)
    np.testing.assert_allclose(
        road.friction(jnp.array([0.0, 29.0, 30.0, 31.0]), 4.0), [0.9, 0.9, 0.55, 0.2], rtol=1e-14
    )
    np.testing.assert_array_equal(road.stiffness_factor(jnp.array([0.0, 60.0]), 0.0), np.ones(2))


def test_later_patches_lie_on_earlier_ones() -> None:
    road = Road.patches(0.9, [(0.0, 10.0, 0.0, 4.0), (5.0, 20.0, 0.0, 4.0)], [0.5, 0.1], [1.0, 0.7], transition=0.1)
    x, y = jnp.array([-3.0, 2.0, 7.0, 15.0, 7.0]), jnp.array([2.0, 2.0, 2.0, 2.0, 6.0])
    np.testing.assert_allclose(road.friction(x, y), [0.9, 0.5, 0.1, 0.1, 0.9], rtol=1e-14)
    np.testing.assert_allclose(road.stiffness_factor(x, y), [1.0, 1.0, 0.7, 0.7, 1.0], rtol=1e-14)


def test_edges_are_smooth_and_never_overshoot() -> None:
    road = Road.lanes([0.0], [0.2, 0.8], transition=1.0)
    y = jnp.linspace(-1.0, 1.0, 401)
    values = np.asarray(road.friction(0.0, y))
    slopes = np.asarray(jax.vmap(jax.grad(lambda s: road.friction(0.0, s)))(y))
    assert (np.diff(values) >= 0).all()
    assert values.min() == 0.2
    assert values.max() == pytest.approx(0.8, abs=1e-15)
    # Largest slope of 3 z^2 - 2 z^3 is 3/2, and neighbouring slopes differ by its curvature 6 times the step.
    assert slopes.max() == pytest.approx(1.5 * 0.6, rel=1e-12)
    assert np.abs(np.diff(slopes)).max() < 6 * 0.6 * 0.005 * 1.01


def test_roads_can_be_varied_under_vmap() -> None:
    def friction(value: Any) -> Any:
        road = Road.lanes([0.0], [0.2, 0.8])
        return Road(road.regions, jnp.stack([value, 2 * value]), road.stiffness_factors, 0.5).friction(0.0, 3.0)

    np.testing.assert_allclose(jax.vmap(friction)(jnp.array([0.1, 0.4])), [0.2, 0.8], rtol=1e-15)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Road.uniform(0.0), "`friction` holds 0"),
        (lambda: Road.uniform(float("nan")), "`frictions` holds nan"),
        (lambda: Road.lanes([0.0, 1.0], [0.5, 0.6]), "2 regions beside the ground need 3 frictions"),
        (lambda: Road.lanes([1.0, 0.0], [0.5, 0.6, 0.7]), "`edges` is .* increase"),
        (lambda: Road.lanes([1.0], [0.5, 0.6], along="z"), "`along` is `z`"),
        (lambda: Road.lanes([1.0], [0.5, 0.6], transition=0.0), "`transition` holds 0"),
        (lambda: Road.lanes([1.0], [0.5, 0.6], [1.0, -1.0]), "`stiffness_factor` holds -1"),
        (lambda: Road.patches(0.9, [(3.0, 1.0, 0.0, 1.0)], [0.2]), "Region 0 spans"),
    ],
)
def test_what_is_no_road_is_refused(make: Any, message: str) -> None:
    with pytest.raises(BadInput, match=message):
        make()
