"""Ifqir et al. 2020 as printed, faults included: Lemma 1, the bounds below (34), the recursion (34) to (36), Theorem 1.

Nothing here is meant to be used but to show what the print does; the library's own observers stand elsewhere.
"""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import cvxpy as cp
import numpy as np

from luenberger.lmi.solvers import SOLVERS


def plus(M: np.ndarray) -> np.ndarray:
    """Return the positive part, entry by entry.

    Args:
        M: any array.
    """
    return np.maximum(M, 0.0)


def minus(M: np.ndarray) -> np.ndarray:
    """Return the negative part as a positive number, entry by entry.

    Args:
        M: any array.
    """
    return np.maximum(-M, 0.0)


@dataclass(frozen=True)
class Bounds:
    """A lower and an upper bound, as they come: the print may put them the wrong way round.

    Args:
        lower: what is called the lower bound.
        upper: what is called the upper bound.
    """

    lower: np.ndarray
    upper: np.ndarray

    @staticmethod
    def around(radius: np.ndarray) -> "Bounds":
        """Return -radius to radius.

        Args:
            radius: half widths.
        """
        return Bounds(-radius, radius)


def lemma_printed(A: Bounds, x: Bounds) -> Bounds:
    """Return the bounds of A x that (2) prints.

    Args:
        A: bounds of a matrix.
        x: bounds of a vector.
    """
    lower = (
        plus(A.lower) @ plus(x.lower)
        - minus(A.upper) @ minus(x.lower)
        - minus(A.lower) @ plus(x.upper)
        + minus(A.upper) @ minus(x.upper)
    )
    upper = (
        plus(A.upper) @ plus(x.upper)
        - minus(A.upper) @ minus(x.upper)
        + plus(A.lower) @ minus(x.upper)
        + minus(A.lower) @ minus(x.lower)
    )
    return Bounds(lower, upper)


def lemma_corrected(A: Bounds, x: Bounds) -> Bounds:
    """Return the bounds of A x that (2) means.

    Args:
        A: bounds of a matrix.
        x: bounds of a vector.
    """
    lower = (
        plus(A.lower) @ plus(x.lower)
        - plus(A.upper) @ minus(x.lower)
        - minus(A.lower) @ plus(x.upper)
        + minus(A.upper) @ minus(x.upper)
    )
    return Bounds(lower, _upper(A, x))


def delta_printed(A: Bounds, x: Bounds) -> Bounds:
    """Return the bounds of dA x as they stand below (34): the upper one is right, the lower one is not.

    Args:
        A: bounds of the uncertain part of a matrix.
        x: bounds of what it is applied to.
    """
    lower = (
        plus(A.lower) @ plus(x.lower)
        - plus(A.upper) @ minus(x.lower)
        - minus(A.lower) @ plus(x.lower)
        + minus(A.upper) @ minus(x.lower)
    )
    return Bounds(lower, _upper(A, x))


@dataclass(frozen=True)
class PrintedMode:
    """What the recursion (34) to (36) needs of a mode.

    Args:
        N: error matrix, (nx, nx).
        P: I + H C, (nx, nx).
        H: decoupling matrix, (nx, ny).
        K: gain, (nx, ny).
        dA: bounds of the uncertain part of A.
        dB: bounds of the uncertain part of B.
    """

    N: np.ndarray
    P: np.ndarray
    H: np.ndarray
    K: np.ndarray
    dA: Bounds
    dB: Bounds


def lumped_printed(mode: PrintedMode, x: Bounds, u: Bounds, noise: np.ndarray) -> Bounds:
    """Return the bounds of Delta that (34) prints.

    Args:
        mode: matrices of the mode.
        x: admissible states.
        u: admissible inputs.
        noise: bound of the noise, (ny,).
    """
    a, b = delta_printed(mode.dA, x), delta_printed(mode.dB, u)
    low, high = a.lower + b.lower, a.upper + b.upper
    shift = (mode.H - mode.K) @ noise
    return Bounds(
        plus(mode.P) @ high - minus(mode.P) @ low + shift,
        plus(mode.P) @ low - minus(mode.P) @ high + shift,
    )


