"""The inequality of norm-bounded stability in exact rationals: proofs that a level is met, and proofs that none above is.

Lower bounds rest on a storage matrix P, upper bounds on a dual matrix Z: for every P >= 0 and a that satisfy

    [[He(P A) + a I - K, P], [P, -I]] <= 0,        K = C' C / epsilon,  or 0 for a closed loop,

and every Z = [[X, Y], [Y', V]] >= 0 with S = He(A X) + Y + Y' >= 0, the product of the inequality with Z gives
a tr X <= tr(K X) + tr V. Floating point proposes P and Z; the verdict is exact on the doubles of the plant.
"""

from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
from flint import fmpq_mat
from scipy.linalg import eigh, solve_continuous_lyapunov

from luenberger.algebra.definiteness import exact, positive_definite
from luenberger.algebra.polynomial import as_fmpq, fraction
from luenberger.core import Outcome
from luenberger.methods.hamiltonian import hamiltonian
from luenberger.methods.lipschitz_plant import LumpedPlant, Transform
from luenberger.systems import System


@dataclass(frozen=True, eq=False)
class LumpedInequality:
    """A and K of the inequality as doubles, to search with, and as rationals, to prove with.

    Args:
        A: drift in z = T e, shape (n, n).
        K: C' C / epsilon, or zero for a closed loop, shape (n, n).
        exact_A: the same in rationals, from the doubles of plant, transform and gain.
        exact_K: the same in rationals.
    """

    A: np.ndarray
    K: np.ndarray
    exact_A: np.ndarray
    exact_K: np.ndarray

    @staticmethod
    def of(system: System, transform: Transform, gain: Any = None, epsilon: float | None = None) -> "LumpedInequality":
        """Pose the inequality of a gain, or of an epsilon.

        Args:
            system: continuous plant with constant matrices.
            transform: T or its diagonal.
            gain: L, shape (nx, ny), or None.
            epsilon: weight of the outputs, or None.
        """
        plant = LumpedPlant.of(system, transform)
        T, A, C = exact(plant.T), exact(np.asarray(system.at("A"))), exact(np.asarray(system.at("C")))
        inverse = exact_inverse(T)
        if gain is not None:
            loop = T @ (A - exact(np.asarray(gain, dtype=float)) @ C) @ inverse
            return LumpedInequality(plant.loop(gain), np.zeros_like(plant.A), loop, exact(np.zeros_like(plant.A)))
        C = C @ inverse
        assert epsilon is not None
        return LumpedInequality(
            plant.A, plant.C.T @ plant.C / epsilon, T @ A @ inverse, C.T @ C / exact(np.array([[epsilon]]))[0, 0]
        )

    def tolerates(self, P: np.ndarray, squared: Fraction) -> bool:
        """True where P is proved to show stability for the Lipschitz constant sqrt(squared)."""
        P, eye = exact(P), exact(np.eye(P.shape[0]))
        corner = P @ self.exact_A
        corner = corner + corner.T + eye * as_fmpq(squared) - self.exact_K
        whole = np.block([[corner, P], [P, -eye]])
        return all(positive_definite(M) is Outcome.PROVED for M in (P, -whole))

    def refuted_above(self, X: np.ndarray, Y: np.ndarray, V: np.ndarray) -> Fraction | None:
        """Return the bound tr(K X) + tr V over tr X where Z > 0 and S > 0 are proved, else None."""
        X, Y, V = exact(X), exact(Y), exact(V)
        drift = self.exact_A @ X + Y
        if any(positive_definite(M) is not Outcome.PROVED for M in (np.block([[X, Y], [Y.T, V]]), drift + drift.T)):
            return None
        return fraction((np.trace(self.exact_K @ X) + np.trace(V)) / np.trace(X))

    def proposed_dual(self, P: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return X, Y, V from the largest solution P at a level just below the margin.

        With Y = X P and V = P X P the bound exceeds the level of P by tr(P S) / tr X, so S is the rank-one matrix for
        which that is least, a little of the identity added for strictness.
        """
        n = P.shape[0]
        loop = self.A + P
        # tr X = tr(S W) for the solution X of He(loop X) = S.
        W = solve_continuous_lyapunov(loop.T, np.eye(n))
        v = eigh(P, (W + W.T) / 2)[1][:, :1]
        S = v @ v.T
        X = solve_continuous_lyapunov(loop, S + 1e-9 * np.trace(S) * np.eye(n))
        X = (X + X.T) / 2 / np.trace(X)
        Y = X @ P
        V = P @ Y
        return X, Y, (V + V.T) / 2 + 1e-12 * (1 + np.trace(V)) * np.eye(n)

    def refuted_by_frequency(self, squared: float) -> Fraction | None:
        """Return the bound from the imaginary eigenvalues j w of the Hamiltonian at a level above the margin, or None.

        For any x and real w, Z = Re [x; z][x; z]* with z = (j w I - A) x has S = 0 and needs no further proof.
        """
        n = self.A.shape[0]
        values, vectors = np.linalg.eig(hamiltonian(self.A, np.eye(n), squared * np.eye(n) - self.K))
        bounds = []
        for k in np.flatnonzero(np.abs(np.real(values)) <= 1e-6 * (1 + np.abs(values))):
            x = vectors[:n, k] / np.linalg.norm(vectors[:n, k])
            real, imaginary = exact(x.real.reshape(-1, 1)), exact(x.imag.reshape(-1, 1))
            w = exact(np.array([[values[k].imag]]))[0, 0]
            z_real = imaginary * -w - self.exact_A @ real
            z_imaginary = real * w - self.exact_A @ imaginary
            size = (real.T @ real + imaginary.T @ imaginary)[0, 0]
            cost = (
                real.T @ self.exact_K @ real
                + imaginary.T @ self.exact_K @ imaginary
                + z_real.T @ z_real
                + z_imaginary.T @ z_imaginary
            )
            bounds.append(fraction(cost[0, 0] / size))
        return min(bounds, default=None)


def exact_inverse(T: np.ndarray) -> np.ndarray:
    """Return the inverse of a square matrix of rationals.

    Args:
        T: object array of rationals, invertible.
    """
    n = T.shape[0]
    inverse = fmpq_mat(n, n, list(T.flat)).inv()
    return np.array(inverse.entries(), dtype=object).reshape(n, n)
