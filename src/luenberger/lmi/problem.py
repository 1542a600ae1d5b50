"""Matrix inequalities as data: named blocks with a margin, an objective, and how they are solved and judged."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import cvxpy as cp
import numpy as np

from luenberger.algebra import Polynomial
from luenberger.lmi.affine_form import Memo, stacked
from luenberger.lmi.posed import Posed
from luenberger.lmi.relaxation import Bernstein, Relaxation
from luenberger.lmi.relaxed import Relaxed
from luenberger.lmi.solvers import SOLVERS, installed_solvers

__all__ = ["RESIDUAL", "SOLVERS", "Block", "Problem", "Solution", "expand", "installed_solvers", "solve"]

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

    @cached_property
    def _relaxed(self) -> dict[tuple[int, ...], list[Relaxed]]:
        """What was expanded already, by the identities of the variables: a recipe solves the same blocks several times."""
        return {}


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
        margin: smallest margin over all blocks that these values prove; negative where one is violated.
        residual: violation relative to the size of the blocks, 0 where all hold.
        solver: who found it.
        solver_seconds: the solvers' own time over all tries [s].
        seconds: wall time over all tries [s].
        duals: block name -> share of the dual certificate charged to it.
        margins: block name -> margin that these values prove,  matrix(r) <= -margin I  on its box.
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
    margins: Mapping[str, float] = field(default_factory=dict)

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
    memo: Memo = {}
    unknowns = list(problem.variables.values())
    posed = Posed(problem.objective, unknowns, expand(problem, memo), _margins(problem), slack, extra, memo)
    own = 0.0
    for name in installed_solvers(solvers):
        own += _run(posed, name)
        if any(v.value is None for v in unknowns) or (slack is not None and slack.value is None):
            continue
        values = {k: np.asarray(v.value) for k, v in problem.variables.items()}
        level = 0.0 if slack is None else float(np.asarray(slack.value))
        margins, residual = posed.judged(list(values.values()), level)
        if residual <= tolerance:
            value = _number(problem.objective)
            total = sum(posed.charges.values()) or 1.0
            duals = {k: v / total for k, v in posed.charges.items()}
            least, seconds = min(margins.values(), default=np.inf), time.perf_counter() - start
            return Solution(values, value, value, least, residual, name, own, seconds, duals, margins)
    return None


def expand(problem: Problem, memo: Memo | None = None) -> dict[str, list[Relaxed]]:
    """Return, block by block, the conditions of its relaxation over the stacked variables.

    Args:
        problem: blocks and variables; x stacks the variables in their order.
        memo: forms of shared sub-expressions, filled on the way.
    """
    unknowns = list(problem.variables.values())
    memo = {} if memo is None else memo
    groups: dict[str, list[Relaxed]] = {}
    key = tuple(v.id for v in unknowns)
    for block in problem.blocks:
        if key not in block._relaxed:
            numeric = block.matrix.map(lambda c: _symmetrised(stacked(c, unknowns, memo)))
            block._relaxed[key] = block.relaxation.relaxed(numeric, block.box)
        groups.setdefault(block.name, []).extend(block._relaxed[key])
    return groups


def _run(posed: Posed, solver: str) -> float:
    return posed.run(solver)


def _margins(problem: Problem) -> dict[str, float]:
    """Margin of each block name, the largest where blocks share one."""
    found: dict[str, float] = {}
    for block in problem.blocks:
        found[block.name] = max(block.margin, found.get(block.name, block.margin))
    return found


def _number(objective: Any) -> float:
    if objective is None:
        return 0.0
    return float(np.asarray(objective.value if isinstance(objective, cp.Expression) else objective))


def _symmetrised(K: np.ndarray) -> np.ndarray:
    n = round(np.sqrt(K.shape[0]))
    flipped = K.reshape(n, n, -1).transpose(1, 0, 2).reshape(K.shape)
    return 0.5 * (K + flipped)
