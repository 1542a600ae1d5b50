"""Unstructured robust LPV observer: matrices of its own, chosen for the worst scheduling error and near the plant's."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import cvxpy as cp
import numpy as np

from luenberger.algebra import Polynomial, symmetric
from luenberger.certify import Claim
from luenberger.core import BadInput, NotAccepted
from luenberger.core.checks import matrix
from luenberger.lmi import Bernstein, Block, Problem, Relaxation, Solution, centre, infeasible, solve
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
from luenberger.methods.robust_luenberger import (
    UNITS,
    decaying,
    require_channels,
    require_options,
    require_reachable,
)
from luenberger.systems import System
from luenberger.systems.jacobian_box import as_floats
from luenberger.systems.observability import require_detectable


@dataclass(frozen=True)
class _Posed:
    """A problem in coordinates z, e = T z, and the way back: P An = P A + scale own, P L = scale Y."""

    problem: Problem
    T: np.ndarray
    Y: cp.Variable
    own: Polynomial
    scale: float

    def in_states(self, values: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        back = np.linalg.inv(self.T)
        return {**values, "P": back.T @ values["P"] @ back}

    def observer(self, system: System) -> tuple[System, Polynomial]:
        """Return what the observer copies, An and Bn, and its gain B_oy."""
        P = np.asarray(self.problem.variables["P"].value)

        def undone(part: Any) -> np.ndarray:
            return self.scale * self.T @ np.linalg.solve(P, np.asarray(part.value))

        own, nx = self.own.map(undone), system.nx
        A = system.polynomial("A") + own @ np.eye(nx + system.nu, nx)
        B = system.polynomial("B") + own @ np.eye(nx + system.nu, system.nu, -nx) if system.nu else system.B
        return system.replace(A=A, B=B), Polynomial.constant(undone(self.Y))


@dataclass(frozen=True)
class UnstructuredObserver:
    """Robust LPV observer  xhat' = A_o(m) xhat + B_ou(m) u + B_oy(m) y  that copies no plant.

    Choose it where the range of the scheduling error is lopsided and the worst case alone counts: its level is lower than
    any Luenberger gain's. Not when the nominal behaviour matters: its matrices are biased towards one side of the errors, and
    even without error xhat does not converge to x while u acts. The level leaves much freedom, so it is relaxed by `slack`
    and the matrices nearest to the plant's are taken.

    Assumes: e' = (A(r) - B_oy(m) C) e + [A(r) - B_oy(m) C - A_o(m), B(r) - B_ou(m)] (xhat; u), C constant, D constant.
    Certifies: |W e|_2 <= level |(xhat, u)|_2, or H2 norm below level at frozen parameters; decay; |B_oy| <= the reported bound.

    Args:
        norm: "h2" or "l2".
        weight: W, rows over the states; left out: the identity.
        level: wanted level; left out: (1 + slack) times the smallest.
        slack: relative distance from the smallest level, > 0.
        gain_weight: weight of B_oy beside A_o + B_oy C - A and B_ou - B in the norm that picks the observer.
        relaxation: how polynomial inequalities become matrix inequalities; exact for multi-affine plants.

    Reference: Y. Wang, dissertation 2014, (3.48) to (3.53). In (3.51) the last block needs + B(theta). The vertices of
    (theta, theta_D) stand for theta_m = theta - theta_D here; the printed gains come from putting them in as theta_m.
    The tie-break is added, since the printed problem has no unique solution.

    Example:
        >>> import luenberger as lb
        >>> from luenberger.methods.unstructured import UnstructuredObserver
        >>> from luenberger.synthesize import synthesize
        >>> A = lb.Polynomial.affine([[-1.0, 0.0], [0.0, 0.0]], speed=[[0.0, 0.0], [-1.0, -1.0]])
        >>> speed = lb.Parameter("speed", 1.0, 3.0, factor=(0.9, 1.2))
        >>> plant = lb.System.lpv(A, C=[[1.0, 0.0]], parameters=[speed])
        >>> synthesize(plant, UnstructuredObserver("l2")).certificate.outcome.value
        'proved'
    """

    norm: Norm = "l2"
    weight: tuple[tuple[float, ...], ...] | None = None
    level: float | None = None
    slack: float = 0.02
    gain_weight: float = 0.01
    relaxation: Relaxation = field(default_factory=Bernstein)

    references: ClassVar[tuple[str, ...]] = ("Y. Wang, dissertation, Auburn University, 2014, eqs. (3.48) to (3.53)",)

    def __post_init__(self) -> None:
        if self.weight is not None:
            object.__setattr__(self, "weight", tuple(tuple(map(float, row)) for row in self.weight))

    def accept(self, system: System) -> None:
        """Refuse plants without scheduling error, and outputs that depend on the scheduling; see `Method`."""
        require_continuous(system)
        require_polynomial(system)
        require_options(self.norm, "estimate", self.level, self.slack)
        if not self.gain_weight > 0:
            raise BadInput(
                f"`gain_weight` is {self.gain_weight}; it needs to be above zero, since gains are free otherwise."
            )
        require_channels(system, "scheduling", "estimate")
        for letter in "CD":
            if any(system.polynomial(letter).degree.values()):
                raise NotAccepted(
                    f"`{letter}` of `{system.name}` depends on the scheduling; this observer is written for constant outputs. "
                    "Use `RobustLuenberger`."
                )
        if system.nonlinearity is not None:
            raise NotAccepted(
                f"`{system.name}` has a nonlinearity; this observer is linear. Use `StructuredLipschitz`."
            )
        self._weight(system)
        require_detectable(system)

    def design(self, system: System) -> Candidate:
        """Find the smallest level, relax it, take the matrices nearest to the plant's; see `Method`."""
        star = self.smallest_level(system)
        level = (1 + self.slack) * star if self.level is None else self.level
        require_reachable(self.norm, level, star)
        posed, found = self._nearest(system, level)
        model, gain = posed.observer(system)
        values = posed.in_states(found.values)
        size, W = float(values["size"]), self._weight(system)
        made = norm_claim(self.norm, values, size, level, W, "scheduling", "estimate")

        def claims(rounded: Polynomial) -> list[Claim]:
            return [made, decaying(made, 0.0), gain_bound(system, rounded)]

        return Candidate(gain, claims, {**statistics(found), "gamma_star": star}, model)

    def smallest_level(self, system: System) -> float:
        """Return the infimum of the level over all observers of this form.

        Args:
            system: accepted plant.

        Raises:
            Infeasible: no observer has a finite level.
        """
        if can_bound(system, "scheduling", "estimate"):
            return gamma_star(system, self.norm, structure="unstructured", weight=self._weight(system)).level
        problem = self._posed(system, None).problem
        found = solve(problem)
        if found is None or not found.objective > 0:
            raise infeasible(problem, "", None, "", None)
        return float(np.sqrt(found.objective))

    def _nearest(self, system: System, level: float) -> tuple["_Posed", Solution]:
        for scale, shrink in UNITS:
            posed = self._posed(system, level, scale, shrink)
            found = centre(posed.problem, floor=NEGLIGIBLE / scale**2, solvers=("CLARABEL",))
            if found is not None:
                return posed, found
        raise infeasible(self._posed(system, level).problem, "level", level, "", None)

    def _posed(self, system: System, level: float | None, scale: float = 1.0, shrink: float = 1.0) -> "_Posed":
        """Minimise the squared level, or, where one is given, |[An - A, Bn - B, gain_weight L]|^2 in units of `scale`."""
        nx, ny = system.nx, system.ny
        error = Affine.of(system, "scheduling", "estimate")
        T = error.shrunk(shrink)
        error, W = error.seen_from(T), self._weight(system) @ T
        P = cp.Variable((nx, nx), symmetric=True, name="P")
        Y = cp.Variable((nx, ny), name="Y")
        like = [as_floats(system.A), as_floats(system.B)] if system.nu else [as_floats(system.A)]
        own, parts = scheduled_variable(nx, nx + system.nu, like, system.scheduling_names, "own")
        here = at_measured(system, own)
        PA = Polynomial.constant(P) @ error.A - Polynomial.constant(Y) @ error.CA * scale
        PB = Polynomial.constant(P) @ error.B - here * scale
        free = cp.Variable(name="reach" if level is None else "size")
        size, reach = (1.0, free) if level is None else (free, free * level**2)
        blocks, trace = norm_blocks(self.norm, P, PA, PB, W, size, reach, error.box, self.relaxation)
        unknowns = {"P": P, "Y": Y, free.name(): free, **parts, **trace}
        if level is None:
            problem = Problem(unknowns, [*blocks, Block("storage", Polynomial.constant(-P))], free)
            return _Posed(problem, T, Y, own, scale)
        squared = cp.Variable(name="squared")
        columns, gains = np.eye(nx + system.nu), np.eye(ny)
        wide = symmetric(
            [
                [Polynomial.constant(P), here, Polynomial.constant(self.gain_weight * Y)],
                [Polynomial.constant(squared * columns), 0],
                [Polynomial.constant(squared * gains)],
            ]
        )
        # In the states themselves this is P >= I, so that the objective bounds the squared norm of what stands in the block.
        blocks += [Block("storage", Polynomial.constant(T @ T - P)), Block("distance", -wide, error.box)]
        return _Posed(Problem({**unknowns, "squared": squared}, blocks, squared), T, Y, own, scale)

    def _weight(self, system: System) -> np.ndarray:
        if self.weight is None:
            return np.eye(system.nx)
        given = np.asarray(self.weight, dtype=float)
        return matrix("weight", given, given.shape[0], system.nx, f"the system has {system.nx} states")
