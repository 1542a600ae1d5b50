"""The box in which the error of a discrete observer ends under bounded disturbance and noise, proved in exact rationals.

With |d| <= dbar, |v| <= vbar and constant matrices the error obeys e+ = F e + M s, |s_j| <= 1, where

    F = A - L C,    M = [E dbar, -(B N + L (G - D N)) vbar].

The smallest set that e never leaves is the sum of all F^k M times the unit box; its half widths are exactly

    w_i = sum over k >= 0 and j of |F^k M|_ij.

Every error ends up as near to that set as one likes, whatever it was at the start. So it ends in each box that holds w in its
interior, and what starts in the set stays in the set, hence in the box.

The sum is cut after K terms. With F' P F < rho^2 P and |x|_P^2 = x' P x, whatever is left of a column x at step K adds at most
sqrt((P^-1)_ii) |x|_P / (1 - rho) to w_i. The columns are rounded to a fixed grid on their way, so that numbers stay short; what
rounding cuts off is a column like any other and enters through the same bound.
"""

from dataclasses import dataclass
from math import isqrt

import numpy as np
from flint import fmpq, fmpq_mat

from luenberger.algebra import Polynomial
from luenberger.algebra.definiteness import exact
from luenberger.certify.claim import Claim
from luenberger.certify.continuum import Verdict, negative_definite
from luenberger.certify.inequality import exact_lift
from luenberger.core import BadInput, NotAccepted, Outcome
from luenberger.systems import System
from luenberger.systems.error_system import ErrorSystem

# Binary digits of the grid below the largest entry of M.
_BITS = 192
# Shares of the room between the estimated contraction and one that are given away to prove it.
_ROOM = (1e-6, 1e-3, 0.1, 0.5)


def steady_box_verdict(system: System, gain: Polynomial, claim: Claim, *, steps: int = 20000) -> tuple[str, Verdict]:
    """Decide whether every error ends in a box, from plant, gain and witnesses.

    Proved where P > 0, F' P F < rho^2 P for some rho < 1, and K exact terms of w with the bound of the rest stay below the box.
    Refuted where the terms alone pass it: admissible disturbances then drive the error out, again and again.

    Args:
        system: discrete linear plant without parameters, with bounds of disturbance and noise.
        gain: constant L.
        claim: of kind "steady_box"; `vector` the half widths [state units], `level` at least the largest of them, `storage` a
            constant P.
        steps: largest number of terms to add.

    Returns:
        the condition that failed (empty where none did), and the verdict; its margin is the smallest room left in the box, its
        point where refuted an entry of the error that is reached.

    Raises:
        NotAccepted: a continuous, scheduled, uncertain or nonlinear plant, or a storage that moves.
        BadInput: a bound is missing, or a vector of the wrong length.
    """
    P = claim.storage
    if not isinstance(P, np.ndarray):
        raise NotAccepted("A steady box needs a constant storage matrix as its witness; the claim has none.")
    require_bounded(system)
    error = ErrorSystem.of(system, gain, exact_lift)
    sides = ((error.disturbance, system.disturbance_bound), (error.noise, system.noise_bound))
    drive = np.hstack([_value(side) * exact(np.asarray(bound or (), dtype=float)) for side, bound in sides])
    return driven_box_verdict(Driven(_value(error.A), drive), claim, system.states, steps)


@dataclass(frozen=True)
class Driven:
    """What is looked at of a driven error: z = T e + D s' with e+ = F e + M s, |s_j| <= 1, |s'_j| <= 1, in exact rationals.

    Args:
        loop: F, (nx, nx).
        drive: M, (nx, ns).
        seen: T, (nx, nx); None for the error itself.
        direct: D, (nx, n), one column for each s' that no s is; None for none.
    """

    loop: np.ndarray
    drive: np.ndarray
    seen: np.ndarray | None = None
    direct: np.ndarray | None = None


def driven_box_verdict(
    driven: Driven, claim: Claim, names: tuple[str, ...], steps: int, what: str = "steady_box"
) -> tuple[str, Verdict]:
    """Decide whether z ends in the box of a claim; see `steady_box_verdict`.

    Args:
        driven: loop and generators.
        claim: with `vector`, `level` and a constant `storage` of e.
        names: of the entries of z.
        steps: largest number of terms to add.
        what: name of the condition where the box itself fails.

    Raises:
        BadInput: a vector of the wrong length.
    """
    box = exact(np.asarray(claim.vector, dtype=float).reshape(-1))
    if box.shape != (len(names),):
        raise BadInput(f"`vector` has {box.size} entries; a box of {len(names)} states needs one for each.")
    if max(box) > exact(claim.level)[()] or min(box) <= 0:
        return "vector", Verdict(Outcome.REFUTED, 0.0, {}, 0)
    P = exact(np.asarray(claim.storage))
    failed, verdict, rho = _contraction(driven.loop, P)
    if rho is None:
        return failed, verdict
    failed, verdict = _decided(_Sum.of(driven, P, rho), box, names, steps)
    return what * bool(failed), verdict


