"""The two-degree-of-freedom observer as printed, on the plants for which its sector condition holds."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from itertools import product
from typing import Any, ClassVar, Literal

import cvxpy as cp
import numpy as np

from luenberger.algebra import Polynomial, symmetric
from luenberger.certify import Claim
from luenberger.core import BadInput, NotAccepted
from luenberger.core.checks import known_keys
from luenberger.lmi import Bernstein, Block, Problem, Relaxation, Solution, centre, infeasible, rounded_storage, solve
from luenberger.methods.channels import jacobian_box
from luenberger.methods.method import NEGLIGIBLE, Candidate, gain_blocks, scheduled_variable, statistics
from luenberger.methods.two_dof import gain_claims, require_two_dof, weight_of
from luenberger.systems import System
from luenberger.systems.jacobian_box import as_floats
from luenberger.systems.observability import require_detectable

# Tried for a floor that is left out: the inequality is not homogeneous, so no one scale suits all plants.
FLOORS = tuple(10.0 ** np.arange(-4, 2))


@dataclass(frozen=True)
class SectorViolation:
    """Differences that the Jacobian bounds allow and the sector condition (5.7) forbids, in exact numbers.

    Args:
        row: row of the Jacobian, from zero.
        error: x - xhat.
        difference: f(x) - f(xhat).
        product: (difference - K1 error)' (difference - K2 error), above zero.
    """

    row: int
    error: tuple[Fraction, ...]
    difference: tuple[Fraction, ...]
    product: Fraction


@dataclass(frozen=True)
class PrintedProblem:
    """The printed inequality on a plant, whether or not the theorem behind it holds there.

    Args:
        problem: blocks and objective.
        P: storage.
        Y: P L1.
        Lb: tau L2, or None where L2 = 0.
        tau: multiplier, in units of the scaled nonlinearity.
        shift: F K1, what joins L2 in the injected gain.
        arguments: H, (nz, nx).
        unit: physical L2 gain at one scaled.
    """

    problem: Problem
    P: cp.Variable
    Y: Polynomial
    Lb: Polynomial | None
    tau: cp.Variable
    shift: Polynomial
    arguments: np.ndarray
    unit: float

    def gains(self, values: Mapping[str, np.ndarray]) -> tuple[Polynomial, Polynomial | None]:
        """Return (L, L2) with the injected gain L = L1 - F K1 H L2 of (5.21).

        Args:
            values: of the variables of the problem.
        """
        for name, variable in self.problem.variables.items():
            variable.save_value(values[name])
        L1 = self.Y.map(lambda y: np.linalg.solve(values["P"], np.asarray(y.value)))
        if self.Lb is None:
            return L1, None
        # What H does not see of L2 corrects nothing.
        seen = np.linalg.pinv(self.arguments) @ self.arguments
        L2 = self.Lb.map(lambda y: seen @ np.asarray(y.value) / float(values["tau"]))
        return L1 - self.shift @ self.arguments @ L2, L2


@dataclass(frozen=True)
class PrintedTwoDof:
    """Two-degree-of-freedom observer with one multiplier for all of f, slopes counted from the lower bounds of the Jacobian.

    Choose it to compare with the dissertation; `TwoDofLuenberger` needs no more and is never more conservative. The theorems
    rest on (f(x) - f(z) - K1 q)' (f(x) - f(z) - K2 q) <= 0, which is false where a row of K2 - K1 has two nonzero entries, so
    such plants are refused (see `sector_lemma_violation`).

    Assumes: e' = (A - L C) e + F J H q + E d, q = (I - L2 C) e, J in the box [K1, K2] with one varying entry a row.
    Certifies: e' P e falls to zero, |L(r)| and |L2(r)| <= the reported bounds; for goal "l2" also |weight e|_2 <= level |d|_2.

    Args:
        goal: "feasible" (theorems 7 and 9): the smallest |L1| by P >= I, [[P, Y], [Y', t I]] >= 0, since the print states no
            objective and a solver may return any gain; "l2" (theorems 8 and 10): the smallest L2 gain from d.
        gain_limit: largest |L1| by (5.35) and (5.36); left out: no limit.
        argument_gain_limit: largest |L2| likewise; zero fixes L2 = 0.
        storage_floor: alpha of (5.35), P >= alpha I; left out: the best of the powers of ten from 1e-4 to 10.
        multiplier_floor: beta of (5.35), tau >= beta, for f in units of its largest slope; left out: likewise.
        epsilon: "norm" puts the squares of the limits for epsilon in (5.36), "printed" the limits themselves, which bounds
            the squared norms.
        weight: rows over the states, for goal "l2"; left out: the identity.
        relaxation: how polynomial inequalities become matrix inequalities; exact for multi-affine ones.

    Reference: Y. Wang, dissertation 2014, theorems 7 to 10, (5.21), (5.22), (5.30), (5.35), (5.36), (5.40) and (5.43). In (5.13)
    I + L2 C has to be I - L2 C; tau is a variable in theorems 7 and 9 too; the boxes of (5.45) are boxes of the scheduling
    that the plant is given in. The claims are proved over the Jacobian box.

    Example:
        >>> import jax.numpy as jnp
        >>> import luenberger as lb
        >>> from luenberger.methods.printed_two_dof import PrintedTwoDof
        >>> from luenberger.synthesize import synthesize
        >>> f = lb.Nonlinearity.bounded(lambda z, u: jnp.sin(z), [[0, 1]], jacobian=([[-1]], [[1]]))
        >>> plant = lb.System.nonlinear([[0, 1], [-1, 0]], C=[[1, 0]], F=[[0], [1]], nonlinearity=f)
        >>> synthesize(plant, PrintedTwoDof()).certificate.outcome.value
        'proved'
    """

    goal: Literal["feasible", "l2"] = "feasible"
    gain_limit: float | None = None
    argument_gain_limit: float | None = None
    storage_floor: float | None = None
    multiplier_floor: float | None = None
    epsilon: Literal["norm", "printed"] = "norm"
    weight: tuple[tuple[float, ...], ...] | None = None
    relaxation: Relaxation = field(default_factory=Bernstein)

    references: ClassVar[tuple[str, ...]] = (
        "Y. Wang, dissertation, Auburn University, 2014, theorems 7 to 10, eqs. (5.21), (5.22), (5.30), (5.35), (5.36), (5.43)",
    )

    def __post_init__(self) -> None:
        if self.weight is not None:
            object.__setattr__(self, "weight", tuple(tuple(map(float, row)) for row in self.weight))

    def accept(self, system: System) -> None:
        """Refuse plants whose Jacobian has a row with two varying entries, and what no design of this form covers; see `Method`."""
        known_keys("`goal`", [self.goal], ["feasible", "l2"])
        known_keys("`epsilon`", [self.epsilon], ["norm", "printed"])
        require_two_dof(system, self.goal, "disturbance", self.gain_limit, self.argument_gain_limit)
        for name in ("storage_floor", "multiplier_floor"):
            floor = getattr(self, name)
            if floor is not None and not (np.isfinite(floor) and floor > 0):
                raise BadInput(
                    f"`{name}` is {floor}; a finite number above zero is needed, or None to try powers of ten."
                )
        self._require_sector(system)
        weight_of(system, self.weight)
        require_detectable(system, 0.0)

    def _require_sector(self, system: System) -> None:
        lower, upper, _ = jacobian_box(system)
        for i, row in enumerate(lower < upper):
            if row.sum() < 2:
                continue
            entries = ", ".join(f"(i, j) = ({i + 1}, {j + 1})" for j in np.flatnonzero(row))
            theorem = {"feasible": (7, 9), "l2": (8, 10)}[self.goal][system.nr > 0]
            raise NotAccepted(
                f"Row {i + 1} of K2 - K1 of `{system.name}` has {row.sum()} nonzero entries, {entries}. Theorem {theorem} then "
                "rests on a sector condition, (5.7), that is false (`sector_lemma_violation` gives a counterexample), and its "
                "gains may be unstable. Use `TwoDofLuenberger` or `ExtendedLuenberger`."
            )

    def design(self, system: System) -> Candidate:
        """Minimise the gain bound or the L2 gain; see `Method`."""
        limited = self.gain_limit is not None, bool(self.argument_gain_limit)
        floors = [
            (given,) if given is not None or not used else FLOORS
            for given, used in zip((self.storage_floor, self.multiplier_floor), limited, strict=True)
        ]
        best: tuple[PrintedProblem, Solution] | None = None
        for alpha, beta in product(*floors):
            posed = replace(self, storage_floor=alpha, multiplier_floor=beta).posed(system)
            found = solve(posed.problem, solvers=("CLARABEL",) if any(limited) else None)
            if found is not None and (best is None or found.objective < best[1].objective):
                best = posed, found
        chosen = self.posed(system) if best is None else best[0]
        settled = None if best is None else centre(chosen.problem, floor=NEGLIGIBLE if self.goal == "feasible" else 0.0)
        if settled is None:
            raise infeasible(chosen.problem, "", None, "", None)
        return self._candidate(system, chosen, settled)

    def _candidate(self, system: System, posed: PrintedProblem, found: Solution) -> Candidate:
        storage, weight = rounded_storage(found.values["P"]), weight_of(system, self.weight)
        level = float(np.sqrt(max(float(found.values["squared"]), 0.0))) * posed.unit
        gain, second = posed.gains(found.values)

        def claims(rounded: Polynomial, argument: Polynomial | None = None) -> list[Claim]:
            made = [Claim("decay", 0.0, storage), *gain_claims(system, rounded, argument)]
            if self.goal == "l2":
                made.append(Claim("l2_gain", level, storage, None, weight, "disturbance"))
            return made

        numbers = {**statistics(found), "optimum": max(found.optimum, 0.0) * posed.unit**2}
        return Candidate(gain, claims, numbers, argument_gain=second)

    def posed(self, system: System) -> PrintedProblem:
        """Return the printed problem, also on plants that `accept` refuses; there its answer proves nothing.

        Args:
            system: plant with a Jacobian box.
        """
        lower, upper, H = jacobian_box(system)
        A, C, F = (as_floats(getattr(system, letter)) for letter in "ACF")
        width = upper - lower
        # f in units of its largest slope: a change of tau alone, without which solvers call feasible problems infeasible.
        size = float(np.abs(width).max()) or 1.0
        P = cp.Variable((system.nx, system.nx), symmetric=True, name="P")
        tau, squared = cp.Variable(name="tau"), cp.Variable(name="squared")
        Y, variables = scheduled_variable(system.nx, system.ny, [A, C, F], system.scheduling_names, "Y")
        seen, Lb = Polynomial.constant(tau * (width / size @ H)), None
        if self.argument_gain_limit != 0:
            Lb, more = scheduled_variable(system.nx, system.ny, [A, C, F], system.scheduling_names, "Lb")
            variables |= more
            seen = seen - (width / size @ H) @ Lb @ C
        drift = Polynomial.constant(P) @ (A + F @ (lower @ H)) - Y @ C
        beside = Polynomial.constant(P) @ F * size + seen.T * 0.5
        last = Polynomial.constant(-tau * np.eye(F.shape[1]))
        unit, rows = 1.0, [[drift + drift.T, beside], [last]]
        if self.goal == "l2":
            W, E = weight_of(system, self.weight), as_floats(system.E)
            unit = max(float(np.linalg.norm(c, 2)) for c in E.bernstein(system.scheduling_box).values()) or 1.0
            inputs = Polynomial.constant(P) @ E * (1 / unit)
            energy = Polynomial.constant(-squared * np.eye(system.nd))
            rows = [[drift + drift.T + W.T @ W, beside, inputs], [last, 0], [energy]]
        name = "decay" if self.goal == "feasible" else "l2_gain"
        blocks = [Block(name, symmetric(rows), system.scheduling_box, relaxation=self.relaxation)]
        blocks += self._limits(system, P, Y, tau, Lb, squared)
        known = {"P": P, "tau": tau, "squared": squared, **variables}
        return PrintedProblem(Problem(known, blocks, squared), P, Y, Lb, tau, F @ lower, H, unit)

    def _limits(
        self,
        system: System,
        P: cp.Variable,
        Y: Polynomial,
        tau: cp.Variable,
        Lb: Polynomial | None,
        squared: cp.Variable,
    ) -> list[Block]:
        """Objective of "feasible", and (5.35) with (5.36) in units of the floors."""
        box, nx, ny = system.scheduling_box, system.nx, system.ny
        feasible = self.goal == "feasible"
        blocks = gain_blocks(P, Y, squared, box) if feasible else [Block("storage", Polynomial.constant(-P))]
        for name, limit, floor, value, scaled in (
            ("gain_limit", self.gain_limit, self.storage_floor, P, Y),
            ("argument_gain_limit", self.argument_gain_limit, self.multiplier_floor, tau * np.eye(1), Lb),
        ):
            if limit is None or floor is None or scaled is None:
                continue
            reach = limit if self.epsilon == "norm" else float(np.sqrt(limit))
            wide = symmetric([[Polynomial.constant(np.eye(nx)), scaled * (1 / (floor * reach))], [np.eye(ny)]])
            least = Polynomial.constant(np.eye(value.shape[0]) - value / floor)
            blocks += [Block(name, -wide, box, relaxation=self.relaxation), Block(f"{name}_floor", least)]
        return blocks


def sector_lemma_violation(
    K1: Sequence[Sequence[Any]] | np.ndarray, K2: Sequence[Sequence[Any]] | np.ndarray
) -> SectorViolation | None:
    """Return exact differences that break (f(x) - f(xhat) - K1 e)' (f(x) - f(xhat) - K2 e) <= 0, or None where it always holds.

    Row by row the mean value theorem gives f_i(x) - f_i(xhat) = g e with g anywhere between the rows of K1 and K2. With two
    entries j, k that vary by D_j and D_k, e_j = 1 / D_j, e_k = -1 / D_k, g_j at its upper and g_k at its lower end, the product
    is one. With one varying entry a row it is a sum of terms t (t - 1) D^2 e^2, 0 <= t <= 1, never above zero.

    Args:
        K1: lower bounds of df/dx, rows over the arguments.
        K2: upper bounds, of the same shape.

    Raises:
        BadInput: shapes that differ, or inverted bounds.

    Reference: Y. Wang, dissertation 2014, lemma 15 and (5.7).
    """
    lower, upper = ([[Fraction(v) for v in np.asarray(row).tolist()] for row in K] for K in (K1, K2))
    if [len(r) for r in lower] != [len(r) for r in upper] or len({len(r) for r in lower}) != 1:
        raise BadInput(
            f"`K1` and `K2` have rows of {[len(r) for r in lower]} and {[len(r) for r in upper]}; both need one shape."
        )
    for i, (low, high) in enumerate(zip(lower, upper, strict=True)):
        if any(a > b for a, b in zip(low, high, strict=True)):
            raise BadInput(f"Row {i + 1} of `K1` exceeds that of `K2`; K1 <= K2 is needed entry by entry.")
        varying = [j for j, (a, b) in enumerate(zip(low, high, strict=True)) if a < b]
        if len(varying) < 2:
            continue
        j, k = varying[:2]
        error = [Fraction(0)] * len(low)
        error[j], error[k] = 1 / (high[j] - low[j]), -1 / (high[k] - low[k])
        # All other rows at their lower ends, where they add nothing.
        difference = [sum((a * e for a, e in zip(r, error, strict=True)), start=Fraction(0)) for r in lower]
        difference[i] = high[j] * error[j] + low[k] * error[k]
        found = tuple(error), tuple(difference)
        return SectorViolation(i, *found, sector_product(lower, upper, *found))
    return None


def sector_product(
    K1: Sequence[Sequence[Any]], K2: Sequence[Sequence[Any]], error: Sequence[Any], difference: Sequence[Any]
) -> Any:
    """Return (difference - K1 error)' (difference - K2 error), the left side of (5.7), in the arithmetic of the numbers given.

    Args:
        K1: lower bounds of df/dx, rows over the arguments.
        K2: upper bounds.
        error: x - xhat.
        difference: f(x) - f(xhat).
    """

    def over(K: Sequence[Sequence[Any]]) -> list[Any]:
        return [d - sum(a * e for a, e in zip(row, error, strict=True)) for d, row in zip(difference, K, strict=True)]

    return sum(a * b for a, b in zip(over(K1), over(K2), strict=True))
