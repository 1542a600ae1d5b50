"""Two-degree-of-freedom observer by one multiplier a channel: both gains found at once, what is injected kept small."""

from dataclasses import dataclass, field, replace
from typing import ClassVar, Literal

import numpy as np

from luenberger.algebra import Polynomial
from luenberger.certify import Claim
from luenberger.core import BadInput, Infeasible, NotAccepted
from luenberger.core.checks import known_keys, matrix
from luenberger.lmi import (
    Bernstein,
    Relaxation,
    Solution,
    centre,
    infeasible,
    nearest_level,
    rounded_storage,
    solve,
)
from luenberger.methods.channels import Channels, Shift, jacobian_box
from luenberger.methods.method import (
    NEGLIGIBLE,
    Candidate,
    gain_bound,
    require_continuous,
    require_polynomial,
    statistics,
)
from luenberger.methods.robust_luenberger import require_channels
from luenberger.methods.two_dof_inequality import Limits, Posing, Unknowns
from luenberger.methods.two_dof_search import KEPT, best_improved, largest_norm, smallest, zero_gain
from luenberger.systems import System
from luenberger.systems.observability import require_detectable

Goal = Literal["gain", "l2"]
# An L2 that changes no argument by more than a millionth of the measured error is left out.
NOTHING = 1e-6
# A gain that nobody would exceed, where solvers would rather not see one without any limit.
FAR = 1e4
LOOSE = 1e6


