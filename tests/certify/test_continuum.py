"""Definiteness on a box: never proved where a dense grid says no, never refuted where the named point says yes."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from luenberger.algebra import Polynomial
from luenberger.algebra.ball import Ball
from luenberger.algebra.definiteness import exact
from luenberger.certify.continuum import as_float, negative_definite, proved_margin
from luenberger.core import BadInput, Outcome

BOX = {"x": (-1.0, 1.0), "y": (0.0, 2.0)}
GRID = [(x, y) for x in np.linspace(-1, 1, 21) for y in np.linspace(0, 2, 21)]


def random_polynomial(seed: int, shift: float) -> Polynomial:
    generator = np.random.default_rng(seed)
    terms = {}
    for exponents in [(0, 0), (1, 0), (0, 1), (1, 1), (2, 0), (0, 2)]:
        half = generator.normal(size=(2, 2))
        terms[exponents] = half + half.T
    terms[(0, 0)] = terms[(0, 0)] - shift * np.eye(2)
    return Polynomial(("x", "y"), terms)


@settings(max_examples=60)
@given(st.integers(0, 10_000), st.floats(-5.0, 40.0))
def test_outcome_agrees_with_a_dense_grid(seed: int, shift: float) -> None:
    matrix = random_polynomial(seed, shift)
    verdict = negative_definite(matrix.map(exact), BOX)
    worst = max(np.linalg.eigvalsh(matrix({"x": x, "y": y}))[-1] for x, y in GRID)
    if verdict.outcome is Outcome.PROVED:
        assert worst < 0
        assert verdict.margin <= -worst + 1e-9
    elif verdict.outcome is Outcome.REFUTED:
        assert np.linalg.eigvalsh(matrix(verdict.point))[-1] >= -1e-12
        assert all(BOX[n][0] <= v <= BOX[n][1] for n, v in verdict.point.items())


def test_effort_is_bounded_and_said() -> None:
    # x^2 - 2 x y + y^2 touches zero on the diagonal: neither provable nor refutable off the corners at this effort.
    touching = Polynomial(
        ("x", "y"),
        {
            (2, 0): exact(-np.eye(1)),
            (1, 1): exact(2 * np.eye(1)),
            (0, 2): exact(-np.eye(1)),
            (0, 0): exact(np.array([[-1e-9]])),
        },
    )
    verdict = negative_definite(touching, {"x": (0.0, 1.0), "y": (0.0, 1.0)}, pieces=50)
    assert verdict.outcome is Outcome.UNDECIDED
    assert verdict.pieces <= 50
    assert set(verdict.point) == {"x", "y"}
    with pytest.raises(BadInput, match="pieces"):
        negative_definite(touching, BOX, pieces=0)


def test_constant_matrix_needs_no_box() -> None:
    assert negative_definite(Polynomial.constant(exact(-np.eye(3))), {}).outcome is Outcome.PROVED
    refuted = negative_definite(Polynomial.constant(exact(np.diag([-1.0, 0.0]))), {})
    assert refuted.outcome is Outcome.REFUTED
    assert refuted.point == {}


def test_degenerate_interval_is_a_point() -> None:
    matrix = Polynomial.affine(-np.eye(1), x=np.eye(1)).map(exact)
    assert negative_definite(matrix, {"x": (0.5, 0.5)}).outcome is Outcome.PROVED
    assert negative_definite(matrix, {"x": (1.0, 1.0)}).outcome is Outcome.REFUTED


def test_balls_are_split_until_they_decide() -> None:
    def matrix(values: dict[str, Ball]) -> np.ndarray:
        x = values["x"]
        return np.array([[x * x - 1.5 * x.square() - Ball.exact(0.01)]], dtype=object)

    # x*x and x^2 are not known to be the same number, so one piece is too coarse.
    verdict = negative_definite(matrix, {"x": (-1.0, 1.0)})
    assert verdict.outcome is Outcome.PROVED
    assert verdict.pieces > 1


def test_margin_is_a_proof_not_an_estimate() -> None:
    matrix = exact(np.array([[2.0, 1.0], [1.0, 2.0]]))
    outcome, margin = proved_margin(matrix)
    assert outcome is Outcome.PROVED
    assert 0.98 <= margin < 1.0
    assert np.linalg.eigvalsh(as_float(matrix) - margin * np.eye(2))[0] > 0
