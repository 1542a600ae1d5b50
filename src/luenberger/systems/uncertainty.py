"""What of a plant is not known at run time, as rank-one factors of unit size around a nominal plant.

    x+ = A0(r) x + B0(r) u + E0 d + sum_k direction_k s_k (rows_k(r) [x; u; d]),     |s_k| <= 1

Each factor is one cause: an unmeasured parameter, a product of some, the error of a measured one, or what E does beyond a constant.
Keeping the cause as one scalar is what makes a set narrow: a cornering stiffness acts on both states through one slip angle.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np

from luenberger.algebra import Polynomial
from luenberger.algebra.definiteness import exact
from luenberger.core import NotAccepted
from luenberger.systems.error_system import beside
from luenberger.systems.parameter import Parameter
from luenberger.systems.system import System

# What is left of an entry after its factors are taken off is rounding below this share of all that was subtracted.
_ROUNDING = 2.0**-44
# Cause of the part of E that changes with the scheduling.
_DIRECTION = "E(r)"

Key = tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Uncertain:
    """A nominal plant and the factors around it.

    Args:
        nominal: unmeasured parameters at their midpoints, scheduling taken as exact on the box of its measurements, E at the middle
            of that box.
        directions: what each factor does to the state, shape (nx, nk).
        rows: what each factor multiplies, a polynomial of the measured scheduling, shape (nk, nx + nu + nd).
        names: cause of each factor, e.g. "front_stiffness", "front_stiffness*speed", or "E(r)".
        spread: width of each factor's cause, for tables; unit of the parameter (radius), shape (nk,).
    """

    nominal: System
    directions: np.ndarray
    rows: Polynomial
    names: tuple[str, ...]
    spread: np.ndarray

    @staticmethod
    def of(system: System) -> "Uncertain":
        """Take a plant apart.

        Every monomial of the unknowns, centred and scaled to [-1, 1], is one cause; its coefficients [A, B, E] are factored by a
        common column space over the monomials of the scheduling, so a cause that acts along one direction stays one factor.

        Assumes: true scheduling inside its box, measured scheduling within `error` and `factor` of it.

        Args:
            system: plant with polynomial matrices, continuous or discrete.

        Raises:
            NotAccepted: a nonlinearity, matrices as functions, outputs or noise that depend on what is not known, a scheduling error
                declared as a map, or an E that varies while nobody bounds d.
        """
        _require(system)
        names, groups = _parts(system, _identity)
        nx, nu = system.nx, system.nu
        wide = groups.pop((0,) * len(names))
        measured = _measurements(system)
        A, B, E = (_columns(wide, slice(*ends)) for ends in ((0, nx), (nx, nx + nu), (nx + nu, wide.shape[1])))
        E0 = np.asarray(E({p.name: p.middle for p in measured}), dtype=float)
        causes = {_cause(key, names): group for key, group in groups.items()}
        if any(np.any(c) for e, c in E if any(e)):
            # E(r) - E0 is known at run time, but what it multiplies is not.
            causes[_DIRECTION] = beside(Polynomial.constant(np.zeros((nx, nx + nu))), E - Polynomial.constant(E0))
        found = [(cause, *factor) for cause, group in causes.items() for factor in _factors(group)]
        rows = [row for _, _, row in found]
        _require_bounded_direction(system, rows, nx + nu)
        kept = {k: v for k, v in system.units.items() if k not in system.uncertainty}
        nominal = system.replace(A=A, B=B, E=E0, parameters=measured, scheduling_error=None, units=kept)
        directions = np.array([direction for _, direction, _ in found]).reshape(len(found), nx).T
        radii = _radii(system)
        spread = np.array([radii.get(cause, 1.0) for cause, _, _ in found])
        stacked = _stacked(rows, wide.shape[1], system.scheduling_names)
        return Uncertain(nominal, directions, stacked, tuple(cause for cause, _, _ in found), spread)

    @property
    def nk(self) -> int:
        """Number of factors."""
        return len(self.names)

    def at(
        self, unit: Mapping[str, float] | np.ndarray, **scheduling: float
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return A, B, E with every factor at given values.

        Args:
            unit: s_k in [-1, 1], shape (nk,), or name -> value for all factors of that name.
            scheduling: name -> value.
        """
        s = np.array([unit.get(n, 0.0) for n in self.names]) if isinstance(unit, Mapping) else np.asarray(unit)
        rows = np.asarray(self.rows({n: scheduling[n] for n in self.rows.names}), dtype=float)
        values = [scheduling[n] for n in self.nominal.scheduling_names]
        wide = (
            np.hstack([np.asarray(self.nominal.at(letter, values)) for letter in "ABE"]) + (self.directions * s) @ rows
        )
        nx, nu = self.nominal.nx, self.nominal.nu
        return wide[:, :nx], wide[:, nx : nx + nu], wide[:, nx + nu :]


