"""L2 gain from a disturbance to the estimation error: of a given gain, the least at an epsilon, and its Riccati equation."""

from collections.abc import Callable
from fractions import Fraction
from typing import Any, Literal

import cvxpy as cp
import numpy as np

from luenberger.algebra import Polynomial, symmetric
from luenberger.algebra.definiteness import exact, positive_definite
from luenberger.algebra.polynomial import fraction
from luenberger.core import BadInput, Infeasible, NotAccepted, NotCertified, Outcome
from luenberger.lmi import Block, Problem, centre, rounded_storage, solve
from luenberger.methods.hamiltonian import positive_solution
from luenberger.methods.lipschitz_inequality import LumpedInequality, exact_inverse
from luenberger.methods.lipschitz_plant import LumpedPlant, Transform, require_epsilon
from luenberger.systems import System

Norm = Literal["transformed", "original"]


def disturbance_gain(system: System, gain: Any, transform: Transform = None, norm: Norm = "transformed") -> float:
    """Return the smallest kappa that one storage matrix shows for a given gain: |W e|_2 <= kappa |d|_2.

    Use it to compare gains, whoever designed them; the multiplier of the nonlinearity is free, so the value is smaller
    than the kappa a design reports.

    Assumes: e' = (A - L C) e + phi + E d, |T phi| <= g |T e| for all states.

    Args:
        system: continuous plant with constant matrices and an unknown input.
        gain: L, shape (nx, ny).
        transform: T or its diagonal.
        norm: "transformed" for |T e|, "original" for |e|.

    Raises:
        NotAccepted: no unknown input.
        Infeasible: the gain does not stabilise the error for the Lipschitz constant of the plant.

    Reference: B. Song, J. K. Hedrick, ACC 2011, Theorem 5, with a free multiplier as in (6).

    Example:
        >>> import luenberger as lb
        >>> from luenberger.methods.lipschitz_gain import disturbance_gain
        >>> plant = lb.System.linear([[0.0]], C=[[1.0]], E=[[1.0]])
        >>> round(disturbance_gain(plant, [[4.0]]), 6)
        0.25
    """
    plant = LumpedPlant.of(system, transform)
    found = solve(_gain_problem(system, plant, gain, norm))
    if found is None:
        raise Infeasible(
            f"No L2 gain exists for this gain: its margin lies below the Lipschitz constant {plant.lipschitz:.6g}.",
            "l2_gain",
        )
    return float(np.sqrt(max(found.values["squared"], 0.0)))


def disturbance_bound(system: System, gain: Any, transform: Transform = None, norm: Norm = "transformed") -> Fraction:
    """Prove an upper bound on kappa^2 of a given gain, about a relative 1e-3 above the square of `disturbance_gain`.

    Certifies: |W e|_2^2 <= bound |d|_2^2, in rational arithmetic, for the plant whose matrices, transform, gain and
    Lipschitz constant in z are exactly the given doubles.

    Args:
        system: continuous plant with constant matrices and an unknown input.
        gain: L, shape (nx, ny).
        transform: T or its diagonal.
        norm: "transformed" for |T e|, "original" for |e|.

    Raises:
        NotAccepted: no unknown input.
        NotCertified: no strictly feasible point was found, or rounding spoiled it.
    """
    plant = LumpedPlant.of(system, transform)
    found = centre(_gain_problem(system, plant, gain, norm), back_off=1e-3)
    if found is not None:
        T, E = exact(plant.T), exact(np.asarray(system.at("E")))
        P, eye = exact(rounded_storage(found.values["P"], bits=50)), exact(np.eye(plant.nx))
        s, squared, g = (
            exact(np.array([[x]]))[0, 0]
            for x in (float(found.values["s"]), float(found.values["squared"]), plant.lipschitz)
        )
        inverse = exact_inverse(T)
        W = eye if norm == "transformed" else inverse.T @ inverse
        PA, PE = P @ LumpedInequality.of(system, transform, gain).exact_A, P @ T @ E
        zero = exact(np.zeros(E.shape))
        whole = np.block(
            [
                [PA + PA.T + eye * (s * g * g) + W, P, PE],
                [P, eye * -s, zero],
                [PE.T, zero.T, exact(np.eye(E.shape[1])) * -squared],
            ]
        )
        if all(positive_definite(M) is Outcome.PROVED for M in (P, -whole)):
            return fraction(squared)
    raise NotCertified(
        "No L2 gain of this gain could be proved; scale the states with `transform`, or choose a gain with more margin."
    )


