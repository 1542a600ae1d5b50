"""Proved lower and upper bounds on stability margins and on the largest epsilon, in exact rational arithmetic.

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
from luenberger.core import Infeasible, NotCertified, Outcome
from luenberger.methods.hamiltonian import hamiltonian, positive_solution
from luenberger.methods.lipschitz_margin import squared_margin, storage_at
from luenberger.methods.lipschitz_plant import LumpedPlant, Transform, require_epsilon
from luenberger.systems import System


@dataclass(frozen=True)
class MarginBracket:
    """Proved bounds on the square of a margin.

    Args:
        lower: every Lipschitz constant g with g^2 <= lower is tolerated.
        upper: no P shows stability for a Lipschitz constant g with g^2 > upper.
    """

    lower: Fraction
    upper: Fraction

    @property
    def alpha(self) -> tuple[float, float]:
        """The bounds on the margin itself, rounded to doubles."""
        return float(self.lower) ** 0.5, float(self.upper) ** 0.5


@dataclass(frozen=True)
class EpsilonBracket:
    """Proved bounds on the largest epsilon at which a plant has a gain of the Riccati form.

    Args:
        feasible: an epsilon for which a P is proved; smaller ones share it.
        infeasible: an epsilon for which no P exists, proved; None where every epsilon up to `ceiling` is feasible.
    """

    feasible: float
    infeasible: float | None


@dataclass(frozen=True, eq=False)
class _Inequality:
    """A and K above as doubles, to search with, and as rationals, to prove with."""

    A: np.ndarray
    K: np.ndarray
    exact_A: np.ndarray
    exact_K: np.ndarray

    @staticmethod
    def of(system: System, transform: Transform, gain: Any = None, epsilon: float | None = None) -> "_Inequality":
        plant = LumpedPlant.of(system, transform)
        T, A, C = exact(plant.T), exact(np.asarray(system.at("A"))), exact(np.asarray(system.at("C")))
        inverse = _inverse(T)
        if gain is not None:
            loop = T @ (A - exact(np.asarray(gain, dtype=float)) @ C) @ inverse
            return _Inequality(plant.loop(gain), np.zeros_like(plant.A), loop, exact(np.zeros_like(plant.A)))
        C = C @ inverse
        assert epsilon is not None
        return _Inequality(
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
        for k in np.flatnonzero(np.abs(values.real) <= 1e-6 * (1 + np.abs(values))):
            x = vectors[:n, k] / np.linalg.norm(vectors[:n, k])
            real, imaginary = exact(x.real.reshape(-1, 1)), exact(x.imag.reshape(-1, 1))
            w = exact(np.array([[values[k].imag]]))[0, 0]
            z_real = imaginary * -w - self.exact_A @ real
            z_imaginary = real * w - self.exact_A @ imaginary
            size = (real.T @ real + imaginary.T @ imaginary)[0, 0]
            cost = real.T @ self.exact_K @ real + imaginary.T @ self.exact_K @ imaginary + z_real.T @ z_real + z_imaginary.T @ z_imaginary
            bounds.append(fraction(cost[0, 0] / size))
        return min(bounds, default=None)


def margin_bracket(
    system: System, *, epsilon: float | None = None, gain: Any = None, transform: Transform = None
) -> MarginBracket:
    """Prove bounds on a stability margin: of a given gain, or of the best Riccati gain at a given epsilon.

    Choose it where `stability_margin` or `margin_at` decides something: both are floating point. The bounds are usually
    a relative 1e-6 apart.

    Certifies: lower <= alpha^2 <= upper, alpha of eq. (13) for a gain, of eq. (24) for an epsilon, for the plant whose
    matrices, transform, gain and epsilon are exactly the given doubles.

    Args:
        system: continuous plant with constant matrices; its Lipschitz constant is not used.
        epsilon: weight of the outputs; give it or `gain`.
        gain: L, shape (nx, ny); give it or `epsilon`.
        transform: T or its diagonal.

    Raises:
        Infeasible: the margin is zero.
        NotCertified: rounding spoiled every proposed proof (badly scaled states).

    Reference: dual of B. Song, J. K. Hedrick, ACC 2011, (13) and (24).

    Example:
        >>> import luenberger as lb
        >>> from luenberger.methods.lipschitz_bracket import margin_bracket
        >>> low, high = margin_bracket(lb.System.linear([[0.0]], C=[[1.0]]), epsilon=0.25).alpha
        >>> 1.999 < low < 2.0 < high < 2.001
        True
    """
    if gain is None:
        require_epsilon(0.0 if epsilon is None else epsilon)
    found = _Inequality.of(system, transform, gain, epsilon)
    best = squared_margin(found.A, found.K)
    if best <= 0:
        raise Infeasible(
            "The margin is zero: no P > 0 exists even without a nonlinearity. Choose a stabilising gain or a smaller epsilon."
        )
    lower = upper = None
    for width in (1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3):
        P = positive_solution(found.A, np.eye(len(found.A)), best * (1 - width) * np.eye(len(found.A)) - found.K)
        if P is None:
            continue
        if lower is None and found.tolerates(P, Fraction(best * (1 - 2 * width))):
            lower = Fraction(best * (1 - 2 * width))
        if upper is None:
            bounds = (found.refuted_above(*found.proposed_dual(P)), found.refuted_by_frequency(best * (1 + width)))
            upper = min((b for b in bounds if b is not None), default=None)
        if lower is not None and upper is not None:
            return MarginBracket(lower, upper)
    raise NotCertified(
        f"The margin {best**0.5:.6g} could not be bracketed by a proof; scale the states with `transform`."
    )


def largest_epsilon(
    system: System,
    lipschitz: float | None = None,
    transform: Transform = None,
    *,
    width: float = 1e-6,
    ceiling: float = 1e6,
) -> EpsilonBracket:
    """Prove a bracket of the largest epsilon at which a gain of the Riccati form exists for a Lipschitz constant.

    Choose it instead of a grid: a grid says only which of its points are feasible, and a misread index is not noticed.

    Certifies: at `feasible` a P satisfies (19), at `infeasible` none does; both in rational arithmetic.

    Args:
        system: continuous plant with constant matrices.
        lipschitz: constant in the coordinates z = T x; default that of the plant.
        transform: T or its diagonal.
        width: wanted relative width of the bracket.
        ceiling: largest epsilon to look at.

    Raises:
        Infeasible: no epsilon down to 1e-8 admits the Lipschitz constant.
        NotCertified: no proof was found at the ends.

    Reference: B. Song, J. K. Hedrick, ACC 2011, Theorem 4, (24).

    Example:
        >>> import luenberger as lb
        >>> from luenberger.methods.lipschitz_bracket import largest_epsilon
        >>> found = largest_epsilon(lb.System.linear([[0.0]], C=[[1.0]]), lipschitz=2.0)
        >>> found.feasible < 0.25 < found.infeasible
        True
    """
    plant = LumpedPlant.of(system, transform)
    g = plant.lipschitz if lipschitz is None else lipschitz
    plant = LumpedPlant(plant.A, plant.C, plant.E, plant.T, plant.T_inverse, g)
    good, bad = epsilon_interval(plant, ceiling)
    squared = Fraction(g) ** 2
    while bad is not None and bad - good > width / 4 * bad:
        middle = (good * bad) ** 0.5
        good, bad = (middle, bad) if storage_at(plant, middle) is not None else (good, middle)
    feasible = next(
        (e for k in range(12) if _feasible(system, transform, e := good * (1 - width / 4 * 2**k), squared)), None
    )
    infeasible = None
    if bad is not None:
        infeasible = next(
            (e for k in range(12) if _infeasible(system, transform, e := bad * (1 + width / 4 * 2**k), squared)), None
        )
    if feasible is None or (bad is not None and infeasible is None):
        raise NotCertified(
            f"The largest epsilon lies near {good:.6g}, but a proof is missing; scale the states with `transform`."
        )
    return EpsilonBracket(feasible, infeasible)


def epsilon_interval(plant: LumpedPlant, ceiling: float = 1e6) -> tuple[float, float | None]:
    """Return a feasible epsilon and ten times it or less that is not (None where `ceiling` is feasible); floating point.

    Args:
        plant: plant with the Lipschitz constant.
        ceiling: largest epsilon to look at.

    Raises:
        Infeasible: no epsilon down to 1e-8 is feasible.
    """
    ladder = np.geomspace(ceiling, 1e-8, 1 + round(np.log10(ceiling) + 8))
    for k, epsilon in enumerate(ladder):
        if storage_at(plant, float(epsilon)) is not None:
            return float(epsilon), (float(ladder[k - 1]) if k else None)
    raise Infeasible(
        f"No epsilon down to 1e-08 admits the Lipschitz constant {plant.lipschitz:.6g} in these coordinates. Choose another "
        "`transform` (a diagonal one that shrinks the states where the nonlinearity acts), or `StructuredLipschitz`.",
        "stability",
    )


def _feasible(system: System, transform: Transform, epsilon: float, squared: Fraction) -> bool:
    found = _Inequality.of(system, transform, None, epsilon)
    eye = np.eye(len(found.A))
    # A P of a slightly larger constant leaves room for rounding.
    proposals = (
        positive_solution(found.A, eye, float(squared) * (1 + more) * eye - found.K) for more in (1e-7, 1e-9, 1e-5)
    )
    return any(P is not None and found.tolerates(P, squared) for P in proposals)


def _infeasible(system: System, transform: Transform, epsilon: float, squared: Fraction) -> bool:
    try:
        return margin_bracket(system, epsilon=epsilon, transform=transform).upper < squared
    except (Infeasible, NotCertified):
        return False


def _inverse(T: np.ndarray) -> np.ndarray:
    n = T.shape[0]
    inverse = fmpq_mat(n, n, list(T.flat)).inv()
    return np.array(inverse.entries(), dtype=object).reshape(n, n)
