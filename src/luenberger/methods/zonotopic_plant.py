"""What the designs for guaranteed estimates share: the driven error of a discrete plant, its steady box, and the claims on it."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import LinAlgError, solve_discrete_are, solve_discrete_lyapunov

from luenberger.algebra import Polynomial
from luenberger.certify import Claim
from luenberger.certify.claim import Kind
from luenberger.certify.steady_box import require_bounded
from luenberger.core import NotAccepted, NotCertified
from luenberger.lmi import rounded_storage
from luenberger.methods.method import gain_bound, require_polynomial
from luenberger.systems import System
from luenberger.systems.observability import require_detectable

# Room of the claimed box over that of floating point; the rest of the infinite sum is proved inside it.
ROOM = 1e-6
# What the infinite sum may still lack, relative to what was added; far below ROOM.
_REST = 1e-9
_STEPS = 20000
# Part of the size of the plant that is added to covariances.
_FLOOR = 1e-6
# Shares of the way from the spectral radius to one: the first whose storage survives rounding is claimed.
_SHARES = (0.05, 0.1, 0.25, 0.5, 0.75)


@dataclass(frozen=True)
class DrivenError:
    """The error e+ = (A - K C) e + (base - K seen) s, |s_j| <= 1, of an observer with constant gain K.

    Args:
        A: (nx, nx).
        C: what the gain sees of the error, (ny, nx).
        base: generators that reach the error past the gain, (nx, ns).
        seen: the same generators in what the gain corrects by, (ny, ns).
    """

    A: np.ndarray
    C: np.ndarray
    base: np.ndarray
    seen: np.ndarray

    @staticmethod
    def of(system: System) -> "DrivenError":
        """Return the error of the predictor with gain L: e+ = (A - L C) e + E d - (B N + L (G - D N)) v.

        Args:
            system: accepted plant, see `require_driven`.
        """
        A, C, W, V, S = _read(system)
        return DrivenError(A, C, np.hstack([W, V]), np.hstack([np.zeros((len(C), W.shape[1])), S]))

    @staticmethod
    def filtered(system: System) -> "DrivenError":
        """Return the error once the current y is used: e+ = (I - K C)(A e + E d - B N v) - K (G - D N) v+.

        Exact where inputs are known. With noise of measured inputs v and v+ are taken as two noises, which is wider than what a
        filter carries along, since the v of the step was in the measurement before it too.

        Args:
            system: accepted plant, see `require_driven`.
        """
        A, C, W, V, S = _read(system)
        base = np.hstack([W, V])
        return DrivenError(A, C @ A, np.hstack([base, np.zeros((len(A), S.shape[1]))]), np.hstack([C @ base, S]))

    def loop(self, K: np.ndarray) -> np.ndarray:
        """A - K C.

        Args:
            K: gain, (nx, ny).
        """
        return self.A - K @ self.C

    def drive(self, K: np.ndarray) -> np.ndarray:
        """base - K seen.

        Args:
            K: gain, (nx, ny).
        """
        return self.base - K @ self.seen

    def radius(self, K: np.ndarray) -> float:
        """Spectral radius of the loop.

        Args:
            K: gain, (nx, ny).
        """
        return float(np.abs(np.linalg.eigvals(self.loop(K))).max())

    def terms(self, K: np.ndarray) -> list[np.ndarray]:
        """Return (A - K C)^k (base - K seen) until the rest no longer counts; the loop must be stable.

        Args:
            K: gain, (nx, ny).
        """
        F, X = self.loop(K), self.drive(K)
        found, total = [X], float(np.abs(X).max(initial=0.0))
        room = _REST * max(1 - self.radius(K), 1e-3)
        while len(found) < _STEPS:
            X = F @ X
            size = float(np.abs(X).max(initial=0.0))
            total += size
            if size <= room * total:
                break
            found.append(X)
        return found

    def box(self, K: np.ndarray) -> np.ndarray:
        """Return the half widths of the steady box, (nx,), infinite where the loop is not stable.

        Args:
            K: gain, (nx, ny).
        """
        if not self.radius(K) < 1:
            return np.full(len(self.A), np.inf)
        return np.abs(np.array(self.terms(K))).sum(axis=(0, 2))

    def slope(self, K: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """Return the gradient of weights' box at a gain with a stable loop, (nx, ny), by the adjoint recursion.

        Where a term changes its sign there is none, and one of its limits is returned.

        Args:
            K: gain, (nx, ny).
            weights: (nx,).
        """
        terms, F = self.terms(K), self.loop(K)
        adjoint, loop = np.zeros_like(terms[0]), np.zeros_like(F)
        for X in reversed(terms):
            loop += adjoint @ X.T
            adjoint = weights[:, None] * np.sign(X) + F.T @ adjoint
        return -loop @ self.C.T - adjoint @ self.seen.T

    def kalman(self, ratio: float = 1.0) -> np.ndarray | None:
        """Return the stationary Kalman gain for s with unit covariance, or None where the equation has no use.

        A small part of the plant's own size is added to both noises, so that perfect outputs and undisturbed modes have a gain too.

        Args:
            ratio: how much the variance in the outputs counts.
        """
        size = float(np.linalg.norm(self.base) ** 2) or 1.0
        seen = np.sqrt(ratio) * self.seen
        Q = self.base @ self.base.T + _FLOOR * size * np.eye(len(self.A))
        R = seen @ seen.T + _FLOOR * size * float(np.linalg.norm(self.C) ** 2) * np.eye(len(self.C))
        both = self.base @ seen.T
        try:
            P = solve_discrete_are(self.A.T, self.C.T, Q, R, s=both)
        except LinAlgError:
            return None
        K = np.linalg.solve(self.C @ P @ self.C.T + R, (self.A @ P @ self.C.T + both).T).T
        return K if np.isfinite(K).all() and self.radius(K) < 1 else None


def require_driven(system: System) -> None:
    """Refuse plants without a constant steady box.

    Args:
        system: plant.

    Raises:
        NotAccepted: a continuous, scheduled, uncertain or nonlinear plant.
        BadInput: a bound is missing, or a mode that no gain makes fade.
    """
    require_bounded(system)
    require_polynomial(system)
    require_detectable(system)


def steady_claims(system: System, gain: Polynomial, filter_gain: Polynomial | None = None) -> list[Claim]:
    """Return the claims on decay, on |L| and on the steady box of a rounded gain, with their witnesses.

    Args:
        system: accepted plant.
        gain: constant L.
        filter_gain: constant K of a filter, L = A K; its own box is claimed too.

    Raises:
        NotCertified: the loop does not contract enough to show it.
    """
    error = DrivenError.of(system)
    L = np.asarray(gain({}), dtype=float)
    level, storage = fading_storage(error.loop(L), system.name)
    claims = [
        Claim("decay", level, storage),
        gain_bound(system, gain),
        _box_claim("steady_box", error.box(L), storage),
    ]
    if filter_gain is not None:
        claims.append(_box_claim("filter_box", filter_box(system, filter_gain({})), storage))
    return claims


def filter_box(system: System, filter_gain: Any) -> np.ndarray:
    """Return the half widths, (nx,), of what the current output leaves of the steady error; infinite without a stable loop.

    Where inputs are noisy this is narrower than `DrivenError.filtered` has it.

    Args:
        system: accepted plant.
        filter_gain: K, (nx, ny).
    """
    K, error = np.asarray(filter_gain, dtype=float), DrivenError.of(system)
    L = error.A @ K
    if not error.radius(L) < 1:
        return np.full(system.nx, np.inf)
    left = np.eye(system.nx) - K @ error.C
    # The noise of the outputs in units of its bounds is what the gain is driven by.
    return np.abs(left @ np.array(error.terms(L))).sum(axis=(0, 2)) + np.abs(K @ error.seen).sum(axis=1)


def _box_claim(kind: Kind, box: np.ndarray, storage: np.ndarray) -> Claim:
    claimed = box * (1 + ROOM) + 1e-9 * (box.max() or 1.0)
    return Claim(kind, float(claimed.max()), storage, vector=claimed)


def no_gain(system: System, what: str) -> NotAccepted:
    """The refusal of a plant for which no stable loop was found.

    Args:
        system: plant.
        what: what was tried.
    """
    return NotAccepted(
        f"{what} of `{system.name}` gave no stable loop; a mode on the stability border may be out of sight of the outputs. "
        "Measure more, or take modes out that do not matter."
    )


def _read(system: System) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """A, C, and in units of the bounds: E, -B N, G - D N."""
    at = {letter: np.asarray(system.at(letter), dtype=float) for letter in "ABCDEGN"}
    noise = np.asarray(system.noise_bound, dtype=float)
    disturbance = np.asarray(system.disturbance_bound or (), dtype=float)
    G = (at["G"] - at["D"] @ at["N"]) * noise
    return at["A"], at["C"], at["E"] * disturbance, -at["B"] @ at["N"] * noise, G


def fading_storage(F: np.ndarray, name: str) -> tuple[float, np.ndarray]:
    """Return a factor a step near the spectral radius, and a rounded P with F' P F < factor^2 P.

    Args:
        F: loop, (nx, nx).
        name: how the plant is called.

    Raises:
        NotCertified: the spectral radius is too near one.
    """
    radius = float(np.abs(np.linalg.eigvals(F)).max())
    for share in _SHARES:
        factor = radius + share * (1 - radius)
        if not factor < 1:
            continue
        P = rounded_storage(solve_discrete_lyapunov(F.T / factor, np.eye(len(F))))
        falls = np.linalg.eigvalsh(F.T @ P @ F - factor**2 * P).max() < 0 < np.linalg.eigvalsh(P).min()
        if falls:
            return factor, P
    raise NotCertified(
        f"The error of `{name}` fades by a factor {radius:.9g} a step, too near one to show it in rounded numbers. Use another gain."
    )
