"""Solve, back off, centre; and say what stands in the way."""

from dataclasses import replace

import cvxpy as cp
import numpy as np
import pytest

from luenberger.algebra import Polynomial
from luenberger.lmi import Block, Problem, centre, charged_block, infeasible, nearest_level, solve

A = np.array([[0.0, 1.0], [-2.0, -3.0]])


def decaying(rate: float) -> Problem:
    """P >= I with a decay rate; the plant's own slowest mode is -1."""
    P = cp.Variable((2, 2), symmetric=True)
    drift = A.T @ P + P @ A + 2 * rate * P
    blocks = [Block("decay", Polynomial.constant(drift)), Block("storage", Polynomial.constant(np.eye(2) - P))]
    return Problem({"P": P}, blocks, cp.trace(P))


def test_centring_gives_a_strict_interior_point_at_a_stated_price() -> None:
    problem = decaying(0.5)
    best, centred = solve(problem), centre(problem, back_off=0.05)
    assert best is not None
    assert centred is not None
    assert centred.margin > 1e-3 > best.margin
    assert centred.optimum == best.objective
    # The price is at most the five percent that were offered (plus solver accuracy).
    assert best.objective <= centred.objective <= 1.05 * best.objective + 1e-6


def test_a_failed_second_solve_leaves_the_first_answer_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    problem, calls = replace(decaying(0.5), objective=None), []

    def once(given: Problem, **options: object) -> object:
        calls.append(given)
        found = solve(given, **options)  # type: ignore[arg-type]
        if len(calls) > 1:
            for variable in problem.variables.values():
                variable.save_value(None)
            return None
        return found

    monkeypatch.setattr("luenberger.lmi.recipe.solve", once)
    found = centre(problem)
    assert len(calls) == 2
    assert found is not None
    assert found.margin > 0
    np.testing.assert_array_equal(np.asarray(problem.variables["P"].value), found.values["P"])


def test_nearest_level_is_the_slowest_mode() -> None:
    assert centre(decaying(2.0)) is None
    nearest = nearest_level(decaying, 0.0, 2.0, steps=12)
    assert nearest is not None
    # The slowest eigenvalue is -1; twelve halvings of 2 leave 5e-4, conditioning of P near the limit a little more.
    assert 0.98 <= nearest < 1.0


def test_nearest_level_says_so_when_nothing_helps() -> None:
    problem = decaying(0.0)
    stuck = replace(problem, blocks=[*problem.blocks, Block("never", Polynomial.constant(np.eye(1)))])
    assert nearest_level(lambda rate: stuck, 0.0, 1.0) is None


def test_the_charged_block_is_the_obstacle() -> None:
    problem = decaying(0.5)
    P = problem.variables["P"]
    impossible = Block("ceiling", Polynomial.constant(P - 0.5 * np.eye(2)))
    assert charged_block(replace(problem, blocks=[*problem.blocks, impossible])) in ("ceiling", "storage")


def test_message_has_request_nearest_and_block() -> None:
    error = infeasible(decaying(2.0), "decay_rate", 2.0, "1/s", 0.99)
    assert error.nearest == 0.99
    assert "decay_rate = 2 1/s" in str(error)
    assert "0.99 1/s" in str(error)
    assert error.block in ("decay", "storage")
    assert f"`{error.block}`" in str(error)