def uncovered(system: System, uncertain: Uncertain) -> np.ndarray:
    """Return an exact bound of what nominal plant and factors leave out of a plant, entry by entry of [A, B, E].

    Everything is formed again in exact arithmetic from the floats of the plant and its intervals: with true = middle + radius s and
    true = measured + radius s, every value in the intervals has |s| <= 1.

    Args:
        system: plant.
        uncertain: from `Uncertain.of`.

    Returns:
        object array of rationals, shape (nx, nx + nu + nd); rounding of the factors, far below any bound.

    Raises:
        NotAccepted: as `Uncertain.of`.
    """
    _require(system)
    names, groups = _parts(system, exact)
    plant = uncertain.nominal
    nominal = beside(beside(plant.polynomial("A"), plant.polynomial("B")), plant.polynomial("E")).map(exact)
    # What E does beyond its constant is a factor of its own.
    left = {_DIRECTION: groups.pop((0,) * len(names)) - nominal}
    left |= {_cause(key, names): group for key, group in groups.items()}
    rows = uncertain.rows.map(exact)
    for k, cause in enumerate(uncertain.names):
        pick = Polynomial.constant(exact(np.eye(1, uncertain.nk, k)))
        taken = Polynomial.constant(exact(uncertain.directions[:, k : k + 1])) @ (pick @ rows)
        left[cause] = left[cause] - taken if cause in left else -taken
    box = {p.name: p.interval for p in _measurements(system)}
    total = exact(np.zeros(nominal.shape))
    for rest in left.values():
        coefficients = rest.bernstein({n: box[n] for n in rest.names}).values()
        total = total + np.max([abs(np.asarray(c, dtype=object)) for c in coefficients], axis=0)
    return total


def _parts(system: System, lift: Callable[[Any], Any]) -> tuple[list[str], dict[Key, Polynomial]]:
    """Unknowns, and exponents of their units -> coefficient of [A, B, E], a polynomial of the scheduling."""
    radii, scheduling = _radii(system), system.scheduling_names
    inner = {}
    for p in system.parameters:
        if p.name in radii:
            unit = Polynomial.affine(np.zeros((1, 1)), **{f"unit {p.name}": np.full((1, 1), radii[p.name])})
            known = Polynomial.affine(np.zeros((1, 1)), **{p.name: np.ones((1, 1))})
            inner[p.name] = (unit + (known if p.measured else np.full((1, 1), p.middle))).map(lift)
    names = list(inner)
    wide = beside(beside(system.polynomial("A"), system.polynomial("B")), system.polynomial("E")).map(lift)
    wide = wide.compose({n: p for n, p in inner.items() if n in wide.names})
    wide = wide.over(tuple(dict.fromkeys((*(f"unit {n}" for n in names), *scheduling, *wide.names))))
    count = len(names)
    zero = {(0,) * len(scheduling): lift(np.zeros(wide.shape))}
    groups: dict[Key, dict[Key, Any]] = {(0,) * count: zero}
    for exponents, coefficient in wide:
        if np.any(coefficient):
            group, here = groups.setdefault(exponents[:count], {}), exponents[count : count + len(scheduling)]
            group[here] = group[here] + coefficient if here in group else coefficient
    return names, {key: Polynomial(scheduling, terms) for key, terms in groups.items()}


def _identity(array: Any) -> np.ndarray:
    return np.asarray(array, dtype=float)


def _radii(system: System) -> dict[str, float]:
    """Half width of everything that is not known exactly, rounded up."""
    found: dict[str, float] = {}
    for p in system.parameters:
        lower, upper = Fraction(p.lower), Fraction(p.upper)
        if not p.measured:
            found[p.name] = _up(max(upper - Fraction(p.middle), Fraction(p.middle) - lower))
        elif not p.is_exact:
            scale = max(abs(Fraction(f) - 1) for f in p.factor)
            found[p.name] = _up(Fraction(p.error) + scale * max(abs(lower), abs(upper)))
    return found


