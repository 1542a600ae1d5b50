"""Design with a storage matrix that moves with the scheduling: a slack matrix keeps gain and storage apart.

With P(r) in the place of P the product P(r) L(r) no longer determines a polynomial gain. Finsler's lemma brings in a constant
square matrix V instead:  e' Pdot e + 2 e' P e' < 0  along  de/dt = Ae e + Be w  holds if, for some epsilon > 0,

    [ Pdot + 2 rate P + V Ae + Ae' V' + W'W    P - V + epsilon Ae' V'    V Be         ]
    [ *                                        -epsilon (V + V')         epsilon V Be ]  < 0,
    [ *                                        *                         -level^2 I   ]

which is linear in P(r), V and Y = V L for a fixed epsilon.

Reference: M. C. de Oliveira, R. E. Skelton, Stability tests for constrained linear systems, 2001, for the slack matrix; the
derivative of P along the scheduling is bounded by its rates.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import cvxpy as cp
import numpy as np

from luenberger.algebra import Polynomial, symmetric
from luenberger.core import NotAccepted
from luenberger.lmi import Block, Problem, Relaxation, Solution, centre
from luenberger.lmi.storage import affine_monomials, storage_variable
from luenberger.methods.method import NEGLIGIBLE, scheduled_variable
from luenberger.systems import System
from luenberger.systems.error_system import ErrorSystem
from luenberger.systems.jacobian_box import as_floats

# Sizes of epsilon that are tried [s]; the best objective wins. The inequality is not convex in epsilon.
EPSILONS = (0.003, 0.01, 0.03, 0.1, 0.3, 1.0)


def require_rates(system: System) -> None:
    """Refuse plants without a bounded rate: a storage that moves arbitrarily fast proves nothing beyond a constant one.

    Args:
        system: plant.

    Raises:
        NotAccepted: no scheduling parameter of A has a rate.
    """
    if len(affine_monomials(system)) == 1:
        raise NotAccepted(
            f"No scheduling parameter in A of `{system.name}` has a bounded rate; give `Parameter` a `rate` or `rate_law`, or "
            'use storage="constant".'
        )


def dilated(
    error: ErrorSystem,
    P: Polynomial,
    V: cp.Variable,
    drift: Polynomial,
    epsilon: float,
    *,
    rate: float = 0.0,
    weight: np.ndarray | None = None,
    entering: Polynomial | None = None,
    gain_squared: Any = None,
) -> Polynomial:
    """Return the symmetric matrix above.

    Args:
        error: gives the derivative of P along the scheduling.
        P: storage with variable coefficients over the scheduling parameters.
        V: slack matrix, shape (nx, nx).
        drift: V Ae = V A - Y C over the free parameters.
        epsilon: positive number [s].
        rate: decay rate [1/s].
        weight: W, shape (nz, nx), or None.
        entering: V Be, shape (nx, nw), or None.
        gain_squared: level^2, with `entering`.
    """
    here, motion = error.storage(P)
    corner = drift + drift.T + here * (2 * rate)
    if motion is not None:
        corner = corner + motion
    if weight is not None:
        corner = corner + Polynomial.constant(weight.T @ weight)
    coupling = here - Polynomial.constant(V) + drift.T * epsilon
    rows: list[list[Any]] = [[corner, coupling], [Polynomial.constant(-epsilon * (V + V.T))]]
    if entering is not None:
        rows[0].append(entering)
        rows[1].append(entering * epsilon)
        rows.append([Polynomial.constant(-gain_squared * np.eye(entering.shape[1]))])
    return symmetric(rows)


@dataclass(frozen=True)
class Posed:
    """The smallest gain for a decay rate with a storage that moves, at one epsilon.

    Args:
        problem: blocks, variables and the bound of the gain.
        storage: P(r).
        scaled_gain: Y(r) = V L(r).
        slack: V.
        epsilon: as above.
    """

    problem: Problem
    storage: Polynomial
    scaled_gain: Polynomial
    slack: cp.Variable
    epsilon: float

    def gain(self) -> Polynomial:
        """Return L(r) = V^-1 Y(r) once solved."""
        return self.scaled_gain.map(lambda y: np.linalg.solve(np.asarray(self.slack.value), np.asarray(y.value)))


def posed(system: System, rate: float, like: Sequence[Polynomial], relaxation: Relaxation, epsilon: float) -> Posed:
    """Pose the smallest gain for a decay rate.

    V + V' >= 2 I makes every singular value of V at least one, so that |L| <= |Y| <= the objective.

    Args:
        system: plant without uncertainty.
        rate: decay rate [1/s].
        like: polynomials whose monomials the gain takes.
        relaxation: how the box is replaced by finitely many inequalities.
        epsilon: as above.
    """
    nx, ny = system.nx, system.ny
    error = ErrorSystem.of(system, Polynomial.constant(np.zeros((nx, ny))))
    P, storages = storage_variable(nx, affine_monomials(system))
    V, bound = cp.Variable((nx, nx), name="V"), cp.Variable(name="bound")
    Y, variables = scheduled_variable(nx, ny, like, system.scheduling_names, "Y")
    drift = Polynomial.constant(V) @ error.A - Y @ as_floats(system.C)
    wide = symmetric([[Polynomial.constant(bound * np.eye(nx)), Y], [Polynomial.constant(bound * np.eye(ny))]])
    blocks = [
        Block("storage", -error.storage(P)[0], error.box, relaxation=relaxation),
        Block("slack", Polynomial.constant(2 * np.eye(nx) - V - V.T)),
        Block("gain", -wide, system.scheduling_box),
        Block("decay", dilated(error, P, V, drift, epsilon, rate=rate), error.box, relaxation=relaxation),
    ]
    problem = Problem({**storages, **variables, "V": V, "bound": bound}, blocks, bound)
    return Posed(problem, P, Y, V, epsilon)


def smallest_moving(pose: Callable[[float], Posed]) -> tuple[Posed, Solution] | None:
    """Return the posed problem with the smallest gain over `EPSILONS` and its centred solution, or None.

    Args:
        pose: epsilon -> posed problem with variables of its own.
    """
    best: tuple[Posed, Solution] | None = None
    for epsilon in EPSILONS:
        candidate = pose(epsilon)
        found = centre(candidate.problem, floor=NEGLIGIBLE)
        if found is not None and (best is None or found.objective < best[1].objective):
            best = (candidate, found)
    return best
