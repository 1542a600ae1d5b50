"""A Lipschitz plant in chosen coordinates, the nonlinearity seen as a norm-bounded signal in all states at once."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from luenberger.core import BadInput, NotAccepted
from luenberger.core.checks import finite_array, matrix
from luenberger.methods.method import require_continuous, require_polynomial
from luenberger.systems import System

Transform = Sequence[Any] | np.ndarray | None


@dataclass(frozen=True, eq=False)
class LumpedPlant:
    """Error dynamics before a gain is chosen:  z' = A z + phi + E d,  |phi| <= lipschitz |z|,  y = C z,  z = T e.

    Args:
        A: T A T^-1, shape (nx, nx).
        C: C T^-1, shape (ny, nx).
        E: T E, shape (nx, nd).
        T: the coordinates, shape (nx, nx).
        T_inverse: its inverse.
        lipschitz: Lipschitz constant of T F f(H T^-1 z), at most |T F| g |H T^-1|.
    """

    A: np.ndarray
    C: np.ndarray
    E: np.ndarray
    T: np.ndarray
    T_inverse: np.ndarray
    lipschitz: float

    @staticmethod
    def of(system: System, transform: Transform = None) -> "LumpedPlant":
        """Transform a plant.

        Args:
            system: continuous plant with constant matrices; a linear one has Lipschitz constant zero.
            transform: T, shape (nx, nx), or its diagonal, shape (nx,); None leaves the states as they are.

        Raises:
            NotAccepted: discrete plant, or A, C, E, F depend on parameters.
            BadInput: T of the wrong shape or singular.
        """
        require_continuous(system)
        require_polynomial(system)
        if moving := {n for letter in "ACEF" for n in system.polynomial(letter).names}:
            raise NotAccepted(
                f"`{system.name}` depends on {sorted(moving)}; this theorem is about constant matrices. Freeze them with `system.freeze`."
            )
        T = transform_matrix(transform, system.nx)
        inverse = np.linalg.inv(T)
        A, C, E, F = (np.asarray(system.at(letter)) for letter in "ACEF")
        f = system.nonlinearity
        lipschitz = (
            0.0 if f is None else float(np.linalg.norm(T @ F, 2) * f.lipschitz_bound * np.linalg.norm(f.H @ inverse, 2))
        )
        return LumpedPlant(T @ A @ inverse, C @ inverse, T @ E, T, inverse, lipschitz)

    @property
    def nx(self) -> int:
        """Number of states."""
        return self.A.shape[0]

    def loop(self, gain: Any) -> np.ndarray:
        """Return T (A - L C) T^-1 for a gain L in the original coordinates, shape (nx, ny)."""
        L = matrix(
            "gain", gain, self.nx, self.C.shape[0], f"the plant has {self.nx} states and {self.C.shape[0]} outputs"
        )
        return self.A - self.T @ L @ self.C

    def gain(self, P: np.ndarray, epsilon: float) -> np.ndarray:
        """Return L = T^-1 P^-1 C' T^-T / (2 epsilon) in the original coordinates, shape (nx, ny).

        Args:
            P: storage matrix in z, (nx, nx).
            epsilon: the same as in the inequality for P.

        Reference: B. Song, J. K. Hedrick, ACC 2011, eq. (33), whose C' must be the transformed one.
        """
        return self.T_inverse @ np.linalg.solve(P, self.C.T) / (2 * epsilon)

    def weight(self, norm: str) -> np.ndarray:
        """Return W with z' W z = |z|^2 ("transformed") or |e|^2 ("original")."""
        return np.eye(self.nx) if norm == "transformed" else self.T_inverse.T @ self.T_inverse


def transform_matrix(transform: Transform, nx: int) -> np.ndarray:
    """Return T as an invertible matrix.

    Args:
        transform: T, its diagonal, or None for the identity.
        nx: number of states.

    Raises:
        BadInput: wrong shape or singular to working precision.
    """
    if transform is None:
        return np.eye(nx)
    T = finite_array("transform", transform)
    T = matrix("transform", np.diag(T) if T.ndim == 1 else T, nx, nx, f"the system has {nx} states")
    if not (condition := np.linalg.cond(T)) < 1e12:
        raise BadInput(
            f"`transform` has condition number {condition:.3g}; coordinates need an invertible T (below 1e12)."
        )
    return T


def as_tuples(transform: Transform) -> tuple[Any, ...] | None:
    """Return a transform as nested tuples, so that options compare and hash by value; None stays None."""
    if transform is None:
        return None
    T = finite_array("transform", transform)
    return tuple(T.tolist()) if T.ndim == 1 else tuple(tuple(row) for row in np.atleast_2d(T).tolist())


def require_epsilon(epsilon: float) -> None:
    """Refuse an epsilon that is not a positive finite number.

    Raises:
        BadInput: see above.
    """
    if not (np.isfinite(epsilon) and epsilon > 0):
        raise BadInput(f"`epsilon` is {epsilon}; the output weight 1/epsilon needs a positive finite number.")


def require_weight(name: str, value: float) -> None:
    """Refuse a trade-off weight outside the open interval (0, 1).

    Args:
        name: how the option is called.
        value: its value.

    Raises:
        BadInput: at the ends one of the two goals is dropped and the optimum is not attained.
    """
    if not 0 < value < 1:
        raise BadInput(
            f"`{name}` is {value}; a number strictly between 0 and 1 is needed: at 0 and 1 one goal is dropped and the best "
            "gain of the other is not attained."
        )


def require_lipschitz(system: System) -> None:
    """Refuse plants without a nonlinearity.

    Args:
        system: plant.

    Raises:
        NotAccepted: see above.
    """
    if system.nonlinearity is None:
        raise NotAccepted(f"`{system.name}` has no nonlinearity; use `PolytopicLuenberger` or `KalmanGain`.")
