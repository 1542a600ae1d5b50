"""The default recipe: solve, back off the level, maximise the margin under a norm cap; and the reason when nothing is found."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import cvxpy as cp
import numpy as np

from luenberger.core import Infeasible
from luenberger.lmi.problem import Problem, Solution, solve


def centre(
    problem: Problem, back_off: float = 0.01, cap: float = 2.0, floor: float = 0.0, solvers: Sequence[str] | None = None
) -> Solution | None:
    """Return a strictly feasible point near the optimum: a point on the boundary cannot be certified after rounding.

    The objective may rise by `back_off` of its optimal size; within that, the smallest margin over all blocks is
    maximised while no variable grows beyond `cap` times its optimal norm.

    Args:
        problem: blocks and objective.
        back_off: relative loss of objective that is given away.
        cap: norm cap relative to the optimiser.
        floor: size below which the objective counts as this large, so that an optimum at zero leaves room too.
        solvers: names to try in order; default all installed.

    Returns:
        a solution with positive margin, or None where none was found.
    """
    best = solve(problem, solvers=solvers)
    if best is None:
        return None
    t = cp.Variable()
    extra = [
        cp.norm(v, "fro" if v.ndim == 2 else 2) <= cap * max(np.linalg.norm(best.values[k]), floor) + 1e-9
        for k, v in problem.variables.items()
    ]
    if problem.objective is not None:
        extra.append(problem.objective <= best.objective + back_off * max(abs(best.objective), floor))
    wide = solve(replace(problem, objective=t), slack=t, extra=extra, solvers=solvers)
    if wide is None or not wide.margin > 0:
        # The optimum itself may lie strictly inside where the wider problem defeats the solvers.
        if not best.margin > 0:
            return None
        # Whoever reads the variables themselves must not see the failed try.
        for name, variable in problem.variables.items():
            variable.save_value(best.values[name])
        return best
    value = 0.0 if problem.objective is None else float(problem.objective.value)
    return replace(
        wide,
        objective=value,
        optimum=best.objective,
        solver_seconds=best.solver_seconds + wide.solver_seconds,
        seconds=best.seconds + wide.seconds,
    )


def charged_block(problem: Problem) -> str:
    """Return the name of the block that the dual certificate of infeasibility charges most.

    The least t is sought for which every block holds with `<= t I`; the dual matrices of that problem have unit total
    trace and share the blame out.
    """
    t = cp.Variable()
    answer = solve(replace(problem, objective=t), slack=t, extra=[t <= 1e6, t >= -1.0])
    return max(answer.duals, key=lambda k: answer.duals[k]) if answer is not None and answer.duals else ""


def nearest_level(
    posed: Callable[[float], Problem], easy: float, wanted: float, steps: int = 10, floor: float = 0.0
) -> float | None:
    """Return the feasible level closest to `wanted` that bisection finds, or None where `easy` fails too.

    Args:
        posed: gives the problem at a level.
        easy: the level most easily met.
        wanted: the level that was asked for and cannot be met.
        steps: number of halvings.
        floor: as in `centre`.
    """

    def feasible(level: float) -> bool:
        return centre(posed(level), floor=floor, solvers=("CLARABEL",)) is not None

    if not feasible(easy):
        return None
    good, bad = easy, wanted
    for _ in range(steps):
        middle = 0.5 * (good + bad)
        good, bad = (middle, bad) if feasible(middle) else (good, middle)
    return good


def infeasible(problem: Problem, option: str, wanted: float | None, unit: str, nearest: float | None) -> Infeasible:
    """Return the error that says what was asked, which block stands in the way, and what could be met.

    Args:
        problem: the problem that has no solution.
        option: name of the requested level, empty where there is none.
        wanted: its value.
        unit: its unit.
        nearest: the closest level found.
    """
    block = charged_block(problem)
    blame = f" The inequality `{block}` stands in the way." if block else ""
    if not option or wanted is None:
        return Infeasible(
            f"No observer of this form was found.{blame} Relax a bound of the plant or add a sensor.", block
        )
    request = f"No observer of this form was found for {option} = {wanted:.6g} {unit}".rstrip() + ";"
    if nearest is None:
        return Infeasible(
            f"{request} no other value of `{option}` helps either.{blame} Relax a bound of the plant or add a sensor.",
            block,
        )
    return Infeasible(
        f"{request} the closest found was {nearest:.6g} {unit}".rstrip()
        + f".{blame} Ask for that `{option}` or less strict.",
        block,
        nearest,
    )