@dataclass(frozen=True)
class TwoDofLuenberger:
    """Observer that corrects the estimate and, by a second gain, the argument of the nonlinearity.

    Choose it where a measured signal enters a strong nonlinearity: f then reads the measurement, and the injected gain can be
    small (Van der Pol, box of half side 5: 1.82 instead of 75.8). Not where f acts on what nobody measures: the multipliers
    are more conservative than `PolytopicLuenberger` and `ExtendedLuenberger`, and may find nothing where these do.

    Assumes: e' = (A - L C) e + F J H q - (L G + B N) v + E d, q = (I - L2 C) e - L2 G v, J in the Jacobian box (one box for
        every point, also for a hull); A, C, F may be scheduled.
    Certifies: e' P e falls at least like exp(-2 decay_rate t), |L(r)| and |L2(r)| <= the reported bounds; for goal "l2" also
        |weight e|_2 <= level |w|_2. All proved over the Jacobian box or hull itself, not by the multipliers.

    Args:
        decay_rate: wanted decay of the error norm [1/s], >= 0.
        goal: "gain" minimises |L|, what is injected; "l2" the L2 gain from `inputs` to weight e.
        inputs: "disturbance", "noise" or "both", for goal "l2".
        weight: rows over the states, for goal "l2"; left out: the identity.
        gain_limit: largest |L| for goal "l2", by P >= p I, [[P, P L], [L' P, limit^2 p I]] >= 0 with free p; left out: the
            smallest that costs half a percent of the squared level.
        argument_gain_limit: largest |L2|, by T >= p (h h')^-1, [[T, Lb], [Lb', limit^2 p I]] >= 0; zero fixes L2 = 0; left
            out: the smallest that costs half a percent of the squared level.
        shift: "none" takes the slopes as they are and splits one off only where zero lies outside their interval; "lower"
            splits off every lower slope, as the dissertation does, so that L1 = L + F K H L2 takes the place of L.
        schedule: "plant" gives both gains the monomials of A, C and F, "constant" one gain each for the whole box.
        relaxation: how polynomial inequalities become matrix inequalities; exact for multi-affine ones.

    Reference: Y. Wang, dissertation 2014, (5.3), (5.21), (5.30) and (5.43), with one multiplier an argument in place of the
    sector condition (5.7), which is false where a row of the Jacobian has two varying entries; slopes unshifted, so that
    L = P^-1 Y without the term F K1 L2; limits on the injected gain, with the scale p a variable in place of (5.35) and
    (5.36); minimal gains, which the printed feasibility problem leaves open. All is jointly convex where each argument feeds
    one channel. Where a slope is split off (P L = Y - P F K H L2 is bilinear), L2 has a limit that the convex problem does
    not keep, or channels share an argument (each may have its multiplier once L2 is given), storage and gains are improved in
    turn from several L2, and the optimum is a local one. Where rows of H depend on each other, the start has one multiplier.

    Example:
        >>> import luenberger as lb
        >>> from luenberger.methods.two_dof import TwoDofLuenberger
        >>> from luenberger.synthesize import synthesize
        >>> f = lb.Nonlinearity.enclosed(lambda z, u: (1 - z[0] ** 2) * z[1], [[1, 0], [0, 1]], ([-5, -5], [5, 5]))
        >>> oscillator = lb.System.nonlinear([[0, 1], [-1, 0]], C=[[1, 0]], F=[[0], [1]], nonlinearity=f)
        >>> synthesize(oscillator, TwoDofLuenberger()).certificate.outcome.value
        'proved'
    """

    decay_rate: float = 0.0
    goal: Goal = "gain"
    inputs: str = "disturbance"
    weight: tuple[tuple[float, ...], ...] | None = None
    gain_limit: float | None = None
    argument_gain_limit: float | None = None
    shift: Shift = "none"
    schedule: Literal["plant", "constant"] = "plant"
    relaxation: Relaxation = field(default_factory=Bernstein)

    references: ClassVar[tuple[str, ...]] = (
        "Y. Wang, dissertation, Auburn University, 2014, eqs. (5.3), (5.21), (5.30), (5.43)",
        "M. Arcak, P. Kokotovic, Nonlinear observers: a circle criterion design and robustness analysis, Automatica 37, 2001",
        "B. Acikmese, M. Corless, Observers for systems with nonlinearities satisfying incremental quadratic constraints, "
        "Automatica 47, 2011",
    )

    def __post_init__(self) -> None:
        if self.weight is not None:
            object.__setattr__(self, "weight", tuple(tuple(map(float, row)) for row in self.weight))

    def accept(self, system: System) -> None:
        """Refuse plants without a Jacobian box, function matrices, scheduling errors, undetectable pairs; see `Method`."""
        known_keys("`goal`", [self.goal], ["gain", "l2"])
        require_two_dof(system, self.goal, self.inputs, self.gain_limit, self.argument_gain_limit)
        known_keys("`shift`", [self.shift], ["none", "lower"])
        known_keys("`schedule`", [self.schedule], ["plant", "constant"])
        Channels.of(system, self.shift)
        weight_of(system, self.weight)
        require_detectable(system, self.decay_rate)

    def design(self, system: System) -> Candidate:
        """Minimise the goal, then the gains that it leaves open; see `Method`."""
        posing = self._posing(system)
        limits = Limits(self.gain_limit, self.argument_gain_limit)
        if limits.argument == 0:
            limits = Limits(self.gain_limit)
            unknowns = posing.fixed(zero_gain(system))
            best = self._best(posing, unknowns, limits)
            limits = self._small_gain(posing, unknowns, limits, best.objective)
        else:
            unknowns, limits, best = self._both_gains(posing, limits)
        problem = posing.problem(unknowns, limits)
        floor = NEGLIGIBLE if self.goal == "gain" else 0.0
        # A gain that is all but zero leaves no room under the usual cap on the norm of every variable.
        found = centre(problem, floor=floor) or centre(problem, floor=floor, cap=LOOSE)
        if found is None:
            raise infeasible(problem, "", None, "", None)
        return self._candidate(posing, unknowns, found, best)

    def _both_gains(self, posing: Posing, limits: Limits) -> tuple[Unknowns, Limits, Solution]:
        """Jointly where that is convex, loses nothing, and L2 keeps its limit so; in turn where not."""
        channels, system = posing.channels, posing.system
        # Where a slope is split off, a limit speaks of L1: it is left out here, and the goal is a mere start.
        spoken = not channels.is_shifted or (self.goal == "l2" and limits.gain is None)
        free, alone = posing.free(), Limits(limits.gain if spoken else None)
        best = self._best(posing, free, alone)
        joint = self._small_gain(posing, free, alone, best.objective) if spoken else alone
        joint = smallest(posing, free, joint, "argument")
        second = free.gains((solve(posing.problem(free, joint)) or best).values)[1]
        if largest_norm(system, second) <= NOTHING:
            second = zero_gain(system)
        kept = limits.argument is None or largest_norm(system, second) <= KEPT * limits.argument
        if spoken and kept and channels.is_separate:
            unknowns = posing.fixed(second)
        else:
            capped = replace(limits, gain=FAR) if self.goal == "l2" and limits.gain is None else limits
            unknowns, best = self._in_turn(posing, capped, second)
        return unknowns, self._small_gain(posing, unknowns, Limits(limits.gain), best.objective), best

    def _small_gain(self, posing: Posing, unknowns: Unknowns, limits: Limits, level: float) -> Limits:
        return smallest(posing, unknowns, limits, "gain", level) if self.goal == "l2" else limits

    def _posing(self, system: System) -> Posing:
        return Posing(
            system,
            Channels.of(system, self.shift),
            self.decay_rate,
            weight_of(system, self.weight) if self.goal == "l2" else None,
            self.inputs,
            self.schedule == "plant",
            self.relaxation,
        )

    def _best(self, posing: Posing, unknowns: Unknowns, limits: Limits) -> Solution:
        problem = posing.problem(unknowns, limits)
        best = solve(problem)
        if self.goal == "l2" and limits.gain is None:
            other = solve(posing.problem(unknowns, replace(limits, gain=FAR)))
            best = min((b for b in (best, other) if b is not None), key=lambda b: b.objective, default=None)
        if best is not None:
            return best
        if limits.gain is not None and not posing.channels.is_shifted:
            least = solve(replace(posing, weight=None).problem(unknowns, Limits()))
            if least is not None:
                raise infeasible(problem, "gain_limit", limits.gain, "1/s", float(np.sqrt(max(least.objective, 0.0))))
        nearest = nearest_level(
            lambda rate: replace(posing, decay_rate=rate).problem(unknowns, limits), 0.0, self.decay_rate
        )
        refused = infeasible(problem, "decay_rate", self.decay_rate, "1/s", nearest)
        advice = (
            "The multipliers are conservative: `ExtendedLuenberger` decides at the vertices and may find an observer."
        )
        raise Infeasible(f"{refused} {advice}", refused.block, refused.nearest)

    def _in_turn(self, posing: Posing, limits: Limits, second: Polynomial) -> tuple[Unknowns, Solution]:
        """Improve (storage, L) beside L2 and (L, L2) beside the storage, from every start that has a level."""
        system, free, least = posing.system, posing.free(), replace(posing, weight=None)
        plain = Limits(None, limits.argument)
        starts = [zero_gain(system), second]
        lower = replace(least, channels=Channels.of(system, "lower"))
        small = lower.free()
        if (found := solve(lower.problem(small, smallest(lower, small, Limits(), "argument")))) is not None:
            starts.append(small.gains(found.values)[1])
        if limits.argument is not None:
            reach = KEPT * limits.argument
            starts = [L2 * min(1.0, reach / max(largest_norm(system, L2), NOTHING)) for L2 in starts]
            if (found := solve(least.problem(free, Limits(None, reach)))) is not None:
                starts.append(free.gains(found.values)[1])
        if (best := best_improved(posing, starts, limits)) is not None:
            return best
        small = None if self.goal == "gain" else best_improved(least, starts, plain)
        if small is None:
            needed = largest_norm(system, second)
            raise infeasible(least.problem(free, plain), "argument_gain_limit", limits.argument, "", needed)
        if (best := best_improved(posing, [small[0].second()], limits)) is not None:
            return best
        nearest = float(np.sqrt(max(small[1].objective, 0.0)))
        raise infeasible(posing.problem(small[0], limits), "gain_limit", limits.gain, "1/s", nearest)

    def _candidate(self, posing: Posing, unknowns: Unknowns, found: Solution, best: Solution) -> Candidate:
        system, energy, scale = posing.system, 1.0, 1.0
        if self.goal == "l2":
            energy, scale = posing.weight_size**2, posing.unit
        storage = rounded_storage(energy * found.values["P"])
        level = float(np.sqrt(max(float(found.values["squared"]), 0.0))) * scale
        weight = weight_of(system, self.weight)

        def claims(gain: Polynomial, second: Polynomial | None = None) -> list[Claim]:
            made = [Claim("decay", self.decay_rate, storage), *gain_claims(system, gain, second)]
            if self.goal == "l2":
                made.append(Claim("l2_gain", level, storage, None, weight, self.inputs))
            return made

        numbers = {**statistics(found), "optimum": max(best.objective, 0.0) * scale**2}
        first, second = unknowns.gains(found.values)
        return Candidate(
            first, claims, numbers, argument_gain=second if largest_norm(system, second) > NOTHING else None
        )


