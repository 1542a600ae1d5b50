"""Matrix inequalities as data: named blocks with a margin, an objective, and how they are solved and judged."""

import os
import time
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import cvxpy as cp
import numpy as np
from cvxpy.error import SolverError

from luenberger.algebra import Polynomial
from luenberger.core import BadInput
from luenberger.lmi.affine_form import Form, stacked
from luenberger.lmi.relaxation import Bernstein, Relaxation

# Tried in this order; each answer is judged by its residual, never by the solver's own word.
SOLVERS: Mapping[str, Mapping[str, Any]] = {
    "CLARABEL": {"tol_gap_abs": 1e-10, "tol_gap_rel": 1e-10, "tol_feas": 1e-10},
    "CVXOPT": {"abstol": 1e-9, "reltol": 1e-9, "feastol": 1e-9},
    "SDPA": {"epsilonStar": 1e-9, "epsilonDash": 1e-9},
    "SCS": {"eps_abs": 1e-8, "eps_rel": 1e-8, "max_iters": 20000},
}
RESIDUAL = 1e-6


@dataclass(frozen=True)
class Block:
    """One inequality  matrix(r) <= -margin I  for all r in the box.

    Args:
        name: how the block is called when it is the obstacle.
        matrix: symmetric polynomial with affine cvxpy coefficients.
        box: parameter name -> interval.
        margin: explicit margin of this block.
        relaxation: how the box is replaced by finitely many matrices.
    """

    name: str
    matrix: Polynomial
    box: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    margin: float = 0.0
    relaxation: Relaxation = field(default_factory=Bernstein)


@dataclass(frozen=True)
class Problem:
    """Blocks, variables and an objective to minimise.

    Args:
        variables: name -> cvxpy variable.
        blocks: the inequalities.
        objective: affine or convex expression to minimise, None for pure feasibility.
    """

    variables: Mapping[str, cp.Variable]
    blocks: Sequence[Block]
    objective: Any = None


@dataclass(frozen=True)
class Solution:
    """What a solver found and how well it holds.

    Args:
        values: variable name -> array.
        objective: value of the objective (0 for feasibility).
        optimum: the best objective found before any back-off.
        margin: smallest  -lambda_max  over all blocks at these values; negative where one is violated.
        residual: violation relative to the size of the blocks, 0 where all hold.
        solver: who found it.
        solver_seconds: the solvers' own time over all tries [s].
        seconds: wall time over all tries [s].
        duals: block name -> share of the dual certificate charged to it.
    """

    values: Mapping[str, np.ndarray]
    objective: float
    optimum: float
    margin: float
    residual: float
    solver: str
    solver_seconds: float
    seconds: float
    duals: Mapping[str, float] = field(default_factory=dict)

    @property
    def holds(self) -> bool:
        """True where every block holds within the residual tolerance."""
        return self.residual <= RESIDUAL


def solve(
    problem: Problem,
    *,
    slack: Any = None,
    extra: Sequence[Any] = (),
    solvers: Sequence[str] | None = None,
    tolerance: float = RESIDUAL,
) -> Solution | None:
    """Minimise the objective subject to the blocks; return the first answer whose residual is small, else None.

    Args:
        problem: what to solve.
        slack: cvxpy scalar t added to every block, matrix <= (t - margin) I; None for none.
        extra: further cvxpy constraints (norm caps, level bounds).
        solvers: names to try in order, default all installed of `SOLVERS`.
        tolerance: largest relative residual accepted.

    Raises:
        BadInput: an unknown or absent solver is named.
    """
    start = time.perf_counter()
    groups = expand(problem)
    unknowns = list(problem.variables.values())
    x = cp.hstack([cp.vec(v, order="F") for v in unknowns])
    cones: dict[str, list[Any]] = {}
    for block in problem.blocks:
        shift = -block.margin if slack is None else slack - block.margin
        cones[block.name] = [
            (shift * np.eye(n) - cp.reshape(K[:, :-1] @ x + K[:, -1], (n, n), order="C")) >> 0
            for n, K in groups[block.name]
        ]
    objective = cp.Minimize(0 if problem.objective is None else problem.objective)
    posed = cp.Problem(objective, [*(c for group in cones.values() for c in group), *extra])
    own = 0.0
    for name in installed_solvers(solvers):
        own += _run(posed, name)
        if any(v.value is None for v in unknowns) or (slack is not None and slack.value is None):
            continue
        values = {k: np.asarray(v.value) for k, v in problem.variables.items()}
        margin, residual = _residual(problem, groups, values, 0.0 if slack is None else float(np.asarray(slack.value)))
        if residual <= tolerance:
            value = float(np.asarray(objective.expr.value))
            return Solution(
                values, value, value, margin, residual, name, own, time.perf_counter() - start, _charges(cones)
            )
    return None


