"""Relaxations against the textbook forms written out here, against grids, and against exact arithmetic."""

from itertools import product
from typing import Any

import cvxpy as cp
import numpy as np
import pytest

from luenberger.algebra import Polynomial
from luenberger.algebra.definiteness import exact
from luenberger.certify.continuum import negative_definite
from luenberger.core import Outcome
from luenberger.experiment.published.relaxation_study import (
    SIZES,
    STUDIED,
    bounds,
    gaps,
    random_quadratics,
    relaxation_rows,
    true_value,
)
from luenberger.experiment.published.row import Verdict
from luenberger.lmi import FullBlockMultiplier, Planned, StructuredMultiplier

COUNT = 15


def gridded(F: Polynomial, points: int) -> float:
    """Largest eigenvalue on a grid of [-1, 1]^p, corners included."""
    p = len(F.names)
    grid = np.stack(np.meshgrid(*[np.linspace(-1, 1, points)] * p, indexing="ij"), axis=-1).reshape(-1, p)
    values = sum(np.prod(grid ** np.array(e), axis=1)[:, None, None] * c for e, c in F)
    return float(np.linalg.eigvalsh(values)[:, -1].max())


@pytest.mark.parametrize(("p", "n", "points"), SIZES)
def test_no_relaxation_is_below_the_grid_and_the_planner_is_tight(p: int, n: int, points: int) -> None:
    matrices = random_quadratics(p, n, COUNT, seed=1)
    grid = np.array([gridded(F, points) for F in matrices])
    truth = np.array([true_value(F, points) for F in matrices])
    # The search starts from a grid and only climbs.
    assert np.all(truth >= grid - 1e-12)
    for studied in STUDIED:
        if p < 3 or not studied.name.startswith("Bernstein"):
            # Bounds are read from the multipliers with their violations paid for: what is left is rounding of eigenvalues.
            assert np.all(bounds(matrices, studied.relaxation) >= grid - 1e-9 * (1 + abs(grid))), studied.name
    relative = gaps(bounds(matrices, Planned()), truth)
    assert relative.mean() <= 1e-3
    # A tight default is one thing, a loose one would be seen: the structured one without skew blocks gives away more.
    assert relative.mean() <= gaps(bounds(matrices, StructuredMultiplier(skew=False)), truth).mean() + 1e-9


@pytest.mark.parametrize(("p", "n", "points"), SIZES)
def test_bounds_are_proved_by_another_route(p: int, n: int, points: int) -> None:
    """F <= bound I on the continuum by Bernstein coefficients of exact rationals and subdivision; below the truth refuted."""
    matrices = random_quadratics(p, n, 3, seed=2)
    box = dict.fromkeys(matrices[0].names, (-1, 1))
    for F, bound in zip(matrices, bounds(matrices, Planned()), strict=True):
        rational, truth = F.map(exact), true_value(F, points)

        def shifted(level: float, of: Polynomial = rational) -> Polynomial:
            return of - Polynomial.constant(exact(level * np.eye(n)))

        # One percent on top, so that few pieces suffice; a tenth of a percent below the truth some corner of a piece refutes.
        assert negative_definite(shifted(bound + 0.01 * abs(bound)), box).outcome is Outcome.PROVED
        assert negative_definite(shifted(truth - 0.001 * abs(truth)), box, pieces=20000).outcome is Outcome.REFUTED


def textbook(F: Polynomial, kind: str) -> float:
    """Full block or structured multiplier for two parameters as in a textbook: every block written out, no library code."""
    n = F.shape[0]
    c = {e: np.asarray(m) for e, m in F}
    zero = np.zeros((n, n))
    f = [
        [c.get(e, zero) for e in row]
        for row in (((0, 0), (1, 0), (0, 1)), ((1, 0), (2, 0), (1, 1)), ((0, 1), (1, 1), (0, 2)))
    ]
    t = cp.Variable()
    constraints: list[Any]
    G = np.block([[f[a][b] * (1.0 if a == b else 0.5) for b in range(3)] for a in range(3)])
    unit = np.kron(np.diag([1.0, 0.0, 0.0]), np.eye(n))
    if kind == "full":
        V = cp.Variable((3 * n, 3 * n), symmetric=True)
        constraints = [G - V << t * unit]
        for corner in product((-1.0, 1.0), repeat=2):
            E = np.vstack([np.eye(n), corner[0] * np.eye(n), corner[1] * np.eye(n)])
            constraints.append(E.T @ V @ E << 0)
        constraints += [V[k * n : (k + 1) * n, k * n : (k + 1) * n] >> 0 for k in (1, 2)]
    else:
        first, second = (cp.Variable((n, n), symmetric=True) for _ in range(2))
        skew = [cp.Variable((n, n)) for _ in range(3)]
        V = cp.bmat(
            [
                [-first - second, skew[0], skew[1]],
                [skew[0].T, first, skew[2]],
                [skew[1].T, skew[2].T, second],
            ]
        )
        M = G - V - t * unit
        constraints = [0.5 * (M + M.T) << 0, first >> 0, second >> 0, *(k + k.T == 0 for k in skew)]
    cp.Problem(cp.Minimize(t), constraints).solve(solver="CLARABEL")
    return float(np.asarray(t.value))


@pytest.mark.parametrize(
    ("kind", "relaxation"), [("full", FullBlockMultiplier()), ("structured", StructuredMultiplier())]
)
def test_multipliers_are_those_of_the_textbook(
    kind: str, relaxation: FullBlockMultiplier | StructuredMultiplier
) -> None:
    matrices = random_quadratics(2, 3, 5, seed=3)
    ours = bounds(matrices, relaxation)
    # Default accuracy of the solver in the textbook form: 1e-8 relative to data of size ten.
    np.testing.assert_allclose(ours, [textbook(F, kind) for F in matrices], rtol=1e-6)


def test_tighter_kinds_are_never_looser() -> None:
    """Every structured multiplier is a full block one, and partial convexity asks less than full convexity."""
    matrices = random_quadratics(3, 2, 10, seed=4)
    partial, full = bounds(matrices, FullBlockMultiplier()), bounds(matrices, FullBlockMultiplier("full"))
    skew, plain = bounds(matrices, StructuredMultiplier()), bounds(matrices, StructuredMultiplier(skew=False))
    slack = 1e-7 * (1 + abs(partial))
    assert np.all(partial <= full + slack)
    assert np.all(partial <= skew + slack)
    assert np.all(skew <= plain + slack)
    # The order is no tie: on these draws each step loses somewhere.
    assert np.any(plain > skew + 1e-3)
    assert np.any(full > partial + 1e-6) or np.any(skew > partial + 1e-6)


def test_rows_of_a_small_study() -> None:
    """The whole study is `luenberger reproduce wang-relaxations`; a few draws show that its rows are made and sound."""
    told: list[str] = []
    rows = list(relaxation_rows(lambda row: told.append(row.item), count=4))
    assert told == [row.item for row in rows]
    first, *_, unknowns, output = rows
    assert first.verdict is Verdict.CORRECTED
    assert "by each of 10 relaxations" in first.ours
    assert unknowns.verdict is Verdict.CORRECTED
    assert output.verdict is Verdict.CORRECTED
    assert all(row.ours.endswith(", 0 below") for row in rows if "number below the truth" in row.item)