def gain_claims(system: System, gain: Polynomial, second: Polynomial | None) -> list[Claim]:
    """Return the claims on |L| and, where there is one, |L2|.

    Args:
        system: plant.
        gain: rounded L(r).
        second: rounded L2(r) or None.
    """
    made = [gain_bound(system, gain)]
    return made if second is None else [*made, replace(gain_bound(system, second), kind="argument_gain_bound")]


def require_two_dof(
    system: System, goal: str, inputs: str, gain_limit: float | None, argument_gain_limit: float | None
) -> None:
    """Refuse plants and options outside a design by multipliers.

    Args:
        system: plant.
        goal: "gain", "feasible" or "l2".
        inputs: channels of the L2 gain.
        gain_limit: largest |L|.
        argument_gain_limit: largest |L2|.

    Raises:
        NotAccepted: discrete plant, function matrices, no Jacobian box, scheduling error, or a channel the error has not.
        BadInput: options that no plant could satisfy.
    """
    require_continuous(system)
    require_polynomial(system)
    jacobian_box(system)
    if system.measured_scheduling is not None:
        raise NotAccepted(
            f"The scheduling of `{system.name}` is measured with error; this design takes it as exact. Give the parameters no "
            "`factor` or `error`, or use `RobustLuenberger` on a linear plant."
        )
    for name, limit, least in (
        ("gain_limit", gain_limit, "above"),
        ("argument_gain_limit", argument_gain_limit, "at least"),
    ):
        if limit is not None and not (np.isfinite(limit) and (limit > 0 or (limit == 0 and least == "at least"))):
            raise BadInput(f"`{name}` is {limit}; a finite number {least} zero is needed, or None for no limit.")
    if goal == "gain" and gain_limit is not None:
        raise BadInput(
            f'`gain_limit` = {gain_limit:g} belongs to goal="l2"; goal="gain" finds the smallest gain itself.'
        )
    if goal == "l2":
        require_channels(system, inputs, "plant")


def weight_of(system: System, weight: tuple[tuple[float, ...], ...] | None) -> np.ndarray:
    """Return W of an L2 gain.

    Args:
        system: plant.
        weight: rows over the states, or None for the identity.

    Raises:
        BadInput: wrong shape, or nothing but zeros.
    """
    if weight is None:
        return np.eye(system.nx)
    given = np.asarray(weight, dtype=float)
    W = matrix("weight", given, given.shape[0], system.nx, f"the system has {system.nx} states")
    if not np.any(W):
        raise BadInput("`weight` is zero; then no error counts. Give a row for what matters.")
    return W
