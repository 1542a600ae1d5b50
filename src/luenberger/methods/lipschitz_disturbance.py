"""Lipschitz observer that trades the L2 gain from a disturbance to the error against the size of the gain matrix."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, Literal

import cvxpy as cp
import numpy as np
from scipy.linalg import solve_continuous_lyapunov

from luenberger.algebra import Polynomial
from luenberger.certify import Claim
from luenberger.core import Infeasible
from luenberger.lmi import Block, Problem, l2_storage, solve
from luenberger.methods.lipschitz_gain import (
    Norm,
    disturbance_solution,
    disturbed,
    least_squared,
    no_storage,
    require_disturbance,
    require_norm,
    weight_size,
)
from luenberger.methods.lipschitz_plant import LumpedPlant, Transform, as_tuples, require_epsilon, require_weight
from luenberger.methods.lipschitz_riccati import SOURCE, lumped_candidate, require_lumped
from luenberger.methods.method import Candidate
from luenberger.systems import System


@dataclass(frozen=True)
class LipschitzDisturbance:
    """Lipschitz observer with a small L2 gain kappa from the disturbance, at a moderate gain matrix.

    Choose it where an unknown input enters and L2 gain matters more than noise. With the disturbance on measured states
    kappa has infimum zero and the gain grows without bound as `delta` nears 1.

    Assumes: e' = (A - L C) e + phi + E d, |T phi| <= g |T e| for all states.
    Certifies: decay and gain bound as `LipschitzRiccati`; |W e|_2 <= kappa |d|_2 from zero error, W = T for
    norm = "transformed", W = I for "original".

    Args:
        epsilon: inverse weight of the outputs, > 0.
        delta: weight of kappa^2 against lmin(P), strictly between 0 and 1.
        transform: coordinates T, shape (nx, nx), or their diagonal, shape (nx,).
        norm: "transformed" bounds |T e| as the theorem does, "original" bounds |e|; there kappa in the objective counts in
            units of |T^-1|, which keeps the weight beside the Lipschitz term at norm one.
        route: "riccati" finds the stationary point on the largest solution, "sdp" solves eq. (34), as a check.

    Reference: B. Song, J. K. Hedrick, ACC 2011, Theorem 5, (30), (34), with kappa^2 as the variable. E must be
    transformed; the printed bound is one on |T e|, which is not said; delta = 1 (printed as 0 for its third gain) is
    refused since its infimum is not attained.

    Example:
        >>> import jax.numpy as jnp
        >>> import luenberger as lb
        >>> from luenberger.methods.lipschitz_disturbance import LipschitzDisturbance
        >>> from luenberger.synthesize import synthesize
        >>> sine = lb.Nonlinearity.bounded(lambda z, u: -jnp.sin(z), [[1, 0]], lipschitz=1.0)
        >>> arm = lb.System.nonlinear([[0, 1], [0, -0.1]], C=[[1, 0]], F=[[0], [1]], nonlinearity=sine, E=[[0], [1]])
        >>> synthesize(arm, LipschitzDisturbance(epsilon=0.02, delta=0.5, transform=(1.0, 0.2))).certificate.outcome.value
        'proved'
    """

    epsilon: float
    delta: float
    transform: Transform = None
    norm: Norm = "transformed"
    route: Literal["riccati", "sdp"] = "riccati"

    references: ClassVar[tuple[str, ...]] = (SOURCE,)

    def __post_init__(self) -> None:
        object.__setattr__(self, "transform", as_tuples(self.transform))

    def accept(self, system: System) -> None:
        """Refuse plants without disturbance or nonlinearity, and options without an optimum; see `Method`."""
        require_epsilon(self.epsilon)
        require_weight("delta", self.delta)
        require_norm(self.norm)
        require_lumped(system, self.transform, self.route)
        require_disturbance(system)

    def design(self, system: System) -> Candidate:
        """Find kappa^2 of the weight and the storage matrix there; see `Method`."""
        start = time.perf_counter()
        plant = LumpedPlant.of(system, self.transform)
        squared, P = self._by_stationarity(plant) if self.route == "riccati" else self._by_sdp(plant)
        W = plant.T if self.norm == "transformed" else np.eye(plant.nx)

        def more(rounded: np.ndarray) -> list[Claim]:
            found = l2_storage(system, Polynomial.constant(rounded), W, "disturbance")
            return [] if found is None else [Claim("l2_gain", found[0], found[1], found[2], W, "disturbance")]

        kappa = float(np.sqrt(squared * weight_size(plant, self.norm)))
        return lumped_candidate(system, plant, P, self.epsilon, self.route, start, more, disturbance_gain=kappa)

    def _by_stationarity(self, plant: LumpedPlant) -> tuple[float, np.ndarray]:
        """lmin(P+(kappa^2)) is concave, so its slope falls through delta / (1 - delta) once."""
        solution = disturbance_solution(plant, self.epsilon, self.norm)
        wanted = self.delta / (1 - self.delta)
        low = least_squared(solution)
        if low is None:
            raise Infeasible(no_storage(self.epsilon), "l2_gain")
        P = _at(solution, low)
        if _slope(plant, P, low) <= wanted:
            raise Infeasible(
                f"At delta = {self.delta:.6g} the objective is least where P is singular and the gain infinite; lower `delta`.",
                "storage",
            )
        high = low
        while _slope(plant, P, high) > wanted:
            low, high = high, 2 * high
            P = _at(solution, high)
        while high - low > 1e-12 * high:
            middle = 0.5 * (low + high)
            P = _at(solution, middle)
            low, high = (middle, high) if _slope(plant, P, middle) > wanted else (low, middle)
        return high, _at(solution, high)

    def _by_sdp(self, plant: LumpedPlant) -> tuple[float, np.ndarray]:
        n, constant = plant.nx, Polynomial.constant
        P, low, squared = cp.Variable((n, n), symmetric=True), cp.Variable(), cp.Variable()
        corner = P @ plant.A + plant.A.T @ P - plant.C.T @ plant.C / self.epsilon
        corner = corner + plant.lipschitz**2 * np.eye(n) + plant.weight(self.norm) / weight_size(plant, self.norm)
        matrix = disturbed(P, corner, -np.eye(n), plant.E, squared)
        blocks = [Block("storage", constant(low * np.eye(n) - P)), Block("l2_gain", matrix)]
        found = solve(
            Problem({"P": P, "low": low, "squared": squared}, blocks, self.delta * squared - (1 - self.delta) * low)
        )
        if found is None or not found.values["low"] > 0:
            raise Infeasible(no_storage(self.epsilon), "l2_gain")
        return float(found.values["squared"]), found.values["P"]


def _at(solution: Callable[[float], np.ndarray | None], squared: float) -> np.ndarray:
    P = solution(squared)
    if P is None:
        raise Infeasible(
            f"The Riccati equation broke down at kappa^2 = {squared:.6g}; scale the states with `transform`.", "l2_gain"
        )
    return P


def _slope(plant: LumpedPlant, P: np.ndarray, squared: float) -> float:
    """d lmin(P) / d kappa^2 along the largest solutions."""
    spread = plant.E @ plant.E.T / squared
    loop = plant.A + P + spread @ P
    change = solve_continuous_lyapunov(loop.T, P @ spread @ P / squared)
    v = np.linalg.eigh(P)[1][:, 0]
    return float(v @ change @ v)
