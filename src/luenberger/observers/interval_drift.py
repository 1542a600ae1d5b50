"""The largest and the smallest drift of a plant over everything that nobody measures, in plain scalar operations.

Matrices that are multi-affine in the unknowns have their extremes at vertices. Unknowns that share no monomial are maximised
apart, so that two stiffnesses cost two comparisons and not four vertices; what a monomial couples is branched on. All of it
happens when the step is traced: what is left are sums, products and comparisons of scalars.
"""

import math
from collections import Counter
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from luenberger.algebra import Polynomial
from luenberger.core import BadInput, NotAccepted
from luenberger.core.checks import matrix
from luenberger.systems.parameter import Parameter, box
from luenberger.systems.system import System

# Evaluations of the drift a sub-step. The enclosure holds for any number, since what the truncated series leaves out is
# added; with four, that is less than a thousandth of what the state moves in a sub-step.
ORDER = 4
# Weights of the chained Euler steps whose sum is the Taylor polynomial of the exponential: T(z) = sum_k w_k (1 + z)^k. None is
# negative, which is why the sum keeps the order that every Euler step keeps.
WEIGHTS = [
    sum((-1) ** i / math.factorial(i) for i in range(ORDER - k + 1)) / math.factorial(k) for k in range(ORDER + 1)
]

# A scalar that is multi-affine in unknowns: the set of unknowns in a monomial -> its coefficient.
Terms = dict[frozenset[Hashable], Any]
Ends = Mapping[Hashable, tuple[Any, Any]]


@dataclass(frozen=True)
class Bounds:
    """Bounds of z, followed by those of how far C x has moved since the sample."""

    lower: list[Any]
    upper: list[Any]


@dataclass(frozen=True)
class Drift:
    """The largest and smallest drift at one sample, as scalars in plain operations.

    Args:
        loop: (nx)(nx) terms of T (A - L C) T^-1.
        gain: (nx)(ny) entries of T L.
        motion: (ny)(nx) terms of C A T^-1.
        forcing: (nx + ny) terms of what does not depend on z.
        slack: (nx + ny) numbers.
        ends: unknown -> interval.
    """

    loop: list[list[Terms]]
    gain: list[list[Any]]
    motion: list[list[Terms]]
    forcing: list[Terms]
    slack: list[Any]
    ends: Ends

    @property
    def ny(self) -> int:
        """Number of outputs whose motion between samples counts."""
        return len(self.motion)

    def advance(self, start: Bounds, h: float, remainder: Any) -> Bounds:
        """Return the bounds one sub-step later.

        Args:
            start: bounds now.
            h: sub-step [s].
            remainder: what the series leaves out, per unit of |h slope|.
        """
        here = start
        lower, upper = ([WEIGHTS[0] * b for b in side] for side in (start.lower, start.upper))
        left: list[Any] = []
        for weight in WEIGHTS[1:]:
            falling, rising = jax.lax.optimization_barrier(self.slopes(here))
            if not left:
                left = self._left_out(start, falling, rising, h, remainder)
            here = Bounds(
                [b + h * s for b, s in zip(here.lower, falling, strict=True)],
                [b + h * s for b, s in zip(here.upper, rising, strict=True)],
            )
            if weight:
                lower = [total + weight * b for total, b in zip(lower, here.lower, strict=True)]
                upper = [total + weight * b for total, b in zip(upper, here.upper, strict=True)]
        return Bounds(
            [b - e for b, e in zip(lower, left, strict=True)], [b + e for b, e in zip(upper, left, strict=True)]
        )

    def slopes(self, bounds: Bounds) -> tuple[list[Any], list[Any]]:
        """Return the slopes of the lower and of the upper bounds."""
        nx = len(self.loop)
        moved = list(zip(bounds.lower[nx:], bounds.upper[nx:], strict=True))
        falling, rising = [], []
        for i, row in enumerate(self.loop):
            pushes = [[self.gain[i][o] * end for end in pair] for o, pair in enumerate(moved)]
            for side, sign, out in ((bounds.lower, -1.0, falling), (bounds.upper, 1.0, rising)):
                terms = self.forcing[i]
                for cell, z in zip(row, side[:nx], strict=True):
                    terms = _plus(terms, _times(cell, z))
                total = sign * largest(_times(terms, sign), self.ends) + sign * self.slack[i]
                extreme = jnp.maximum if sign > 0 else jnp.minimum
                out.append(total + sum(extreme(*pair) for pair in pushes))
        ends = {**self.ends, **{("state", j): (bounds.lower[j], bounds.upper[j]) for j in range(nx)}}
        for o, row in enumerate(self.motion):
            terms = self.forcing[nx + o]
            for j, cell in enumerate(row):
                terms = _plus(terms, {key | {("state", j)}: c for key, c in cell.items()})
            falling.append(-largest(_times(terms, -1.0), ends) - self.slack[nx + o])
            rising.append(largest(terms, ends) + self.slack[nx + o])
        return falling, rising

    def _left_out(self, start: Bounds, falling: list[Any], rising: list[Any], h: float, remainder: Any) -> list[Any]:
        """Bound what the Taylor polynomial of the true motion leaves out, from a bound of its slope at the start."""
        slope = [jnp.maximum(jnp.abs(a), jnp.abs(b)) for a, b in zip(falling, rising, strict=True)]
        for i, row in enumerate(self.loop):
            # Where z lies inside its bounds the diagonal entry may add its share of the width to the slope.
            width = start.upper[i] - start.lower[i]
            slope[i] = slope[i] + jnp.maximum(largest(_times(row[i], -1.0), self.ends), 0.0) * width
        table = jnp.asarray(remainder, slope[0].dtype)
        return [sum(table[i, j] * s for j, s in enumerate(slope)) * h for i in range(len(slope))]


