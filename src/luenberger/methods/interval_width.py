"""Interval observer with the narrowest enclosure, by linear programmes."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product
from typing import Any, ClassVar

import cvxpy as cp
import numpy as np
from scipy.optimize import linprog

from luenberger.algebra import Polynomial
from luenberger.certify import Claim
from luenberger.core import BadInput, Infeasible, NotAccepted, NotCertified
from luenberger.core.checks import matrix
from luenberger.lmi import Bernstein, Block, Problem, rounded_storage, solve
from luenberger.methods.interval_coordinates import Choice, candidates
from luenberger.methods.interval_plant import Coordinates, refusal, require_enclosable
from luenberger.methods.interval_programme import Found, Programme, Vertex, through_vertices, vertices_of
from luenberger.methods.method import Candidate, gain_bound
from luenberger.systems import System
from luenberger.systems.enclosure_system import EnclosureSystem

Numbers = Sequence[Any] | np.ndarray
# Share of the width that is given away for a smaller gain.
BACK_OFF = 0.01
# Room of the proved widths over those of floating point: roundoff is a few 1e-16 of every term.
_ROOM = 1e-6
# Gains are capped at this multiple of the fastest motion: the optimum may lie at infinity.
_LARGEST_GAIN = 2.0
# Best coordinates in which common widths are looked for.
_FINISHED = 3


@dataclass(frozen=True)
class IntervalWidth:
    """Upper and lower bounds of the state, by the gain that leaves the narrowest steady enclosure.

    Choose it where bounds of slip angles (or any state), sensor noise and force offsets are known in numbers and the width of the
    enclosure is what matters; the energy gain of `IntervalLuenberger` is a poor measure of that. One output.

    Assumes: x' = A(r, q) x + B(r, q) u + E d, y = C x + D(r) u + G v, r measured, q in its box, |x| <= state_bound,
    |v| <= noise_bound, |d| <= disturbance_bound. The matrices multi-affine in r and q.
    Certifies: T (A - L C) T^-1 keeps order on the box (cooperative), the state stays enclosed (containment), a vector v of widths
    of z = T x that is never left again, however fast r and q change (width), |L| <= the reported bound.

    Args:
        state_bound: |x_k| <= bound [state units], nx numbers; after them nu bounds of |u| where the input matrix is
            uncertain, which an error of a measured speed makes it.
        weights: how much the width of each state counts, nx numbers; None: one each.
        decay_rate: the width also has to decay at this rate [1/s] at every frozen vertex; with it the claim width_decay.
        gain_limit: largest |L_z| allowed [1/s]; None: twice the fastest motion of the plant. In steady state high gains may be
            best, which a sampled observer cannot run: stay below a fifth of the sampling rate.
        coordinates: "states", "signs" (all sign changes of the states), "search" (signs, then constant matrices T), or
            one T, shape (nx, nx).

    The gain is multi-affine in r through the optima of the frozen vertices of the scheduling box: its cost is the mean of
    the weighted steady widths there, within 1 % of the least that gains below the limit reach. The widths of the claim hold for all r together and are wider.

    Reference: the width inequality w' <= (A - L C) w + b is Wang, dissertation 2014, (4.35), with the residuals of (4.21) bounded by
        the range of A over q; fixing C v turns the search for L into linear programmes, which is ours.

    Example:
        >>> import luenberger as lb
        >>> from luenberger.methods.interval_width import IntervalWidth
        >>> from luenberger.synthesize import synthesize
        >>> A = lb.Polynomial.affine([[-1.0, 0.2], [0.3, -2.0]], q=[[0.1, 0.0], [0.0, 0.2]])
        >>> hidden = lb.Parameter("q", -1.0, 1.0, measured=False)
        >>> plant = lb.System.lpv(A, C=[[1.0, 0.0]], parameters=[hidden], noise_bound=(0.01,))
        >>> synthesize(plant, IntervalWidth([1.0, 1.0])).certificate.outcome.value
        'proved'
    """

    state_bound: Numbers
    weights: Numbers | None = None
    decay_rate: float = 0.0
    gain_limit: float | None = None
    coordinates: str | Numbers = "signs"

    references: ClassVar[tuple[str, ...]] = (
        "Y. Wang, dissertation, Auburn University, 2014, section 4.4, eq. (4.21), (4.35)",
        "J. L. Gouze, A. Rapaport, M. Z. Hadj-Sadok, Interval observers for uncertain biological systems, Ecol. Model. 133 (2000) 45-56",
    )

    def __post_init__(self) -> None:
        for name in ("state_bound", "weights"):
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, tuple(np.ravel(np.asarray(value, dtype=float)).tolist()))
        if not isinstance(self.coordinates, str):
            object.__setattr__(self, "coordinates", tuple(map(tuple, matrix("coordinates", self.coordinates).tolist())))

    def accept(self, system: System) -> None:
        """Refuse what `IntervalLuenberger` refuses, several outputs, a scheduled C and missing bounds; see `Method`."""
        require_enclosable(system, self.decay_rate, noise=False)
        nx, nu = system.nx, system.nu
        if system.ny != 1:
            raise NotAccepted(
                f"`{system.name}` has {system.ny} outputs; the line search is over one. Use `IntervalLuenberger`."
            )
        here = EnclosureSystem.of(system)
        bent = {n for value in (here.A, here.B, here.C, here.D) for n, d in value.degree.items() if d > 1}
        if any(here.C.degree.values()) or bent:
            raise NotAccepted(
                f"`C` of `{system.name}` is scheduled or {sorted(bent)} enter with a power above one; vertices then decide nothing. "
                "Use `IntervalLuenberger`."
            )
        if len(self.state_bound) not in (nx, nx + nu) or min(self.state_bound) < 0:
            raise BadInput(
                f"`state_bound` is {self.state_bound}; {nx} numbers >= 0 are needed, or {nx + nu} with those of the inputs."
            )
        uncertain = any(value.degree.get(n, 0) for value in (here.B, here.D) for n in here.hidden)
        if uncertain and nu and len(self.state_bound) < nx + nu:
            raise BadInput(
                f"The inputs of `{system.name}` act through matrices that are not known at run time; `state_bound` needs "
                f"{nx + nu} numbers, states then inputs."
            )
        if self.gain_limit is not None and not self.gain_limit > 0:
            raise BadInput(f"`gain_limit` is {self.gain_limit} 1/s; a positive number is needed, or None.")
        if self.weights is not None and (len(self.weights) != nx or min(self.weights) < 0 or max(self.weights) == 0):
            raise BadInput(f"`weights` is {self.weights}; {nx} numbers >= 0, not all zero, are needed.")

    def design(self, system: System) -> Candidate:
        """Search the best coordinates, then gains vertex by vertex; see `Method`."""

        def attempt(T: np.ndarray) -> Choice | None:
            if Coordinates.of(system, T, Bernstein()).hopeless():
                return None
            vertices = vertices_of(EnclosureSystem.of(system, T), self._states(system))
            found: list[Found] = []
            for vertex in vertices:
                best = self._programme(system, T, vertex, limit=self._limit(vertices)).best()
                if best is None:
                    return None
                found.append(best)
            cost = float(np.mean([f.cost for f in found]))
            return Choice(T, cost, cost, (vertices, found))

        choices, tried = candidates(self.coordinates, system, attempt)
        if not choices:
            raise self._refused(system, tried)
        if not choices[0].level > 0:
            raise NotAccepted(
                f"Nothing widens an enclosure of `{system.name}`: no uncertainty, noise or unknown input. Use `IntervalLuenberger`."
            )
        for choice in choices[:_FINISHED]:
            T = choice.transform
            gain = self._gain(system, choice)
            if self.common_widths(system, gain, T) is not None:
                facts = {"solver": "HIGHS", "optimum": choice.level, "transform": T.tolist()}
                return Candidate(gain, partial(self._claims, system, T), facts)
        raise Infeasible(
            f"The frozen plants of `{system.name}` have narrow enclosures, but no widths hold for all of them at once under "
            "arbitrarily fast scheduling. Use `IntervalLuenberger`, or a smaller box.",
            "width",
        )

    def _refused(self, system: System, tried: list[np.ndarray]) -> Infeasible:
        answer = refusal(
            system, [Coordinates.of(system, T, Bernstein()) for T in tried], self.decay_rate, lambda T: None
        )
        if answer.nearest is not None or self.decay_rate > 0:
            return answer
        return Infeasible(
            f"Gains that keep order exist for `{system.name}`, but within `gain_limit` none leaves a finite enclosure at every "
            "scheduling vertex. Raise `gain_limit`, or try other `coordinates`.",
            "width",
        )

    def cost_of(self, system: System, gain: Polynomial, transform: Any = None) -> float | None:
        """Return the mean weighted steady width over the frozen scheduling vertices for a given gain; None where infinite.

        Whether the gain keeps order is another question, see `order_margin`.

        Args:
            system: plant.
            gain: L(r), shape (nx, 1).
            transform: T; None for the states themselves.
        """
        T = matrix("transform", np.eye(system.nx) if transform is None else transform, system.nx, system.nx)
        costs = []
        for vertex in vertices_of(EnclosureSystem.of(system, T), self._states(system)):
            here = T @ np.asarray(gain({n: vertex.point[n] for n in gain.names}), dtype=float)
            found = self._programme(system, T, vertex, gain=here[:, 0]).at(None)
            if found is None:
                return None
            costs.append(found.cost)
        return float(np.mean(costs))

    def common_widths(self, system: System, gain: Polynomial, transform: Any = None) -> np.ndarray | None:
        """Return the narrowest v with Mbar(r) v + b(r) <= 0 on the whole box, None where there is none.

        Args:
            system: plant.
            gain: L(r), shape (nx, 1).
            transform: T; None for the states themselves.
        """
        here = EnclosureSystem.of(system, transform)
        rows = here.rows(here.correction(gain))
        nx, states, inputs = system.nx, self._states(system), self._inputs(system)
        places = [Polynomial.constant(np.eye(1, nx + 1, j)) for j in range(nx + 1)]
        left, right = [], []
        for i in range(nx):
            for *loop, drive in product(*rows.loop[i], rows.drive(i, list(states), list(inputs))):
                total = drive @ places[nx]
                for j, value in enumerate(loop):
                    total = total + value @ places[j]
                for coefficient in total.bernstein(here.box).values():
                    left.append(np.ravel(coefficient)[:nx])
                    right.append(-float(coefficient[0, nx]))
        table = np.array(left)
        table = table + _ROOM * 1e-3 * np.abs(table).max() * np.ones(nx)
        answer = linprog(
            self._cost(system, here), table, np.array(right) * (1 + _ROOM), bounds=[(1e-12, None)] * nx, method="highs"
        )
        return answer.x * (1 + _ROOM) if answer.status == 0 else None

    def _gain(self, system: System, choice: Choice) -> Polynomial:
        vertices, found = choice.posed
        gains = []
        for vertex, best in zip(vertices, found, strict=True):
            programme = self._programme(system, choice.transform, vertex, limit=self._limit(vertices))
            small = programme.smallest(best, best.cost * (1 + BACK_OFF))
            gains.append((best if small is None else small).gain)
        values = np.linalg.solve(choice.transform, np.array(gains).T).T[:, :, None]
        return through_vertices(vertices, values, EnclosureSystem.of(system).box)

    def _claims(self, system: System, T: np.ndarray, gain: Polynomial) -> list[Claim]:
        widths = self.common_widths(system, gain, T)
        if widths is None:
            raise NotCertified("No widths hold for the rounded gain; give `synthesize` more digits.")
        bound = np.array(self.state_bound)
        claims = [
            Claim("cooperative", 0.0, transform=T),
            Claim("width", float(widths.max()), vector=widths, state_bound=bound, transform=T),
            Claim("containment", 0.0, transform=T),
            gain_bound(system, gain),
        ]
        if self.decay_rate > 0:
            claims.append(
                Claim("width_decay", self.decay_rate, _decay_storage(system, gain, T, self.decay_rate), transform=T)
            )
        return claims

    def _programme(
        self, system: System, T: np.ndarray, vertex: Vertex, *, gain: np.ndarray | None = None, limit: float = np.inf
    ) -> Programme:
        cost = self._cost(system, EnclosureSystem.of(system, T))
        return Programme(vertex, cost, self._inputs(system), self.decay_rate, gain, limit)

    def _limit(self, vertices: Sequence[Vertex]) -> float:
        if self.gain_limit is not None:
            return self.gain_limit
        output = max(float(np.abs(v.C).max()) for v in vertices)
        return _LARGEST_GAIN * max(float(np.abs(v.A).max()) for v in vertices) / output

    def _cost(self, system: System, here: EnclosureSystem) -> np.ndarray:
        """Weights of the widths of z: the width of x is |T^-1| times that of z."""
        weights = np.ones(system.nx) if self.weights is None else np.array(self.weights)
        return weights @ np.abs(here.inverse.terms[()])

    def _states(self, system: System) -> np.ndarray:
        return np.array(self.state_bound[: system.nx])

    def _inputs(self, system: System) -> np.ndarray:
        given = self.state_bound[system.nx :]
        return np.array(given) if len(given) else np.zeros(system.nu)


def _decay_storage(system: System, gain: Polynomial, T: np.ndarray, rate: float) -> np.ndarray:
    """A diagonal P with he(P Mbar) + 2 rate P < 0 with the largest margin.

    Raises:
        Infeasible: there is none.
    """
    here = Coordinates.of(system, T, Bernstein(), gain=gain)
    blocks = [Block("storage", -here.P)]
    for loop in here.largest_loops():
        blocks.append(Block("width_decay", loop + loop.T + here.P * (2 * rate), here.measured.box))
    t = cp.Variable()
    total = cp.sum(here.variables["diagonal"])
    found = solve(Problem({**here.variables, "t": t}, blocks, t), slack=t, extra=[total <= system.nx])
    if found is None or not found.margin > 0:
        raise Infeasible(
            f"The widths decay at {rate:.6g} 1/s at every frozen vertex, but no common diagonal storage shows it for fast "
            "scheduling. Ask for a lower `decay_rate`.",
            "width_decay",
        )
    return rounded_storage(np.diag(found.values["diagonal"]))
