"""What is handed to the solver without a modelling layer is, number for number, what the modelling layer makes of it."""

from typing import Any

import clarabel
import cvxpy as cp
import numpy as np
import pytest

from luenberger.algebra import Polynomial
from luenberger.lmi import Block, FullBlockMultiplier, Problem, centre, solve
from luenberger.lmi.posed import Posed
from luenberger.lmi.problem import expand

A = np.array([[0.0, 1.0], [-2.0, -3.0]])


def posed(extra: Any = None) -> tuple[Problem, list[Any], cp.Variable]:
    """A Lyapunov problem with a symmetric, a signed and a free variable, and a slack."""
    P, s = cp.Variable((2, 2), symmetric=True, name="P"), cp.Variable(nonneg=True, name="s")
    Y, t = cp.Variable((2, 1), name="Y"), cp.Variable(name="t")
    half = P @ A - Y @ np.array([[1.0, 0.5]])
    blocks = [
        Block("decay", Polynomial.affine(half + half.T, r=s * np.eye(2)), {"r": (-1.0, 1.0)}, margin=0.2),
        Block("storage", Polynomial.constant(np.eye(2) - P)),
    ]
    limits = [
        cp.norm(P, "fro") <= 5.0,
        cp.norm(Y, "fro") <= 2.0 + s,
        cp.norm(s, 2) <= 3.0,
        t >= -1.0,
        cp.trace(P) == 3.0,
        P >> 0.5 * np.eye(2),
    ]
    return Problem({"P": P, "s": s, "Y": Y}, blocks, t - 0.1 * s), limits if extra is None else extra, t


def recorded(monkeypatch: pytest.MonkeyPatch) -> list[tuple[Any, ...]]:
    seen: list[tuple[Any, ...]] = []
    whole: Any = vars(clarabel)["DefaultSolver"]

    def keeping(*given: Any) -> Any:
        seen.append(given)
        return whole(*given)

    monkeypatch.setattr(clarabel, "DefaultSolver", keeping)
    return seen


def test_numbers_are_those_of_the_modelling_layer(monkeypatch: pytest.MonkeyPatch) -> None:
    seen = recorded(monkeypatch)
    problem, limits, t = posed()
    direct = solve(problem, slack=t, extra=limits, solvers=("CLARABEL",))
    monkeypatch.setattr("luenberger.lmi.posed.conic_form", lambda *_: None)
    modelled = solve(problem, slack=t, extra=limits, solvers=("CLARABEL",))
    assert direct is not None
    assert modelled is not None
    (_, c1, A1, b1, cones1, _), (_, c2, A2, b2, cones2, _) = seen
    assert [str(c) for c in cones1] == [str(c) for c in cones2]
    # Equal to the last bit but for the order in which cvxpy adds up what meets in one entry.
    assert abs(A1 - A2).max() <= 1e-15
    np.testing.assert_allclose(b1, b2, rtol=0, atol=1e-15)
    np.testing.assert_array_equal(c1, c2)
    assert direct.objective == pytest.approx(modelled.objective, abs=1e-9)
    assert direct.margin == pytest.approx(modelled.margin, abs=1e-9)
    for name, share in direct.duals.items():
        assert share == pytest.approx(modelled.duals[name], abs=1e-7)


def test_what_the_form_cannot_say_goes_through_the_modelling_layer(monkeypatch: pytest.MonkeyPatch) -> None:
    P = cp.Variable((2, 2), symmetric=True, name="P")
    blocks = [Block("decay", Polynomial.constant(P @ A + A.T @ P + np.eye(2)))]
    problem = Problem({"P": P}, blocks, cp.sum_squares(P))
    form = Posed(problem.objective, [P], expand(problem), {"decay": 0.0}, None, [], {})
    assert form._conic is None
    found = solve(problem)
    assert found is not None
    assert found.objective == pytest.approx(float(np.sum(found.values["P"] ** 2)))


def test_infeasible_leaves_no_values() -> None:
    P = cp.Variable((1, 1), symmetric=True)
    grows = [Block("decrease", Polynomial.constant(2.0 * P + np.eye(1))), Block("storage", Polynomial.constant(-P))]
    problem = Problem({"P": P}, grows, cp.trace(P))
    form = Posed(problem.objective, [P], expand(problem), {"decrease": 0.0, "storage": 0.0}, None, [], {})
    assert form.run("CLARABEL") >= 0.0
    assert P.value is None


def test_multipliers_survive_centring() -> None:
    x = cp.Variable((1, 1), name="x")
    F = Polynomial(("s",), {(0,): 1.0 - x, (2,): -2.0 * np.eye(1)})
    problem = Problem({"x": x}, [Block("top", F, {"s": (-1.0, 1.0)}, relaxation=FullBlockMultiplier())], x[0, 0])
    found = centre(problem, back_off=0.1)
    assert found is not None
    # The top of 1 - 2 s^2 is 1; ten percent more leaves a margin of 0.1.
    assert found.values["x"][0, 0] == pytest.approx(1.1, abs=1e-6)
    assert found.margin == pytest.approx(0.1, abs=1e-6)
