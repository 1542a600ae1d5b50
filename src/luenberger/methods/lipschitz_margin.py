"""How much Lipschitz nonlinearity an observer gain tolerates, and how much any gain of the Riccati form can tolerate.

Every number has two routes: a semidefinite programme as printed, and an oracle that needs none.
"""

from typing import Any, Literal

import cvxpy as cp
import numpy as np
from scipy.linalg import solve_continuous_lyapunov

from luenberger.algebra import Polynomial, symmetric
from luenberger.core import Infeasible
from luenberger.lmi import Block, Problem, rounded_storage, solve
from luenberger.methods.hamiltonian import hinf_peak, positive_solution
from luenberger.methods.lipschitz_plant import LumpedPlant, Transform, require_epsilon
from luenberger.systems import System


def stability_margin(
    system: System, gain: Any, transform: Transform = None, route: Literal["norm", "maximise", "minimise"] = "norm"
) -> float:
    """Return the quadratic stability margin alpha of a gain: the supremum of Lipschitz constants it tolerates.

    Use it to compare gains, whoever designed them. It is a supremum: stability is proved for every Lipschitz constant
    strictly below, not at alpha itself.

    Assumes: e' = (A - L C) e + phi, |T phi| <= g |T e|.
    Certifies: nothing; `margin_bracket` of `lipschitz_bracket` proves bounds.

    Args:
        system: continuous plant with constant matrices.
        gain: L, shape (nx, ny).
        transform: T or its diagonal; the margin depends on it.
        route: "norm" is 1 / |(s I - T (A - L C) T^-1)^-1|_inf, "maximise" is eq. (13), "minimise" is eq. (15).

    Returns:
        alpha; 0 where A - L C is not stable.

    Raises:
        Infeasible: no solver gave an answer (SDP routes only).

    Reference: B. Song, J. K. Hedrick, ACC 2011, Corollary 1, (13) and (15); the printed "greater than or equal to" must be
    "greater than".

    Example:
        >>> import luenberger as lb
        >>> from luenberger.methods.lipschitz_margin import stability_margin
        >>> plant = lb.System.linear([[0.0]], C=[[1.0]])
        >>> stability_margin(plant, [[3.0]])
        3.0
    """
    loop = LumpedPlant.of(system, transform).loop(gain)
    if np.linalg.eigvals(loop).real.max() >= 0:
        return 0.0
    n = loop.shape[0]
    eye = np.eye(n)
    if route == "norm":
        return 1.0 / hinf_peak(loop, eye, eye).level
    P, level = cp.Variable((n, n), symmetric=True), cp.Variable(nonneg=True)
    drift = P @ loop + loop.T @ P
    if route == "maximise":
        problem = Problem({"P": P, "level": level}, _blocks(P, drift + level * eye, -eye), -level)
        return float(np.sqrt(max(_solved(problem), 0.0)))
    problem = Problem({"P": P, "level": level}, _blocks(P, drift + eye, -level * eye), level)
    return float(1.0 / np.sqrt(_solved(problem)))


def margin_at(
    system: System, epsilon: float, transform: Transform = None, route: Literal["riccati", "sdp"] = "riccati"
) -> float:
    """Return the largest Lipschitz constant for which a gain L = P^-1 C' / (2 epsilon) exists at this epsilon.

    Choose it to see whether coordinates and epsilon suit a plant. It falls as epsilon grows. The P of the optimum is
    singular, so no gain may be built from it; `LipschitzRiccati` builds one strictly inside.

    Assumes: e' = (A - L C) e + phi, |T phi| <= g |T e|.

    Args:
        system: continuous plant with constant matrices.
        epsilon: weight of the outputs, > 0.
        transform: T or its diagonal.
        route: "riccati" bisects on the largest solution of the Riccati equation, "sdp" solves eq. (24).

    Returns:
        alpha; 0 where no P > 0 exists at all.

    Reference: B. Song, J. K. Hedrick, ACC 2011, Theorem 4, (24).

    Example:
        >>> import luenberger as lb
        >>> from luenberger.methods.lipschitz_margin import margin_at
        >>> plant = lb.System.linear([[0.0]], C=[[1.0]])
        >>> round(margin_at(plant, 0.25), 9)
        2.0
    """
    require_epsilon(epsilon)
    plant = LumpedPlant.of(system, transform)
    eye, outputs = np.eye(plant.nx), plant.C.T @ plant.C / epsilon
    if route == "sdp":
        P, level = cp.Variable((plant.nx, plant.nx), symmetric=True), cp.Variable(nonneg=True)
        corner = P @ plant.A + plant.A.T @ P + level * eye - outputs
        return float(np.sqrt(max(_solved(Problem({"P": P, "level": level}, _blocks(P, corner, -eye), -level)), 0.0)))
    return float(np.sqrt(squared_margin(plant.A, outputs)))


