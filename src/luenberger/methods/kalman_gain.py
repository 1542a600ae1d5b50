"""Stationary Kalman gain as a design like any other: the gain everyone knows, with its convergence proved."""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any, ClassVar

import numpy as np
from scipy.linalg import solve_continuous_are, solve_discrete_are

from luenberger.algebra import Polynomial
from luenberger.certify import Claim
from luenberger.core import BadInput, NotAccepted, NotCertified
from luenberger.core.checks import matrix
from luenberger.lmi import decay_storage
from luenberger.methods.method import Candidate, require_polynomial
from luenberger.systems import System
from luenberger.systems.error_system import ErrorSystem
from luenberger.systems.observability import require_detectable

Covariance = Sequence[Any] | np.ndarray


@dataclass(frozen=True)
class KalmanGain:
    """Steady-state Kalman gain, for a scheduled plant fitted over the scheduling box.

    Choose it as the baseline, or where covariances are known and the scheduling is slow. It minimises the error variance of
    a plant frozen at one point; convergence over the whole box under arbitrarily fast scheduling is no part of that and
    is therefore proved or the design refused.

    Assumes: dx = A(r) x + w, y = C(r) x + v, w and v white with the given covariances (spectral densities in continuous
    time), no nonlinearity.
    Certifies: e' P e falls at least like exp(-2 rate t) (by rate^2 a step for a discrete plant), rate the best that could be
    proved after a back-off; |L(r)| <= the reported bound.

    Args:
        process_covariance: covariance of w [state units^2, per second in continuous time], shape (nx, nx), >= 0.
        measurement_covariance: covariance of v [output units^2, times second in continuous time], shape (ny, ny), > 0.
        points: grid points on every axis of the scheduling box.

    Reference: R. E. Kalman, R. S. Bucy, J. Basic Engineering 83 (1961) 95-108. The discrete gain is the predictor form
    L = A P C' (C P C' + R)^-1. The least-squares fit over the box, with the monomials of A and C, is ours.

    Example:
        >>> import luenberger as lb
        >>> from luenberger.methods.kalman_gain import KalmanGain
        >>> from luenberger.synthesize import synthesize
        >>> plant = lb.System.linear([[0.0]], C=[[1.0]])
        >>> design = synthesize(plant, KalmanGain([[4.0]], [[1.0]]))
        >>> design.gain_at().tolist(), design.certificate.outcome.value
        ([[2.0]], 'proved')
    """

    process_covariance: Covariance
    measurement_covariance: Covariance
    points: int = 3

    references: ClassVar[tuple[str, ...]] = (
        "R. E. Kalman, R. S. Bucy, New Results in Linear Filtering and Prediction Theory, J. Basic Engineering 83 (1961) 95-108",
    )

    def __post_init__(self) -> None:
        for name in ("process_covariance", "measurement_covariance"):
            object.__setattr__(self, name, tuple(map(tuple, matrix(name, getattr(self, name)).tolist())))

    def accept(self, system: System) -> None:
        """Refuse nonlinear and undetectable plants and indefinite covariances; see `Method`."""
        if system.nonlinearity is not None:
            raise NotAccepted(
                f"`{system.name}` has a nonlinearity, of which this gain knows nothing; use `StructuredLipschitz` or `PolytopicLuenberger`."
            )
        if self.points < 2:
            raise BadInput(f"`points` is {self.points}; at least 2 grid points on every axis are needed.")
        require_polynomial(system)
        _covariance("process_covariance", self.process_covariance, system.nx, "states", strict=False)
        _covariance("measurement_covariance", self.measurement_covariance, system.ny, "outputs", strict=True)
        require_detectable(system)

    def design(self, system: System) -> Candidate:
        """Solve the Riccati equation on the grid and fit the gain; see `Method`."""
        start = time.perf_counter()
        box = system.scheduling_box
        points = list(product(*(np.linspace(*box[n], self.points) for n in system.scheduling_names)))
        gains = [self.gain_at(system, point) for point in points]
        keys = _monomials(system)
        basis = np.array([[np.prod(np.power(point, key)) for key in keys] for point in points])
        fitted, *_ = np.linalg.lstsq(basis, np.array([L.ravel() for L in gains]), rcond=None)
        terms = {key: row.reshape(system.nx, system.ny) for key, row in zip(keys, fitted, strict=True)}
        misfit = float(np.abs(basis @ fitted - np.array([L.ravel() for L in gains])).max())
        facts = {
            "solver": "Riccati equation",
            "solver_seconds": time.perf_counter() - start,
            "grid_points": len(points),
            "misfit": misfit,
        }

        def claims(rounded: Polynomial) -> list[Claim]:
            return [_decay(system, rounded, points), _bound(system, rounded)]

        return Candidate(Polynomial(system.scheduling_names, terms), claims, facts)

    def gain_at(self, system: System, r: Sequence[float] = ()) -> np.ndarray:
        """Return the stationary gain of the plant frozen at a scheduling vector, shape (nx, ny).

        Args:
            system: plant.
            r: scheduling, shape (nr,).

        Raises:
            NotAccepted: no stabilising solution, e.g. a mode on the stability border that no process noise excites.
        """
        A, C = np.asarray(system.at("A", r)), np.asarray(system.at("C", r))
        Q, R = np.array(self.process_covariance), np.array(self.measurement_covariance)
        try:
            if system.dt is None:
                P = solve_continuous_are(A.T, C.T, Q, R)
                L = np.linalg.solve(R, C @ P).T
            else:
                P = solve_discrete_are(A.T, C.T, Q, R)
                L = np.linalg.solve(C @ P @ C.T + R, C @ P @ A.T).T
        except np.linalg.LinAlgError:
            L = np.full((system.nx, system.ny), np.nan)
        if np.isnan(L).any() or not _fades(A - L @ C, system.dt):
            where = f" at {dict(zip(system.scheduling_names, r, strict=True))}" if len(r) else ""
            raise NotAccepted(
                f"The Riccati equation of `{system.name}`{where} has no stabilising solution; give process noise on every mode "
                "that does not die out by itself."
            )
        return L