class Enclosed(eqx.Module):
    """A plant in coordinates z = T x, with what of it is unknown at run time.

    Args:
        matrices: name -> polynomial: "A" T A T^-1, "B" T B, "C" C, "Cz" C T^-1, "D", "E" T E, "BN" T B N, "GDN" G - D N, and
            for the motion of the outputs "CA", "CB", "CE", "CBN".
        transform: T.
        inverse: T^-1.
        system: the plant.
        hidden: unknowns of the matrices -> constant interval, or the name of the scheduling parameter they are.
        readable: interval of every measured scheduling parameter.
        noise: |v| bound, empty where noise does not count.
        disturbance: |d| bound, likewise.
        corrects: False for the gain zero, whose outputs do not matter.
    """

    matrices: dict[str, Polynomial]
    transform: np.ndarray
    inverse: np.ndarray
    system: System
    hidden: tuple[tuple[str, tuple[float, float] | str], ...] = eqx.field(static=True)
    readable: tuple[tuple[float, float], ...] = eqx.field(static=True)
    noise: tuple[float, ...] = eqx.field(static=True)
    disturbance: tuple[float, ...] = eqx.field(static=True)
    corrects: bool = eqx.field(static=True)

    @staticmethod
    def of(system: System, transform: Any, corrects: bool, switches: Mapping[str, bool]) -> "Enclosed":
        """Write a plant in coordinates and refuse what cannot be enclosed; see `IntervalObserver`."""
        nx = system.nx
        T = matrix("transform", np.eye(nx) if transform is None else transform, nx, nx, f"the system has {nx} states")
        if not np.linalg.cond(T) < 1e12:
            raise BadInput(f"`transform` {T.tolist()} has no inverse; coordinates need an invertible matrix.")
        inexact = [p for p in system.parameters if p.measured and not p.is_exact]
        if switches["scheduling_error"] and system.scheduling_error is not None:
            raise NotAccepted(
                f"The scheduling error of `{system.name}` is declared as a map, which cannot be turned round at run time; state it "
                "by `error` and `factor` of its parameters, or leave it out by with_scheduling_error=False."
            )
        readable = tuple(_readable(p) for p in system.parameters if p.measured)
        hidden: dict[str, tuple[float, float] | str] = {p.name: p.interval for p in system.parameters if not p.measured}
        if switches["scheduling_error"]:
            hidden |= {p.name: p.name for p in inexact}
        noise, disturbance = _bounds_of(system, switches)
        inverse = np.linalg.inv(T)
        A, B, C, D, E, G, N = (system.polynomial(letter) for letter in "ABCDEGN")
        M = {"A": T @ A @ inverse, "B": T @ B, "C": C, "Cz": C @ inverse, "D": D, "E": T @ E}
        M |= {"BN": T @ B @ N, "GDN": G - D @ N}
        if corrects:
            # The outputs read the parameters a second time: apart, so that everything stays multi-affine.
            twice = {n: f"{n} in the output" for n in C.names if n in hidden}
            copied = C.compose({n: _named(other) for n, other in twice.items()}) if twice else C
            hidden |= {other: hidden[n] for n, other in twice.items()}
            M |= {"CA": copied @ A @ inverse, "CB": copied @ B, "CE": copied @ E, "CBN": copied @ B @ N}
        used = {k: m for k, m in M.items() if (noise or "N" not in k) and (disturbance or "E" not in k)}
        _require_multi_affine(system, used, hidden)
        return Enclosed(used, T, inverse, system, tuple(hidden.items()), readable, noise, disturbance, corrects)

    def drift(self, L: Any, u: Any, y: Any, r: Any) -> Drift:
        """Return the extreme drifts at one sample.

        Args:
            L: gain at the measured scheduling, shape (nx, ny).
            u: input, shape (nu,).
            y: output, shape (ny,).
            r: measured scheduling, shape (nr,).
        """
        nx, names = self.system.nx, [n for n, _ in self.hidden]
        known = {n: r[k] for k, n in enumerate(self.system.scheduling_names) if n not in names}
        cells = {k: _cells(m, known) for k, m in self.matrices.items()}
        ny = self.system.ny if self.corrects else 0
        gain = [[_dot(self.transform[i], [L[k, o] for k in range(nx)]) for o in range(ny)] for i in range(nx)]
        loop, forcing, slack = [], [], []
        ends = self._ends(r)
        for i in range(nx):
            loop.append([_corrected(c, gain[i], cells["Cz"], j) for j, c in enumerate(cells["A"][i])])
            terms: Terms = {}
            for j, c in enumerate(cells["B"][i]):
                terms = _plus(terms, _times(_corrected(c, gain[i], cells["D"], j), u[j]))
            for o in range(ny):
                terms = _plus(terms, {frozenset(): gain[i][o] * y[o]})
            forcing.append(terms)
            noise = (
                [_corrected(c, [-g for g in gain[i]], cells["GDN"], j) for j, c in enumerate(cells["BN"][i])]
                if self.noise
                else []
            )
            slack.append(self._slack(noise, cells["E"][i] if self.disturbance else [], ends))
        for o in range(ny):
            terms = {}
            for j, c in enumerate(cells["CB"][o]):
                terms = _plus(terms, _times(c, u[j]))
            forcing.append(terms)
            slack.append(
                self._slack(cells["CBN"][o] if self.noise else [], cells["CE"][o] if self.disturbance else [], ends)
            )
        loop, gain, cells['CA'] , forcing, slack, ends = jax.lax.optimization_barrier((loop, gain, cells.get('CA',[]), forcing, slack, ends))
        return Drift(loop, gain, cells["CA"] if ny else [], forcing, slack, ends)

    def largest_entries(self, gain: Polynomial) -> np.ndarray:
        """Return the largest |entry| of [[T (A - L C) T^-1, T L], [C A T^-1, 0]] over the box, shape (nx + ny, nx + ny).

        Args:
            gain: L(r), over the scheduling names.
        """
        system = self.system
        nx, ny = system.nx, system.ny if self.corrects else 0
        intervals = box(system.parameters)
        measured = {n: f"{n} as measured" for n in gain.names}
        read = dict(zip(system.scheduling_names, self.readable, strict=True))
        intervals |= {other: read[n] for n, other in measured.items()}
        intervals |= {n: intervals.get(e, (0.0, 0.0)) if isinstance(e, str) else e for n, e in self.hidden}
        total = np.zeros((nx + ny, nx + ny))
        Lz = self.transform @ (gain.compose({n: _named(other) for n, other in measured.items()}) if measured else gain)
        total[:nx, :nx] = _largest_absolute(self.matrices["A"] - Lz @ self.matrices["Cz"], intervals)
        if ny:
            total[:nx, nx:] = _largest_absolute(Lz, intervals)
            total[nx:, :nx] = _largest_absolute(self.matrices["CA"], intervals)
        return total

    def _ends(self, r: Any) -> Ends:
        """Intervals of the unknowns: constants, and the true scheduling that the measured one allows."""
        order = self.system.scheduling_names
        declared = {p.name: p for p in self.system.parameters}
        ends: dict[Hashable, tuple[Any, Any]] = {}
        for name, interval in self.hidden:
            ends[name] = (
                interval if isinstance(interval, tuple) else _true(declared[interval], r[order.index(interval)])
            )
        return ends

    def _slack(self, noise: Sequence[Terms], disturbance: Sequence[Terms], ends: Ends) -> Any:
        bounds = [*zip(noise, self.noise, strict=False), *zip(disturbance, self.disturbance, strict=False)]
        total: Any = 0.0
        for terms, bound in bounds:
            if terms and bound:
                total = total + bound * jnp.maximum(largest(terms, ends), largest(_times(terms, -1.0), ends))
        return total


