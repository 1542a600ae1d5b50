"""Subdivision: pieces cover the box, children are no wider than parents, mean-value bounds are used only where sound."""

import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax

from luenberger.algebra.subdivision import Search
from luenberger.core import BadInput


def search(function, lower, upper, tolerance: float = 1e-3, max_pieces: int = 300) -> Search:
    return Search(function, np.asarray(lower, dtype=float), np.asarray(upper, dtype=float), tolerance, max_pieces)


def test_pieces_cover_the_box_without_overlap() -> None:
    found = search(lambda x: jnp.sin(3 * x[0]) * jnp.cos(x[1]) * x[1], [-1.0, -2.0], [2.0, 1.0])
    assert found.refine()
    volume = sum(np.prod(piece.right - piece.left) for piece in found.pieces)
    # Halving rounds each end at most once; volumes add to a few roundings of 9.
    assert volume == pytest.approx(9.0, rel=1e-12)
    points = np.random.default_rng(1).uniform([-1, -2], [2, 1], (200, 2))
    for point in points:
        assert any((piece.left <= point).all() and (point <= piece.right).all() for piece in found.pieces)


def test_values_on_a_piece_lie_in_its_bounds() -> None:
    def function(x):
        return jnp.array([x[0] * x[1] - x[0] ** 2 * x[1], jnp.exp(-x[0]) / (2 + jnp.sin(x[1]))])

    found = search(function, [-1.0, -2.0], [2.0, 1.0], tolerance=1e-2)
    found.refine()
    generator = np.random.default_rng(2)
    for piece in found.pieces:
        for _ in range(3):
            value = np.asarray(function(jnp.asarray(generator.uniform(piece.left, piece.right))))
            # The double value may be a rounding beyond the real one.
            assert (piece.lower - 1e-14 <= value).all()
            assert (value <= piece.upper + 1e-14).all()


def test_a_piece_is_halved_where_the_function_varies() -> None:
    found = search(lambda x: jnp.sin(20 * x[0]) * x[0] + 1e-6 * x[1] - x[0], [0.0, 0.0], [1.0, 1.0])
    assert found.refine()
    widths = np.array([piece.right - piece.left for piece in found.pieces])
    assert widths[:, 0].min() < 0.1
    assert (widths[:, 1] == 1.0).all()


def test_a_degenerate_axis_is_never_halved() -> None:
    found = search(lambda x: jnp.sin(x[0]) * x[0] * x[1], [0.0, 2.0], [3.0, 2.0])
    assert found.refine()
    assert all(piece.left[1] == piece.right[1] == 2.0 for piece in found.pieces)


def test_mean_value_form_is_left_out_across_a_jump() -> None:
    # The slope is zero on both sides; a mean-value form that trusts it would miss the jump from 0 to 1.
    found = search(lambda x: jnp.where(x > 0.3, 1.0, 0.0) + 0.0 * x, [0.0], [1.0], max_pieces=40)
    found.refine()
    assert min(piece.lower[0] for piece in found.pieces) == 0.0
    assert max(piece.upper[0] for piece in found.pieces) == 1.0
    floor = search(lambda x: jnp.floor(x) - 0.5 * x, [0.0], [3.5], max_pieces=200)
    floor.refine()
    assert max(piece.upper[0] for piece in floor.pieces) >= 1.5


def test_derivative_rules_by_hand_are_not_trusted() -> None:
    found = search(lambda x: lax.stop_gradient(jnp.sin(x)) * (1 + 0 * x) - lax.stop_gradient(x) / 9, [0.0], [3.0])
    assert found.derivative is None
    found.refine()
    # max of sin(x) - x/9 lies at cos(x) = 1/9.
    top = np.arccos(1 / 9)
    assert max(piece.upper[0] for piece in found.pieces) >= np.sin(top) - top / 9


def test_more_than_one_array_is_refused() -> None:
    with pytest.raises(BadInput, match="returns 2 arrays"):
        search(lambda x: (x, x), [0.0], [1.0])
