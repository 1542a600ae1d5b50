"""Constant gains by the P-radius of the set of errors: predictors (PRad-E) and intersections with strips (PRad-A, PRad-C)."""

from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar

import cvxpy as cp
import numpy as np

from luenberger.algebra import Polynomial, symmetric
from luenberger.core import BadInput, NotAccepted
from luenberger.lmi import Block, Problem, Solution, centre, infeasible, solve
from luenberger.methods.method import Candidate, statistics
from luenberger.methods.zonotopic_plant import DrivenError, require_driven, steady_claims
from luenberger.observers.zonotopic_strips import together
from luenberger.systems import System

# Contractions a step that are tried; the inequality is convex for each.
CONTRACTIONS = tuple(np.linspace(0.05, 0.95, 10).tolist())
# How far the search closes in around the best of them.
_HALVINGS = 4
# Contractions for which an inner point is looked for.
_TRIED = 4
# Share of t that is given away for a strict inequality.
BACK_OFF = 0.005


@dataclass(frozen=True)
class PRadiusGain:
    """Constant gain that makes the ellipsoid around all steady errors small; CORA's classes PRad-A, PRad-C and PRad-E.

    Choose it for a published gain with a proved contraction. `SteadyWidth` finds narrower boxes. With the current measurement the
    design carries one filter gain for all strips together; strips taken one by one are the same with their product.

    Assumes: x+ = A x + B u + E d, y = C x + D u + G v, u measured as u + N v, constant matrices, |d| <= disturbance_bound,
    |v| <= noise_bound.
    Certifies: see `SteadyWidth`, for the predictor with gain L, which is A K where the current measurement is used.

    With x' P x the squared radius of an error x, F its loop and M the generators of disturbance and noise,

        [[b P, 0, F' P], [0, (1 - b) diag(m), M' P], [P F, P M, P]] >= 0,   m >= 0,   sum m <= 1,   P >= t I

    gives |x+|_P^2 <= b |x|_P^2 + (1 - b): the radius ends at one or below. For each b the largest t is sought, then the best b.

    Args:
        uses: "previous" predicts with y up to the last sample, F = A - L C (PRad-E); "current" cuts the prediction by the
            strips of the current y, F = (I - K C) A (PRad-A, PRad-C).
        strips: with the current measurement, "together" takes one gain for all strips (PRad-C), "one by one" a gain for each
            strip from its own inequality (PRad-A); these are the same with one output.

    Reference: V. Le, C. Stoica, T. Alamo, E. Camacho, D. Dumur, Zonotopic guaranteed state estimation for uncertain systems,
    Automatica 49 (2013) 3418-3424, theorem 3; weights m of the single generators, where the paper has one number for all, are ours. Names of
    the classes as in M. Althoff, J. Rath, Automatica 130 (2021) 109662.

    Example:
        >>> import luenberger as lb
        >>> from luenberger.methods.zonotopic_radius import PRadiusGain
        >>> plant = lb.System.linear(
        ...     [[0.5]], C=[[1.0]], E=[[1.0]], dt=0.1, disturbance_bound=[1.0], noise_bound=[1.0])
        >>> PRadiusGain(uses="current").filter_gain(plant).shape
        (1, 1)
    """

    uses: str = "previous"
    strips: str = "together"

    references: ClassVar[tuple[str, ...]] = (
        "V. Le, C. Stoica, T. Alamo, E. Camacho, D. Dumur, Zonotopic guaranteed state estimation for uncertain systems, "
        "Automatica 49 (2013) 3418-3424",
        "M. Althoff, J. Rath, Comparison of guaranteed state estimators for linear time-invariant systems, "
        "Automatica 130 (2021) 109662",
    )

    def accept(self, system: System) -> None:
        """Refuse plants without a constant steady box; see `Method`."""
        if self.uses not in ("previous", "current") or self.strips not in ("together", "one by one"):
            raise BadInput(
                f'`uses` is "{self.uses}" and `strips` "{self.strips}"; "previous" or "current", and "together" or "one by one", '
                "are needed."
            )
        require_driven(system)

    def design(self, system: System) -> Candidate:
        """Search the contraction; see `Method`."""
        found, contractions = self._found(system)
        facts: dict[str, Any] = statistics(found[0]) | {"contraction": contractions}
        gains, claims = np.hstack([_gain(f) for f in found]), partial(steady_claims, system)
        if self.uses == "previous":
            return Candidate(Polynomial.constant(gains), claims, facts)
        K = self._joined(system, gains)
        L = np.asarray(system.at("A")) @ K
        return Candidate(Polynomial.constant(L), claims, facts, filter_gain=Polynomial.constant(K))

    def filter_gain(self, system: System) -> np.ndarray:
        """Return K, shape (nx, ny), for `ZonotopicStripFilter`; its columns belong to strips taken as `strips` says.

        Args:
            system: plant.

        Raises:
            NotAccepted: a predictor; or one by one, an output that alone does not make the error fade.
            BadInput: see `accept`.
            Infeasible: nothing was found.
        """
        if self.uses == "previous":
            raise NotAccepted('A predictor has no filter gain; ask for `PRadiusGain(uses="current")`.')
        self.accept(system)
        return np.hstack([_gain(f) for f in self._found(system)[0]])

    def _joined(self, system: System, gains: np.ndarray) -> np.ndarray:
        if self.strips == "together":
            return gains
        return np.asarray(together(gains, np.asarray(system.at("C"), dtype=float)))

    def _found(self, system: System) -> tuple[list[Solution], list[float]]:
        if self.uses == "previous":
            seen = [DrivenError.of(system)]
        elif self.strips == "together":
            seen = [DrivenError.filtered(system)]
        else:
            alone = [_alone(system, k) for k in range(system.ny)]
            for plant in alone:
                require_driven(plant)
            seen = [DrivenError.filtered(plant) for plant in alone]
        answers = [_best(error) for error in seen]
        return [a[1] for a in answers], [a[0] for a in answers]


