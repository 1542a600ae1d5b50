"""Robust LPV Luenberger observers: smallest H2 or L2 gain from what a scheduling error excites, then the smallest gain."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import ClassVar, Literal

import cvxpy as cp
import numpy as np

from luenberger.algebra import Polynomial, symmetric
from luenberger.certify import Claim
from luenberger.core import BadInput, Infeasible, NotAccepted
from luenberger.core.checks import known_keys, matrix
from luenberger.lmi import Bernstein, Block, Problem, Relaxation, Solution, centre, infeasible, solve
from luenberger.lmi.storage import affine_monomials, l2_storage
from luenberger.methods.method import (
    NEGLIGIBLE,
    Candidate,
    gain_bound,
    require_continuous,
    require_polynomial,
    scheduled_variable,
    statistics,
)
from luenberger.methods.robust_bound import can_bound, gamma_star
from luenberger.methods.robust_inequality import Affine, Norm, at_measured, norm_blocks, norm_claim
from luenberger.methods.scheduled_storage import require_rates
from luenberger.systems import System
from luenberger.systems.error_system import ErrorSystem, Form
from luenberger.systems.jacobian_box import as_floats
from luenberger.systems.observability import require_detectable

# Units of P L and of the error that the outputs show, in which a problem is posed until a solver meets it.
UNITS = ((1.0, 1.0), (30.0, 3.0), (300.0, 7.0), (300.0, 20.0), (3000.0, 70.0))


@dataclass(frozen=True)
class Optimum:
    """Smallest level and the gain that the solver stopped at.

    Args:
        level: H2 or L2 gain.
        gain: L(r); where the gain drives no input its size says nothing, only its direction.
        solver: who found it.
    """

    level: float
    gain: Polynomial
    solver: str


@dataclass(frozen=True)
class _Unscaled:
    """From the coordinates z, e = T z, of a solved problem back to the states."""

    T: np.ndarray
    scaled_gain: Polynomial

    def gain(self, values: Mapping[str, np.ndarray]) -> Polynomial:
        return self.scaled_gain.map(lambda y: self.T @ np.linalg.solve(values["P"], np.asarray(y.value)))

    def values(self, values: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        back = np.linalg.inv(self.T)
        return {**values, "P": back.T @ values["P"] @ back}


@dataclass(frozen=True)
class RobustLuenberger:
    """Robust LPV Luenberger design: a guaranteed H2 or L2 gain from the scheduling error to the estimate, small gain.

    Choose it when speed or another scheduling signal is measured with a known relative or absolute error; not when the
    plant itself is uncertain (use an interval design). The level alone does not determine the gain: where the correction
    amplifies nothing, its infimum is approached by ever larger gains, so the level is relaxed by `slack` and the smallest
    gain taken. Name "scheduling+noise", or write y as it is computed (`output="slip_constraint"`), to have large gains pay.

    Assumes: e' = (A - L(m) C) e + B w, w = (x, u) or (xhat, u) times the scheduling error, noise, or disturbance.
    Certifies: |W e|_2 <= level |w|_2, or H2 norm below level at frozen parameters; decay; |L| <= the reported bound.

    Args:
        norm: "h2" or "l2".
        inputs: channels of w joined by "+": "scheduling", "noise", "disturbance".
        form: "plant" drives the error by (x, u), which no gain can change; "estimate" by (xhat, u), as the dissertation does.
        schedule: "constant" one gain for the whole box, "plant" the monomials of A and C where the gain drives an input
            (elsewhere a constant gain is as good as any).
        weight: W, rows over the states; left out: the identity.
        level: wanted level; left out: (1 + slack) times the smallest.
        slack: relative distance from the smallest level, > 0.
        decay_rate: wanted decay of the error norm [1/s], >= 0.
        storage: "constant" holds for arbitrarily fast scheduling; "scheduled" looks, for the gain found, for a storage with the
            monomials of A whose rates are bounded, and claims the lower L2 level that it shows ("l2" alone).
        relaxation: how polynomial inequalities become matrix inequalities; exact for multi-affine plants.

    Reference: Y. Wang, dissertation 2014, (3.41) and (3.43). (3.41) bounds the H2 norm by gamma, not by its root; fixing
    1.02 of the smallest level and minimising the gain are added, since the printed problem has no smallest gain.

    Example:
        >>> import luenberger as lb
        >>> from luenberger.methods.robust_luenberger import RobustLuenberger
        >>> from luenberger.synthesize import synthesize
        >>> A = lb.Polynomial.affine([[-1.0, 1.0], [0.0, 0.0]], speed=[[0.0, 0.0], [-1.0, -1.0]])
        >>> speed = lb.Parameter("speed", 1.0, 3.0, factor=(0.9, 1.1))
        >>> plant = lb.System.lpv(A, C=[[1.0, 0.0]], parameters=[speed])
        >>> synthesize(plant, RobustLuenberger("l2", "scheduling+noise")).certificate.outcome.value
        'proved'
    """

    norm: Norm = "l2"
    inputs: str = "scheduling"
    form: Form = "plant"
    schedule: Literal["plant", "constant"] = "constant"
    weight: tuple[tuple[float, ...], ...] | None = None
    level: float | None = None
    slack: float = 0.02
    decay_rate: float = 0.0
    storage: Literal["constant", "scheduled"] = "constant"
    relaxation: Relaxation = field(default_factory=Bernstein)

    references: ClassVar[tuple[str, ...]] = (
        "Y. Wang, dissertation, Auburn University, 2014, eqs. (3.41) and (3.43)",
        "S. Boyd, L. El Ghaoui, E. Feron, V. Balakrishnan, Linear Matrix Inequalities in System and Control Theory, SIAM 1994",
    )

    def __post_init__(self) -> None:
        if self.weight is not None:
            object.__setattr__(self, "weight", tuple(tuple(map(float, row)) for row in self.weight))

    def accept(self, system: System) -> None:
        """Refuse plants outside the theorem and channels that the error does not have; see `Method`."""
        require_continuous(system)
        require_polynomial(system)
        require_options(self.norm, self.form, self.level, self.slack)
        require_channels(system, self.inputs, self.form)
        self._weight(system)
        require_detectable(system, self.decay_rate)
        if self.storage == "scheduled":
            require_rates(system)
            if self.norm != "l2":
                raise NotAccepted(
                    'A storage that moves is looked for in the L2 gain alone; use norm="l2" or storage="constant".'
                )

    def design(self, system: System) -> Candidate:
        """Find the smallest level, relax it, minimise the gain; see `Method`."""
        star = self.smallest_level(system)
        level = (1 + self.slack) * star if self.level is None else self.level
        require_reachable(self.norm, level, star)
        found, undo = self._smallest_gain(system, level)
        W, values = self._weight(system), undo.values(found.values)
        made = norm_claim(self.norm, values, float(values["size"]), level, W, self.inputs, self.form)

        def claims(rounded: Polynomial) -> list[Claim]:
            tighter = self._with_moving_storage(system, rounded, W) if self.storage == "scheduled" else None
            return [tighter or made, decaying(made, self.decay_rate), gain_bound(system, rounded)]

        return Candidate(undo.gain(found.values), claims, {**statistics(found), "gamma_star": star})

    def _with_moving_storage(self, system: System, gain: Polynomial, weight: np.ndarray) -> Claim | None:
        """The lower level of the same gain that a storage within the rates of the scheduling shows, or None."""
        found = l2_storage(
            system,
            gain,
            weight,
            self.inputs,
            form=self.form,
            monomials=affine_monomials(system),
            relaxation=Bernstein(parts=2),
        )
        if found is None:
            return None
        return Claim("l2_gain", found[0], found[1], None, weight, self.inputs, self.form)

    def _smallest_gain(self, system: System, level: float) -> tuple[Solution, _Unscaled]:
        """Near the infimum gains are large, and solvers fail on numbers of unlike size: units are tried until one is met."""
        schedules = (self.schedule,) if self.schedule == "constant" else (self.schedule, "constant")
        for schedule, (scale, shrink) in product(schedules, UNITS):
            posed, undo = replace(self, schedule=schedule)._posed(system, level, scale, shrink)
            found = centre(posed, floor=NEGLIGIBLE / scale**2, solvers=("CLARABEL",))
            if found is not None:
                return found, undo
        raise infeasible(self._posed(system, level)[0], "level", level, "", None)

    def smallest_level(self, system: System) -> float:
        """Return the infimum of the level over all gains of this form.

        Args:
            system: accepted plant.

        Raises:
            Infeasible: no gain has a finite level.
        """
        if can_bound(system, self.inputs, self.form):
            return gamma_star(
                system, self.norm, self.inputs, self.form, weight=self._weight(system), decay_rate=self.decay_rate
            ).level
        return self.optimum(system).level

    def optimum(self, system: System, solvers: Sequence[str] | None = None) -> Optimum:
        """Solve the printed problem: minimise the level alone.

        Args:
            system: accepted plant.
            solvers: names to try in order; default all installed.

        Raises:
            Infeasible: no gain has a finite level.
        """
        problem, undo = self._posed(system, None)
        found = solve(problem, solvers=solvers)
        if found is None or not found.objective > 0:
            raise infeasible(problem, "", None, "", None)
        return Optimum(float(np.sqrt(found.objective)), undo.gain(found.values), found.solver)

    def _posed(
        self, system: System, level: float | None, scale: float = 1.0, shrink: float = 1.0
    ) -> tuple[Problem, _Unscaled]:
        """Minimise the squared level, or, where one is given, the squared gain norm in units of `scale`."""
        error = Affine.of(system, self.inputs, self.form)
        T = error.shrunk(shrink)
        error, W = error.seen_from(T), self._weight(system) @ T
        P = cp.Variable((system.nx, system.nx), symmetric=True, name="P")
        # Where the gain drives no input, Finsler's lemma makes a constant gain as good as any.
        plain = self.schedule == "constant" or can_bound(system, self.inputs, self.form)
        like = [] if plain else [as_floats(system.A), as_floats(system.C)]
        Y, variables = scheduled_variable(system.nx, system.ny, like, system.scheduling_names, "Y")
        here = at_measured(system, Y)
        PA = Polynomial.constant(P) @ error.A - here @ error.CA * scale
        PB = Polynomial.constant(P) @ error.B - here @ error.CB * scale
        free = cp.Variable(name="reach" if level is None else "size")
        size, reach = (1.0, free) if level is None else (free, free * level**2)
        blocks, more = norm_blocks(self.norm, P, PA, PB, W, size, reach, error.box, self.relaxation)
        if self.decay_rate > 0:
            drift = PA + PA.T + Polynomial.constant(2 * self.decay_rate * P)
            blocks.append(Block("decay", drift, error.box, relaxation=self.relaxation))
        unknowns = {"P": P, free.name(): free, **variables, **more}
        undo = _Unscaled(T, Y * scale)
        if level is None:
            return Problem(unknowns, [*blocks, Block("storage", Polynomial.constant(-P))], free), undo
        squared = cp.Variable(name="squared")
        wide = symmetric([[Polynomial.constant(P), here], [Polynomial.constant(squared * np.eye(system.ny))]])
        # In the states themselves this is P >= I, so that |L|^2 <= L' P L <= squared.
        blocks += [Block("storage", Polynomial.constant(T @ T - P)), Block("gain", -wide, error.box)]
        return Problem({**unknowns, "squared": squared}, blocks, squared), undo

    def _weight(self, system: System) -> np.ndarray:
        if self.weight is None:
            return np.eye(system.nx)
        given = np.asarray(self.weight, dtype=float)
        return matrix("weight", given, given.shape[0], system.nx, f"the system has {system.nx} states")


def require_options(norm: str, form: str, level: float | None, slack: float) -> None:
    """Refuse options that no plant could satisfy.

    Args:
        norm: "h2" or "l2".
        form: "plant" or "estimate".
        level: wanted level or None.
        slack: relative distance from the smallest level.

    Raises:
        BadInput: see above.
    """
    known_keys("`norm`", [norm], ["h2", "l2"])
    known_keys("`form`", [form], ["plant", "estimate"])
    if level is not None and not (np.isfinite(level) and level > 0):
        raise BadInput(f"`level` is {level}; give a finite level above zero, or leave it out for the smallest.")
    if not (np.isfinite(slack) and slack > 0):
        raise BadInput(f"`slack` is {slack}; it needs to be above zero, since the smallest level has no finite gain.")


def require_channels(system: System, inputs: str, form: Form) -> None:
    """Refuse channels that the error does not have.

    Args:
        system: plant.
        inputs: channels joined by "+".
        form: which signal a scheduling error multiplies.

    Raises:
        NotAccepted: no such channel; says how to give the plant one.
    """
    advice = {
        "scheduling": 'give `Parameter` a `factor` or `error`, or design with `inputs="noise"`',
        "disturbance": "give the plant an `E`",
        "noise": "give the plant a `G` or `N`",
    }
    wanted = ("disturbance+noise" if inputs == "both" else inputs).split("+")
    known_keys("`inputs`", wanted, list(advice))
    error = ErrorSystem.of(system, Polynomial.constant(np.zeros((system.nx, system.ny))), form=form)
    for name in wanted:
        if name not in error.inputs or error.inputs[name].shape[1] == 0:
            raise NotAccepted(f"The error of `{system.name}` has no input `{name}`; {advice[name]}.")


def require_reachable(norm: Norm, level: float, star: float) -> None:
    """Refuse a level that no gain has.

    Args:
        norm: which norm.
        level: wanted level.
        star: smallest level.

    Raises:
        Infeasible: the wanted level is not above the smallest; names it.
    """
    if level <= star:
        name = {"h2": "H2", "l2": "L2"}[norm]
        raise Infeasible(
            f"No observer of this form was found for level = {level:.6g}; the {name} gain of every one is above {star:.6g} "
            "with a constant storage. Ask for a larger `level`, or measure the scheduling better.",
            f"{norm}_gain",
            star,
        )


def decaying(made: Claim, rate: float) -> Claim:
    """Return the decay claim that holds with the storage of a gain claim.

    Args:
        made: gain claim with its storage.
        rate: decay rate [1/s].
    """
    return Claim("decay", rate, made.storage, form=made.form)
