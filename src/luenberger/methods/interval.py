"""Interval observer by linear matrix inequalities with a diagonal storage."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Literal

import cvxpy as cp
import numpy as np

from luenberger.algebra import Polynomial, symmetric
from luenberger.certify import Claim
from luenberger.core import BadInput, NotAccepted
from luenberger.core.checks import matrix
from luenberger.lmi import (
    Bernstein,
    Block,
    Problem,
    Relaxation,
    Solution,
    centre,
    rounded_storage,
    solve,
)
from luenberger.methods.interval_coordinates import Choice, candidates
from luenberger.methods.interval_plant import Coordinates, gain_of, refusal, require_enclosable
from luenberger.methods.method import NEGLIGIBLE, Candidate, gain_bound, scheduled_variable, statistics
from luenberger.systems import System
from luenberger.systems.enclosure_system import EnclosureSystem
from luenberger.systems.error_system import beside

# Share of the optimal level that is given away, so that the inequalities hold with room for rounding.
BACK_OFF = 0.01
# Bisections of the decay rate that a refusal names: a part in 128 is enough to choose another.
_HALVINGS = 7
# Best coordinates in which a point with room is looked for, should the very best be too close to singular.
_CENTRED = 5
Numbers = Sequence[Any] | np.ndarray


@dataclass(frozen=True)
class IntervalLuenberger:
    """Upper and lower bounds of the state, by a gain that keeps order and bounds the energy of the width.

    Choose it where cornering stiffness (any hidden parameter) has an interval and a guaranteed enclosure is wanted. The
    objective "residual" is the published one; "mismatch" also counts that the width grows with the state. Neither level is the
    width itself: `IntervalWidth` minimises that.

    Assumes: x' = A(r, q) x + B(r, q) u + E d, y = C(r) x + D(r) u + G v, r measured, q in its box, arbitrarily fast; d, v
    within their stated bounds. A, B multi-affine in q.
    Certifies: T (A - L C) T^-1 keeps order on the box (cooperative), the state stays enclosed (containment), the width
    decays where nothing drives it (width_decay), |W width|_2 <= level |w|_2 (width_gain), |L| <= the reported bound.

    Args:
        objective: "residual": w is what the maximisation over q adds to the drift. "mismatch": w = |x|, which reaches the
            width through the range of A over q.
        decay_rate: wanted decay of the width [1/s], >= 0.
        weight: W of the widths of the states, shape (nz, nx); None: every width counts alike (those of z = T x for
            "residual", those of the states for "mismatch").
        state_bound: |x_k| taken as one unit of the mismatch, nx numbers; None: one in SI units.
        noise: count 2 |T B N + L_z (G - D N)| noise_bound as directions of w too, so that the gain stays moderate.
        schedule: "plant" gives L(r) the monomials of the plant, "constant" one gain for the whole box.
        coordinates: "states", "signs" (all sign changes of the states), "search" (signs, then constant matrices T), or
            one T, shape (nx, nx).
        relaxation: how polynomial inequalities become matrix inequalities; exact for multi-affine plants.

    Reference: Y. Wang, dissertation 2014, theorem 5, inequality (4.32), which is kept. Departures: stability is asked of the
        entrywise largest matrix over q, since the added terms depend on the bounds themselves; among all gains within 1 % of the
        optimum the one with the smallest bound L' P L is taken, since optimal gains may be unbounded; both signs of every state are
        tried, since the printed gain (4.47) keeps order only for (front, -rear) and up to 118.5 km/h.

    Example:
        >>> import luenberger as lb
        >>> from luenberger.methods.interval import IntervalLuenberger
        >>> from luenberger.synthesize import synthesize
        >>> A = lb.Polynomial.affine([[-1.0, 0.2], [0.3, -2.0]], q=[[0.1, 0.0], [0.0, 0.2]])
        >>> plant = lb.System.lpv(A, C=[[1.0, 0.0]], parameters=[lb.Parameter("q", -1.0, 1.0, measured=False)])
        >>> synthesize(plant, IntervalLuenberger()).certificate.outcome.value
        'proved'
    """

    objective: Literal["residual", "mismatch"] = "residual"
    decay_rate: float = 0.0
    weight: Numbers | None = None
    state_bound: Numbers | None = None
    noise: bool = False
    schedule: Literal["plant", "constant"] = "plant"
    coordinates: str | Numbers = "signs"
    relaxation: Relaxation = field(default_factory=Bernstein)

    references: ClassVar[tuple[str, ...]] = (
        "Y. Wang, dissertation, Auburn University, 2014, theorem 5, eq. (4.32)",
        "J. L. Gouze, A. Rapaport, M. Z. Hadj-Sadok, Interval observers for uncertain biological systems, Ecol. Model. 133 (2000) 45-56",
    )

    def __post_init__(self) -> None:
        for name in ("weight", "coordinates"):
            value = getattr(self, name)
            if value is not None and not isinstance(value, str):
                object.__setattr__(self, name, tuple(map(tuple, matrix(name, value).tolist())))
        if self.state_bound is not None:
            object.__setattr__(self, "state_bound", tuple(np.ravel(np.asarray(self.state_bound, dtype=float)).tolist()))

    def accept(self, system: System) -> None:
        """Refuse discrete, nonlinear and undetectable plants, unknown outputs and missing bounds; see `Method`."""
        require_enclosable(system, self.decay_rate, self.noise)
        if self.weight is not None:
            matrix("weight", self.weight, None, system.nx, f"the system has {system.nx} states")
        if self.state_bound is not None and (len(self.state_bound) != system.nx or min(self.state_bound) <= 0):
            raise BadInput(f"`state_bound` is {self.state_bound}; {system.nx} positive numbers are needed.")
        if self.objective == "mismatch" and not self.noise and not _is_uncertain(system):
            raise NotAccepted(
                f'Nothing in `A` of `{system.name}` is uncertain, so there is no mismatch; use objective="residual".'
            )

    def design(self, system: System) -> Candidate:
        """Minimise the level in the best coordinates, then the gain at that level; see `Method`."""

        def attempt(T: np.ndarray) -> Choice | None:
            posed = _Posed(self, self._at(system, T))
            if posed.here.hopeless():
                return None
            best = solve(posed.problem(None), solvers=("CLARABEL",))
            if best is None:
                return None
            return Choice(T, best.objective, self._comparable(best.objective, T), posed)

        choices, tried = candidates(self.coordinates, system, attempt)
        for choice in choices[:_CENTRED]:
            found = centre(choice.posed.problem(choice.level * (1 + BACK_OFF)), floor=NEGLIGIBLE)
            if found is not None:
                return choice.posed.candidate(choice, found)
        raise refusal(system, [self._at(system, T) for T in tried], self.decay_rate, lambda T: self._slower(system, T))

    def level_of(self, system: System, gain: Polynomial, transform: Any = None) -> float | None:
        """Return the smallest level of this objective that a given gain reaches with a diagonal storage, or None.

        Whether the gain keeps order is another question, see `order_margin`.

        Args:
            system: plant.
            gain: L(r), shape (nx, ny).
            transform: T; None for the states themselves.
        """
        T = matrix("transform", np.eye(system.nx) if transform is None else transform, system.nx, system.nx)
        posed = _Posed(self, Coordinates.of(system, T, self.relaxation, gain=gain))
        best = solve(posed.problem(None, order=False))
        return None if best is None else best.objective

    def _slower(self, system: System, T: np.ndarray) -> float | None:
        """The largest decay rate below the wanted one for which bisection finds a design."""

        def feasible(rate: float) -> bool:
            problem = _Posed(replace(self, decay_rate=rate), self._at(system, T)).problem(None)
            return solve(problem, solvers=("CLARABEL",)) is not None

        good, bad = 0.0, self.decay_rate
        if not feasible(good):
            return None
        for _ in range(_HALVINGS):
            middle = 0.5 * (good + bad)
            good, bad = (middle, bad) if feasible(middle) else (good, middle)
        return good

    def _at(self, system: System, T: np.ndarray) -> Coordinates:
        return Coordinates.of(system, T, self.relaxation, constant=self.schedule == "constant")

    def _comparable(self, level: float, T: np.ndarray) -> float:
        """A level that can be compared between coordinates: of the width of the states, from inputs in their units."""
        if self.objective == "mismatch":
            return level
        rows = T / np.linalg.norm(T, axis=1, keepdims=True)
        return level * (np.linalg.cond(rows) if self.weight is None else float(np.linalg.norm(np.abs(rows), 2)))


class _Posed:
    """The inequalities of a design in given coordinates."""

    def __init__(self, method: IntervalLuenberger, here: Coordinates):
        self.method, self.here = method, here
        self.system = here.true.system
        self.nx = self.system.nx
        self.P = here.P

    def weight(self) -> np.ndarray:
        """What of the widths of z is measured; the width of x is |T^-1| times that of z."""
        method = self.method
        if method.weight is None and method.objective == "residual":
            return np.eye(self.nx)
        back = np.abs(np.linalg.inv(self.here.transform))
        return back if method.weight is None else np.asarray(method.weight) @ back

    def problem(self, level: float | None, order: bool = True) -> Problem:
        """Return the problem of the smallest level, or of the smallest gain at a level."""
        here, P = self.here, self.P
        size = cp.Variable(name="level" if level is None else "squared")
        noise, noise_variables, blocks = self._noise()
        blocks += [Block("storage", -P), *(here.order() if order else [])]
        box = here.measured.box
        for loop in here.largest_loops() if order else []:
            decay = loop + loop.T + P * (2 * self.method.decay_rate)
            blocks.append(Block("width_decay", decay, box, relaxation=self.method.relaxation))
        gamma = size if level is None else level
        for loop, direction, over in self._channels():
            if noise is not None:
                direction = beside(direction, noise, Polynomial.constant)
            blocks.append(
                Block("width_gain", self._bounded(loop, direction, gamma), over, relaxation=self.method.relaxation)
            )
        if level is not None:
            Y = here.true.at_measured(here.Y)
            wide = symmetric([[P, Y], [Polynomial.constant(size * np.eye(self.system.ny))]])
            blocks.append(Block("gain", -wide, here.true.box, relaxation=self.method.relaxation))
        variables = {**here.variables, **noise_variables, str(size.name()): size}
        return Problem(variables, blocks, size)

    def _channels(self) -> list[tuple[Polynomial, Polynomial, Any]]:
        """Matrix P M, direction P B and box of every inequality of the level."""
        here, P = self.here, self.P
        if self.method.objective == "residual":
            if self.method.noise:
                return [(here.measured.loop(here.Y, P), P, here.measured.box)]
            return [(here.loop(), P, here.true.box)]
        scale = np.eye(self.nx) if self.method.state_bound is None else np.diag(self.method.state_bound)
        directions = [P @ (R @ scale) for R in here.ranges()]
        return [(loop, R, here.measured.box) for loop in here.largest_loops() for R in directions]

    def _bounded(self, loop: Polynomial, direction: Polynomial, gamma: Any) -> Polynomial:
        """[he(P M), P B, W'; . -gamma I, 0; . . -gamma I], as (4.32) is printed."""
        W = self.weight()
        zero = np.zeros((direction.shape[1], W.shape[0]))
        last = Polynomial.constant(-gamma * np.eye(W.shape[0]))
        middle = Polynomial.constant(-gamma * np.eye(direction.shape[1]))
        return symmetric([[loop + loop.T, direction, W.T], [middle, zero], [last]])

    def _noise(self) -> tuple[Polynomial | None, dict[str, cp.Variable], list[Block]]:
        """Directions 2 S with S >= |P T B N + Y (G - D N)| noise_bound entrywise, and the blocks that say so."""
        if not self.method.noise or self.system.noise_bound is None:
            return None, {}, []
        here = self.here.measured
        scale = np.diag(self.system.noise_bound)
        columns = here.noise(self.here.Y, self.P) @ scale
        nv, names = columns.shape[1], [n for n in columns.names if n not in here.hidden]
        like = [here.noise(Polynomial.constant(np.ones((self.nx, self.system.ny))))]
        like = [p.substitute({n: 1.0 for n in here.hidden if n in p.names}) for p in like]
        S, variables = scheduled_variable(self.nx, nv, [*like, *self._monomials()], names, "S")
        blocks = []
        for i in range(self.nx):
            for k in range(nv):
                pick, column = np.eye(1, self.nx, i), np.eye(nv, 1, -k)
                one = pick @ columns @ column
                for sign in (1.0, -1.0):
                    side = one * sign - pick @ S @ column
                    blocks.append(Block("noise", side, here.box, relaxation=self.method.relaxation))
        return S * 2.0, variables, blocks

    def _monomials(self) -> list[Polynomial]:
        return [Polynomial(self.here.Y.names, {e: np.ones((1, 1)) for e, _ in self.here.Y})]

    def candidate(self, choice: Choice, found: Solution) -> Candidate:
        """Return the gain with its claims.

        Args:
            choice: coordinates and their optimum.
            found: solution at the backed-off level.
        """
        level, T = choice.level * (1 + BACK_OFF), choice.transform
        P = np.diag(found.values["diagonal"])
        gain = gain_of(T, P, self.here.Y)
        inputs = self.method.objective + "+noise" * self.method.noise
        bound = None if self.method.state_bound is None else np.asarray(self.method.state_bound)
        # (4.32) is homogeneous: multiplied by the level it has the level squared below and one above.
        storage = rounded_storage(P * level)

        def claims(rounded: Polynomial) -> list[Claim]:
            return [
                Claim("cooperative", 0.0, transform=T),
                Claim(
                    "width_gain", level, storage, weight=self.weight(), inputs=inputs, transform=T, state_bound=bound
                ),
                Claim("width_decay", self.method.decay_rate, storage, transform=T),
                Claim("containment", 0.0, transform=T),
                gain_bound(self.system, rounded),
            ]

        facts = {**statistics(found), "optimum": choice.level, "squared_gain": found.objective, "transform": T.tolist()}
        return Candidate(gain, claims, facts)


def _is_uncertain(system: System) -> bool:
    here = EnclosureSystem.of(system)
    return any(here.A.degree.get(n, 0) for n in here.hidden)