def _measurements(system: System) -> list[Parameter]:
    """Scheduling parameters on the box of their measurements, which is wider than that of the true values."""
    out = []
    for p in system.parameters:
        if p.measured and p.is_exact:
            out.append(p)
        elif p.measured:
            ends = [Fraction(end) * Fraction(f) for end in p.interval for f in p.factor]
            lower, upper = -_up(Fraction(p.error) - min(ends)), _up(Fraction(p.error) + max(ends))
            out.append(replace(p, lower=lower, upper=upper, error=0.0, factor=(1.0, 1.0)))
    return out


def _up(value: Fraction) -> float:
    near = float(value)
    return near if Fraction(near) >= value else math.nextafter(near, math.inf)


def _factors(group: Polynomial) -> Iterator[tuple[np.ndarray, Polynomial]]:
    """Directions and rows whose products sum to a group: one of its columns and one of its rows at a time.

    Elimination with the largest entry as the pivot: one direction where the group has rank one, entries given back to rounding, and
    further factors only for what the ones before leave out. Rows are weighed by their own size, so no state leads by its unit.
    """
    coefficients = [np.asarray(c, dtype=float) for _, c in group]
    rest = np.hstack(coefficients)
    weight = np.abs(rest).max(axis=1, keepdims=True)
    weight[weight == 0] = 1.0
    rounding = _ROUNDING * np.abs(rest)
    while (np.abs(rest) > rounding).any():
        share = np.where(np.abs(rest) > rounding, np.abs(rest) / weight, 0.0)
        top, column = np.unravel_index(int(share.argmax()), share.shape)
        direction, row = rest[:, column] / rest[top, column], rest[top].copy()
        taken = np.outer(direction, row)
        # Row and column of the pivot are gone exactly, whatever their rounding says.
        rest, rounding = rest - taken, rounding + _ROUNDING * np.abs(taken)
        rest[top], rest[:, column] = 0.0, 0.0
        parts = np.split(row[None], len(coefficients), axis=1)
        yield direction, Polynomial(group.names, dict(zip(group.terms, parts, strict=True)))


def _cause(key: Key, names: list[str]) -> str:
    return "*".join(n + (f"^{e}" if e > 1 else "") for n, e in zip(names, key, strict=True) if e)


def _columns(matrix: Polynomial, which: slice) -> Polynomial:
    return matrix.map(lambda c: np.asarray(c)[:, which])


def _stacked(rows: list[Polynomial], width: int, names: tuple[str, ...]) -> Polynomial:
    terms = {(0,) * len(names): np.zeros((len(rows), width))}
    for k, row in enumerate(rows):
        for exponents, coefficient in row.over(names):
            terms.setdefault(exponents, np.zeros((len(rows), width)))[k] += np.asarray(coefficient)[0]
    return Polynomial(names, terms)


def _require(system: System) -> None:
    if system.nonlinearity is not None:
        raise NotAccepted(f"`{system.name}` has a nonlinearity; sets are carried by linear plants.")
    if system.scheduling_error is not None:
        raise NotAccepted(
            f"The scheduling error of `{system.name}` is declared as a map; state it by `error` and `factor` of its parameters."
        )
    unknown = set(_radii(system))
    for letter in "CDGN":
        matrix = system.polynomial(letter)
        moving = {n for e, c in matrix for n, power in zip(matrix.names, e, strict=True) if power and np.any(c)}
        if hidden := unknown & moving:
            raise NotAccepted(
                f"`{letter}` of `{system.name}` depends on {sorted(hidden)}, which nobody knows exactly; only A, B and E may. Freeze it, or "
                "move its effect into `noise_bound`."
            )


def _require_bounded_direction(system: System, rows: list[Polynomial], start: int) -> None:
    moves = any(np.any(np.asarray(c)[:, start:]) for row in rows for _, c in row)
    if moves and system.disturbance_bound is None:
        raise NotAccepted(
            f"E of `{system.name}` varies, so no constant gain takes all of d out, and d has no `disturbance_bound`. Give one, or freeze "
            "what E depends on."
        )