@contextmanager
def _silent(solver: str) -> Iterator[None]:
    """SDPA writes to the process's own standard output past every Python stream; keep machine-readable output clean."""
    if solver != "SDPA":
        yield
        return
    kept = os.dup(1)
    with open(os.devnull, "w", encoding="utf-8") as nowhere:
        os.dup2(nowhere.fileno(), 1)
        try:
            yield
        finally:
            os.dup2(kept, 1)
            os.close(kept)


def expand(problem: Problem) -> dict[str, list[tuple[int, np.ndarray]]]:
    """Return, block by block, the constant matrix inequalities of its relaxation as (n, K), vec(M) = K @ [x; 1] <= 0.

    Args:
        problem: blocks and variables; x stacks the variables in their order.
    """
    unknowns = list(problem.variables.values())
    memo: dict[int, Form] = {}
    groups: dict[str, list[tuple[int, np.ndarray]]] = {}
    for block in problem.blocks:
        n = block.matrix.shape[0]
        numeric = block.matrix.map(lambda c: _symmetrised(stacked(c, unknowns, memo)))
        groups.setdefault(block.name, []).extend((n, K) for K in block.relaxation.matrices(numeric, block.box))
    return groups


def _symmetrised(K: np.ndarray) -> np.ndarray:
    n = round(np.sqrt(K.shape[0]))
    flipped = K.reshape(n, n, -1).transpose(1, 0, 2).reshape(K.shape)
    return 0.5 * (K + flipped)


def _run(posed: cp.Problem, solver: str) -> float:
    """Run one solver; its status is ignored on purpose. Returns its own time [s]."""
    try:
        with warnings.catch_warnings(), _silent(solver):
            warnings.simplefilter("ignore")
            posed.solve(solver=solver, **SOLVERS[solver])
    except (SolverError, ArithmeticError, ValueError):
        for variable in posed.variables():
            variable.save_value(None)
        return 0.0
    return float(posed.solver_stats.solve_time or 0.0)


def _residual(
    problem: Problem, groups: Mapping[str, list[tuple[int, np.ndarray]]], values: Mapping[str, np.ndarray], slack: float
) -> tuple[float, float]:
    """Return (smallest -lambda_max, largest relative violation) over all matrices at these values."""
    x = np.concatenate([np.ravel(values[k], order="F") for k in problem.variables] + [np.ones(1)])
    margin, worst = np.inf, 0.0
    for block in problem.blocks:
        for n, K in groups[block.name]:
            value = (K @ x).reshape(n, n)
            top = float(np.linalg.eigvalsh(value)[-1])
            margin = min(margin, -top)
            worst = max(worst, (top + block.margin - slack) / (1.0 + float(np.abs(value).max())))
    return margin, worst


def _charges(cones: Mapping[str, list[Any]]) -> dict[str, float]:
    traces = {
        name: sum(float(np.trace(np.atleast_2d(c.dual_value))) for c in group if c.dual_value is not None)
        for name, group in cones.items()
    }
    total = sum(traces.values()) or 1.0
    return {name: value / total for name, value in traces.items()}


def installed_solvers(wanted: Sequence[str] | None = None) -> list[str]:
    """Return the solvers to try, in order.

    Args:
        wanted: names; None for every installed one of `SOLVERS`.

    Raises:
        BadInput: an unknown or absent solver is named.
    """
    have = cp.installed_solvers()
    if wanted is None:
        return [s for s in SOLVERS if s in have]
    if absent := [s for s in wanted if s not in SOLVERS or s not in have]:
        raise BadInput(f"Solver {absent} is not available; installed: {[s for s in SOLVERS if s in have]}.")
    return list(wanted)
