"""Lipschitz observer from a Riccati equation: the storage matrix of largest smallest eigenvalue at a given epsilon."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import cvxpy as cp
import numpy as np

from luenberger.algebra import Polynomial, symmetric
from luenberger.certify import Claim
from luenberger.core import BadInput, NotCertified
from luenberger.lmi import Block, Problem, decay_storage, infeasible, solve
from luenberger.methods.hamiltonian import hinf_peak, riccati_residual
from luenberger.methods.lipschitz_bracket import epsilon_interval
from luenberger.methods.lipschitz_margin import storage_at
from luenberger.methods.lipschitz_plant import LumpedPlant, Transform, as_tuples, require_epsilon, require_lipschitz
from luenberger.methods.method import Candidate
from luenberger.systems import System
from luenberger.systems.observability import require_detectable

SOURCE = "B. Song, J. K. Hedrick, Nonlinear Observer Design for Lipschitz Nonlinear Systems, American Control Conference 2011"


@dataclass(frozen=True)
class LipschitzRiccati:
    """Lipschitz observer with the gain L = T^-1 P^-1 C' T^-T / (2 epsilon) of the Riccati equation.

    Choose it to reproduce published designs or where a gain without any solver is wanted; for a small gain choose
    `StructuredLipschitz`, which needs no coordinates and is far less conservative. `lipschitz_algorithm` finds the range
    of epsilon.

    Assumes: e' = (A - L C) e + phi, |T phi| <= g |T e| for all states, g from the Lipschitz bound of the plant.
    Certifies: e' P e falls at least like exp(-2 rate t), rate the largest that could be proved; |L| <= the reported bound.

    Args:
        epsilon: inverse weight of the outputs, > 0; small values give fast observers with large gains.
        transform: coordinates T, shape (nx, nx), or their diagonal, shape (nx,); None leaves the states as they are.
        route: "riccati" takes the largest solution of the equation, "sdp" maximises lmin(P) with a solver, as a check.

    Reference: S. Raghavan, J. K. Hedrick, Int. J. Control 59 (1994) 515-528; B. Song, J. K. Hedrick, ACC 2011, (19), (26),
    (33). (33) prints C' where the transformed C belongs. Maximising lmin(P), as (26) does, does not minimise the gain.

    Example:
        >>> import jax.numpy as jnp
        >>> import luenberger as lb
        >>> from luenberger.methods.lipschitz_riccati import LipschitzRiccati
        >>> from luenberger.synthesize import synthesize
        >>> sine = lb.Nonlinearity.bounded(lambda z, u: -jnp.sin(z), [[1, 0]], lipschitz=1.0)
        >>> pendulum = lb.System.nonlinear([[0, 1], [0, -0.1]], C=[[1, 0]], F=[[0], [1]], nonlinearity=sine)
        >>> synthesize(pendulum, LipschitzRiccati(epsilon=0.05, transform=(1.0, 0.3))).certificate.outcome.value
        'proved'
    """

    epsilon: float
    transform: Transform = None
    route: Literal["riccati", "sdp"] = "riccati"

    references: ClassVar[tuple[str, ...]] = (
        SOURCE,
        "S. Raghavan, J. K. Hedrick, Observer design for a class of nonlinear systems, Int. J. Control 59 (1994) 515-528",
    )

    def __post_init__(self) -> None:
        object.__setattr__(self, "transform", as_tuples(self.transform))

    def accept(self, system: System) -> None:
        """Refuse linear, discrete, scheduled and undetectable plants, and epsilon <= 0; see `Method`."""
        require_epsilon(self.epsilon)
        require_lumped(system, self.transform, self.route)

    def design(self, system: System) -> Candidate:
        """Solve the Riccati equation; see `Method`."""
        start = time.perf_counter()
        plant = LumpedPlant.of(system, self.transform)
        P = storage_at(plant, self.epsilon) if self.route == "riccati" else _storage_by_sdp(plant, self.epsilon)
        if P is None:
            raise infeasible(
                storage_problem(plant, self.epsilon)[0], "epsilon", self.epsilon, "", feasible_epsilon(plant)
            )
        Q = plant.lipschitz**2 * np.eye(plant.nx) - plant.C.T @ plant.C / self.epsilon
        residual = float(np.abs(riccati_residual(P, plant.A, np.eye(plant.nx), Q)).max())
        return lumped_candidate(system, plant, P, self.epsilon, self.route, start, residual=residual)


def require_lumped(system: System, transform: Transform, route: str) -> None:
    """Refuse what no Riccati-form Lipschitz design covers.

    Args:
        system: plant.

    Raises:
        NotAccepted: linear, discrete, scheduled or undetectable plant.
        BadInput: bad transform, or a route that is not known.
    """
    if route not in ("riccati", "sdp"):
        raise BadInput(f"`route` is {route!r}; `riccati` or `sdp` is needed.")
    require_lipschitz(system)
    LumpedPlant.of(system, transform)
    require_detectable(system)


def lumped_candidate(
    system: System,
    plant: LumpedPlant,
    P: np.ndarray,
    epsilon: float,
    route: str,
    start: float,
    more: Callable[[np.ndarray], Sequence[Claim]] | None = None,
    **statistics: Any,
) -> Candidate:
    """Return the candidate that a storage matrix in z = T e gives.

    Args:
        system: the plant.
        plant: the same in its coordinates.
        P: storage matrix in z.
        epsilon: weight of the outputs.
        route: how P was found.
        start: when the search began [s].
        more: claims beyond decay and gain bound, from the rounded gain.
        statistics: further entries for the record.
    """
    facts = {
        "solver": "Riccati equation" if route == "riccati" else "semidefinite programme",
        "solver_seconds": time.perf_counter() - start,
        "smallest_eigenvalue": float(np.linalg.eigvalsh(P)[0]),
        "lipschitz": plant.lipschitz,
        "epsilon": epsilon,
    }

    def claims(rounded: Polynomial) -> list[Claim]:
        L = np.asarray(rounded({}))
        return [decay_claim(system, rounded), gain_claim(L), *(more(L) if more else ())]

    return Candidate(Polynomial.constant(plant.gain(P, epsilon)), claims, facts | statistics)


def decay_claim(system: System, gain: Polynomial) -> Claim:
    """Return a decay claim with its witness, at the largest rate that could be shown, backed off by a twentieth.

    Args:
        system: continuous Lipschitz plant with constant matrices.
        gain: L, fixed.

    Raises:
        NotCertified: not even rate zero has a witness.
    """
    best = decay_rate(system, np.asarray(gain({})))
    for part in (0.95, 0.8, 0.5, 0.1, 0.0):
        if (found := decay_storage(system, gain, part * best)) is not None:
            return Claim("decay", part * best, *found)
    raise NotCertified(
        f"A gain for `{system.name}` was found, but no storage matrix shows its stability; ask for more margin (a smaller epsilon)."
    )


def gain_claim(gain: np.ndarray) -> Claim:
    """Return the bound on the norm of a constant gain, wide enough to be proved.

    Args:
        gain: L, shape (nx, ny).
    """
    return Claim("gain_bound", float(np.linalg.norm(gain, 2)) * (1 + 1e-6))


def decay_rate(system: System, gain: np.ndarray) -> float:
    """Return the largest decay rate [1/s] that a quadratic storage shows through the channel F, H; 0 where none.

    A rate a is shown exactly where A - L C + a I is stable and g |H (s I - A + L C - a I)^-1 F|_inf < 1.

    Args:
        system: continuous Lipschitz plant with constant matrices.
        gain: L, shape (nx, ny).
    """
    A, C, F = (np.asarray(system.at(letter)) for letter in "ACF")
    f = system.nonlinearity
    assert f is not None
    loop, eye = A - gain @ C, np.eye(system.nx)

    def shown(rate: float) -> bool:
        shifted = loop + rate * eye
        stable = np.linalg.eigvals(shifted).real.max() < 0
        return bool(stable and f.lipschitz_bound * hinf_peak(shifted, F, f.H, 1e-6).level < 1)

    good, bad = 0.0, max(-float(np.linalg.eigvals(loop).real.max()), 0.0)
    for _ in range(30 if shown(0.0) else 0):
        middle = 0.5 * (good + bad)
        good, bad = (middle, bad) if shown(middle) else (good, middle)
    return good


def storage_problem(plant: LumpedPlant, epsilon: float) -> tuple[Problem, cp.Variable]:
    """Return the problem (26), maximise lmin(P) subject to (19), and its P.

    Args:
        plant: plant in its coordinates, with the Lipschitz constant.
        epsilon: weight of the outputs.
    """
    n, constant = plant.nx, Polynomial.constant
    P, low = cp.Variable((n, n), symmetric=True), cp.Variable(name="smallest")
    corner = P @ plant.A + plant.A.T @ P + plant.lipschitz**2 * np.eye(n) - plant.C.T @ plant.C / epsilon
    blocks = [
        Block("storage", constant(low * np.eye(n) - P)),
        Block("stability", symmetric([[constant(corner), constant(P)], [constant(-np.eye(n))]])),
    ]
    return Problem({"P": P, "low": low}, blocks, -low), P


def feasible_epsilon(plant: LumpedPlant) -> float:
    """Return an epsilon within 1e-4 of the largest feasible one; floating point.

    Args:
        plant: plant with the Lipschitz constant.

    Raises:
        Infeasible: no epsilon is feasible.
    """
    good, bad = epsilon_interval(plant)
    while bad is not None and bad - good > 1e-4 * bad:
        middle = (good * bad) ** 0.5
        good, bad = (middle, bad) if storage_at(plant, middle) is not None else (good, middle)
    return good


def _storage_by_sdp(plant: LumpedPlant, epsilon: float) -> np.ndarray | None:
    found = solve(storage_problem(plant, epsilon)[0])
    return found.values["P"] if found is not None and found.values["low"] > 0 else None
