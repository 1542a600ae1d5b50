"""Relaxations with unknowns: never below the truth, exact where theory says so, and no lie of the solver passes."""

from collections.abc import Callable

import cvxpy as cp
import numpy as np
import pytest

from luenberger.algebra import Polynomial
from luenberger.algebra.definiteness import exact
from luenberger.certify.continuum import negative_definite
from luenberger.core import NotAccepted, Outcome
from luenberger.lmi import (
    Bernstein,
    Block,
    FullBlockMultiplier,
    Planned,
    Problem,
    Relaxation,
    StructuredMultiplier,
    largest_value,
    solve,
)

SOUND: tuple[Relaxation, ...] = (
    Bernstein(),
    Bernstein(2, 3),
    FullBlockMultiplier(),
    FullBlockMultiplier("full"),
    StructuredMultiplier(),
    StructuredMultiplier(skew=False),
    Planned(),
)
BENT = Polynomial(("s",), {(0,): np.array([[1.0]]), (2,): np.array([[-2.0]])})


def scalar(names: tuple[str, ...], **terms: float) -> Polynomial:
    """A polynomial of shape (1, 1) from names like e21 for the exponents (2, 1)."""
    return Polynomial(names, {tuple(map(int, k[1:])): np.array([[v]]) for k, v in terms.items()})


@pytest.mark.parametrize("relaxation", SOUND)
def test_positive_in_the_middle_is_rejected(relaxation: Relaxation) -> None:
    # 1 - 2 s^2 is -1 at both ends of [-1, 1] and +1 in the middle.
    bound = largest_value([BENT], {"s": (-1.0, 1.0)}, relaxation)
    assert bound is not None
    assert bound[0] >= 1.0
    t = cp.Variable(name="t")
    block = Block("bent", BENT + Polynomial.constant(cp.reshape(0 * t, (1, 1), order="C")), {"s": (-1.0, 1.0)})
    asked = Block(block.name, block.matrix, block.box, relaxation=relaxation)
    assert solve(Problem({"t": t}, [asked], t), extra=[t >= 0]) is None


@pytest.mark.parametrize("relaxation", [r for r in SOUND if not isinstance(r, Bernstein)])
def test_multipliers_are_exact_for_one_parameter(relaxation: Relaxation) -> None:
    # 1 - 2 s^2 on an interval that holds the top, and on one that does not: 1 - 2 * 0.25.
    for interval, top in (((-0.5, 2.0), 1.0), ((0.5, 2.0), 0.5)):
        bound = largest_value([BENT], {"s": interval}, relaxation)
        assert bound is not None
        assert bound[0] == pytest.approx(top, abs=1e-8)


@pytest.mark.parametrize("degree", [3, 4, 5])
def test_structured_multiplier_is_exact_for_one_parameter_of_any_degree(degree: int) -> None:
    generator = np.random.default_rng(degree)
    line = np.linspace(-1.0, 2.0, 20001)
    for _ in range(5):
        terms = {(k,): generator.normal(size=(2, 2)) for k in range(degree + 1)}
        F = Polynomial(("s",), {e: c + c.T for e, c in terms.items()})
        values = sum(line[:, None, None] ** e[0] * c for e, c in F)
        truth = float(np.linalg.eigvalsh(values)[:, -1].max())
        bound = largest_value([F], {"s": (-1.0, 2.0)}, StructuredMultiplier())
        assert bound is not None
        # The grid misses its own maximum by (1.5e-4)^2 times a curvature of some hundreds at most.
        assert truth - 1e-9 <= bound[0] <= truth + 1e-4 * (1 + abs(truth))


def test_higher_degrees_of_several_parameters_are_lifted_soundly() -> None:
    F = scalar(("x", "y"), e00=1.0, e21=-2.0, e13=1.5, e22=0.7)
    box = {"x": (-1.0, 2.0), "y": (-1.0, 1.0)}
    bound = largest_value([F], box, StructuredMultiplier())
    assert bound is not None
    # At the corner (2, -1) by hand: 1 + 8 - 3 + 2.8.
    assert bound[0] == pytest.approx(8.8, abs=1e-6)


def test_full_block_refuses_what_it_cannot_write() -> None:
    with pytest.raises(NotAccepted, match="degree 3"):
        largest_value([scalar(("x", "y"), e00=1.0, e21=1.0)], {"x": (0.0, 1.0), "y": (0.0, 1.0)}, FullBlockMultiplier())


@pytest.mark.parametrize("relaxation", [FullBlockMultiplier(), StructuredMultiplier(), Planned()])
def test_margin_is_that_of_the_implied_inequality(relaxation: Relaxation) -> None:
    # F = s^2 - 3 + x on [-1, 1] has its top at x - 2; the largest x with margin 1/2 is 3/2.
    x = cp.Variable((1, 1), name="x")
    F = Polynomial(("s",), {(0,): x - 3.0, (2,): np.eye(1)})
    block = Block("top", F, {"s": (-1.0, 1.0)}, margin=0.5, relaxation=relaxation)
    found = solve(Problem({"x": x}, [block], -x[0, 0]))
    assert found is not None
    assert found.values["x"][0, 0] == pytest.approx(1.5, abs=1e-8)
    assert found.margin == pytest.approx(0.5, abs=1e-8)
    assert found.margins["top"] == found.margin
    slack = cp.Variable()
    pushed = solve(Problem({"x": x}, [block], slack), slack=slack, extra=[x == 0.0])
    assert pushed is not None
    assert pushed.margin == pytest.approx(2.0, abs=1e-7)