def squared_margin(A: np.ndarray, outputs: np.ndarray) -> float:
    """Return the largest a for which He(P A) + P P + a I - outputs = 0 has a largest solution P > 0; 0 where none.

    Args:
        A: (n, n).
        outputs: C' C / epsilon, or zero for the margin of a closed loop, (n, n).
    """
    eye = np.eye(A.shape[0])

    def holds(level: float) -> bool:
        return positive_solution(A, eye, level * eye - outputs) is not None

    good, bad = 0.0, 1.0
    while holds(bad):
        good, bad = bad, 4 * bad
    while bad - good > 1e-13 * bad and bad > 1e-16:
        middle = 0.5 * (good + bad)
        good, bad = (middle, bad) if holds(middle) else (good, middle)
    return good


def storage_at(plant: LumpedPlant, epsilon: float) -> np.ndarray | None:
    """Return the P of largest lmin(P) at an epsilon: the largest solution of the Riccati equation; None where none is > 0.

    Args:
        plant: plant in its coordinates, with the Lipschitz constant.
        epsilon: weight of the outputs.

    Reference: B. Song, J. K. Hedrick, ACC 2011, (26), whose optimum solves (19) as an equation.
    """
    return positive_solution(
        plant.A, np.eye(plant.nx), plant.lipschitz**2 * np.eye(plant.nx) - plant.C.T @ plant.C / epsilon
    )


def thau_bound(system: System, gain: Any, transform: Transform = None) -> float:
    """Return 1 / (2 lmax(P)) with He(P (A - L C)) = -I; the error is stable for every Lipschitz constant below it.

    The oldest test and the most cautious one; it never exceeds `stability_margin`.

    Args:
        system: continuous plant with constant matrices.
        gain: L, shape (nx, ny).
        transform: T or its diagonal.

    Returns:
        the bound; 0 where A - L C is not stable.

    Reference: F. E. Thau, Int. J. Control 17 (1973) 471-479; B. Song, J. K. Hedrick, ACC 2011, (5).
    """
    loop = LumpedPlant.of(system, transform).loop(gain)
    if np.linalg.eigvals(loop).real.max() >= 0:
        return 0.0
    P = solve_continuous_lyapunov(loop.T, -np.eye(loop.shape[0]))
    return float(1.0 / (2.0 * np.linalg.eigvalsh(P)[-1]))


def quadratic_storage(
    system: System, gain: Any, transform: Transform = None, form: Literal["multiplier", "unit"] = "multiplier"
) -> np.ndarray | None:
    """Return a P in z = T e that shows stability for the Lipschitz constant of the plant, or None.

    The two forms are equivalent: a P of one is a multiple of a P of the other.

    Args:
        system: continuous plant with constant matrices.
        gain: L, shape (nx, ny).
        transform: T or its diagonal.
        form: "multiplier" is eq. (6) with a free multiplier, "unit" is eq. (8) with multiplier one.

    Reference: B. Song, J. K. Hedrick, ACC 2011, Theorems 1 and 2; in (6) the multiplier must be > 0.
    """
    plant = LumpedPlant.of(system, transform)
    loop, eye = plant.loop(gain), np.eye(plant.nx)
    P, s, t = cp.Variable((plant.nx, plant.nx), symmetric=True), cp.Variable(nonneg=True), cp.Variable()
    scale = s if form == "multiplier" else 1.0
    corner = P @ loop + loop.T @ P + scale * plant.lipschitz**2 * eye
    # Without a cap on P the slack of the homogeneous form would grow for ever.
    extra = [cp.trace(P) + s <= plant.nx] if form == "multiplier" else [s == 0, t >= -1]
    found = solve(Problem({"P": P, "s": s, "t": t}, _blocks(P, corner, -scale * eye), t), slack=t, extra=extra)
    return rounded_storage(found.values["P"]) if found is not None and found.margin > 1e-9 else None


def _blocks(P: Any, corner: Any, last: Any) -> list[Block]:
    constant = Polynomial.constant
    return [
        Block("storage", constant(-P)),
        Block("stability", symmetric([[constant(corner), constant(P)], [constant(last)]])),
    ]


def _solved(problem: Problem) -> float:
    found = solve(problem)
    if found is None:
        raise Infeasible(
            "No solver gave an answer that satisfies its own inequalities; scale the states with `transform`."
        )
    return float(found.values["level"])
