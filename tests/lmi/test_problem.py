"""Answers are judged by their residual; statuses are never read."""

import cvxpy as cp
import numpy as np
import pytest

from luenberger.algebra import Polynomial
from luenberger.core import BadInput
from luenberger.lmi import Block, Problem, solve
from luenberger.lmi.problem import installed_solvers

A = np.array([[0.0, 1.0], [-2.0, -3.0]])


def lyapunov(margin: float = 0.0) -> tuple[Problem, cp.Variable]:
    P = cp.Variable((2, 2), symmetric=True)
    drift = A.T @ P + P @ A + np.eye(2)
    blocks = [Block("decrease", Polynomial.constant(drift), margin=margin), Block("storage", Polynomial.constant(-P))]
    return Problem({"P": P}, blocks, cp.trace(P)), P


@pytest.mark.parametrize("solver", installed_solvers(None))
def test_every_solver_finds_the_lyapunov_solution(solver: str) -> None:
    problem, _ = lyapunov()
    found = solve(problem, solvers=(solver,), tolerance=1e-4)
    assert found is not None
    exact = np.array([[1.25, 0.25], [0.25, 0.25]])  # A'P + PA = -I solved by hand
    # First-order solvers stop early: SCS is asked for 1e-8 and reaches 1e-4 here.
    np.testing.assert_allclose(found.values["P"], exact, atol=1e-3 if solver == "SCS" else 1e-6)


def test_margin_is_part_of_the_inequality() -> None:
    found = solve(lyapunov(margin=1.0)[0])
    assert found is not None
    # With margin 1 the right-hand side doubles, and so does the solution.
    np.testing.assert_allclose(found.values["P"], [[2.5, 0.5], [0.5, 0.5]], atol=1e-6)


def test_infeasible_is_none_whatever_the_solvers_say() -> None:
    P = cp.Variable((1, 1), symmetric=True)
    grows = [Block("decrease", Polynomial.constant(2.0 * P + np.eye(1))), Block("storage", Polynomial.constant(-P))]
    assert solve(Problem({"P": P}, grows, cp.trace(P))) is None


def test_residual_is_recomputed_from_the_values() -> None:
    problem, _ = lyapunov()
    found = solve(problem)
    assert found is not None
    value = A.T @ found.values["P"] + found.values["P"] @ A + np.eye(2)
    top = max(np.linalg.eigvalsh((value + value.T) / 2)[-1], -np.linalg.eigvalsh(found.values["P"])[0])
    assert found.margin == pytest.approx(-top, abs=1e-12)


def test_unknown_solver_is_refused() -> None:
    with pytest.raises(BadInput, match="MOSEK2"):
        solve(lyapunov()[0], solvers=("MOSEK2",))


def test_a_solver_that_lies_is_not_believed(monkeypatch: pytest.MonkeyPatch) -> None:
    problem, P = lyapunov()

    def liar(posed: cp.Problem, solver: str) -> float:
        P.value = -np.eye(2)  # "optimal", and neither positive nor decreasing
        return 0.0

    monkeypatch.setattr("luenberger.lmi.problem._run", liar)
    assert solve(problem) is None
    taken = solve(problem, tolerance=np.inf)
    assert taken is not None
    assert not taken.holds
