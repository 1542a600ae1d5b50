"""The largest ellipsoid of errors that keeps the argument of f inside the domain of f, for gains already fixed."""

from typing import Any, Literal

import cvxpy as cp
import numpy as np

from luenberger.algebra import Polynomial, symmetric
from luenberger.core import BadInput
from luenberger.core.checks import known_keys
from luenberger.lmi.problem import Block, Problem, solve
from luenberger.lmi.relaxation import Bernstein
from luenberger.lmi.storage import rounded_storage
from luenberger.systems import System
from luenberger.systems.error_system import ErrorSystem
from luenberger.systems.jacobian_box import as_floats, jacobian_corners

Objective = Literal["volume", "ball"]
OBJECTIVES = ("volume", "ball")


def validity_storage(
    system: System,
    gain: Polynomial,
    state_bound: np.ndarray,
    *,
    argument_gain: Polynomial | None = None,
    objective: Objective = "volume",
    back_off: float = 0.01,
) -> tuple[np.ndarray, float, float] | None:
    """Return (P, level, multiplier) of a large invariant set e' P e <= level inside the bounds, or None.

    With Q = P^-1 everything is affine: V = e' P e falls where he(A_e Q) < 0 on scheduling box and Jacobian set, and the set
    keeps |h e| <= m where h Q h' <= m^2. First the size is maximised; then, the semi-axes giving away a share `back_off`,
    the margin of the decay, which a proof with rounded numbers needs.

    Assumes: a Jacobian set, or a Lipschitz bound g with the condition [[he(A_e Q) + t F F', g Q H'], [g H Q, -t I]] < 0,
        t = 1 / multiplier.

    Args:
        system: plant whose nonlinearity has a domain.
        gain: L(r), fixed.
        state_bound: bound m of |((I - L2 C) e)_k|, shape (nx,), in the units of the states; zero where f does not read
            state k. The search, not the claim, also keeps every |e_k| within the width of the domain.
        argument_gain: L2(r) of an observer with two degrees of freedom; None for zero.
        objective: "volume" maximises det Q, "ball" the largest ball inside, in units of `state_bound`.
        back_off: share of the semi-axes given away (of their geometric mean for "volume"), below one.

    Raises:
        BadInput: unknown objective, or a plant whose nonlinearity has no domain.

    Reference: S. Boyd, L. El Ghaoui, E. Feron, V. Balakrishnan, Linear Matrix Inequalities in System and Control Theory
        (SIAM 1994), section 5.2: invariant ellipsoids of largest volume inside symmetric strips.
    """
    known_keys("`objective`", [objective], OBJECTIVES)
    f = system.nonlinearity
    if f is None or f.domain is None:
        raise BadInput(f"`{system.name}` has no nonlinearity with a `domain`; there is nothing to stay inside of.")
    bound = np.asarray(state_bound, dtype=float)
    # In these units every strip is |h e| <= 1, so the entries of Q compare.
    width = f.domain[1] - f.domain[0]
    scale = np.where(bound > 0, bound, np.where(width > 0, width, 1.0))
    Q, t, slack = cp.Variable((system.nx, system.nx), symmetric=True), cp.Variable(nonneg=True), cp.Variable()
    size, shape = _volume(Q) if objective == "volume" and system.nx > 1 else (cp.lambda_min(Q), [])
    errors = [ErrorSystem.of(corner, gain, argument_gain=argument_gain) for corner in jacobian_corners(system)]
    rows = _rows(system, bound, argument_gain)
    # Directions that never reach f have no strip of their own; without the width of the domain the set could be endless.
    wide = [(row, w) for row, w in zip(np.eye(system.nx), np.maximum(scale, width), strict=True)]
    strips = [cp.quad_form(h * scale / m, Q) <= 1.0 for h, m in [*rows, *wide]]
    known = {"Q": Q, "t": t}
    best = solve(Problem(known, _falls(errors, Q, t, scale), -size), extra=[*strips, *shape])
    if best is None:
        return None
    least = -best.objective * (1.0 - back_off) ** 2
    loose = Problem({**known, "slack": slack}, _falls(errors, Q, t, scale, slack), slack)
    found = solve(loose, extra=[*strips, *shape, size >= least])
    if found is None or not found.values["slack"] < 0:
        return None
    P = rounded_storage(np.linalg.inv(found.values["Q"] * np.outer(scale, scale)))
    # A millionth below the touching level: the strips are open, and P was rounded.
    level = (1.0 - 1e-6) / max((float(h @ np.linalg.solve(P, h)) / m**2 for h, m in rows), default=1.0)
    multiplier = 0.0 if errors[0].F is None else 1.0 / float(found.values["t"])
    return P, level, multiplier


def _volume(Q: Any) -> tuple[Any, list[Any]]:
    """det(Q)^(1/n) as the geometric mean of the diagonal of a factor; no logarithm, which solvers take badly at zero."""
    Z = cp.Variable(Q.shape)
    return cp.geo_mean(cp.diag(Z)), [cp.bmat([[Q, Z], [Z.T, cp.diag(cp.diag(Z))]]) >> 0, cp.upper_tri(Z) == 0]


def _rows(system: System, bound: np.ndarray, argument_gain: Polynomial | None) -> list[tuple[np.ndarray, float]]:
    """(h, m) of all strips |h e| <= m; a strip of h(r) holds where it holds for the Bernstein coefficients of h."""
    seen = Polynomial.constant(np.eye(system.nx))
    if argument_gain is not None:
        seen = seen - argument_gain @ as_floats(system.C)
    matrices = [np.asarray(c) for c in Bernstein().matrices(seen, system.scheduling_box)]
    return [(M[k], float(bound[k])) for M in matrices for k in np.flatnonzero(bound > 0) if np.any(M[k])]


def _falls(errors: list[ErrorSystem], Q: Any, t: Any, scale: np.ndarray, slack: Any = None) -> list[Block]:
    """The dissipation inequality after the congruence with Q, in units of `scale`, for every Jacobian corner."""
    into, back = np.diag(1 / scale), np.diag(scale)
    blocks: list[Block] = []
    for error in errors:
        AQ = into @ error.A @ back @ Q
        matrix = (
            _continuous(error, AQ, Q, t, into, back) if error.dt is None else _discrete(error, AQ, Q, t, into, back)
        )
        if slack is not None:
            matrix = matrix - slack * np.eye(matrix.shape[0])
        blocks.append(Block("decay", matrix, error.box))
    return blocks


def _continuous(error: ErrorSystem, AQ: Polynomial, Q: Any, t: Any, into: np.ndarray, back: np.ndarray) -> Polynomial:
    if error.F is None or error.H is None:
        return AQ + AQ.T
    F, HQ = into @ error.F, (error.H @ back) @ Q * error.lipschitz
    return symmetric([[AQ + AQ.T + F @ F.T * t, HQ.T], [-error.eye(HQ.shape[0]) * t]])


def _discrete(error: ErrorSystem, AQ: Polynomial, Q: Any, t: Any, into: np.ndarray, back: np.ndarray) -> Polynomial:
    corner = -Polynomial.constant(Q)
    if error.F is None or error.H is None:
        return symmetric([[corner, AQ.T], [corner]])
    F, HQ = into @ error.F, (error.H @ back) @ Q * error.lipschitz
    return symmetric([[corner, AQ.T, HQ.T], [corner + F @ F.T * t, 0], [-error.eye(HQ.shape[0]) * t]])
