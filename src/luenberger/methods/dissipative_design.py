"""What designs by one dissipation inequality share: decay, L2 gain and gain limits around it, and the order of the solves.

For e' = Ae e + Be w with a Jacobian set inside Ae, a storage P and Y = P L, a method states in its own way that

    V' + e' S e - reach |w|^2 < 0,   V = e' P e,        S = 2 decay_rate P   or   S = size W'W  (with |W e| <= level |w|)

holds for all Jacobians. Around it stand limits of the gain that is injected: P >= p I and [[P, Y], [Y', t I]] >= 0 give
|L|^2 <= t / p. With size = 1 and t = limit^2 p everything is linear in (P, Y, p, reach): the scale p is found, not scanned.
With p = 1 and reach = size level^2 the size is free and t, the squared gain norm, is minimised.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Literal

import cvxpy as cp
import numpy as np

from luenberger.algebra import Polynomial, symmetric
from luenberger.certify import Claim, certify_claims
from luenberger.core import BadInput, Infeasible, NotAccepted, Outcome
from luenberger.core.checks import known_keys, matrix
from luenberger.lmi import (
    Block,
    Problem,
    Solution,
    centre,
    infeasible,
    l2_storage,
    nearest_level,
    rounded_storage,
    solve,
)
from luenberger.methods.method import (
    NEGLIGIBLE,
    Candidate,
    gain_blocks,
    gain_bound,
    require_continuous,
    require_polynomial,
    scheduled_variable,
    statistics,
)
from luenberger.methods.robust_luenberger import require_channels
from luenberger.methods.supply import Supply, input_unit
from luenberger.systems import System
from luenberger.systems.jacobian_box import as_floats, jacobian, jacobian_corners
from luenberger.systems.observability import require_detectable

Variables = dict[str, cp.Variable]
Pose = Callable[[float], tuple[Problem, Polynomial]]
# Relative distance from the smallest L2 level, within which the smallest gain is taken: the level alone leaves it open. The
# second one is for levels that only gains beyond the numbers of a solver come closer to.
SLACKS = (0.01, 0.1)
# Squared level, for inputs of unit size, below which it counts as a level that no finite gain reaches.
NEGLIGIBLE_REACH = 1e-9
# Units of P L that are tried: a large gain goes with numbers of unlike size, on which solvers fail.
SCALES = (1.0, 30.0, 300.0, 3000.0)
# Margin, relative to P L, above which the rounding of a gain to seven digits is not worth a look.
THIN = 1e-5
# Weights of W'W that are tried: with large levels P grows, and its inverse shrinks.
SIZES = (1.0, 1e-3)
TRIES: tuple[tuple[float, tuple[str, ...] | None], ...] = (*((s, ("CLARABEL",)) for s in SCALES), (1.0, None))


@dataclass(frozen=True)
class _Found:
    """A centred solution, P L, its unit, the size of W'W, the squared level in units of the input, and its optimum."""

    solution: Solution
    Y: Polynomial
    scale: float
    size: float = 1.0
    reach: float | None = None
    optimum: float = 0.0


