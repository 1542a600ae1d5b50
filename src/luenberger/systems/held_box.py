"""The exact zero-order hold of a linear plant whose parameters nobody measures: affine in them, with a proved remainder.

With M(q) = dt [A B E; 0 0 0] and q = middle + radius s, the hold is the first rows of exp(M(s)). Its power series in s up to a
degree comes from one exponential: on polynomials cut off at that degree, multiplication by M(s) is a block matrix, and the first
block row of its exponential holds all coefficients. What is cut off is bounded by the series of exp(|M|(s)), whose coefficients
are sums of entrywise moduli: its value at s = 1 less its own first terms.
"""

import math
from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from flint import arb, arb_mat, fmpq

from luenberger.algebra import Polynomial
from luenberger.algebra.definiteness import exact
from luenberger.algebra.endpoint import at_working_precision, number, rational
from luenberger.core import BadInput, NotAccepted
from luenberger.systems.discretize import discretize
from luenberger.systems.error_system import beside
from luenberger.systems.parameter import Parameter
from luenberger.systems.system import System

# Degree of the series in the parameters, lowered until the block matrix has at most this many rows.
_HIGHEST, _MOST_ROWS = 4, 120

Key = tuple[int, ...]


class Hull(NamedTuple):
    """A held matrix as floats: middle + sum over parameters of value * slope, within radius entry by entry."""

    middle: np.ndarray
    slopes: dict[str, np.ndarray]
    radius: np.ndarray


def discretize_enclosed(system: System, dt: float) -> System:
    """Return the exactly sampled plant, affine in its unmeasured parameters, with what is not affine in proved intervals.

    Choose it over `discretize(system, dt, "euler")` where a set has to contain the state of a continuous plant: forward differences
    leave out more than a narrow set allows for. Inputs and unknown inputs are held over the step; a d that changes within a step
    is not the d of this plant.

    The remainder of entry (i, j) is one more unmeasured parameter in [-1, 1], e.g. hold_a_12 of A, hold_b_21 of B, hold_e_11 of E.
    E then moves with the parameters, so nothing takes all of d out, and observers ask for `disturbance_bound`.

    Assumes: parameters constant over the step; dx = A(q) x + B(q) u + E(q) d, polynomials of q.

    Args:
        system: continuous linear plant without scheduling in A, B, E.
        dt: sample time [s].

    Raises:
        BadInput: dt not positive.
        NotAccepted: a discrete plant, a nonlinearity, matrices as functions, scheduled ones, or parameters that move the plant so far
            within a step that nothing finite can be said; the message says what to do.

    Reference: N. J. Higham, Functions of Matrices (2008), section 3.1 and theorem 4.12 (exponentials of block triangular matrices).
    """
    _require(system, dt)
    hidden = [p for p in system.parameters if not p.measured]
    if not hidden:
        return discretize(system, dt)
    found = _held(system, dt, hidden)
    nx, nu = system.nx, system.nu
    changes: dict[str, Any] = {}
    extra: list[Parameter] = []
    for letter, first, last in (("A", 0, nx), ("B", nx, nx + nu), ("E", nx + nu, nx + nu + system.nd)):
        changes[letter], added = _matrix(letter, found, slice(first, last))
        extra += added
    if taken := {p.name for p in extra} & {p.name for p in system.parameters}:
        raise BadInput(f"Parameters of `{system.name}` are called {sorted(taken)}, as the remainders; rename them.")
    return system.replace(**changes, parameters=[*system.parameters, *extra], dt=dt)


def _require(system: System, dt: float) -> None:
    if not (np.isfinite(dt) and dt > 0):
        raise BadInput(f"`dt` is {dt}; a positive step in seconds is needed.")
    if system.dt is not None:
        raise NotAccepted(
            f"`{system.name}` is discrete already (dt = {system.dt:g} s); give a continuous plant (dt = None) or use it as it is."
        )
    if system.nonlinearity is not None:
        raise NotAccepted(f"`{system.name}` has a nonlinearity; the exact hold is written for linear plants.")
    moving = {n for letter in "ABE" for n, d in system.polynomial(letter).degree.items() if d}
    if scheduled := [n for n in system.scheduling_names if n in moving]:
        values = ", ".join(f"{n}=..." for n in scheduled)
        raise NotAccepted(
            f"`{system.name}` is scheduled by {scheduled}; the enclosed hold is written for constant scheduling. Take one plant for each "
            f"mode, `system.freeze({values})`, and put them together with `Switched.of`."
        )


@at_working_precision
def _held(system: System, dt: float, hidden: Sequence[Parameter]) -> Hull:
    """[A, B, E] of the hold."""
    nx = system.nx
    terms, spans = _unit_terms(system, dt, hidden)
    n = next(iter(terms.values())).shape[0]
    count = len(hidden)
    degree = next(d for d in range(_HIGHEST, 0, -1) if d == 1 or math.comb(count + d, d) * n <= _MOST_ROWS)
    series = _series(terms, degree)
    tail = _tail(terms, degree)
    zero = (0,) * count
    units = {p.name: tuple(int(k == j) for j in range(count)) for k, p in enumerate(hidden)}
    middle, radius = np.zeros((nx, n)), np.zeros((nx, n))
    slopes = {name: np.zeros((nx, n)) for name in units}
    for i, j in np.ndindex(nx, n):
        curved = _interval(tail[i, j])
        for key, value in series.items():
            if sum(key) > 1:
                # An even power stays in [0, 1].
                curved = curved + value[i, j] * (arb(fmpq(1, 2), fmpq(1, 2)) if _even(key) else arb(0, 1))
        left, wrong = series[zero][i, j] + curved, arb(0)
        for name, key in units.items():
            centre, half = spans[name]
            slope = float((series[key][i, j] / half).mid()) if half != 0 else 0.0
            slopes[name][i, j] = slope
            left = left - arb(slope) * centre
            wrong = wrong + abs(series[key][i, j] - arb(slope) * half)
        if not (left.is_finite() and wrong.is_finite()):
            raise NotAccepted(
                f"The hold of `{system.name}` over {dt:g} s has no finite enclosure; its parameters move it too far within one step. "
                "Take a shorter step, or narrower intervals."
            )
        nearest = float(left.mid())
        middle[i, j] = nearest
        radius[i, j] = _above((abs(left - arb(nearest)) + wrong).upper())
    return Hull(middle, slopes, radius)