def _gain(found: Solution) -> np.ndarray:
    return np.linalg.solve(found.values["P"], found.values["Y"])


def _alone(system: System, k: int) -> System:
    parts = {letter: system.polynomial(letter).map(lambda c: np.asarray(c)[[k]]) for letter in "CDG"}
    return system.replace(
        **parts, outputs=[system.outputs[k]], units={}, name=f"{system.name} seen by {system.outputs[k]}"
    )


def _best(error: DrivenError) -> tuple[float, Solution]:
    """The contraction with the largest t, and a centred solution for it."""
    values: dict[float, float] = {}

    def reached(b: float) -> float:
        if b not in values:
            found = solve(_posed(error, b), solvers=("CLARABEL",))
            values[b] = -np.inf if found is None else -found.objective
        return values[b]

    best = max(CONTRACTIONS, key=reached)
    step = (CONTRACTIONS[1] - CONTRACTIONS[0]) / 2
    for _ in range(_HALVINGS):
        best = max((best - step, best, best + step), key=reached)
        step /= 2
    # Where a share goes to zero, the solver may find no inner point: the neighbours are nearly as good.
    for b in sorted(values, key=reached, reverse=True)[:_TRIED]:
        centred = centre(_posed(error, b), back_off=BACK_OFF)
        if centred is not None:
            return b, centred
    raise infeasible(_posed(error, best), "", None, "", None)


def _posed(error: DrivenError, b: float) -> Problem:
    nx = len(error.A)
    P = cp.Variable((nx, nx), symmetric=True, name="P")
    Y = cp.Variable((nx, len(error.C)), name="Y")
    t = cp.Variable(name="t")
    loop, drive = P @ error.A - Y @ error.C, P @ error.base - Y @ error.seen
    m = cp.Variable(drive.shape[1], name="m")
    zero = np.zeros((nx, drive.shape[1]))
    radius = symmetric(
        [
            [Polynomial.constant(b * P), Polynomial.constant(zero), Polynomial.constant(loop.T)],
            [Polynomial.constant((1 - b) * cp.diag(m)), Polynomial.constant(drive.T)],
            [Polynomial.constant(P)],
        ]
    )
    blocks = [
        Block("radius", -radius),
        Block("size", Polynomial.constant(t * np.eye(nx) - P)),
        Block("share", Polynomial.constant(cp.reshape(cp.sum(m) - 1, (1, 1), order="C"))),
    ]
    return Problem({"P": P, "Y": Y, "t": t, "m": m}, blocks, -t)
