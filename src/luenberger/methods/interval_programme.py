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

# Sizes of t that are tried, in units of the width that the fastest motion would leave, and halvings around the best one: t is
# found to a part in ten thousand.
_TRIALS = np.concatenate([-np.logspace(3, -3, 13), [0.0], np.logspace(-3, 3, 13)])
_HALVINGS = 14


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
        gain: L_z, (nx,).
        output: t = C v in the units of the programme.
    """

    cost: float
    widths: np.ndarray
    gain: np.ndarray
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
    """Linear programme over widths and a gain at one vertex of the scheduling.

    Args:
        vertex: its numbers.
        cost: weights of v, (nx,).
        input_bound: bounds of |u|, (nu,).
        decay_rate: (Abar - L C + decay_rate) v + b <= 0 is asked [1/s].
        gain: fixed gain L_z, (nx,); None where it is sought.
        gain_limit: largest entry of L_z [1/s].
    """

    def __init__(
        self,
        vertex: Vertex,
        cost: np.ndarray,
        input_bound: np.ndarray,
        decay_rate: float,
        gain: np.ndarray | None = None,
        gain_limit: float = np.inf,
    ):
        self.cost = cost
        # Solvers have absolute tolerances: time is counted in the fastest motion, widths in what it would leave.
        self.speed = float(np.abs(vertex.A).max())
        self.reach = float(np.abs(vertex.C).max()) or 1.0
        drive = float(vertex.constant.max(initial=0.0) + np.abs(vertex.entering).max(initial=0.0))
        self.unit = (drive or 1.0) / self.speed
        self.vertex = self._scaled(vertex, input_bound)
        self.rate = decay_rate / self.speed
        self.gain_unit = self.speed / self.reach
        self.gain = None if gain is None else gain / self.gain_unit
        self.limit = gain_limit / self.gain_unit
        nx, nu, nv = len(cost), vertex.B.shape[2], vertex.entering.shape[2]
        sizes = {"width": nx, "gain": nx, "absolute": nx, "top": nx * nu, "bottom": nx * nu, "slack": nx * nv}
        ends = np.cumsum(list(sizes.values()))
        self.size = int(ends[-1])
        # Where each variable stands, by its row and column.
        shapes = {"top": (nx, nu), "bottom": (nx, nu), "slack": (nx, nv)}
        self.place = {
            name: np.arange(end - count, end).reshape(shapes.get(name, (nx,)))
            for (name, count), end in zip(sizes.items(), ends, strict=True)
        }
        rows = [*self._width_rows(), *self._gain_rows(), *self._bounding_rows()]
        self.table = np.array([row for row, _ in rows])
        self.sides = np.array([side for _, side in rows])

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
        return self._searched(_TRIALS, lambda found: found.cost, None, _HALVINGS)

    def smallest(self, near: Found, cost: float) -> Found | None:
        """Return the answer with the smallest sum of |L| among those whose weighted width is at most `cost`.

        Args:
            near: an answer with a smaller cost.
            cost: see above.
        """
        trials = np.concatenate([_TRIALS, near.output * np.linspace(0.6, 1.6, 11)])
        return self._searched(trials, lambda found: float(np.abs(found.gain).sum()), cost, _HALVINGS // 2)

    def at(self, t: float | None, limit: float | None = None) -> Found | None:
        """Solve at t = C v, or with the fixed gain where t is None.

        Args:
            t: output of the widths, in units of the programme.
            limit: minimise the sum of |L| with a cost below this; None minimises the cost.
        """
        place, nx = self.place, len(self.cost)
        table, sides, objective = self.table, self.sides, np.zeros(self.size)
        if limit is None:
            objective[place["width"]] = self.cost
        else:
            table = np.vstack([table, self._row({"width": self.cost})])
            sides = np.append(sides, limit / self.unit)
            objective[place["absolute"]] = 1.0
        equal = None
        if t is not None:
            table = table.copy()
            table[np.arange(nx), place["gain"]] = -t
            equal = self._row({"width": self.vertex.C})[None, :]
        bounds = np.full((self.size, 2), [-np.inf, np.inf])
        bounds[place["width"], 0] = 0.0
        if self.gain is not None:
            bounds[place["gain"]] = self.gain[:, None]
        answer = linprog(objective, table, sides, equal, None if t is None else [t], bounds=bounds, method="highs")
        if answer.status != 0:
            return None
        v, gain = answer.x[place["width"]], answer.x[place["gain"]]
        return Found(float(self.cost @ v) * self.unit, v * self.unit, gain * self.gain_unit, float(self.vertex.C @ v))

    def _searched(
        self, trials: np.ndarray, worth: Callable[[Found], float], limit: float | None, halvings: int
    ) -> Found | None:
        found = [answer for t in trials if (answer := self.at(float(t), limit)) is not None]
        for _ in range(halvings if found else 0):
            below, above = _neighbours(trials, min(found, key=worth).output)
            finer = np.linspace(below, above, 5)[1:-1]
            found += [answer for t in finer if (answer := self.at(float(t), limit)) is not None]
            trials = np.concatenate([trials, finer])
        return min(found, key=worth, default=None)

    def _width_rows(self) -> list[tuple[np.ndarray, float]]:
        """(Abar + rate) v - L t + range + top - bottom + 2 slack <= 0; the term with t is filled in by `at`."""
        vertex, nx = self.vertex, len(self.cost)
        top = vertex.A.max(axis=0) + self.rate * np.eye(nx)
        if self.gain is not None:
            top = top - np.outer(self.gain, vertex.C)
        return [
            (
                self._row({"width": top[i], "top": (i, 1.0), "bottom": (i, -1.0), "slack": (i, 2.0)}),
                -float(vertex.constant[i]),
            )
            for i in range(nx)
        ]

    def _gain_rows(self) -> list[tuple[np.ndarray, float]]:
        """Order, the cap of the gain and its absolute value."""
        if self.gain is not None:
            return []
        vertex, nx = self.vertex, len(self.cost)
        low, one = vertex.A.min(axis=0), np.eye(nx)
        rows = [
            (self._row({"gain": one[i] * vertex.C[j]}), float(low[i, j]) - ROOM)
            for i, j in off_diagonal(nx)
            if vertex.C[j] != 0.0
        ]
        for i in range(nx):
            rows += [(self._row({"gain": sign * one[i], "absolute": -one[i]}), 0.0) for sign in (1.0, -1.0)]
            rows += [(self._row({"absolute": one[i]}), self.limit)] if np.isfinite(self.limit) else []
        return rows

    def _bounding_rows(self) -> list[tuple[np.ndarray, float]]:
        """top >= T B - L D >= bottom and slack >= |T B N + L (G - D N)| noise_bound at every hidden vertex."""
        vertex, place, rows = self.vertex, self.place, []

        def bound(variable: int, sign: float, i: int, constants: np.ndarray, slopes: np.ndarray) -> None:
            """sign * variable >= constant + slope L_i."""
            for constant, slope in {(float(c), float(g)) for c, g in zip(constants, slopes, strict=True)}:
                row = np.zeros(self.size)
                row[variable], row[place["gain"][i]] = -sign, slope
                rows.append((row, -constant))

        for i, j in np.ndindex(*place["top"].shape):
            b, d = vertex.B[:, i, j], vertex.D[:, j]
            bound(int(place["top"][i, j]), 1.0, i, b, -d)
            bound(int(place["bottom"][i, j]), -1.0, i, -b, d)
        for i, n in np.ndindex(*place["slack"].shape):
            for sign in (1.0, -1.0):
                bound(int(place["slack"][i, n]), 1.0, i, sign * vertex.entering[:, i, n], sign * vertex.reading[:, n])
        return rows

    def _row(self, entries: Mapping[str, Any]) -> np.ndarray:
        """One row; a pair (i, value) fills row i of a variable."""
        row = np.zeros(self.size)
        for name, value in entries.items():
            if isinstance(value, tuple):
                row[self.place[name][value[0]]] = value[1]
            else:
                row[self.place[name]] = value
        return row


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
    """The nearest trials on either side of t; what differs from t by roundoff is t itself."""
    apart = 1e-9 * abs(t) + 1e-12
    below, above = trials[trials < t - apart], trials[trials > t + apart]
    return float(below.max()) if below.size else t, float(above.min()) if above.size else t
