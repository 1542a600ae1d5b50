"""Zonotopes against the points they are made of."""

from itertools import product

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial import ConvexHull

from luenberger.core import BadInput
from luenberger.sets import Interval, Zonotope

generator = np.random.default_rng(2)


def drawn(n: int, p: int) -> Zonotope:
    return Zonotope.of(generator.normal(size=n), generator.normal(size=(n, p)))


def points(z: Zonotope) -> np.ndarray:
    signs = np.array(list(product([-1.0, 1.0], repeat=z.generators.shape[1])))
    return np.asarray(z.center) + signs @ np.asarray(z.generators).T


@pytest.mark.parametrize(("n", "p"), [(2, 3), (2, 8), (3, 6)])
def test_volume_hull_and_support_of_all_points(n: int, p: int) -> None:
    z = drawn(n, p)
    cloud = points(z)
    assert z.volume() == pytest.approx(ConvexHull(cloud).volume, rel=1e-9)
    np.testing.assert_allclose(z.interval().lower, cloud.min(axis=0), atol=1e-12)
    np.testing.assert_allclose(z.interval().upper, cloud.max(axis=0), atol=1e-12)
    direction = generator.normal(size=n)
    assert float(z.support(direction)) == pytest.approx((cloud @ direction).max(), abs=1e-12)


def test_planar_vertices_are_those_of_the_hull() -> None:
    z = drawn(2, 6)
    corners = z.vertices()
    assert corners.shape == (12, 2)
    assert ConvexHull(corners).volume == pytest.approx(z.volume(), rel=1e-9)
    assert len(ConvexHull(corners).vertices) == 12
    with pytest.raises(BadInput, match="dimension 3"):
        drawn(3, 4).vertices()


def test_maps_and_sums_are_exact() -> None:
    one, two, M = drawn(2, 3), drawn(2, 2), generator.normal(size=(2, 2))
    mapped = M @ one + two + np.array([1.0, -1.0])
    cloud = (points(one) @ M.T)[:, None] + points(two)[None] + [1.0, -1.0]
    np.testing.assert_allclose(mapped.interval().upper, cloud.reshape(-1, 2).max(axis=0), atol=1e-12)
    assert mapped.volume() == pytest.approx(ConvexHull(cloud.reshape(-1, 2)).volume, rel=1e-9)
    assert mapped.order == 2.5


def test_containment_by_scaling() -> None:
    z = drawn(3, 7)
    direction = generator.normal(size=3)
    b = np.sign(direction @ np.asarray(z.generators))
    surface = np.asarray(z.generators) @ b
    # A support point lies on the boundary: the scale is one, and moves with the point.
    for share in (0.3, 1.0, 1.7):
        assert z.depth(np.asarray(z.center) + share * surface) == pytest.approx(share, abs=1e-7)
    assert z.contains(np.asarray(z.center) + 0.999 * surface)
    assert not z.contains(np.asarray(z.center) + 1.001 * surface)


def test_a_flat_set_holds_nothing_beside_itself() -> None:
    line = Zonotope.of([0.0, 0.0], [[1.0], [1.0]])
    assert line.contains([0.5, 0.5])
    assert not line.contains([0.5, 0.4])
    assert line.volume() == 0.0


def test_states_of_small_numbers_do_not_drown_beside_large_ones() -> None:
    box = Zonotope.of([0.0, 0.0, 0.0], np.diag([1.0, 1e-12, 0.0]))
    assert box.contains([1.0, 1e-12, 0.0])
    assert not box.contains([0.0, 5e-12, 0.0])
    assert not box.contains([0.0, 0.0, 1e-15])
    assert box.depth([0.0, 5e-12, 0.0]) == pytest.approx(5.0, rel=1e-6)


def test_points_and_maps_of_another_dimension_are_refused() -> None:
    square = Zonotope.of([0.0, 0.0], np.eye(2))
    with pytest.raises(BadInput, match=r"`point` has shape \(3,\); \(2,\) is needed"):
        square.contains([0.0, 0.0, 0.0])
    with pytest.raises(BadInput, match=r"dimension 2 has no image under a matrix of shape \(2, 3\)"):
        np.ones((2, 3)) @ square


def test_box_there_and_back() -> None:
    box = Interval.of([-1.0, 2.0], [3.0, 2.5])
    back = Zonotope.from_interval(box).interval()
    np.testing.assert_allclose(back.lower, box.lower)
    np.testing.assert_allclose(back.upper, box.upper)


def test_passes_through_jit_and_vmap() -> None:
    z, M = drawn(2, 5), jnp.asarray(generator.normal(size=(4, 2, 2)))
    hulls = jax.jit(jax.vmap(lambda m: (m @ z).reduce(3).interval()))(M)
    np.testing.assert_allclose(hulls.upper[1], (np.asarray(M[1]) @ z).reduce(3).interval().upper, rtol=1e-12)


@pytest.mark.parametrize(
    ("center", "generators"), [([0.0], [[1.0], [1.0]]), ([[0.0]], [[1.0]]), ([np.nan], [[1.0]]), ([0.0], [1.0])]
)
def test_shapes_that_do_not_belong_together_are_refused(center: object, generators: object) -> None:
    with pytest.raises(BadInput):
        Zonotope.of(center, generators)
