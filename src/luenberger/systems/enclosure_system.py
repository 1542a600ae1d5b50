"""The closed-loop matrices an interval observer lives by, and what is largest of them over all that is not known.

In coordinates z = T x, with the gain L_z = T L, the upper and the lower bound are wrong by errors that obey

    e' = M(r, q) e + residual + slack,      M = (T A(r, q) - L_z(m) C(r)) T^-1,      e >= 0 where M keeps order,

and the width w of the enclosure, from the largest and the smallest drift over everything unknown at the measured m, by

    w' <= Mbar(m) w + R(m) |x| + U(m) |u| + 2 slack(m)

with Mbar the entrywise maximum of M, R and U the entrywise ranges of T A - L_z C and T B - L_z D, and the slack the
entrywise |T B N + L_z (G - D N)| noise_bound + |T E| disturbance_bound. All of it is stated in any arithmetic: floats and
decision variables to find gains, exact rationals to prove them.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from flint import fmpq_mat

from luenberger.algebra import Polynomial
from luenberger.core import BadInput, NotAccepted
from luenberger.core.checks import matrix
from luenberger.systems.jacobian_box import as_floats, error_box
from luenberger.systems.matrix import PlantMatrix
from luenberger.systems.parameter import Parameter, box
from luenberger.systems.system import System
from luenberger.systems.width_rows import Cells, WidthRows
from luenberger.systems.worst_vertex import entry, entrywise, largest, size, spread

Lift = Callable[[PlantMatrix], Polynomial]


@dataclass(frozen=True)
class EnclosureSystem:
    """A plant in the coordinates of an interval observer.

    Args:
        A: T A(r, q), columns belong to the states x, shape (nx, nx).
        B: T B(r, q), shape (nx, nu).
        C: shape (ny, nx).
        D: shape (ny, nu).
        E: T E, shape (nx, nd).
        G: shape (ny, nv).
        N: shape (nu, nv).
        transform: T, constant.
        inverse: T^-1, constant.
        measured: scheduling name -> measured scheduling as a polynomial of the free parameters.
        box: free parameter -> interval; those of `hidden` included.
        hidden: free parameters that nobody measures.
        system: the plant.
        lift: turns float matrices into the coefficient arithmetic in use.
    """

    A: Polynomial
    B: Polynomial
    C: Polynomial
    D: Polynomial
    E: Polynomial
    G: Polynomial
    N: Polynomial
    transform: Polynomial
    inverse: Polynomial
    measured: Mapping[str, Polynomial]
    box: dict[str, tuple[float, float]]
    hidden: tuple[str, ...]
    system: System
    lift: Lift

    @staticmethod
    def of(
        system: System,
        transform: Any = None,
        lift: Lift = as_floats,
        view: Literal["true", "measured"] = "measured",
    ) -> "EnclosureSystem":
        """Write a plant in coordinates z = T x over the parameters that range freely.

        Args:
            system: continuous plant without nonlinearity; its uncertainties are hidden parameters.
            transform: T, shape (nx, nx); None for the states themselves.
            lift: arithmetic of the result.
            view: "true" lets true scheduling and its errors range, which is exactly what can happen; "measured" lets
                the measured scheduling range and takes the true one from it, (measured - offset) * inverse_factor,
                which is what an observer can maximise over.

        Raises:
            BadInput: T of the wrong shape, not finite, or without inverse.
            NotAccepted: a nonlinearity, a sample time, a function on the domain, or in the measured view a scheduling
                error that is declared as a map and cannot be turned round.
        """
        if system.nonlinearity is not None or system.dt is not None:
            what = "has a nonlinearity" if system.nonlinearity is not None else f"is discrete (dt = {system.dt:g} s)"
            raise NotAccepted(
                f"`{system.name}` {what}; enclosures are written for continuous plants that are linear in the state."
            )
        hidden = [p for p in system.parameters if not p.measured]
        true, measured, intervals = (_forward if view == "true" else _backward)(system)
        free = intervals | box(hidden)
        known = tuple(system.scheduling_names) if view == "measured" else tuple(intervals)
        inner = {n: lift(p) for n, p in true.items()}

        def at_true(value: PlantMatrix) -> Polynomial:
            return lift(value).compose(inner) if inner else lift(value)

        T, inverse = _pair(system, transform, lift)
        A, B, C, D, E, G, N = (at_true(getattr(system, letter)) for letter in "ABCDEGN")
        return EnclosureSystem(
            A=T @ A,
            B=T @ B,
            C=C,
            D=D,
            E=T @ E,
            G=G,
            N=N,
            transform=T,
            inverse=inverse,
            measured={n: lift(p) for n, p in measured.items()},
            box=free,
            hidden=tuple(n for n in free if n not in known),
            system=system,
            lift=lift,
        )

    def correction(self, gain: Polynomial) -> Polynomial:
        """Return L_z = T L at the measured scheduling, written over the free parameters.

        Args:
            gain: L(r), shape (nx, ny).

        Raises:
            BadInput: wrong shape, or a parameter that is not measured.
        """
        system = self.system
        if gain.shape != (system.nx, system.ny):
            raise BadInput(
                f"The gain has shape {gain.shape}; a plant with {system.nx} states and {system.ny} outputs needs "
                f"({system.nx}, {system.ny})."
            )
        if unknown := set(gain.names) - set(system.scheduling_names):
            raise BadInput(f"The gain depends on {sorted(unknown)}, which `{system.name}` does not measure.")
        return self.transform @ self.at_measured(self.lift(gain))

    def at_measured(self, polynomial: Polynomial) -> Polynomial:
        """Return a polynomial of the scheduling, already lifted, at the measured scheduling."""
        return polynomial.compose(self.measured) if self.measured else polynomial

    def loop(self, correction: Polynomial, storage: Polynomial | None = None) -> Polynomial:
        """Return S M = (S T A - Y C) T^-1 with Y = S L_z, the matrix that must keep order; S is one where left out.

        Args:
            correction: Y, over the free parameters.
            storage: S.
        """
        return (_scaled(storage, self.A) - correction @ self.C) @ self.inverse

    def drift(self, correction: Polynomial, storage: Polynomial | None = None) -> Polynomial:
        """Return S T A - Y C, whose columns belong to the states x."""
        return _scaled(storage, self.A) - correction @ self.C

    def steer(self, correction: Polynomial, storage: Polynomial | None = None) -> Polynomial:
        """Return S T B - Y D, shape (nx, nu)."""
        return _scaled(storage, self.B) - correction @ self.D

    def noise(self, correction: Polynomial, storage: Polynomial | None = None) -> Polynomial:
        """Return S T B N + Y (G - D N), shape (nx, nv)."""
        return _scaled(storage, self.B) @ self.N + correction @ (self.G - self.D @ self.N)

    def rows(self, correction: Polynomial) -> WidthRows:
        """Return the candidates of every entry of w' <= Mbar w + R |x| + U |u| + 2 slack.

        Args:
            correction: L_z over the free parameters, numeric.
        """
        two = self.lift(Polynomial.constant(np.full((1, 1), 2.0)))
        bounds = (self.system.noise_bound, self.system.disturbance_bound)
        slack = [
            value
            @ self.lift(Polynomial.constant(np.diag(np.zeros(value.shape[1]) if bound is None else np.array(bound))))
            for value, bound in zip((self.noise(correction), self.E), bounds, strict=True)
        ]
        return WidthRows(
            self._cells(self.loop(correction), largest),
            *(self._cells(value, spread) for value in (self.drift(correction), self.steer(correction))),
            *(self._cells(value * two, size) for value in slack),
        )

    def _cells(self, value: Polynomial, candidates: Callable[..., list[Polynomial]]) -> Cells:
        rows, columns = value.shape
        return [[candidates(entry(value, i, j), self.hidden, self.box) for j in range(columns)] for i in range(rows)]

    def upper(self, value: Polynomial) -> list[Polynomial]:
        """Return the entrywise maximum of a matrix over the hidden parameters, see `worst_vertex.largest`."""
        return entrywise(value, lambda scalar: largest(scalar, self.hidden, self.box))

    def spread(self, value: Polynomial) -> list[Polynomial]:
        """Return the entrywise range (largest minus smallest) of a matrix over the hidden parameters."""
        return entrywise(value, lambda scalar: spread(scalar, self.hidden, self.box))

    def size(self, value: Polynomial) -> list[Polynomial]:
        """Return the entrywise largest absolute value of a matrix over the hidden parameters."""
        return entrywise(value, lambda scalar: size(scalar, self.hidden, self.box))


@dataclass(frozen=True)
class OrderMargin:
    """The smallest entry off the diagonal of a closed loop.

    Args:
        value: the entry [1/s]; negative where order is not kept.
        row: its row.
        column: its column.
        point: where it is reached.
    """

    value: float
    row: int
    column: int
    point: Mapping[str, float]


def order_margin(system: System, gain: Any, transform: Any = None) -> OrderMargin:
    """Return the smallest off-diagonal entry of T (A - L C) T^-1 over the box, in floats.

    Choose it to see how far a gain is from an interval observer; the claim "cooperative" proves. For entries with a
    power above one the value is a lower bound and the point the nearest corner.

    Args:
        system: plant.
        gain: L(r), shape (nx, ny).
        transform: T; None for the states themselves.

    Raises:
        BadInput: a plant with one state, which has no such entry.
    """
    if system.nx < 2:
        raise BadInput(f"`{system.name}` has one state; order is kept by any gain.")
    here = EnclosureSystem.of(system, transform, view="true")
    M = here.loop(here.correction(Polynomial.constant(gain)))
    found: list[OrderMargin] = []
    for i, j in off_diagonal(system.nx):
        scalar = entry(M, i, j)
        degree = scalar.degree
        for index, value in scalar.bernstein(here.box).items():
            where = {n: here.box[n][2 * k > degree[n]] for n, k in zip(scalar.names, index, strict=True)}
            found.append(OrderMargin(float(value[0, 0]), i, j, where))
    return min(found, key=lambda margin: margin.value)


def off_diagonal(n: int) -> list[tuple[int, int]]:
    """Return the places of all entries off the diagonal of an n x n matrix."""
    return [(i, j) for i in range(n) for j in range(n) if i != j]


def _scaled(storage: Polynomial | None, value: Polynomial) -> Polynomial:
    return value if storage is None else storage @ value


def _forward(system: System) -> tuple[dict[str, Polynomial], dict[str, Polynomial], dict[str, tuple[float, float]]]:
    """True and measured scheduling over the true one and its errors: exactly what can happen."""
    error = system.measured_scheduling
    if error is None:
        return {}, {}, dict(system.scheduling_box)
    return error.true, error.measured, error_box(system)


def _backward(system: System) -> tuple[dict[str, Polynomial], dict[str, Polynomial], dict[str, tuple[float, float]]]:
    """True scheduling over the measured one: the intervals are rounded outward, so nothing is lost."""
    if system.scheduling_error is not None:
        raise NotAccepted(
            f"The scheduling error of `{system.name}` is declared as a map, which cannot be turned round; state it by `error` "
            "and `factor` of its parameters."
        )
    true: dict[str, Polynomial] = {}
    intervals: dict[str, tuple[float, float]] = {}
    for p in (p for p in system.parameters if p.measured):
        intervals[p.name] = p.interval if p.is_exact else _read(p)
        if p.is_exact:
            continue
        here = Polynomial((p.name,), {(1,): np.ones((1, 1))})
        if p.error:
            name = f"{p.name}_offset"
            here = here - Polynomial((name,), {(1,): np.ones((1, 1))})
            intervals[name] = (-p.error, p.error)
        if p.factor != (1.0, 1.0):
            name = f"{p.name}_inverse_factor"
            here = here * Polynomial((name,), {(1,): np.ones((1, 1))})
            intervals[name] = _outward(1 / p.factor[1], 1 / p.factor[0])
        true[p.name] = here
    return true, {}, intervals


def _read(p: Parameter) -> tuple[float, float]:
    ends = [factor * end for factor in p.factor for end in p.interval]
    lower, upper = _outward(min(ends), max(ends))
    return _outward(lower - p.error, upper + p.error)


def _outward(lower: float, upper: float) -> tuple[float, float]:
    return math.nextafter(lower, -math.inf), math.nextafter(upper, math.inf)


def _pair(system: System, transform: Any, lift: Lift) -> tuple[Polynomial, Polynomial]:
    nx = system.nx
    given = matrix("transform", np.eye(nx) if transform is None else transform, nx, nx, f"the system has {nx} states")
    if not np.linalg.cond(given) < 1e12:
        raise BadInput(f"`transform` {given.tolist()} has no inverse; coordinates need an invertible matrix.")
    T = lift(Polynomial.constant(given))
    exact = T.terms[()]
    if exact.dtype != object:
        return T, Polynomial.constant(np.linalg.inv(given))
    inverse = np.array(fmpq_mat(nx, nx, list(exact.flat)).inv().tolist(), dtype=object).reshape(nx, nx)
    return T, Polynomial.constant(inverse)
