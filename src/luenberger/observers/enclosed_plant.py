"""A plant written for an interval observer: its matrices in the coordinates of the bounds, and what of it is unknown."""

import math
from collections.abc import Hashable, Mapping, Sequence
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from luenberger.algebra import Polynomial
from luenberger.core import BadInput, NotAccepted
from luenberger.core.checks import matrix
from luenberger.observers.interval_drift import Drift, Ends, Terms, largest, plus, times
from luenberger.systems.parameter import Parameter, box
from luenberger.systems.system import System


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
                terms = plus(terms, times(_corrected(c, gain[i], cells["D"], j), u[j]))
            for o in range(ny):
                terms = plus(terms, {frozenset(): gain[i][o] * y[o]})
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
                terms = plus(terms, times(c, u[j]))
            forcing.append(terms)
            slack.append(
                self._slack(cells["CBN"][o] if self.noise else [], cells["CE"][o] if self.disturbance else [], ends)
            )
        return Drift(loop, gain, cells["CA"] if ny else [], forcing, slack, ends)

    def outputs(self, lower: Any, upper: Any, u: Any, r: Any) -> tuple[Any, Any]:
        """Return the interval of what may be read as output while the state lies between bounds, two times shape (ny,).

        Args:
            lower: lower bound of x, shape (nx,).
            upper: upper bound of x, shape (nx,).
            u: measured input, shape (nu,).
            r: measured scheduling, shape (nr,).
        """
        names = [n for n, _ in self.hidden]
        known = {n: r[k] for k, n in enumerate(self.system.scheduling_names) if n not in names}
        cells = {k: _cells(self.matrices[k], known) for k in ("C", "D", "GDN") if k in self.matrices}
        ends = {**self._ends(r), **{("state", j): (lower[j], upper[j]) for j in range(self.system.nx)}}
        low, high = [], []
        for o in range(self.system.ny):
            slack = self._slack(cells["GDN"][o] if self.noise else [], [], ends)
            terms: Terms = {}
            for j, c in enumerate(cells["C"][o]):
                terms = plus(terms, {key | {("state", j)}: v for key, v in c.items()})
            for j, c in enumerate(cells["D"][o]):
                terms = plus(terms, times(c, u[j]))
            low.append(-largest(times(terms, -1.0), ends) - slack)
            high.append(largest(terms, ends) + slack)
        return jnp.stack([jnp.asarray(v) for v in low]), jnp.stack([jnp.asarray(v) for v in high])

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
                total = total + bound * jnp.maximum(largest(terms, ends), largest(times(terms, -1.0), ends))
        return total


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
            cells[i][j] = plus(cells[i][j], {key: float(coefficient[i, j]) * factor})
    return cells


def _corrected(terms: Terms, gain: Sequence[Any], outputs: list[list[Terms]], column: int) -> Terms:
    """One entry of X - L Y from the entry of X, the row of L and the matrix Y."""
    for o, g in enumerate(gain):
        terms = plus(terms, times(outputs[o][column], -g))
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