def largest(terms: Terms, ends: Ends) -> Any:
    """Return the maximum of a multi-affine scalar over intervals of its unknowns.

    Args:
        terms: set of unknowns -> coefficient.
        ends: unknown -> (lower, upper), numbers or traced scalars.
    """
    total: Any = terms.get(frozenset(), 0.0)
    for part in _apart([key for key in terms if key]):
        count = Counter(name for key in part for name in sorted(key, key=str))
        name, _ = count.most_common(1)[0]
        values = []
        for end in ends[name]:
            left: Terms = {}
            for key in part:
                left = _plus(left, {key - {name}: terms[key] * end if name in key else terms[key]})
            values.append(largest(left, ends))
        total = total + jnp.maximum(*values)
    return total


def _apart(keys: Sequence[frozenset[Hashable]]) -> list[list[frozenset[Hashable]]]:
    """Sort monomials into groups that share no unknown."""
    groups: list[list[frozenset[Hashable]]] = []
    for key in keys:
        touching = [g for g in groups if any(key & other for other in g)]
        groups = [g for g in groups if g not in touching] + [[k for g in touching for k in g] + [key]]
    return groups


def _plus(left: Terms, right: Terms) -> Terms:
    return left | {key: left[key] + c if key in left else c for key, c in right.items()}


