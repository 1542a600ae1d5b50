"""Storage matrices for a gain that is already fixed: the analysis problem, convex in P."""

from typing import Any

import cvxpy as cp
import numpy as np

from luenberger.algebra import Polynomial
from luenberger.lmi.problem import Block, Problem, solve
from luenberger.lmi.recipe import centre
from luenberger.systems import System
from luenberger.systems.error_system import ErrorSystem


def decay_storage(system: System, gain: Polynomial, rate: float) -> tuple[np.ndarray, float] | None:
    """Return (P, multiplier) that show the decay rate with the largest margin, or None.

    Args:
        system: plant.
        gain: L(r), fixed.
        rate: decay rate [1/s], or factor a step of a discrete plant.
    """
    error, P, s, blocks = _posed(system, gain)
    blocks = [*blocks, Block("decay", error.dissipation(P, rate=rate, multiplier=s), error.box)]
    t = cp.Variable()
    found = solve(Problem({"P": P, "s": s, "t": t}, blocks, t), slack=t, extra=[cp.trace(P) <= system.nx])
    if found is None or not found.margin > 0:
        return None
    return rounded_storage(found.values["P"]), float(found.values["s"])


def l2_storage(
    system: System, gain: Polynomial, weight: np.ndarray, inputs: str
) -> tuple[float, np.ndarray, float] | None:
    """Return (level, P, multiplier) of the smallest L2 gain found for a fixed gain, backed off by one percent; or None.

    Args:
        system: plant.
        gain: L(r), fixed.
        weight: performance output, shape (nz, nx).
        inputs: "disturbance" or "noise".
    """
    error, P, s, blocks = _posed(system, gain)
    squared = cp.Variable(nonneg=True)
    w = {"disturbance": error.disturbance, "noise": error.noise}[inputs]
    rate = 0 if system.dt is None else 1
    matrix = error.dissipation(
        P,
        rate=rate,
        weight=Polynomial.constant(np.asarray(weight, dtype=float)),
        inputs=w,
        gain_squared=squared,
        multiplier=s,
    )
    problem = Problem({"P": P, "s": s, "squared": squared}, [*blocks, Block("l2_gain", matrix, error.box)], squared)
    found = centre(problem, back_off=0.02)
    if found is None:
        return None
    level = float(np.sqrt(found.values["squared"]))
    return level, rounded_storage(found.values["P"]), float(found.values["s"])


def rounded_storage(P: np.ndarray, bits: int = 30) -> np.ndarray:
    """Return P symmetrised and rounded to a grid of 2^-bits of its size, so that its rationals stay short.

    Args:
        P: storage matrix.
        bits: binary digits kept below the largest entry.
    """
    step = 2.0 ** (np.ceil(np.log2(np.abs(P).max())) - bits)
    return np.round((P + P.T) / 2 / step) * step


def _posed(system: System, gain: Polynomial) -> tuple[ErrorSystem, cp.Variable, Any, list[Block]]:
    error = ErrorSystem.of(system, gain)
    P = cp.Variable((system.nx, system.nx), symmetric=True)
    s = cp.Variable(nonneg=True)
    return error, P, s, [Block("storage", Polynomial.constant(-P))]
