"""Solvers agree where the problem is easy, and nobody's word is taken where it is not."""

import cvxpy as cp
import numpy as np

from luenberger.algebra import Polynomial
from luenberger.lmi import Block, Problem, cross_check


def lyapunov(sign: float) -> Problem:
    A = sign * np.array([[0.0, 1.0], [-2.0, -3.0]])
    P = cp.Variable((2, 2), symmetric=True)
    blocks = [
        Block("decrease", Polynomial.constant(A.T @ P + P @ A + np.eye(2))),
        Block("storage", Polynomial.constant(-P)),
    ]
    return Problem({"P": P}, blocks, cp.trace(P))


def test_interior_point_solvers_agree() -> None:
    found = cross_check(lyapunov(1.0), ("CLARABEL", "CVXOPT"))
    assert set(found.accepted) == {"CLARABEL", "CVXOPT"}
    # Two interior-point codes, each asked for 1e-9 or better; trace P = 1.5 by hand.
    assert found.spread < 1e-6
    assert abs(found.accepted["CLARABEL"].objective - 1.5) < 1e-6


def test_nothing_is_accepted_where_nothing_exists() -> None:
    found = cross_check(lyapunov(-1.0), ("CLARABEL", "CVXOPT"))
    assert found.accepted == {}
    assert found.spread == float("inf")