def errors_printed(
    modes: Sequence[PrintedMode], x: Bounds, inputs: Sequence[Bounds], noise: np.ndarray, start: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return centre and radius of the box around the errors that (36) gives, each of shape (nt, nx).

    The centre of Delta is dropped and its upper bound taken for its radius, as printed.

    Args:
        modes: mode of every sample.
        x: admissible states.
        inputs: admissible inputs of every sample.
        noise: bound of the noise, (ny,).
        start: generators of the first errors, (nx, ng).
    """
    center, generators = np.zeros(len(start)), start
    centers, radii = [], []
    for mode, u in zip(modes, inputs, strict=True):
        centers.append(center)
        radii.append(np.abs(generators).sum(axis=1))
        upper = lumped_printed(mode, x, u, noise).upper
        center = mode.N @ center
        generators = np.hstack([mode.N @ generators, np.diag(upper)])
        # What has died out would only cost time: below a millionth of a millionth of the box.
        generators = generators[:, np.abs(generators).sum(axis=0) > 1e-12 * np.abs(generators).sum()]
    return np.array(centers), np.array(radii)


@dataclass(frozen=True)
class Attenuation:
    """What Theorem 1 returns.

    Args:
        gamma: least gamma.
        Q: storage matrix, (nx, nx).
        gains: K of every mode, (nx, ny).
    """

    gamma: float
    Q: np.ndarray
    gains: tuple[np.ndarray, ...]


def theorem_printed(
    modes: Sequence[tuple[np.ndarray, np.ndarray, np.ndarray]], fade: float, alpha: float, *, slack: bool = True
) -> Attenuation | None:
    """Return the least gamma of (21) with Q >= alpha I, None where no solver finds a solution.

    The print speaks of "given positive scalars alpha" but has no condition on Q other than being positive; alpha = 0 is that.
    J_n in the block (1, 3) is read as I_n. Where C E takes all outputs, J = 0 and X_i is left out.

    Args:
        modes: A, E, C of every mode.
        fade: epsilon.
        alpha: least eigenvalue of Q that is asked for.
        slack: S free; False puts S = Q.
    """
    n, ny = modes[0][0].shape[0], modes[0][2].shape[0]
    Q, gamma = cp.Variable((n, n), symmetric=True), cp.Variable()
    S = cp.Variable((n, n)) if slack else Q
    conditions, found = [alpha * np.eye(n) << Q, gamma >= 0], []
    for A, E, C in modes:
        inverse = np.linalg.pinv(C @ E, rcond=1e-8)
        U, J = -E @ inverse, np.eye(ny) - C @ E @ inverse
        W = cp.Variable((n, ny))
        SN = S @ (np.eye(n) + U @ C) @ A - W @ C
        if np.abs(J).max() > 1e-9:
            SN = SN + cp.Variable((n, ny)) @ (J @ C @ A)
        zero = np.zeros((n, n))
        block = cp.bmat([[(fade - 1) * Q, zero, SN.T], [zero, -gamma * np.eye(n), S.T], [SN, S, Q - S - S.T]])
        conditions.append(0.5 * (block + block.T) << 0)
        found.append(W)
    problem = cp.Problem(cp.Minimize(gamma), conditions)
    for solver in ("CLARABEL", "SCS"):
        try:
            with warnings.catch_warnings():
                # The status says the same.
                warnings.filterwarnings("ignore", message="Solution may be inaccurate")
                problem.solve(solver=solver, **SOLVERS[solver])
        except cp.SolverError:
            continue
        if problem.status in ("infeasible", "unbounded"):
            return None
        if problem.status == "optimal" and Q.value is not None and gamma.value is not None:
            multiplier = Q.value if S.value is None else S.value
            gains = tuple(np.linalg.lstsq(multiplier, W.value, rcond=None)[0] for W in found)
            return Attenuation(float(gamma.value), np.asarray(Q.value), gains)
    return None


def _upper(A: Bounds, x: Bounds) -> np.ndarray:
    return (
        plus(A.upper) @ plus(x.upper)
        - plus(A.lower) @ minus(x.upper)
        - minus(A.upper) @ plus(x.lower)
        + minus(A.lower) @ minus(x.lower)
    )
