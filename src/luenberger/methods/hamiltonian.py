"""Riccati equations He(P A) + P R P + Q = 0 and the H-infinity norm, both read off a Hamiltonian matrix, without an SDP.

Lipschitz design inequalities in one storage matrix are Riccati inequalities with R >= 0. Their largest solution, which
maximises lmin(P), is the antistabilising one. It costs a Schur form instead of a solver run and holds to all digits.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.linalg import schur, solve_continuous_lyapunov

from luenberger.core import BadInput
from luenberger.core.checks import matrix

# A solution is believed while its residual stays below this part of its largest term.
RESIDUAL = 1e-8


def hamiltonian(A: np.ndarray, R: np.ndarray, Q: np.ndarray) -> np.ndarray:
    """Return [[A, R], [-Q, -A']], whose invariant subspaces [I; P] solve He(P A) + P R P + Q = 0.

    Args:
        A: (n, n).
        R: (n, n), symmetric.
        Q: (n, n), symmetric.
    """
    return np.block([[A, R], [-Q, -A.T]])


def riccati_residual(P: np.ndarray, A: np.ndarray, R: np.ndarray, Q: np.ndarray) -> np.ndarray:
    """Return He(P A) + P R P + Q, shape (n, n).

    Args:
        P: candidate, (n, n), symmetric.
        A: (n, n).
        R: (n, n), symmetric.
        Q: (n, n), symmetric.
    """
    return P @ A + A.T @ P + P @ R @ P + Q


def riccati_solution(
    A: np.ndarray, R: np.ndarray, Q: np.ndarray, which: Literal["maximal", "minimal"] = "maximal"
) -> np.ndarray | None:
    """Return the largest (or smallest) symmetric solution of He(P A) + P R P + Q = 0 with R >= 0, or None.

    The largest P makes every eigenvalue of A + R P unstable and bounds every solution of the inequality "<= 0" from
    above; the smallest makes them stable. The Schur subspace is refined by Newton steps (a Lyapunov equation each).

    Args:
        A: (n, n).
        R: (n, n), symmetric, >= 0.
        Q: (n, n), symmetric, of any sign.
        which: end of the lattice of solutions.

    Returns:
        P, shape (n, n), or None where the Hamiltonian has eigenvalues on the imaginary axis or the subspace has no
        graph form, so that no such solution exists.

    Reference: S. Bittanti, A. J. Laub, J. C. Willems (eds.), The Riccati Equation, Springer 1991, chapter 3.
    """
    n = A.shape[0]
    H = hamiltonian(A, R, Q)
    real = np.linalg.eigvals(H).real
    # A double eigenvalue on the axis splits by the square root of the precision.
    if np.abs(real).min() <= 1e-8 * np.abs(H).max() or (real > 0).sum() != n:
        return None
    Z = schur(H, output="real", sort="rhp" if which == "maximal" else "lhp")[1]
    X1, X2 = Z[:n, :n], Z[n:, :n]
    if np.linalg.cond(X1) > 1e14:
        return None
    P = np.linalg.solve(X1.T, X2.T).T
    P = _refined((P + P.T) / 2, A, R, Q)
    terms = max(np.abs(part).max() for part in (P @ A, P @ R @ P, Q))
    return P if np.abs(riccati_residual(P, A, R, Q)).max() <= RESIDUAL * (1 + terms) else None


def positive_solution(A: np.ndarray, R: np.ndarray, Q: np.ndarray) -> np.ndarray | None:
    """Return the largest solution of He(P A) + P R P + Q = 0 where it is positive definite, else None.

    None says that He(P A) + P R P + Q < 0 has no P > 0 either (up to rounding): every solution of the inequality lies
    below the largest solution of the equation.

    Args:
        A: (n, n).
        R: (n, n), symmetric, >= 0.
        Q: (n, n), symmetric.
    """
    P = riccati_solution(A, R, Q)
    return P if P is not None and np.linalg.eigvalsh(P)[0] > 0 else None


@dataclass(frozen=True)
class Peak:
    """Largest value of a frequency response.

    Args:
        level: H-infinity norm, attained at `frequency` up to the tolerance.
        frequency: where it is attained [rad/s].
    """

    level: float
    frequency: float


def hinf_peak(A: np.ndarray, B: np.ndarray, C: np.ndarray, tolerance: float = 1e-10) -> Peak:
    """Return the H-infinity norm of C (s I - A)^-1 B and the frequency of its peak.

    Bisection on the level, two-sided: the response at a frequency bounds the norm from below; a level whose Hamiltonian
    has no imaginary eigenvalue bounds it from above, and one that has names the frequencies to look at next.

    Assumes: A stable.

    Args:
        A: (n, n).
        B: (n, nw).
        C: (nz, n).
        tolerance: relative accuracy of the level.

    Raises:
        BadInput: A is not stable, so the norm is infinite.

    Reference: S. Boyd, V. Balakrishnan, P. Kabamba, Math. Control Signals Systems 2 (1989) 207-219; the jump to the
    middle frequencies is N. A. Bruinsma, M. Steinbuch, Systems & Control Letters 14 (1990) 287-293.
    """
    A = matrix("A", A)
    poles = np.linalg.eigvals(A)
    if poles.real.max() >= 0:
        raise BadInput(
            f"`A` has an eigenvalue with real part {poles.real.max():.3g} 1/s; the norm needs a stable matrix (all < 0)."
        )
    best = max((_response(A, B, C, w) for w in (0.0, *np.abs(poles), *np.abs(poles.imag))), key=lambda p: p.level)
    while best.level > 0:
        level = best.level * (1 + tolerance)
        found = np.linalg.eigvals(hamiltonian(A, B @ B.T / level, C.T @ C / level))
        # Near the peak two imaginary eigenvalues meet and rounding moves them by the square root of the precision; a
        # frequency taken in vain costs one evaluation, a missed one would end the search too early.
        near = np.sort(np.abs(found.imag[np.abs(found.real) <= 1e-6 * (1 + np.abs(found))]))
        places = [*near, *(near[1:] + near[:-1]) / 2]
        higher = max((_response(A, B, C, w) for w in places), key=lambda p: p.level, default=best)
        if higher.level <= level:
            return max(best, higher, key=lambda p: p.level)
        best = higher
    return best


def _response(A: np.ndarray, B: np.ndarray, C: np.ndarray, frequency: float) -> Peak:
    value = C @ np.linalg.solve(1j * frequency * np.eye(A.shape[0]) - A, B)
    return Peak(float(np.linalg.norm(value, 2)), float(frequency))


def _refined(P: np.ndarray, A: np.ndarray, R: np.ndarray, Q: np.ndarray, steps: int = 4) -> np.ndarray:
    """Newton steps while the residual falls."""
    residual = riccati_residual(P, A, R, Q)
    for _ in range(steps):
        loop = A + R @ P
        step = solve_continuous_lyapunov(loop.T, -residual)
        candidate = P + (step + step.T) / 2
        after = riccati_residual(candidate, A, R, Q)
        if not np.abs(after).max() < np.abs(residual).max():
            break
        P, residual = candidate, after
    return P
