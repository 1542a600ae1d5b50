"""Outer polytopes hold their points with few vertices; facets speak exactly of the hull of the vertices."""

import numpy as np
import pytest
from flint import fmpq
from scipy.spatial import ConvexHull

from luenberger.algebra.definiteness import exact
from luenberger.core import BadInput
from luenberger.systems.embedding_polytope import facets, outer_polytope


def inside(vertices: np.ndarray, point: np.ndarray) -> bool:
    return all(normal @ exact(point) <= offset for normal, offset in facets(vertices))


@pytest.mark.parametrize(("m", "limit"), [(2, 3), (2, 16), (3, 12), (4, 8), (5, 12)])
def test_points_are_held_at_a_distance_with_few_vertices(m: int, limit: int) -> None:
    points = np.random.default_rng(m).normal(size=(300, m))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    vertices = outer_polytope(points, limit, 0.01)
    assert m + 1 <= len(vertices) <= limit
    hull = ConvexHull(vertices)
    # The inflation is 0.01; 1e-6 allows for qhull and for vertices rounded to nine digits.
    assert (hull.equations[:, :-1] @ points.T + hull.equations[:, -1:]).max() <= -0.01 + 1e-6


def test_a_disc_takes_a_nearly_regular_polygon() -> None:
    angles = np.linspace(0, 2 * np.pi, 2000)
    vertices = outer_polytope(np.stack([np.cos(angles), np.sin(angles)], axis=1), 16, 1e-4)
    # The regular tangent polygon has 16 tan(pi/16) = 1.0131 pi; removal one by one is not quite regular.
    assert np.pi < ConvexHull(vertices).volume < 1.02 * np.pi


def test_a_triangle_stays_one() -> None:
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    weights = np.random.default_rng(0).dirichlet(np.ones(3), 500)
    vertices = outer_polytope(np.vstack([corners, weights @ corners]), 16, 1e-3)
    assert ConvexHull(vertices).volume == pytest.approx(0.5, rel=0.02)


def test_points_on_a_line_get_a_thin_polygon() -> None:
    t = np.linspace(-1, 1, 50)
    vertices = outer_polytope(np.stack([t, 0.5 * t], axis=1), 16, 1e-3)
    # The box around the points has area 2; inflation alone makes 0.0045, corners cut no finer than it the rest.
    assert ConvexHull(vertices).volume < 0.05


def test_facets_of_a_square_are_exact() -> None:
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    assert inside(square, np.array([1.0, 0.3]))
    assert not inside(square, np.array([np.nextafter(1.0, 2.0), 0.3]))


@pytest.mark.parametrize("m", [2, 3, 4])
def test_facets_agree_with_a_cube_whose_faces_are_cut_into_simplices(m: int) -> None:
    cube = np.array(np.meshgrid(*[[-1.0, 1.0]] * m)).reshape(m, -1).T
    generator = np.random.default_rng(m)
    for point in generator.uniform(-1.2, 1.2, (40, m)):
        assert inside(cube, point) == (abs(point).max() <= 1.0)


def test_facets_lie_in_the_hull_of_rounded_vertices() -> None:
    # Vertices of a turned cube are rounded, so that its faces are not flat: still nothing outside may be let in.
    turn = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
    cube = np.array(np.meshgrid(*[[-1.0, 1.0]] * 3)).reshape(3, -1).T @ turn
    assert inside(cube, 0.999 * cube[0])
    assert not inside(cube, 1.001 * cube[0])
    assert all(isinstance(offset, fmpq) for _, offset in facets(cube))


def test_flat_vertices_are_refused() -> None:
    with pytest.raises(BadInput, match="do not span the 2 Jacobian entries"):
        facets(np.array([[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]]))