def least_disturbance_gain(
    system: System, epsilon: float, transform: Transform = None, norm: Norm = "transformed"
) -> float:
    """Return the infimum of kappa over all storage matrices at an epsilon; no gain attains it.

    Args:
        system: continuous plant with constant matrices and an unknown input.
        epsilon: weight of the outputs.
        transform: T or its diagonal.
        norm: "transformed" for |T e|, "original" for |e|.

    Raises:
        Infeasible: no kappa at all at this epsilon.
    """
    require_epsilon(epsilon)
    require_norm(norm)
    require_disturbance(system)
    plant = LumpedPlant.of(system, transform)
    low = least_squared(disturbance_solution(plant, epsilon, norm))
    if low is None:
        raise Infeasible(no_storage(epsilon), "l2_gain")
    return float(np.sqrt(low * weight_size(plant, norm)))


def _gain_problem(system: System, plant: LumpedPlant, gain: Any, norm: Norm) -> Problem:
    require_norm(norm)
    require_disturbance(system)
    loop, n = plant.loop(gain), plant.nx
    P, s, squared = cp.Variable((n, n), symmetric=True), cp.Variable(nonneg=True), cp.Variable(nonneg=True)
    corner = P @ loop + loop.T @ P + s * plant.lipschitz**2 * np.eye(n) + plant.weight(norm)
    matrix = disturbed(P, corner, -s * np.eye(n), plant.E, squared)
    blocks = [Block("storage", Polynomial.constant(-P)), Block("l2_gain", matrix)]
    return Problem({"P": P, "s": s, "squared": squared}, blocks, squared)


def disturbance_solution(plant: LumpedPlant, epsilon: float, norm: Norm) -> Callable[[float], np.ndarray | None]:
    """Return the function kappa^2 -> largest P > 0 of He(P A) + P (I + E E' / kappa^2) P + g^2 I + W - C' C / epsilon = 0, |W| = 1.

    Args:
        plant: plant in its coordinates.
        epsilon: weight of the outputs.
        norm: which error norm W stands for.
    """
    eye = np.eye(plant.nx)
    Q = plant.lipschitz**2 * eye + plant.weight(norm) / weight_size(plant, norm) - plant.C.T @ plant.C / epsilon
    return lambda squared: positive_solution(plant.A, eye + plant.E @ plant.E.T / squared, Q)


def require_norm(norm: str) -> None:
    """Refuse an unknown error norm.

    Raises:
        BadInput: see above.
    """
    if norm not in ("transformed", "original"):
        raise BadInput(f"`norm` is {norm!r}; `transformed` (|T e|) or `original` (|e|) is needed.")


def require_disturbance(system: System) -> None:
    """Refuse plants without an unknown input.

    Args:
        system: plant.

    Raises:
        NotAccepted: see above.
    """
    if not system.nd or not np.any(np.asarray(system.at("E"))):
        raise NotAccepted(f"`{system.name}` has no unknown input; give its direction `E`, or use `LipschitzRiccati`.")


def weight_size(plant: LumpedPlant, norm: Norm) -> float:
    """Return |W|, by which weight and kappa^2 are divided so that the unit multiplier of (30) suits both terms.

    Args:
        plant: plant in its coordinates.
        norm: which error norm W stands for.
    """
    return float(np.linalg.norm(plant.weight(norm), 2))


def disturbed(P: Any, corner: Any, middle: Any, E: np.ndarray, squared: Any) -> Polynomial:
    """Return [[corner, P, P E], [P, middle, 0], [E' P, 0, -squared I]], the matrix of (30).

    Args:
        P: storage variable, (n, n).
        corner: first block, (n, n).
        middle: block of the nonlinearity, (n, n).
        E: direction of the disturbance, (n, nd).
        squared: kappa^2.
    """
    constant = Polynomial.constant
    last = constant(-squared * np.eye(E.shape[1]))
    return symmetric([[constant(corner), constant(P), constant(P @ E)], [constant(middle), 0], [last]])


def least_squared(solution: Callable[[float], np.ndarray | None]) -> float | None:
    """Return the smallest kappa^2 with a P > 0 to a relative 1e-10, from the feasible side; None where none up to 1e12.

    Args:
        solution: see `disturbance_solution`.
    """
    good = next((k for k in 10.0 ** np.arange(-14.0, 13.0) if solution(float(k)) is not None), None)
    if good is None:
        return None
    good, bad = float(good), float(good) / 10 if good > 1e-14 else 0.0
    while good - bad > 1e-10 * good and good > 1e-14:
        middle = 0.5 * (good + bad)
        good, bad = (middle, bad) if solution(middle) is not None else (good, middle)
    return good


def no_storage(epsilon: float) -> str:
    """Return the sentence for an epsilon at which no kappa exists."""
    return f"No storage matrix bounds the L2 gain at epsilon = {epsilon:.6g}; lower `epsilon` or choose other coordinates `transform`."