@dataclass(frozen=True)
class DissipativeDesign(ABC):
    """Base of the methods that differ only in how the dissipation inequality is stated over the Jacobian set.

    Args:
        decay_rate: wanted decay of the error norm [1/s], >= 0.
        goal: "gain" looks for the smallest gain norm, "l2" for the smallest L2 gain from `inputs` to `weight` e.
        inputs: "disturbance", "noise" or "both", for goal "l2".
        weight: W, rows over the states; left out: the identity.
        gain_limit: bound of |L| that is kept; left out: none.
        schedule: "plant" gives L(r) the monomials of A and C, "constant" one gain for the whole box.
    """

    decay_rate: float = 0.0
    goal: Literal["gain", "l2"] = "gain"
    inputs: str = "disturbance"
    weight: tuple[tuple[float, ...], ...] | None = None
    gain_limit: float | None = None
    schedule: Literal["plant", "constant"] = "plant"

    def __post_init__(self) -> None:
        if self.weight is not None:
            object.__setattr__(self, "weight", tuple(tuple(map(float, row)) for row in self.weight))

    @abstractmethod
    def dissipates(self, system: System, P: Polynomial, Y: Polynomial, supply: Supply) -> tuple[list[Block], Variables]:
        """Return the blocks that state V' + e' S e - reach |w|^2 < 0 for all Jacobians, and the variables they bring along.

        Args:
            system: accepted plant.
            P: storage variable, (nx, nx).
            Y: P L, (nx, ny).
            supply: S, inputs and reach.
        """

    def second_gain(self) -> np.ndarray | None:
        """Return L2 where the observer corrects the argument of f, else None."""
        return None

    def accept(self, system: System) -> None:
        """Refuse plants and options outside the theorem; see `Method`."""
        known_keys("`goal`", [self.goal], ["gain", "l2"])
        known_keys("`schedule`", [self.schedule], ["plant", "constant"])
        if self.gain_limit is not None and not (np.isfinite(self.gain_limit) and self.gain_limit > 0):
            raise BadInput(f"`gain_limit` is {self.gain_limit}; give a finite bound above zero, or leave it out.")
        require_continuous(system)
        require_polynomial(system)
        if system.measured_scheduling is not None:
            raise NotAccepted(
                f"The scheduling of `{system.name}` is measured with error; use `RobustLuenberger`, or give exact parameters."
            )
        if system.nonlinearity is not None:
            jacobian(system)
        if self.goal == "l2":
            known_keys("`inputs`", [self.inputs], ["disturbance", "noise", "both"])
            require_channels(system, self.inputs, "plant")
            self._weight(system)
        for corner in jacobian_corners(system):
            require_detectable(corner, self.decay_rate)

    def design(self, system: System) -> Candidate:
        """Find the smallest gain, or the smallest level; see `Method`."""
        found = self._found(system)
        P = found.solution.values["P"]
        gain = found.Y.map(lambda y: np.linalg.solve(P, np.asarray(y.value)))
        L2 = self.second_gain()

        def claims(rounded: Polynomial, second: Polynomial | None = None) -> list[Claim]:
            made = [Claim("decay", self.decay_rate, rounded_storage(P)), gain_bound(system, rounded)]
            if second is not None:
                made.append(replace(gain_bound(system, second), kind="argument_gain_bound"))
            return made if found.reach is None else [self._level_claim(system, found, rounded, second), *made]

        second = None if L2 is None else Polynomial.constant(L2)
        noted = {**statistics(found.solution), "optimum": found.optimum}
        return Candidate(gain, claims, noted, argument_gain=second)

    def _level_claim(self, system: System, found: _Found, gain: Polynomial, second: Polynomial | None) -> Claim:
        """The level that was designed for; where a thin margin did not outlast the rounding, that of the rounded gain."""
        assert found.reach is not None
        W, storage = self._weight(system), rounded_storage(found.solution.values["P"] / found.size)
        # The solution lies strictly inside, so that the level itself may be rounded up by its last digits.
        level = float(np.sqrt(found.reach)) * input_unit(system, self.inputs) * (1 + 1e-9)
        made = Claim("l2_gain", level, storage, weight=W, inputs=self.inputs)
        scaled = max(float(np.abs(found.solution.values["P"] @ np.asarray(c)).max()) for _, c in gain)
        wide = found.solution.margin > THIN * scaled
        if wide or certify_claims(system, gain, [made], argument_gain=second).outcome is Outcome.PROVED:
            return made
        again = l2_storage(system, gain, W, self.inputs, argument_gain=second)
        return made if again is None else Claim("l2_gain", again[0], again[1], weight=W, inputs=self.inputs)

    def _found(self, system: System) -> _Found:
        if self.goal == "gain":
            found = _centred(lambda scale: self._gain_problem(system, scale), NEGLIGIBLE)
        elif self.gain_limit is not None:
            found = self._smallest_level(system)
        else:
            found = self._near_smallest_level(system)
        if found is None:
            raise self._refusal(system)
        if self.goal == "gain":
            return replace(found, optimum=found.optimum * found.scale**2)
        return replace(found, optimum=found.optimum * input_unit(system, self.inputs) ** 2)

    def _smallest_level(self, system: System) -> _Found | None:
        """The smallest level within the limit of the gain, centred."""
        for size in SIZES:
            found = _centred(lambda scale, size=size: self._level_problem(system, scale, size), 0.0)
            if found is not None:
                reach = float(found.solution.values["reach"]) / size
                return replace(found, size=size, reach=reach, optimum=found.optimum / size)
        return None

    def _near_smallest_level(self, system: System) -> _Found | None:
        """The smallest gain within `SLACKS` of the smallest level, which may be the limit of ever larger gains."""
        tries = (solve(self._level_problem(system, scale)[0], solvers=solvers) for scale, solvers in TRIES)
        best = next((t for t in tries if t is not None and t.objective > NEGLIGIBLE_REACH), None)
        if best is None:
            return None
        for slack in SLACKS:
            reach = (1 + slack) ** 2 * best.objective
            found = _centred(lambda scale, reach=reach: self._gain_problem(system, scale, reach), NEGLIGIBLE)
            if found is not None:
                spent = {k: getattr(best, k) + getattr(found.solution, k) for k in ("solver_seconds", "seconds")}
                size, whole = float(found.solution.values["size"]), replace(found.solution, **spent)
                return replace(found, solution=whole, size=size, reach=reach, optimum=best.objective)
        return None

    def _gain_problem(self, system: System, scale: float, reach: float | None = None) -> tuple[Problem, Polynomial]:
        """The smallest squared gain norm in units of `scale`, P >= I; the size is free where a squared level is kept."""
        P, Y, variables = self._unknowns(system)
        squared, size = cp.Variable(name="squared"), cp.Variable(name="size", nonneg=True)
        known = {"P": P, "squared": squared, **variables}
        supplies = []
        if reach is not None:
            known["size"] = size
            supplies.append(self._performance(system, size, size * reach))
        blocks, more = self._demands(system, P, Y * scale, supplies)
        blocks += gain_blocks(P, Y, squared, system.scheduling_box)
        if self.gain_limit is not None:
            excess = squared * (scale / self.gain_limit) ** 2 - 1.0
            blocks.append(Block("gain_limit", Polynomial.constant(excess * np.eye(1))))
        return Problem({**known, **more}, blocks, squared), Y

    def _level_problem(self, system: System, scale: float, size: float = 1.0) -> tuple[Problem, Polynomial]:
        """The smallest squared level in units of the input, times `size`; Y in units of `scale`."""
        P, Y, variables = self._unknowns(system)
        p, reach = cp.Variable(name="p", nonneg=True), cp.Variable(name="reach")
        blocks, more = self._demands(system, P, Y * scale, [self._performance(system, size, reach)])
        blocks.append(Block("storage", Polynomial.constant(p * np.eye(system.nx) - P)))
        if self.gain_limit is not None:
            corner = Polynomial.constant((self.gain_limit / scale) ** 2 * p * np.eye(system.ny))
            wide = symmetric([[Polynomial.constant(P), Y], [corner]])
            blocks.append(Block("gain_limit", -wide, system.scheduling_box))
        return Problem({"P": P, "p": p, "reach": reach, **variables, **more}, blocks, reach), Y

    def _unknowns(self, system: System) -> tuple[cp.Variable, Polynomial, Variables]:
        P = cp.Variable((system.nx, system.nx), symmetric=True, name="P")
        like = [] if self.schedule == "constant" else [as_floats(system.A), as_floats(system.C)]
        Y, variables = scheduled_variable(system.nx, system.ny, like, system.scheduling_names, "Y")
        return P, Y, variables

    def _demands(
        self, system: System, P: cp.Variable, Y: Polynomial, supplies: list[Supply]
    ) -> tuple[list[Block], Variables]:
        wanted = list(supplies)
        if self.decay_rate > 0 or not supplies:
            wanted.append(Supply("decay", 2 * self.decay_rate * P))
        blocks: list[Block] = []
        variables: Variables = {}
        for supply in wanted:
            found, more = self.dissipates(system, Polynomial.constant(P), Y, supply)
            blocks += found
            variables |= more
        return blocks, variables

    def _performance(self, system: System, size: Any, reach: Any) -> Supply:
        W = self._weight(system)
        return Supply("l2_gain", size * (W.T @ W), self.inputs, reach, input_unit(system, self.inputs))

    def _weight(self, system: System) -> np.ndarray:
        if self.weight is None:
            return np.eye(system.nx)
        return matrix("weight", self.weight, len(self.weight), system.nx, f"the system has {system.nx} states")

    def _refusal(self, system: System) -> Infeasible:
        """What is in the way, with the nearest decay rate or gain limit that can be met."""
        plain = replace(self, goal="gain", gain_limit=None)

        def unlimited(rate: float, scale: float = SCALES[1]) -> Problem:
            return replace(plain, decay_rate=rate)._gain_problem(system, scale)[0]

        tries = ((s, centre(unlimited(self.decay_rate, s), floor=NEGLIGIBLE / s**2)) for s in SCALES[1:])
        smallest = next((s * float(np.sqrt(found.objective)) for s, found in tries if found is not None), None)
        if smallest is None:
            nearest = nearest_level(unlimited, 0.0, self.decay_rate, floor=NEGLIGIBLE / SCALES[1] ** 2)
            return infeasible(unlimited(self.decay_rate), "decay_rate", self.decay_rate, "1/s", nearest)
        if self.gain_limit is not None:
            problem = self._gain_problem(system, SCALES[1])[0]
            return infeasible(problem, "gain_limit", self.gain_limit, "", smallest)
        return Infeasible(
            f"No smallest L2 gain from `{self.inputs}` was found for `{system.name}`; larger gains may lower it without end. Give a "
            f"`gain_limit`; observers of this form exist from {smallest:.6g} on.",
            "l2_gain",
            smallest,
        )


def _centred(pose: Pose, floor: float) -> _Found | None:
    """The first solution over the units of P L, or None."""
    for scale, solvers in TRIES:
        problem, Y = pose(scale)
        found = centre(problem, floor=floor / scale**2, solvers=solvers)
        if found is not None:
            return _Found(found, Y * scale, scale, optimum=found.optimum)
    return None