def _times(terms: Terms, factor: Any) -> Terms:
    return {key: c * factor for key, c in terms.items()}


def _dot(row: np.ndarray, column: Sequence[Any]) -> Any:
    return sum((float(a) * b for a, b in zip(row, column, strict=True) if a), 0.0)


def _cells(value: Polynomial, known: Mapping[str, Any]) -> list[list[Terms]]:
    """Entries of a matrix with the known parameters put in."""
    rows, columns = value.shape
    cells: list[list[Terms]] = [[{} for _ in range(columns)] for _ in range(rows)]
    for exponents, coefficient in value:
        powers = dict(zip(value.names, exponents, strict=True))
        key = frozenset(n for n, power in powers.items() if power and n not in known)
        factor = math.prod(known[n] ** power for n, power in powers.items() if power and n in known)
        for i, j in np.argwhere(coefficient):
            cells[i][j] = _plus(cells[i][j], {key: float(coefficient[i, j]) * factor})
    return cells


def _corrected(terms: Terms, gain: Sequence[Any], outputs: list[list[Terms]], column: int) -> Terms:
    """One entry of X - L Y from the entry of X, the row of L and the matrix Y."""
    for o, g in enumerate(gain):
        terms = _plus(terms, _times(outputs[o][column], -g))
    return terms


def _true(p: Parameter, m: Any) -> tuple[Any, Any]:
    """Interval of the true scheduling that a measured value allows."""
    values = [(m - error) * (1 / factor) for error in (-p.error, p.error) for factor in p.factor]
    lower, upper = values[0], values[0]
    for value in values[1:]:
        lower, upper = jnp.minimum(lower, value), jnp.maximum(upper, value)
    return jnp.clip(lower, p.lower, p.upper), jnp.clip(upper, p.lower, p.upper)


def _readable(p: Parameter) -> tuple[float, float]:
    values = [factor * end for factor in p.factor for end in p.interval]
    return min(values) - p.error, max(values) + p.error


def _named(name: str) -> Polynomial:
    return Polynomial((name,), {(1,): np.ones((1, 1))})


def _largest_absolute(value: Polynomial, intervals: Mapping[str, tuple[float, float]]) -> np.ndarray:
    return np.max([np.abs(np.asarray(c, float)) for c in value.bernstein(intervals).values()], axis=0)


def _bounds_of(system: System, switches: Mapping[str, bool]) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Bounds of noise and disturbance that count, refusing what is described and not bounded."""
    disturbance = system.disturbance_bound if switches["offset"] else ()
    if system.nd and disturbance is None:
        raise NotAccepted(
            f"`{system.name}` has {system.nd} unknown inputs without `disturbance_bound`; an enclosure needs one."
        )
    noise = system.noise_bound if switches["noise"] else ()
    # A plant that says nothing of noise is taken without noise; one that shapes it has to bound it.
    G, N = system.polynomial("G"), system.polynomial("N")
    plain = all(not any(e) and np.array_equal(c, np.eye(*G.shape)) for e, c in G) and not any(np.any(c) for _, c in N)
    if noise is None and not plain:
        raise NotAccepted(f"`{system.name}` has {system.nv} noises without `noise_bound`; an enclosure needs one.")
    return tuple(map(float, noise or ())), tuple(map(float, disturbance or ()))


def _require_multi_affine(system: System, matrices: Mapping[str, Polynomial], hidden: Mapping[str, Any]) -> None:
    for name, value in matrices.items():
        nonzero = [e for e, c in value if np.any(c)]
        if bent := sorted(
            {n for e in nonzero for n, power in zip(value.names, e, strict=True) if power > 1 and n in hidden}
        ):
            raise NotAccepted(
                f"`{name}` of `{system.name}` depends on a power above one of {bent}, which nobody measures exactly, so the largest "
                "drift is not at a vertex; introduce the power as a parameter of its own."
            )
