"""The contract of a published design method."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Protocol, runtime_checkable

import cvxpy as cp
import numpy as np

from luenberger.algebra import Polynomial, symmetric
from luenberger.certify import Claim, SwitchedClaim
from luenberger.core import NotAccepted
from luenberger.lmi import Block, Problem, Solution, centre, infeasible, nearest_level
from luenberger.systems import Switched, System
from luenberger.systems.matrix import MatrixFunction

# Squared gain norm [1/s^2] below which a smaller gain is no use: a plant that needs no correction still gets room to be proved.
NEGLIGIBLE = 1e-2


@dataclass(frozen=True)
class Candidate:
    """What a method hands to `synthesize`: a gain that nobody has checked yet.

    Args:
        gain: L(r) with full digits; it is rounded before anything is claimed.
        claims: takes the rounded gain (and the rounded argument gain where there is one), returns the claims with
            witnesses; they are proved or the design is refused.
        statistics: solver, times [s], optimum; plain JSON values.
        model: what the observer copies where that is not the plant; its A and B are rounded as the gain is.
        argument_gain: L2(r) of an observer with two degrees of freedom, rounded too; None where f is evaluated at the
            estimate itself.
        filter_gain: K(r) of a filter that uses the current output, for all outputs at once. It is rounded in place of `gain`, which
            becomes A K, and `claims` takes it beside the gain; None for a predictor.
    """

    gain: Polynomial
    claims: Callable[..., Sequence[Claim]]
    statistics: Mapping[str, Any] = field(default_factory=dict)
    model: System | None = None
    argument_gain: Polynomial | None = None
    filter_gain: Polynomial | None = None


@dataclass(frozen=True)
class SwitchedCandidate:
    """What a method for switched plants hands to `synthesize`: gains of every mode that nobody has checked yet.

    Args:
        gains: K_i(r) with full digits; they are rounded before anything is claimed.
        decoupling: H_i with full digits, kept as they are: rounding them would let the unknown input in.
        claims: takes the rounded gains and the decoupling, returns the claims with witnesses.
        statistics: solver, times [s], optimum; plain JSON values.
    """

    gains: tuple[Polynomial, ...]
    decoupling: tuple[Polynomial, ...]
    claims: Callable[[Sequence[Polynomial], Sequence[Polynomial]], Sequence[SwitchedClaim]]
    statistics: Mapping[str, Any] = field(default_factory=dict)


@runtime_checkable
class SwitchedMethod(Protocol):
    """A design for plants with modes; a plant without is one with a single mode."""

    takes_modes: ClassVar[bool]
    references: ClassVar[tuple[str, ...]]

    def accept(self, system: Switched) -> None:
        """Refuse plants the theorem does not cover, before any solver runs; see `Method`.

        Args:
            system: the plant.
        """
        ...

    def design(self, system: Switched) -> SwitchedCandidate:
        """Find the gains; see `Method`.

        Args:
            system: an accepted plant.
        """
        ...


@runtime_checkable
class Method(Protocol):
    """One published design with its options (the dataclass fields)."""

    references: ClassVar[tuple[str, ...]]

    def accept(self, system: System) -> None:
        """Refuse plants the theorem does not cover, before any solver runs.

        Args:
            system: the plant.

        Raises:
            NotAccepted: an assumption of the theorem fails; the message names it.
            BadInput: options that no plant could satisfy.
        """
        ...

    def design(self, system: System) -> Candidate:
        """Find a gain.

        Args:
            system: an accepted plant.

        Raises:
            Infeasible: nothing was found; says which inequality stands in the way and the nearest level.
        """
        ...


def require_polynomial(system: System) -> None:
    """Refuse plants with function matrices or unmeasured parameters in the error equation.

    Args:
        system: plant.

    Raises:
        NotAccepted: see above.
    """
    for letter in "ACF":
        value = getattr(system, letter)
        if isinstance(value, MatrixFunction):
            raise NotAccepted(
                f"`{letter}` of `{system.name}` is a function on the domain; this method needs polynomial matrices."
            )
        if hidden := set(value.names) & set(system.uncertainty):
            raise NotAccepted(
                f"`{letter}` of `{system.name}` depends on the unmeasured {sorted(hidden)}; freeze them or use a robust method."
            )


def require_continuous(system: System) -> None:
    """Refuse discrete plants.

    Args:
        system: plant.

    Raises:
        NotAccepted: the plant has a sample time.
    """
    if system.dt is not None:
        raise NotAccepted(f"`{system.name}` is discrete (dt = {system.dt:g} s); this theorem is about continuous time.")


def scheduled_variable(
    rows: int, columns: int, like: Sequence[Polynomial], names: Sequence[str], name: str
) -> tuple[Polynomial, dict[str, cp.Variable]]:
    """Return a decision matrix with one coefficient for every monomial of the measured parameters that the plant shows.

    Args:
        rows: number of rows.
        columns: number of columns.
        like: polynomials whose monomials are copied, the constant always included.
        names: measured parameters; monomials with others are left out.
        name: stem of the variable names.
    """
    wide = [p.over(tuple(dict.fromkeys((*names, *p.names)))) for p in like]
    keys = {(0,) * len(names)}
    keys |= {e[: len(names)] for p in wide for e, c in p if not any(e[len(names) :]) and abs(c).max(initial=0.0) > 0}
    variables = {f"{name}{''.join(map(str, e))}": cp.Variable((rows, columns)) for e in sorted(keys)}
    return Polynomial(tuple(names), dict(zip(sorted(keys), variables.values(), strict=True))), variables


def gain_blocks(P: Any, Y: Polynomial, squared: Any, box: Mapping[str, tuple[float, float]]) -> list[Block]:
    """Return the blocks P >= I and [[P, Y], [Y', t I]] >= 0, which bound |P^-1 Y|^2 by t.

    Args:
        P: storage variable, (nx, nx).
        Y: P L, (nx, ny).
        squared: t.
        box: scheduling box.
    """
    nx, ny = Y.shape
    wide = symmetric([[Polynomial.constant(P), Y], [Polynomial.constant(squared * np.eye(ny))]])
    return [Block("storage", Polynomial.constant(np.eye(nx) - P)), Block("gain", -wide, box)]


def smallest_gain(problem: Problem, again: Callable[[float], Problem], decay_rate: float) -> Solution:
    """Return the centred solution of a problem that minimises the squared gain norm for a decay rate.

    Args:
        problem: what to solve, posed for `decay_rate`.
        again: poses the problem for another decay rate [1/s].
        decay_rate: the wanted rate [1/s].

    Raises:
        Infeasible: nothing was found; names the inequality in the way and the nearest rate.
    """
    found = centre(problem, floor=NEGLIGIBLE)
    if found is None:
        nearest = nearest_level(again, 0.0, decay_rate, floor=NEGLIGIBLE)
        raise infeasible(problem, "decay_rate", decay_rate, "1/s", nearest)
    return found


def gain_bound(system: System, gain: Polynomial) -> Claim:
    """Return the claim on |L| wherever the measured scheduling may be, with the tightest level the Bernstein hull gives.

    Args:
        system: plant.
        gain: the rounded gain.
    """
    error = system.measured_scheduling
    read, box = (gain, system.scheduling_box) if error is None else (gain.compose(error.measured), error.box)
    level = max(np.linalg.norm(np.asarray(c), 2) for c in read.bernstein(box).values())
    return Claim("gain_bound", float(level) * (1 + 1e-6) + 1e-12)


def statistics(found: Solution) -> dict[str, Any]:
    """Return what a design file records of a solver run: who, how long, how well, and the optimum before back-off.

    Args:
        found: solution of the recipe.
    """
    return {
        "solver": found.solver,
        "solver_seconds": found.solver_seconds,
        "lmi_seconds": found.seconds,
        "residual": found.residual,
        "margin": found.margin,
        "optimum": found.optimum,
    }
