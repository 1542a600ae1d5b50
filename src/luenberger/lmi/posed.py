"""A relaxed problem on its way through the solvers, and what their numbers prove."""

import warnings
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any

import cvxpy as cp
import numpy as np
from cvxpy.error import SolverError

from luenberger.lmi.affine_form import Memo
from luenberger.lmi.conic_form import ConicForm, conic_form
from luenberger.lmi.relaxed import Relaxed
from luenberger.lmi.solvers import SOLVERS, silent


class Posed:
    """A relaxed problem; after a run it holds the multipliers' unknowns and the dual weight of each block.

    Args:
        objective: affine or convex expression to minimise, None for feasibility.
        unknowns: variables of the blocks, in the order of the numeric forms.
        groups: block name -> its relaxation.
        margins: block name -> its margin.
        slack: cvxpy scalar added to every level, or None.
        extra: further cvxpy constraints.
        memo: forms of shared sub-expressions.
    """

    def __init__(
        self,
        objective: Any,
        unknowns: Sequence[cp.Variable],
        groups: Mapping[str, Sequence[Relaxed]],
        margins: Mapping[str, float],
        slack: Any,
        extra: Sequence[Any],
        memo: Memo,
    ):
        self.objective, self.unknowns, self.groups, self.margins = objective, unknowns, groups, margins
        self.slack, self.extra, self.memo = slack, extra, memo
        self.multipliers: Sequence[np.ndarray] = [np.zeros(r.unknowns) for g in groups.values() for r in g]
        self.charges: Mapping[str, float] = {}

    def run(self, solver: str) -> float:
        """Run one solver; its status is ignored on purpose. Returns its own time [s].

        Args:
            solver: name.
        """
        if solver == "CLARABEL" and self._conic is not None:
            seconds, found, self.charges = self._conic.run()
            self.multipliers = self.multipliers if found is None else found
            return seconds
        posed, own, cones = self._modelled
        try:
            with warnings.catch_warnings(), silent(solver):
                warnings.simplefilter("ignore")
                posed.solve(solver=solver, **SOLVERS[solver])
        except (SolverError, ArithmeticError, ValueError):
            for variable in posed.variables():
                variable.save_value(None)
            return 0.0
        if all(w is None or w.value is not None for w in own):
            self.multipliers = [np.zeros(0) if w is None else np.asarray(w.value) for w in own]
        self.charges = {
            name: sum(float(np.diagonal(np.atleast_2d(c.dual_value)) @ u) for c, u in group if c.dual_value is not None)
            for name, group in cones.items()
        }
        return float(posed.solver_stats.solve_time or 0.0)

    def judged(self, values: Sequence[np.ndarray], slack: float) -> tuple[dict[str, float], float]:
        """Return (proved margin of each block name, largest relative violation) at these values.

        The level that a relaxation proves counts, multipliers and side conditions included; see `Relaxed.level`.

        Args:
            values: of the variables, in order.
            slack: value of the slack.
        """
        x = np.concatenate([np.ravel(v, order="F") for v in values] + [np.ones(1)])
        margins, worst = dict.fromkeys(self.groups, np.inf), 0.0
        multipliers = iter(self.multipliers)
        for name, group in self.groups.items():
            for relaxed in group:
                level, size = relaxed.level(x, next(multipliers))
                margins[name] = min(margins[name], -level)
                worst = max(worst, (level + self.margins[name] - slack) / (1.0 + size))
        return margins, worst

    @cached_property
    def _conic(self) -> ConicForm | None:
        return conic_form(self.objective, self.unknowns, self.groups, self.margins, self.slack, self.extra, self.memo)

    @cached_property
    def _modelled(self) -> tuple[cp.Problem, list[Any], dict[str, list[tuple[Any, np.ndarray]]]]:
        """The problem in the modelling layer, the multipliers' unknowns, and the cones with their unit blocks."""
        x = cp.hstack([cp.vec(v, order="F") for v in self.unknowns])
        own: list[Any] = []
        cones: dict[str, list[tuple[Any, np.ndarray]]] = {}
        for name, group in self.groups.items():
            level = -self.margins[name] if self.slack is None else self.slack - self.margins[name]
            cones[name] = []
            for relaxed in group:
                own.append(cp.Variable(relaxed.unknowns) if relaxed.unknowns else None)
                for condition in relaxed.conditions:
                    n, K = condition.size, condition.K
                    vector = K[:, :-1] @ x + K[:, -1]
                    if condition.W is not None:
                        vector = vector + condition.W @ own[-1]
                    bound = level * np.diag(condition.unit) - cp.reshape(vector, (n, n), order="C")
                    cones[name].append((bound >> 0, condition.unit))
        constraints = [c for group in cones.values() for c, _ in group]
        objective = cp.Minimize(0 if self.objective is None else self.objective)
        return cp.Problem(objective, [*constraints, *self.extra]), own, cones
