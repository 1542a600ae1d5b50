"""The linear programmes of an interval observer with the narrowest steady enclosure, at vertices of the scheduling.

At one vertex the width obeys w' <= (Abar - L C) w + b(L) with Abar the entrywise maximum of T A T^-1 over all that is not
measured and C one row. A width v with (Abar - L C) v + b(L) <= 0 is never left again. The product L C v is the only one
of unknowns; with t = C v fixed everything is linear in (v, L), so one line search over t remains.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np
from scipy.optimize import linprog

from luenberger.algebra import Polynomial
from luenberger.methods.interval_plant import ROOM
from luenberger.systems.enclosure_system import EnclosureSystem, off_diagonal

# Gains are capped at this multiple of the fastest motion: the optimum may lie at infinity.
_LARGEST_GAIN = 2.0
# Sizes of t that are tried, in units of the width that the fastest motion would leave, and refinements of the best one.
_TRIALS = np.concatenate([-np.logspace(3, -3, 25), [0.0], np.logspace(-3, 3, 25)])
_REFINEMENTS = 4


@dataclass(frozen=True, eq=False)
class Vertex:
    """Numbers of a plant at one vertex of the measured scheduling; axis 0 of arrays counts hidden vertices.

    Args:
        A: T A T^-1, (nh, nx, nx).
        drift: T A, whose columns belong to the states, (nh, nx, nx).
        B: T B, (nh, nx, nu).
        D: (nh, nu).
        entering: T B N with every column multiplied by its bound, (nh, nx, nv).
        reading: G - D N likewise, (nh, nv).
        constant: range of T A times the state bound, and twice the slack of the unknown inputs, (nx,).
        C: the row C T^-1, (nx,).
        point: scheduling values.
    """

    A: np.ndarray
    drift: np.ndarray
    B: np.ndarray
    D: np.ndarray
    entering: np.ndarray
    reading: np.ndarray
    constant: np.ndarray
    C: np.ndarray
    point: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class Found:
    """Answer of a programme.

    Args:
        cost: weighted width.
        widths: v, (nx,).
        gains: L_z at every vertex, (vertices, nx).
        output: t = C v in the units of the programme.
    """

    cost: float
    widths: np.ndarray
    gains: np.ndarray
    output: float


def vertices_of(here: EnclosureSystem, state_bound: np.ndarray) -> list[Vertex]:
    """Return the numbers of a plant at all vertices of its measured scheduling.

    Args:
        here: plant in coordinates, measured view, one output.
        state_bound: bounds of |x|, (nx,).
    """
    system = here.system
    noise = np.zeros(system.nv) if system.noise_bound is None else np.array(system.noise_bound)
    disturbance = np.zeros(system.nd) if system.disturbance_bound is None else np.array(system.disturbance_bound)
    hidden = [dict(zip(here.hidden, c, strict=True)) for c in product(*(here.box[n] for n in here.hidden))]
    names = system.scheduling_names
    found = []
    for corner in product(*(dict.fromkeys(here.box[n]) for n in names)):
        point = dict(zip(names, corner, strict=True))
        A, drift, B, D, E, entering, reading = (
            np.array([_at(value, point | q) for q in hidden])
            for value in (
                here.A @ here.inverse,
                here.A,
                here.B,
                here.D,
                here.E,
                here.B @ here.N,
                here.G - here.D @ here.N,
            )
        )
        constant = (drift.max(axis=0) - drift.min(axis=0)) @ state_bound + 2 * np.abs(E).max(axis=0) @ disturbance
        C = _at(here.C @ here.inverse, point)[0]
        found.append(Vertex(A, drift, B, D[:, 0], entering * noise, reading[:, 0] * noise, constant, C, point))
    return found


class Programme:
    """Linear programme over widths v that several vertices share, and a gain of each of them.

    Args:
        vertices: scheduling vertices.
        cost: weights of v, (nx,).
        input_bound: bounds of |u|, (nu,).
        decay_rate: (Abar - L C + decay_rate) v + b <= 0 is asked [1/s].
        gains: fixed gains L_z, (vertices, nx); None where they are sought.
        gain_limit: largest entry of L_z; None for twice the largest entry of A.
    """

    def __init__(
        self,
        vertices: Sequence[Vertex],
        cost: np.ndarray,
        input_bound: np.ndarray,
        decay_rate: float,
        gains: np.ndarray | None = None,
        gain_limit: float | None = None,
    ):
        self.cost = cost
        self.nx, self.nu, self.nv = len(cost), vertices[0].B.shape[2], vertices[0].entering.shape[2]
        self.block = self.nx * (2 + 2 * self.nu + self.nv)
        self.size = self.nx + self.block * len(vertices)
        # Solvers have absolute tolerances: time is counted in the fastest motion, widths in what it would leave.
        self.speed = max(float(np.abs(v.A).max()) for v in vertices)
        self.reach = max(float(np.abs(v.C).max()) for v in vertices) or 1.0
        drives = (float(v.constant.max(initial=0.0) + np.abs(v.entering).max(initial=0.0)) for v in vertices)
        self.unit = (max(drives) or 1.0) / self.speed
        self.vertices = [self._scaled(v, input_bound) for v in vertices]
        self.rate = decay_rate / self.speed
        self.gain_unit = self.speed / self.reach
        self.gains = None if gains is None else gains / self.gain_unit
        self.limit = _LARGEST_GAIN if gain_limit is None else gain_limit / self.gain_unit

    def _scaled(self, vertex: Vertex, input_bound: np.ndarray) -> Vertex:
        """The same numbers without units; bounds of the inputs are multiplied in."""
        drive, reading = self.speed * self.unit, self.reach * self.unit
        return replace(
            vertex,
            A=vertex.A / self.speed,
            B=vertex.B * input_bound / drive,
            D=vertex.D * input_bound / reading,
            entering=vertex.entering / drive,
            reading=vertex.reading / reading,
            constant=vertex.constant / drive,
            C=vertex.C / self.reach,
        )

    def best(self) -> Found | None:
        """Return the narrowest widths over all gains, by a line search over t."""
        return self._searched(_TRIALS, lambda found: found.cost, None)

    def smallest(self, near: Found, cost: float) -> Found | None:
        """Return the answer with the smallest sum of |L| among those whose weighted width is at most `cost`.

        Args:
            near: an answer with a smaller cost.
            cost: see above.
        """
        trials = np.concatenate([_TRIALS, near.output * np.linspace(0.6, 1.6, 11)])
        return self._searched(trials, lambda found: float(np.abs(found.gains).sum()), cost)

    def _searched(self, trials: np.ndarray, worth: Callable[[Found], float], limit: float | None) -> Found | None:
        found = [answer for t in trials if (answer := self.at(float(t), limit)) is not None]
        for _ in range(_REFINEMENTS if found else 0):
            below, above = _neighbours(trials, min(found, key=worth).output)
            finer = np.linspace(below, above, 9)[1:-1]
            found += [answer for t in finer if (answer := self.at(float(t), limit)) is not None]
            trials = np.concatenate([trials, finer])
        return min(found, key=worth, default=None)

    def at(self, t: float | None, limit: float | None = None) -> Found | None:
        """Solve at t = C v, or with fixed gains where t is None.

        Args:
            t: output of the widths, in units of the programme.
            limit: minimise the sum of |L| with a cost below this; None minimises the cost.
        """
        rows, sides = [], []
        for k in range(len(self.vertices)):
            for row, side in self._rows(k, t):
                rows.append(row)
                sides.append(side)
        objective = np.zeros(self.size)
        if limit is None:
            objective[: self.nx] = self.cost
        else:
            rows.append(np.concatenate([self.cost, np.zeros(self.size - self.nx)]))
            sides.append(limit / self.unit)
            for k in range(len(self.vertices)):
                objective[self._place(k, "absolute", slice(None))] = 1.0
        equal = None if t is None else np.concatenate([self.vertices[0].C, np.zeros(self.size - self.nx)])[None, :]
        answer = linprog(
            objective,
            np.array(rows),
            np.array(sides),
            equal,
            None if t is None else [t],
            bounds=[(0, None)] * self.nx + [(None, None)] * (self.size - self.nx),
            method="highs",
        )
        if answer.status != 0:
            return None
        gains = np.array([answer.x[self._place(k, "gain", slice(None))] for k in range(len(self.vertices))])
        v = answer.x[: self.nx]
        output = float(self.vertices[0].C @ v)
        return Found(float(self.cost @ v) * self.unit, v * self.unit, gains * self.gain_unit, output)

    def _rows(self, k: int, t: float | None) -> list[tuple[np.ndarray, float]]:
        """Inequalities row @ x <= side of one vertex."""
        vertex, rows = self.vertices[k], []
        top = vertex.A.max(axis=0) + self.rate * np.eye(self.nx)
        for i in range(self.nx):
            width = np.zeros(self.size)
            width[: self.nx] = top[i]
            side = -float(vertex.constant[i])
            if self.gains is not None:
                width[: self.nx] -= self.gains[k, i] * vertex.C
            elif t is not None:
                width[self._place(k, "gain", i)] = -t
            for j in range(self.nu):
                width[self._place(k, "top", i * self.nu + j)] = 1.0
                width[self._place(k, "bottom", i * self.nu + j)] = -1.0
            for n in range(self.nv):
                width[self._place(k, "slack", i * self.nv + n)] = 2.0
            rows.append((width, side))
        return rows + self._gain_rows(k) + self._steer_rows(k) + self._slack_rows(k)

    def _gain_rows(self, k: int) -> list[tuple[np.ndarray, float]]:
        """Order, the cap of the gain and its absolute value; or the gain that is given."""
        vertex, rows = self.vertices[k], []
        if self.gains is not None:
            for i in range(self.nx):
                for sign in (1.0, -1.0):
                    rows.append(self._row({self._place(k, "gain", i): sign}, sign * self.gains[k, i]))
            return rows
        low = vertex.A.min(axis=0)
        for i, j in off_diagonal(self.nx):
            if vertex.C[j] != 0.0:
                rows.append(self._row({self._place(k, "gain", i): vertex.C[j]}, float(low[i, j]) - ROOM))
        for i in range(self.nx):
            gain, absolute = self._place(k, "gain", i), self._place(k, "absolute", i)
            rows += [self._row({gain: sign, absolute: -1.0}, 0.0) for sign in (1.0, -1.0)]
            rows.append(self._row({absolute: 1.0}, self.limit))
        return rows

    def _steer_rows(self, k: int) -> list[tuple[np.ndarray, float]]:
        """top >= T B - L D >= bottom at every hidden vertex."""
        vertex, rows = self.vertices[k], []
        for i, j in product(range(self.nx), range(self.nu)):
            gain = self._place(k, "gain", i)
            for b, d in {(float(b), float(d)) for b, d in zip(vertex.B[:, i, j], vertex.D[:, j], strict=True)}:
                rows.append(self._row({self._place(k, "top", i * self.nu + j): -1.0, gain: -d}, -b))
                rows.append(self._row({self._place(k, "bottom", i * self.nu + j): 1.0, gain: d}, b))
        return rows

    def _slack_rows(self, k: int) -> list[tuple[np.ndarray, float]]:
        """slack >= |T B N + L (G - D N)| noise_bound at every hidden vertex."""
        vertex, rows = self.vertices[k], []
        for i, n in product(range(self.nx), range(self.nv)):
            gain, slack = self._place(k, "gain", i), self._place(k, "slack", i * self.nv + n)
            pairs = {(float(b), float(g)) for b, g in zip(vertex.entering[:, i, n], vertex.reading[:, n], strict=True)}
            rows += [self._row({slack: -1.0, gain: s * g}, -s * b) for b, g in pairs for s in (1.0, -1.0)]
        return rows

    def _place(self, k: int, what: str, index: Any) -> Any:
        """Where a variable of vertex k stands."""
        sizes = {"gain": self.nx, "absolute": self.nx, "top": self.nx * self.nu, "bottom": self.nx * self.nu, "slack": self.nx * self.nv}  # fmt: skip
        start = self.nx + k * self.block + sum(list(sizes.values())[: list(sizes).index(what)])
        return slice(start, start + sizes[what]) if isinstance(index, slice) else start + index

    def _row(self, entries: Mapping[Any, float], side: float) -> tuple[np.ndarray, float]:
        row = np.zeros(self.size)
        for place, value in entries.items():
            row[place] += value
        return row, side


def through_vertices(
    vertices: Sequence[Vertex], values: np.ndarray, box: Mapping[str, tuple[float, float]]
) -> Polynomial:
    """Return the multi-affine polynomial through given values at the vertices of the scheduling.

    Args:
        vertices: all vertices.
        values: one matrix for each, (vertices, rows, columns).
        box: interval of every scheduling parameter.
    """
    total: Polynomial | None = None
    for vertex, value in zip(vertices, values, strict=True):
        part = Polynomial.constant(value)
        for name, here in vertex.point.items():
            lower, upper = box[name]
            if upper > lower:
                other = lower if here == upper else upper
                share = Polynomial((name,), {(0,): np.array([[-other]]), (1,): np.ones((1, 1))}) * (1 / (here - other))
                part = part * share
        total = part if total is None else total + part
    assert total is not None
    return total


def _at(value: Polynomial, point: Mapping[str, float]) -> np.ndarray:
    return np.asarray(value({n: point[n] for n in value.names}), dtype=float)


def _neighbours(trials: np.ndarray, t: float) -> tuple[float, float]:
    order = np.sort(trials)
    k = int(np.argmin(np.abs(order - t)))
    return float(order[max(k - 1, 0)]), float(order[min(k + 1, len(order) - 1)])