@pytest.mark.parametrize("relaxation", [FullBlockMultiplier(), StructuredMultiplier()])
def test_a_multiplier_that_lies_is_not_believed(relaxation: Relaxation, monkeypatch: pytest.MonkeyPatch) -> None:
    t = cp.Variable(name="t")
    block = Block("b", BENT - Polynomial.constant(t * np.eye(1)), {"s": (-1.0, 1.0)}, relaxation=relaxation)
    problem = Problem({"t": t}, [block], t)
    honest = solve(problem)
    assert honest is not None

    def liar(posed: object, solver: str) -> float:
        t.value = -0.5  # below the truth: no multiplier can support it
        posed.run(solver)  # type: ignore[attr-defined]
        t.value = -0.5
        return 0.0

    monkeypatch.setattr("luenberger.lmi.problem._run", liar)
    assert solve(problem) is None
    taken = solve(problem, tolerance=np.inf)
    assert taken is not None
    # The numbers prove F - t <= level with t + level still at the truth.
    assert taken.margin == pytest.approx(-1.5, abs=1e-7)


def test_other_solvers_read_the_same_problem() -> None:
    t = cp.Variable(name="t")
    for relaxation in (FullBlockMultiplier(), StructuredMultiplier()):
        block = Block("b", BENT - Polynomial.constant(t * np.eye(1)), {"s": (-0.5, 2.0)}, relaxation=relaxation)
        found = solve(Problem({"t": t}, [block], t), solvers=("CVXOPT",))
        assert found is not None
        assert found.objective == pytest.approx(1.0, abs=1e-6)
        assert found.duals["b"] == pytest.approx(1.0, abs=1e-6)


def drift(P: object, Y: Polynomial, C: Polynomial, lift: Callable[[np.ndarray], np.ndarray]) -> Polynomial:
    """P A - Y C and its transpose for a plant with one moderately unstable mode."""
    half = Polynomial.constant(P) @ lift(np.array([[0.2, -0.4], [0.6, -2.1]])) - Y @ C.map(lift)
    return half + half.T


def smallest(C: Polynomial, relaxation: Relaxation | None) -> tuple[float, np.ndarray, Polynomial] | None:
    """Smallest t with I <= P <= t I, |Y| <= t and decay; without a relaxation the two ends of the interval stand for it."""
    P, t = cp.Variable((2, 2), symmetric=True, name="P"), cp.Variable(name="t")
    parts = {(k,): cp.Variable((2, 1), name=f"Y{k}") for k in range(2)}
    F = drift(P, Polynomial(("r",), dict(parts)), C, lambda c: c)
    blocks = [
        Block("below", Polynomial.constant(np.eye(2) - P)),
        Block("above", Polynomial.constant(P - t * np.eye(2))),
    ]
    if relaxation is None:
        blocks += [Block(f"end{end}", Polynomial.constant(F({"r": end})), margin=0.1) for end in (-1.0, 1.0)]
    else:
        blocks.append(Block("decay", F, {"r": (-1.0, 1.0)}, margin=0.1, relaxation=relaxation))
    problem = Problem({"P": P, "t": t, **{v.name(): v for v in parts.values()}}, blocks, t)
    found = solve(problem, extra=[cp.norm(y, "fro") <= t for y in parts.values()], solvers=("CLARABEL",))
    if found is None:
        return None
    return found.objective, found.values["P"], Polynomial(("r",), {k: found.values[v.name()] for k, v in parts.items()})


def test_a_design_with_scheduled_output_is_proved_or_refused_where_the_ends_alone_lie() -> None:
    """Output and gain both affine in r make the inequality quadratic: two ends of the interval prove nothing."""

    def outcome(P: np.ndarray, Y: Polynomial, C: Polynomial) -> Outcome:
        return negative_definite(drift(exact(P), Y.map(exact), C.map(exact), exact), {"r": (-1.0, 1.0)}).outcome

    def output(share: float) -> Polynomial:
        return Polynomial(("r",), {(0,): np.array([[0.2, 0.0]]), (1,): share * np.array([[-0.7, 1.1]])})

    relaxations = (FullBlockMultiplier(), FullBlockMultiplier("full"), StructuredMultiplier(), Planned())
    lie = smallest(output(0.8), None)
    assert lie is not None
    assert lie[0] == pytest.approx(1.0, abs=1e-6)
    assert outcome(*lie[1:], output(0.8)) is Outcome.REFUTED
    for relaxation in relaxations:
        assert smallest(output(0.8), relaxation) is None
        honest = smallest(output(0.4), relaxation)
        assert honest is not None
        # With less swing the ends happen to be right; no sound relaxation may find less.
        ends = smallest(output(0.4), None)
        assert ends is not None
        assert honest[0] == pytest.approx(ends[0], rel=1e-6)
        assert outcome(*honest[1:], output(0.4)) is Outcome.PROVED
