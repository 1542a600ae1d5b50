"""Lipschitz observer that trades the smallest eigenvalue of the storage matrix against the output weight."""

import time
from dataclasses import dataclass
from typing import ClassVar, Literal

import cvxpy as cp
import numpy as np
from scipy.linalg import solve_continuous_lyapunov

from luenberger.algebra import Polynomial, symmetric
from luenberger.core import BadInput, Infeasible
from luenberger.lmi import Block, Problem, solve
from luenberger.methods.lipschitz_margin import storage_at
from luenberger.methods.lipschitz_plant import LumpedPlant, Transform, as_tuples, require_weight
from luenberger.methods.lipschitz_riccati import SOURCE, feasible_epsilon, lumped_candidate, require_lumped
from luenberger.methods.method import Candidate
from luenberger.systems import System


@dataclass(frozen=True)
class LipschitzPareto:
    """Lipschitz observer on the Pareto front of lmin(P), to be large, and sigma = 1 / epsilon, to be small.

    Choose it to let one weight pick epsilon. The two goals only stand for a small gain; they do not give the smallest
    one, and a small `delta` moves to the edge of feasibility, where gains explode.

    Assumes: e' = (A - L C) e + phi, |T phi| <= g |T e| for all states.
    Certifies: e' P e falls at least like exp(-2 rate t), rate the largest that could be proved; |L| <= the reported bound.

    Args:
        delta: weight of lmin(P) against sigma, strictly between 0 and 1.
        sigma_min: smallest sigma allowed, >= 0; 0 leaves it to the inequality.
        transform: coordinates T, shape (nx, nx), or their diagonal, shape (nx,).
        route: "riccati" finds the stationary point on the largest solution, "sdp" solves eq. (27), as a check.

    Reference: B. Song, J. K. Hedrick, ACC 2011, (27). lmin(P) is concave in sigma, not proportional to it; at delta = 1 the
    problem is unbounded, at delta = 0 its optimum is not attained.

    Example:
        >>> import jax.numpy as jnp
        >>> import luenberger as lb
        >>> from luenberger.methods.lipschitz_pareto import LipschitzPareto
        >>> from luenberger.synthesize import synthesize
        >>> sine = lb.Nonlinearity.bounded(lambda z, u: -jnp.sin(z), [[1, 0]], lipschitz=1.0)
        >>> pendulum = lb.System.nonlinear([[0, 1], [0, -0.1]], C=[[1, 0]], F=[[0], [1]], nonlinearity=sine)
        >>> synthesize(pendulum, LipschitzPareto(delta=0.99, transform=(1.0, 0.3))).certificate.outcome.value
        'proved'
    """

    delta: float
    sigma_min: float = 0.0
    transform: Transform = None
    route: Literal["riccati", "sdp"] = "riccati"

    references: ClassVar[tuple[str, ...]] = (SOURCE,)

    def __post_init__(self) -> None:
        object.__setattr__(self, "transform", as_tuples(self.transform))

    def accept(self, system: System) -> None:
        """Refuse linear, discrete, scheduled and undetectable plants, and weights without an optimum; see `Method`."""
        require_weight("delta", self.delta)
        if not (np.isfinite(self.sigma_min) and self.sigma_min >= 0):
            raise BadInput(f"`sigma_min` is {self.sigma_min}; a finite number >= 0 is needed.")
        require_lumped(system, self.transform, self.route)

    def design(self, system: System) -> Candidate:
        """Find the sigma of the weight and the storage matrix there; see `Method`."""
        start = time.perf_counter()
        plant = LumpedPlant.of(system, self.transform)
        sigma, P = self._by_stationarity(plant) if self.route == "riccati" else self._by_sdp(plant)
        value = self.delta * float(np.linalg.eigvalsh(P)[0]) - (1 - self.delta) * sigma
        return lumped_candidate(system, plant, P, 1 / sigma, self.route, start, sigma=sigma, optimum=value)

    def _by_stationarity(self, plant: LumpedPlant) -> tuple[float, np.ndarray]:
        """lmin(P+(sigma)) is concave, so its slope falls through (1 - delta) / delta once."""
        wanted = (1 - self.delta) / self.delta
        edge = 1 / feasible_epsilon(plant)
        low = max(edge, self.sigma_min)
        P = _at(plant, low)
        if (slope := slope_of_smallest(plant, P)) <= wanted:
            if low == edge:
                raise Infeasible(
                    f"At delta = {self.delta:.6g} the objective is best at sigma = {edge:.6g}, the edge of feasibility, where P is singular and "
                    f"the gain infinite; give `sigma_min` above it, or `delta` above {1 / (1 + slope):.4g}.",
                    "storage",
                    1 / (1 + slope),
                )
            return low, P
        high = low
        while slope_of_smallest(plant, P) > wanted:
            low, high = high, 2 * high
            P = _at(plant, high)
        while high - low > 1e-11 * high:
            middle = 0.5 * (low + high)
            low, high = (middle, high) if slope_of_smallest(plant, _at(plant, middle)) > wanted else (low, middle)
        return high, _at(plant, high)

    def _by_sdp(self, plant: LumpedPlant) -> tuple[float, np.ndarray]:
        n, constant = plant.nx, Polynomial.constant
        P, low, sigma = cp.Variable((n, n), symmetric=True), cp.Variable(), cp.Variable()
        corner = P @ plant.A + plant.A.T @ P + plant.lipschitz**2 * np.eye(n) - sigma * (plant.C.T @ plant.C)
        blocks = [
            Block("storage", constant(low * np.eye(n) - P)),
            Block("stability", symmetric([[constant(corner), constant(P)], [constant(-np.eye(n))]])),
        ]
        problem = Problem({"P": P, "low": low, "sigma": sigma}, blocks, (1 - self.delta) * sigma - self.delta * low)
        found = solve(problem, extra=[sigma >= self.sigma_min])
        if found is None or not found.values["low"] > 0:
            raise Infeasible(
                "No solver found a positive storage matrix; choose other coordinates `transform` or a larger `delta`.",
                "storage",
            )
        return float(found.values["sigma"]), found.values["P"]


def slope_of_smallest(plant: LumpedPlant, P: np.ndarray) -> float:
    """Return d lmin(P) / d sigma along the largest solutions of the Riccati equation.

    Args:
        plant: plant with the Lipschitz constant.
        P: largest solution at a sigma.
    """
    # Differentiating the equation: He(dP (A + P)) = C' C.
    change = solve_continuous_lyapunov((plant.A + P).T, plant.C.T @ plant.C)
    v = np.linalg.eigh(P)[1][:, 0]
    return float(v @ change @ v)


def _at(plant: LumpedPlant, sigma: float) -> np.ndarray:
    P = storage_at(plant, 1 / sigma)
    if P is None:
        raise Infeasible(
            f"The Riccati equation broke down at sigma = {sigma:.3g}; scale the states with `transform`.", "stability"
        )
    return P