def require_bounded(system: System) -> None:
    """Refuse plants of which no steady box can be claimed.

    Args:
        system: plant.

    Raises:
        NotAccepted: a continuous, scheduled, uncertain or nonlinear plant.
        BadInput: a bound is missing.
    """
    if system.dt is None or system.nonlinearity is not None or not system.is_lti or system.scheduling_error is not None:
        raise NotAccepted(
            f"`{system.name}` is not a discrete linear plant with constant matrices; only there is the steady box a sum of "
            "powers. Discretise or freeze it."
        )
    if system.noise_bound is None or (system.nd and system.disturbance_bound is None):
        missing = "no `noise_bound`" if system.noise_bound is None else "an E without `disturbance_bound`"
        raise BadInput(
            f"`{system.name}` has {missing}; a steady box needs bounds of noise and disturbance. Give numbers, zero where there is nothing."
        )


def _contraction(loop: np.ndarray, P: np.ndarray) -> tuple[str, Verdict, fmpq | None]:
    """A proved factor rho < 1 with F' P F < rho^2 P, or None with what failed."""
    verdict = negative_definite(Polynomial.constant(-P), {})
    if verdict.outcome is not Outcome.PROVED:
        return "storage", verdict, None
    mapped = loop.T @ P @ loop
    verdict = negative_definite(Polynomial.constant(mapped - P), {})
    if verdict.outcome is not Outcome.PROVED:
        return "contraction", verdict, None
    F, storage = _floats(loop), _floats(P)
    R = np.linalg.cholesky(storage).T
    estimate = min(float(np.linalg.norm(R @ F @ np.linalg.inv(R), 2)), 1.0)
    for part in _ROOM:
        rho = fmpq(exact(estimate + part * (1 - estimate)).item())
        if rho < 1:
            verdict = negative_definite(Polynomial.constant(mapped - P * (rho * rho)), {})
            if verdict.outcome is Outcome.PROVED:
                return "", verdict, rho
    return "contraction", Verdict(Outcome.UNDECIDED, 0.0, {}, len(_ROOM)), None


@dataclass
class _Sum:
    """Terms of w added so far, in units of a grid, and the column at which it stands."""

    driven: Driven
    P: np.ndarray
    columns: np.ndarray
    added: np.ndarray
    grid: fmpq
    reach: list[fmpq]
    cut: fmpq
    roundings: int = 1

    @staticmethod
    def of(driven: Driven, P: np.ndarray, rho: fmpq) -> "_Sum":
        M, n = driven.drive, len(P)
        largest = max((abs(x) for x in M.flat), default=fmpq(0)) or fmpq(1)
        grid = largest / fmpq(2**_BITS)
        inverse = np.array(fmpq_mat(n, n, list(P.flat)).inv().tolist(), dtype=object)
        spread = inverse if driven.seen is None else driven.seen @ inverse @ driven.seen.T
        reach = [_root(spread[i, i]) / (1 - rho) for i in range(n)]
        # A cut of less than one unit in each of n entries is no longer than sqrt(n trace P) units in the norm of P.
        cut = _root(n * sum(P.diagonal(), fmpq(0))) * grid * M.shape[1]
        added = np.array([fmpq(0)] * n, dtype=object)
        if driven.direct is not None:
            added = added + abs(driven.direct).sum(axis=1) / grid
        return _Sum(driven, P, _floor(M / grid), added, grid, reach, cut)

    def advance(self) -> None:
        shown = self.columns if self.driven.seen is None else self.driven.seen @ self.columns
        self.added = self.added + abs(shown).sum(axis=1)
        self.columns = _floor(self.driven.loop @ self.columns)
        self.roundings += 1

    def bounds(self) -> tuple[list[fmpq], list[fmpq]]:
        """Lower and upper bounds of w."""
        blurred = self.cut * self.roundings
        rest = sum((_root(x @ self.P @ x) for x in self.columns.T), fmpq(0)) * self.grid
        low = [a * self.grid - r * blurred for a, r in zip(self.added, self.reach, strict=True)]
        high = [a * self.grid + r * (blurred + rest) for a, r in zip(self.added, self.reach, strict=True)]
        return low, high


def _decided(total: _Sum, box: np.ndarray, names: tuple[str, ...], steps: int) -> tuple[str, Verdict]:
    check, name = 1, "steady_box"
    for k in range(1, steps + 1):
        total.advance()
        if k < check and k < steps:
            continue
        # Roots cost more than steps; a look every tenth of the way wastes no more than that.
        check = k + max(4, k // 10)
        low, high = total.bounds()
        for i, state in enumerate(names):
            if low[i] > box[i]:
                return name, Verdict(Outcome.REFUTED, 0.0, {state: _float(low[i])}, 1)
        room = min(b - h for b, h in zip(box, high, strict=True))
        if room > 0:
            return "", Verdict(Outcome.PROVED, _float(room), {}, 1)
    return name, Verdict(Outcome.UNDECIDED, 0.0, {}, 1)


def _value(matrix: Polynomial) -> np.ndarray:
    """The only coefficient of a constant."""
    return np.asarray(matrix({}), dtype=object)


def _floor(matrix: np.ndarray) -> np.ndarray:
    out = np.empty(matrix.shape, dtype=object)
    for index, x in np.ndenumerate(matrix):
        value = fmpq(x)
        out[index] = fmpq(int(value.p) // int(value.q))
    return out


def _root(value: fmpq) -> fmpq:
    """An upper bound of the square root, to 64 bits and better."""
    p, q = int(value.p), int(value.q)
    return fmpq(isqrt(p * q << 128) + 1, q << 64)


def _float(value: fmpq) -> float:
    return int(value.p) / int(value.q)


def _floats(matrix: np.ndarray) -> np.ndarray:
    return np.array([[_float(x) for x in row] for row in matrix])