def _unit_terms(
    system: System, dt: float, hidden: Sequence[Parameter]
) -> tuple[dict[Key, np.ndarray], dict[str, tuple[arb, arb]]]:
    """Exponents of the units s -> coefficient of dt [A B E; 0 0 0], exact; and middle and radius of every parameter."""
    names = [p.name for p in hidden]
    ends = {p.name: (rational(p.lower), rational(p.upper)) for p in hidden}
    middles = {n: (a + b) / 2 for n, (a, b) in ends.items()}
    radii = {n: (b - a) / 2 for n, (a, b) in ends.items()}
    inner = {n: Polynomial((f"unit {n}",), {(0,): _one(middles[n]), (1,): _one(radii[n])}) for n in names}
    wide = beside(beside(system.polynomial("A"), system.polynomial("B")), system.polynomial("E")).map(exact)
    wide = wide.compose({n: p for n, p in inner.items() if n in wide.names}) * rational(dt)
    # Scheduling that enters with zero coefficients only has no power left to keep.
    wide = wide.substitute({n: fmpq(0) for n in wide.names if n in system.scheduling_names})
    wide = wide.over(tuple(f"unit {n}" for n in names))
    n = wide.shape[1]
    terms: dict[Key, np.ndarray] = {}
    for key, coefficient in wide:
        terms[key] = exact(np.zeros((n, n)))
        terms[key][: system.nx] = coefficient
    return terms, {n: (arb(middles[n]), arb(radii[n])) for n in names}


def _one(value: fmpq) -> np.ndarray:
    out = np.empty((1, 1), dtype=object)
    out[0, 0] = value
    return out


def _series(terms: Mapping[Key, np.ndarray], degree: int) -> dict[Key, arb_mat]:
    """Coefficients of exp(sum of terms) up to a total degree: the first block row of one exponential."""
    count = len(next(iter(terms)))
    keys = sorted((k for k in product(range(degree + 1), repeat=count) if sum(k) <= degree), key=lambda k: (sum(k), k))
    place = {key: k for k, key in enumerate(keys)}
    n = next(iter(terms.values())).shape[0]
    block = arb_mat(n * len(keys), n * len(keys))
    for row, key in enumerate(keys):
        for step, coefficient in terms.items():
            column = place.get(tuple(a + b for a, b in zip(key, step, strict=True)))
            if column is not None:
                for i, j in np.ndindex(n, n):
                    if coefficient[i, j] != 0:
                        block[row * n + i, column * n + j] = number(coefficient[i, j])
    whole = block.exp()
    return {key: arb_mat([[whole[i, k * n + j] for j in range(n)] for i in range(n)]) for k, key in enumerate(keys)}


def _tail(terms: Mapping[Key, np.ndarray], degree: int) -> arb_mat:
    """Bound of all that the series leaves out, entry by entry, for |s| <= 1."""
    sizes: dict[Key, np.ndarray] = {}
    n = next(iter(terms.values())).shape[0]
    # exp(M) = exp(-c) exp(M + c): with diagonals on both sides of zero, moduli grow least.
    constant = terms.get((0,) * len(next(iter(terms))), exact(np.zeros((n, n))))
    diagonal = [constant[i, i] for i in range(n)]
    shift = -(max(diagonal) + min(diagonal)) / 2
    for key, coefficient in terms.items():
        size = sizes.get((sum(key),), exact(np.zeros((n, n))))
        sizes[(sum(key),)] = size + abs(coefficient + exact(np.eye(n)) * shift if not any(key) else coefficient)
    total = sum(sizes.values(), exact(np.zeros((n, n))))
    left = arb_mat([[arb(x) for x in row] for row in total.tolist()]).exp()
    for coefficient in _series(sizes, degree).values():
        left = left - coefficient
    return left * (-arb(shift)).exp()


def _interval(bound: arb) -> arb:
    """All numbers of at most this size."""
    return arb(0, max(bound.upper(), arb(0)))


def _even(key: Key) -> bool:
    return all(power % 2 == 0 for power in key)


def _above(value: arb) -> float:
    near = float(value)
    while arb(near) < value:
        near = math.nextafter(near, math.inf)
    return near


def _matrix(letter: str, held: Hull, columns: slice) -> tuple[Polynomial, list[Parameter]]:
    """One matrix as a polynomial of the parameters and its remainders, and the parameters of the remainders."""
    middle, radius = held.middle[:, columns], held.radius[:, columns]
    slopes = {name: slope[:, columns] for name, slope in held.slopes.items()}
    parts = {name: slope for name, slope in slopes.items() if slope.any()}
    gap = "" if max(middle.shape) < 10 else "_"
    added = []
    for i, j in np.ndindex(*middle.shape):
        if radius[i, j] > 0:
            name = f"hold_{letter.lower()}_{i + 1}{gap}{j + 1}"
            parts[name] = np.zeros(middle.shape)
            parts[name][i, j] = radius[i, j]
            added.append(Parameter(name, -1.0, 1.0, measured=False))
    return Polynomial.affine(middle, **parts), added