def _fades(loop: np.ndarray, dt: float | None) -> bool:
    values = np.linalg.eigvals(loop)
    # A mode on the stability border is found on either side of it by the square root of the precision.
    return bool(np.real(values).max() < -1e-8 if dt is None else np.abs(values).max() < 1 - 1e-8)


def _covariance(name: str, value: Covariance, size: int, word: str, strict: bool) -> None:
    S = matrix(name, value, size, size, f"the system has {size} {word}")
    if not np.allclose(S, S.T, rtol=1e-12, atol=0.0):
        raise BadInput(f"`{name}` is not symmetric; a covariance needs to be. Give (S + S.T) / 2.")
    low = float(np.linalg.eigvalsh(S)[0])
    if low < -1e-12 * np.abs(S).max() or (strict and low <= 0):
        raise BadInput(
            f"`{name}` has the eigenvalue {low:.6g}; a covariance here needs all eigenvalues {'> 0' if strict else '>= 0'}."
        )


def _monomials(system: System) -> list[tuple[int, ...]]:
    names = system.scheduling_names
    keys = {(0,) * len(names)}
    for letter in "AC":
        keys |= {e for e, c in system.polynomial(letter).over(names) if np.abs(c).max(initial=0.0) > 0}
    return sorted(keys)


def _decay(system: System, gain: Polynomial, points: Sequence[Sequence[float]]) -> Claim:
    """The frozen error loops bound the rate from above; the first back-off of it with a witness is claimed."""
    error = ErrorSystem.of(system, gain)
    loops = [np.linalg.eigvals(error.A(dict(zip(system.scheduling_names, p, strict=True)))) for p in points]
    continuous = system.dt is None
    best = min(-v.real.max() for v in loops) if continuous else max(np.abs(v).max() for v in loops)
    for part in (0.95, 0.9, 0.75, 0.5, 0.25, 0.1, 0.0):
        level = float(part * best if continuous else best + (1 - part) * (1 - best))
        if level >= 0 and (found := decay_storage(system, gain, level)) is not None:
            return Claim("decay", level, *found)
    raise NotCertified(
        f"The Kalman gain of `{system.name}` converges where the plant is frozen, but no quadratic storage shows convergence over the whole "
        "box under arbitrarily fast scheduling. Shrink the box, or use `PolytopicLuenberger`."
    )


def _bound(system: System, gain: Polynomial) -> Claim:
    parts = gain.bernstein(system.scheduling_box).values()
    return Claim("gain_bound", max(float(np.linalg.norm(c, 2)) for c in parts) * (1 + 1e-6))
