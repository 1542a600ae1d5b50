"""Storage matrices for a gain that is already fixed: the analysis problem, convex in P."""

from collections.abc import Sequence
from typing import Any

import cvxpy as cp
import numpy as np

from luenberger.algebra import Polynomial
from luenberger.lmi.problem import Block, Problem, solve
from luenberger.lmi.recipe import centre
from luenberger.lmi.relaxation import Bernstein, Relaxation
from luenberger.systems import System
from luenberger.systems.error_system import ErrorSystem, Form
from luenberger.systems.jacobian_box import jacobian_corners
from luenberger.systems.scheduling_error import scheduling_rates

Monomials = Sequence[dict[str, int]]


def decay_storage(
    system: System,
    gain: Polynomial,
    rate: float,
    *,
    monomials: Monomials = ({},),
    relaxation: Relaxation | None = None,
    argument_gain: Polynomial | None = None,
) -> tuple[np.ndarray | Polynomial, float] | None:
    """Return (P, multiplier) that show the decay rate with the largest margin, or None.

    Args:
        system: plant.
        gain: L(r), fixed.
        rate: decay rate [1/s], or factor a step of a discrete plant.
        monomials: what P may depend on, see `storage_variable`; default: a constant P.
        relaxation: how the box is replaced by finitely many inequalities.
        argument_gain: L2(r) of an observer with two degrees of freedom; None for zero.
    """
    errors = [ErrorSystem.of(corner, gain, argument_gain=argument_gain) for corner in jacobian_corners(system)]
    P, s, variables, blocks = _posed(errors[0], system.nx, monomials, relaxation)
    blocks += [_block("decay", e.dissipation(P, rate=rate, multiplier=s), e, relaxation) for e in errors]
    t = cp.Variable()
    size = sum((cp.trace(c) for _, c in P), start=0)
    found = solve(Problem({**variables, "s": s, "t": t}, blocks, t), slack=t, extra=[size <= system.nx])
    if found is None or not found.margin > 0:
        return None
    return storage_value(P), float(found.values["s"])


def l2_storage(
    system: System,
    gain: Polynomial,
    weight: np.ndarray,
    inputs: str,
    *,
    form: Form = "plant",
    model: System | None = None,
    monomials: Monomials = ({},),
    relaxation: Relaxation | None = None,
    argument_gain: Polynomial | None = None,
) -> tuple[float, np.ndarray | Polynomial, float] | None:
    """Return (level, P, multiplier) of the smallest L2 gain found for a fixed gain, backed off by one percent; or None.

    Args:
        system: plant.
        gain: L(r), fixed.
        weight: performance output, shape (nz, nx).
        inputs: channels of w joined by "+", see `ErrorSystem.joined`.
        form: which signal a scheduling error multiplies.
        model: what the observer copies; None for the plant itself.
        monomials: what P may depend on; default: a constant P.
        relaxation: how the box is replaced by finitely many inequalities.
        argument_gain: L2(r) of an observer with two degrees of freedom; None for zero.

    Raises:
        BadInput: an input that the error does not have.
    """
    errors = [
        ErrorSystem.of(corner, gain, form=form, model=model, argument_gain=argument_gain)
        for corner in jacobian_corners(system)
    ]
    P, s, variables, blocks = _posed(errors[0], system.nx, monomials, relaxation)
    squared = cp.Variable(nonneg=True)
    for error in errors:
        matrix = error.dissipation(
            P,
            rate=0 if system.dt is None else 1,
            weight=Polynomial.constant(np.asarray(weight, dtype=float)),
            inputs=error.joined(inputs),
            gain_squared=squared,
            multiplier=s,
        )
        blocks.append(_block("l2_gain", matrix, error, relaxation))
    found = centre(Problem({**variables, "s": s, "squared": squared}, blocks, squared), back_off=0.02)
    if found is None:
        return None
    return float(np.sqrt(found.values["squared"])), storage_value(P), float(found.values["s"])


def storage_variable(nx: int, monomials: Monomials = ({},)) -> tuple[Polynomial, dict[str, cp.Variable]]:
    """Return P(r) = sum of monomial times symmetric variable, and its variables by name.

    Args:
        nx: number of states.
        monomials: one mapping of parameter name to power for each term; {} is the constant.
    """
    names = tuple(dict.fromkeys(n for m in monomials for n in m))
    keys = [tuple(m.get(n, 0) for n in names) for m in monomials]
    terms = {k: cp.Variable((nx, nx), symmetric=True, name=f"P{''.join(map(str, k))}") for k in keys}
    return Polynomial(names, terms), {v.name(): v for v in terms.values()}


def affine_monomials(system: System) -> list[dict[str, int]]:
    """Return the monomials of A in the scheduling parameters whose rates are bounded: a storage as rich as the plant.

    Args:
        system: plant with polynomial A.
    """
    moving = scheduling_rates(system.parameters)[0] if system.nr else {}
    A = system.polynomial("A")
    found: dict[tuple[tuple[str, int], ...], None] = {(): None}
    for exponents, coefficient in A:
        powers = {n: e for n, e in zip(A.names, exponents, strict=True) if e}
        if powers and set(powers) <= set(moving) and np.any(np.asarray(coefficient)):
            found[tuple(powers.items())] = None
    return [dict(m) for m in found]


def storage_value(P: Polynomial) -> np.ndarray | Polynomial:
    """Return the solved storage, rounded: a matrix where it is constant, else a polynomial.

    Args:
        P: storage with solved variables as coefficients.
    """
    values = P.map(lambda c: rounded_storage(np.asarray(c.value)))
    return values if any(values.degree.values()) else next(iter(values.terms.values()))


def rounded_storage(P: np.ndarray, bits: int = 30) -> np.ndarray:
    """Return P symmetrised and rounded to a grid of 2^-bits of its size, so that its rationals stay short.

    Args:
        P: storage matrix.
        bits: binary digits kept below the largest entry.
    """
    largest = np.abs(P).max()
    if largest == 0:
        return np.zeros_like(P)
    step = 2.0 ** (np.ceil(np.log2(largest)) - bits)
    return np.round((P + P.T) / 2 / step) * step


def _posed(
    error: ErrorSystem, nx: int, monomials: Monomials, relaxation: Relaxation | None
) -> tuple[Polynomial, Any, dict[str, cp.Variable], list[Block]]:
    P, variables = storage_variable(nx, monomials)
    s = cp.Variable(nonneg=True)
    return P, s, variables, [_block("storage", -error.storage(P)[0], error, relaxation)]


def _block(name: str, matrix: Polynomial, error: ErrorSystem, relaxation: Relaxation | None) -> Block:
    return Block(name, matrix, error.box, relaxation=relaxation or Bernstein())
