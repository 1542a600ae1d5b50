"""The same problem by every solver that is installed: agreement is evidence, a residual is a fact."""

from collections.abc import Sequence
from dataclasses import dataclass

from luenberger.lmi.problem import Problem, Solution, installed_solvers, solve


@dataclass(frozen=True)
class CrossCheck:
    """Answers of several solvers to one problem.

    Args:
        answers: solver name -> its answer, whatever its residual; None where it gave no numbers.
    """

    answers: dict[str, Solution | None]

    @property
    def accepted(self) -> dict[str, Solution]:
        """The answers whose recomputed residual is small."""
        return {name: answer for name, answer in self.answers.items() if answer is not None and answer.holds}

    @property
    def spread(self) -> float:
        """Largest difference of accepted objectives, relative to their size; infinite where fewer than two are accepted."""
        values = [answer.objective for answer in self.accepted.values()]
        if len(values) < 2:
            return float("inf")
        return (max(values) - min(values)) / (1e-12 + max(abs(v) for v in values))


def cross_check(problem: Problem, solvers: Sequence[str] | None = None) -> CrossCheck:
    """Solve a problem with every installed solver, each judged by its residual and never by its status.

    Choose it before a number is published, or where two routes disagree; a design does not need it, since its claims are
    proved anyway.

    Args:
        problem: what to solve.
        solvers: names to use; default all installed ones.

    Raises:
        BadInput: an unknown or absent solver is named.
    """
    names = installed_solvers(solvers)
    return CrossCheck({name: solve(problem, solvers=(name,), tolerance=float("inf")) for name in names})
