"""A problem as the cones and sparse matrices that Clarabel reads, made from numeric forms without a modelling layer.

On problems of this size the translation of expression trees takes twenty times what the solver takes. Everything is known in
numbers already, so it is handed over as it is. What the form cannot say (another objective or constraint than those below) is
left to the modelling layer: `conic_form` returns None.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import clarabel
import cvxpy as cp
import numpy as np
import scipy.sparse as sp

from luenberger.lmi.affine_form import Memo, stacked
from luenberger.lmi.conic_rows import Rows, merged, triangle
from luenberger.lmi.relaxed import Relaxed
from luenberger.lmi.solvers import SOLVERS

# The extension module comes without stubs.
_solver: Any = clarabel
# Ends of a run whose point is worth judging; the others return certificates of infeasibility or nothing.
_USABLE = ("Solved", "AlmostSolved", "MaxIterations", "MaxTime")


@dataclass
class ConicForm:
    """minimise c'z subject to A z + s = b, s in a product of cones, and how z gives the variables.

    Args:
        variables: in the order of their coordinates in z; a multiplier's unknowns come after them.
        place: vec(variables) = z[place], entries in Fortran order.
        widths: number of unknowns of each multiplier.
        objective: c.
        A: constraint matrix.
        b: its right-hand side.
        cones: the cones of s.
        diagonals: block name -> rows of s whose duals sum to the charge of the block.
    """

    variables: Sequence[cp.Variable]
    place: np.ndarray
    widths: Sequence[int]
    objective: np.ndarray
    A: sp.csc_array
    b: np.ndarray
    cones: list[Any]
    diagonals: Mapping[str, np.ndarray]

    def run(self) -> tuple[float, list[np.ndarray] | None, dict[str, float]]:
        """Solve; give the variables their values, or None where no usable point was found.

        Returns:
            solver's own time [s], the values of the multipliers' unknowns or None, charge of each block.
        """
        settings = _solver.DefaultSettings()
        settings.verbose = False
        for option, value in SOLVERS["CLARABEL"].items():
            setattr(settings, option, value)
        n = len(self.objective)
        empty = sp.csc_array((n, n))
        answer = _solver.DefaultSolver(empty, self.objective, self.A, self.b, self.cones, settings).solve()
        z = np.asarray(answer.x)
        if str(answer.status) not in _USABLE or not np.isfinite(z).all():
            for variable in self.variables:
                variable.save_value(None)
            return float(answer.solve_time), None, {}
        full, start = z[self.place], 0
        for variable in self.variables:
            variable.save_value(full[start : start + variable.size].reshape(variable.shape, order="F"))
            start += variable.size
        tail = np.split(z[len(z) - sum(self.widths) :], np.cumsum(self.widths)[:-1]) if self.widths else []
        dual = np.asarray(answer.z)
        charges = {name: float(dual[rows].sum()) for name, rows in self.diagonals.items()}
        return float(answer.solve_time), tail, charges


def conic_form(
    objective: Any,
    unknowns: Sequence[cp.Variable],
    groups: Mapping[str, Sequence[Relaxed]],
    margins: Mapping[str, float],
    slack: Any,
    extra: Sequence[Any],
    memo: Memo,
) -> ConicForm | None:
    """Return the problem in conic form, or None where it has a part that the form cannot say.

    Args:
        objective: affine expression or number to minimise, None for feasibility.
        unknowns: variables of the blocks, in the order of the numeric forms.
        groups: block name -> its relaxation.
        margins: block name -> its margin.
        slack: cvxpy variable added to every level, or None.
        extra: further cvxpy constraints: affine (in)equalities, definiteness, Euclidean norms bounded by an affine expression.
        memo: forms of shared sub-expressions.
    """
    everyone = _ordered(objective, unknowns, slack, extra)
    if not all(_plain(v) for v in everyone) or not (slack is None or isinstance(slack, cp.Variable)):
        return None
    if isinstance(objective, cp.Expression) and not objective.is_affine():
        return None
    rows = Rows(everyone, memo)
    for variable in everyone:
        if variable.attributes["nonneg"]:
            rows.affine(variable, "nonneg")
    widths = [r.unknowns for group in groups.values() for r in group]
    diagonals = _blocks(rows, unknowns, groups, margins, slack, sum(widths))
    if not all(rows.constraint(c) for c in extra):
        return None
    place = _place(everyone)
    coordinates = int(place.max(initial=-1)) + 1
    c = np.zeros(coordinates + rows.further + sum(widths))
    if isinstance(objective, cp.Expression):
        c[:coordinates] = merged(stacked(objective, everyone, memo)[:, :-1], place)[0]
    A, b, cones, first = rows.collected(place, sum(widths))
    return ConicForm(everyone, place, widths, c, A, b, cones, {k: first + d for k, d in diagonals.items()})


def _ordered(objective: Any, unknowns: Sequence[cp.Variable], slack: Any, extra: Sequence[Any]) -> list[cp.Variable]:
    """All variables, in the order the modelling layer has them: on ill-conditioned problems the last digits depend on it."""
    rest = [*_variables(slack), *unknowns, *(v for c in extra for v in _variables(c))]
    signed = [v for v in rest if v.attributes["nonneg"]]
    return list({v.id: v for v in [*_variables(objective), *signed, *rest]}.values())


def _blocks(
    rows: Rows,
    unknowns: Sequence[cp.Variable],
    groups: Mapping[str, Sequence[Relaxed]],
    margins: Mapping[str, float],
    slack: cp.Variable | None,
    width: int,
) -> dict[str, np.ndarray]:
    """Add  (slack - margin) diag(unit) - M >= 0  for all conditions; return where the duals of the unit blocks' diagonals are."""
    known = np.concatenate([rows.place[v.id] + np.arange(v.size) for v in unknowns])
    found: dict[str, list[np.ndarray]] = {name: [np.zeros(0, dtype=int)] for name in groups}
    start = 0
    for name, group in groups.items():
        for relaxed in group:
            for condition in relaxed.conditions:
                order, scale, diagonal = triangle(condition.size)
                K = condition.K[order]
                left = np.zeros((len(order), rows.entries))
                left[:, known] = K[:, :-1]
                if slack is not None:
                    left[diagonal, rows.place[slack.id]] -= condition.unit
                b = -K[:, -1]
                b[diagonal] -= margins[name] * condition.unit
                W = None if condition.W is None else _scaled(condition.W, order, scale, start, width)
                first = rows.add("psd", condition.size, left, b * scale, W)
                found[name].append(first + diagonal[condition.unit > 0])
            start += relaxed.unknowns
    return {name: np.concatenate(parts) for name, parts in found.items()}


