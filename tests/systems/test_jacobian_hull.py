"""A hull is proved around every Jacobian, close to the true set, and a shrunk one is refused."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from luenberger.core import BadInput, NotCertified
from luenberger.systems import Nonlinearity
from luenberger.systems.jacobian_hull import prove_hull, proved_hull


def van_der_pol(z: Any, u: Any) -> jax.Array:
    return jnp.stack([(1.0 - z[0] ** 2) * z[1]])


def box(r: float, n: int = 2) -> tuple[np.ndarray, np.ndarray]:
    return np.full(n, -r), np.full(n, r)


def vertices_of(f: Nonlinearity) -> np.ndarray:
    assert f.jacobian_vertices is not None
    return f.jacobian_vertices


def assert_inside(points: np.ndarray, vertices: np.ndarray) -> None:
    """Points (n, m) in the hull of vertices (nk, m), both scaled to the range of the vertices."""
    low, span = vertices.min(axis=0), np.ptp(vertices, axis=0)
    hull = ConvexHull((vertices - low) / span)
    # 1e-12: rounding of qhull's planes in coordinates of size one.
    assert (hull.equations[:, :-1] @ ((points - low) / span).T + hull.equations[:, -1:] <= 1e-12).all()


def test_the_hull_of_van_der_pol_has_the_true_area_within_a_percent() -> None:
    r = 5.0
    f = proved_hull(van_der_pol, np.eye(2), box(r), vertices=16)
    assert f.bound_status == "proved"
    V = vertices_of(f)[:, 0]
    assert len(V) <= 16
    # The set {|g1| <= 2 r sqrt(1 - g2), 1 - r^2 <= g2 <= 1} has the area 8/3 r^4; 16 tangents and the inflation of a
    # thousandth add about half a percent.
    assert 1.0 < ConvexHull(V).volume / (8 / 3 * r**4) < 1.01
    x = np.stack(np.meshgrid(np.linspace(-r, r, 201), np.linspace(-r, r, 201)), axis=-1).reshape(-1, 2)
    assert_inside(np.stack([-2 * x[:, 0] * x[:, 1], 1 - x[:, 0] ** 2], axis=1), V)


def test_a_hull_shrunk_by_a_twentieth_is_refuted_with_a_point_outside() -> None:
    V = vertices_of(proved_hull(van_der_pol, np.eye(2), box(5.0), vertices=6, inflation=0.02))
    assert prove_hull(van_der_pol, V, np.eye(2), box(5.0)).bound_status == "proved"
    middle = V.mean(axis=0)
    with pytest.raises(NotCertified, match="lie outside the hull"):
        prove_hull(van_der_pol, middle + 0.95 * (V - middle), np.eye(2), box(5.0))


def test_a_hull_that_cannot_be_proved_with_the_pieces_given_says_what_is_open() -> None:
    with pytest.raises(NotCertified, match=r"still open on .* % of the domain after 20 pieces; raise `inflation`"):
        proved_hull(van_der_pol, np.eye(2), box(5.0), max_pieces=20)


def test_one_varying_entry_gives_its_interval() -> None:
    f = proved_hull(lambda z, u: jnp.sin(z[:1]), np.eye(2)[:1], box(1.0))
    V = vertices_of(f)
    assert V.shape == (2, 1, 1)
    assert V.min() <= np.cos(1.0)
    # The entrywise enclosure overshoots by at most a thousandth of its range.
    assert V.min() >= np.cos(1.0) - 1e-3
    assert V.max() == 1.0


def test_no_varying_entry_gives_one_matrix() -> None:
    f = proved_hull(lambda z, u: jnp.stack([2.0 * z[0] - z[1]]), np.eye(2), box(1.0))
    np.testing.assert_array_equal(vertices_of(f), [[[2.0, -1.0]]])
    assert f.bound_status == "proved"


def test_constant_entries_stand_still_in_every_vertex() -> None:
    f = proved_hull(
        lambda z, u: jnp.stack([z[0] ** 2 + 3.0 * z[1], (1 - z[0] ** 2) * z[1]]),
        np.eye(2),
        box(1.0),
        vertices=5,
        inflation=0.05,
    )
    assert (vertices_of(f)[:, 0, 1] == 3.0).all()


def test_entries_that_follow_from_one_another_span_a_segment() -> None:
    f = proved_hull(lambda z, u: jnp.stack([jnp.sin(z[0]), 2.0 * jnp.sin(z[0])]), np.eye(1), box(1.0, 1))
    V = vertices_of(f)[:, :, 0]
    assert len(V) == 2
    np.testing.assert_array_equal(V[:, 1], 2.0 * V[:, 0])


def test_products_in_a_box_give_its_corners_exactly() -> None:
    f = proved_hull(lambda z, u: jnp.stack([z[0] * z[1]]), np.eye(2), box(1.0))
    assert {tuple(v) for v in vertices_of(f)[:, 0]} == {(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)}


def test_three_entries_that_vary_together() -> None:
    f = proved_hull(lambda z, u: jnp.stack([z[0] * z[1] * z[2]]), np.eye(3), box(1.0, 3), inflation=0.15, vertices=14)
    V = vertices_of(f)[:, 0]
    # The box has volume 8.
    assert ConvexHull(V).volume < 7.0
    x = np.random.default_rng(3).uniform(-1, 1, (4000, 3))
    assert_inside(np.stack([x[:, 1] * x[:, 2], x[:, 0] * x[:, 2], x[:, 0] * x[:, 1]], axis=1), V)


def test_a_slope_that_reads_an_input_is_bounded_over_its_box() -> None:
    f = proved_hull(lambda z, u: jnp.stack([u[0] * z[0] ** 2]), np.eye(1), box(1.0, 1), inputs=([-3.0], [2.0]))
    assert f.jacobian_lower is not None
    # df/dz = 2 u z over |z| <= 1, -3 <= u <= 2.
    assert f.jacobian_lower[0, 0] == pytest.approx(-6.0, rel=2e-3)
    assert f.jacobian_lower[0, 0] <= -6.0


def test_a_jump_leaves_the_hull_declared() -> None:
    f = proved_hull(lambda z, u: jnp.stack([jnp.where(z[0] > 0, z[0], 2.0 * z[0])]), np.eye(2), box(1.0))
    assert f.bound_status == "declared"


def test_a_nonlinearity_keeps_its_own_domain() -> None:
    plain = Nonlinearity.enclosed(van_der_pol, np.eye(2), box(2.0))
    f = proved_hull(plain, vertices=5, inflation=0.05)
    assert f.domain is not None
    np.testing.assert_array_equal(f.domain[1], [2.0, 2.0])
    with pytest.raises(BadInput, match="clipped"):
        proved_hull(plain.clipped())


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"vertices": 2}, "needs at least 3 vertices"),
        ({"inflation": 0.0}, "a positive share is needed"),
        ({"inputs": ([1.0], [0.0])}, "lower <= upper"),
    ],
)
def test_bad_options_are_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(BadInput, match=message):
        proved_hull(van_der_pol, np.eye(2), box(1.0), **options)


def test_a_box_is_needed() -> None:
    with pytest.raises(BadInput, match="give `H` and `domain`"):
        proved_hull(van_der_pol)
    with pytest.raises(BadInput, match="lower <= upper"):
        proved_hull(van_der_pol, np.eye(2), ([1.0, 0.0], [0.0, 1.0]))


def test_a_given_hull_is_checked_for_shape_and_span() -> None:
    with pytest.raises(BadInput, match="`hull` has shape"):
        prove_hull(van_der_pol, np.zeros((3, 2, 2)), np.eye(2), box(1.0))
    with pytest.raises(BadInput, match="do not span"):
        prove_hull(van_der_pol, [[[0.0, 0.0]], [[1.0, 1.0]], [[2.0, 2.0]]], np.eye(2), box(1.0))
    with pytest.raises(NotCertified, match="widen it"):
        prove_hull(lambda z, u: jnp.sin(z), [[[0.6]], [[1.0]]], np.eye(1), box(1.0, 1))


COEFFICIENT = st.integers(-8, 8).map(lambda k: k / 4)


@settings(max_examples=2, deadline=None, derandomize=True)
@given(st.lists(COEFFICIENT, min_size=6, max_size=6), st.integers(0, 2**31 - 1))
def test_random_cubics_stay_in_their_hull(c: list[float], seed: int) -> None:
    def cubic(z: Any, u: Any) -> jax.Array:
        x, y = z[0], z[1]
        return jnp.stack([c[0] * x**2 + c[1] * x * y + c[2] * y**2 + c[3] * x**3 + c[4] * x**2 * y + c[5] * y**3])

    f = proved_hull(cubic, np.eye(2), box(1.0), inflation=5e-2, vertices=6)
    V = vertices_of(f)[:, 0]
    z = np.random.default_rng(seed).uniform(-1, 1, (500, 2))
    J = np.asarray(jax.vmap(jax.jacfwd(lambda p: cubic(p, None)[0]))(z))
    varies = np.ptp(V, axis=0) > 0
    # 1e-13: rounding of the sampled Jacobian itself.
    np.testing.assert_allclose(J[:, ~varies], np.broadcast_to(V[0, ~varies], (500, int((~varies).sum()))), atol=1e-13)
    if np.linalg.matrix_rank(V[1:] - V[0]) == 2:
        assert_inside(J, V)
    else:
        assert (V.min(axis=0) - 1e-13 <= J).all()
        assert (V.max(axis=0) + 1e-13 >= J).all()