def _place(variables: Sequence[cp.Variable]) -> np.ndarray:
    """Coordinate of every entry: the lower triangle of a symmetric variable, all entries of any other."""
    found, start = [np.zeros(0, dtype=int)], 0
    for variable in variables:
        if variable.attributes["symmetric"]:
            n = variable.shape[0]
            rows, columns = np.tril_indices(n)
            place = np.zeros((n, n), dtype=int)
            place[rows, columns] = place[columns, rows] = np.arange(len(rows))
            found.append(start + place.ravel(order="F"))
            start += len(rows)
        else:
            found.append(start + np.arange(variable.size))
            start += variable.size
    return np.concatenate(found)


def _plain(variable: cp.Variable) -> bool:
    used = {k for k, value in variable.attributes.items() if value is not None and value is not False}
    return used <= {"symmetric", "nonneg"}


def _variables(part: Any) -> list[cp.Variable]:
    return part.variables() if hasattr(part, "variables") else []


def _scaled(W: sp.csr_array, order: np.ndarray, scale: np.ndarray, start: int, width: int) -> sp.csr_array:
    picked = sp.csr_array(W[order])
    data = picked.data * np.repeat(scale, np.diff(picked.indptr))
    return sp.csr_array((data, picked.indices + start, picked.indptr), shape=(len(order), width))
