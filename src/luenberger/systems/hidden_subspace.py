"""The part of the state that no output shows, and the points of a plant at which it is looked for."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.linalg import matrix_balance, subspace_angles

from luenberger.systems.jacobian_box import error_box, jacobian
from luenberger.systems.system import System

RELATIVE_TOLERANCE = 1e-9
# Subspaces closer than this angle [rad] are taken to meet; roundoff of the recursion stays far below.
_ANGLE = 1e-7
# A double real eigenvalue splits by about the root of the machine precision; such a pair is still real.
_SPLIT = 1e-7
# Above this many vertices the box is sampled at its middle and at the ends of one parameter at a time.
_MOST_VERTICES = 1024

Point = tuple[dict[str, float], np.ndarray, np.ndarray, np.ndarray]


@dataclass(frozen=True, eq=False)
class Balanced:
    """A frozen pair or triple in coordinates in which ranks can be judged: A balanced, rows of C and columns of E unit.

    Args:
        A: balanced state matrix, (nx, nx).
        E: unknown-input directions as an orthonormal basis, (nx, rank E).
        C: outputs, (ny, nx).
        scale: state = scale * balanced state, (nx,).
    """

    A: np.ndarray
    E: np.ndarray
    C: np.ndarray
    scale: np.ndarray

    @staticmethod
    def of(A: np.ndarray, C: np.ndarray, E: np.ndarray) -> "Balanced":
        """Balance A by powers of two, carry C and E along."""
        A, (scale, _) = matrix_balance(A, permute=False, separate=True)
        C = C * scale
        length = np.linalg.norm(C, axis=1, keepdims=True)
        return Balanced(A, span(_unit_columns(E / scale[:, None])), C / np.where(length > 0, length, 1.0), scale)

    @property
    def size(self) -> float:
        """Norm of A, the yardstick of every tolerance; 1 for A = 0."""
        return float(np.linalg.norm(self.A, 2)) or 1.0

    @property
    def roundoff(self) -> float:
        """Error of an eigenvalue that counts as none."""
        return RELATIVE_TOLERANCE * self.size

    def hidden_subspace(self) -> np.ndarray:
        """Return an orthonormal basis of the states that some unknown input can keep invisible for ever.

        It is the largest V in ker C with A V inside V + im E; without E the unobservable subspace. The recursion works
        on subspaces, never on powers of A, so fast and slow modes keep their digits.
        """
        V = kernel(self.C, 1.0)
        while V.shape[1]:
            W = span(np.hstack([V, self.E]))
            AV = self.A @ V
            smaller = V @ kernel(AV - W @ (W.T @ AV), self.size)
            if smaller.shape[1] == V.shape[1]:
                break
            V = np.linalg.qr(smaller)[0]
        return V

    def hidden_modes(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the eigenvalues and the state directions (nx, k), in original coordinates, of the hidden motions.

        Where im E meets the hidden subspace (`input_is_hidden`) the unknown input may choose some of the eigenvalues.
        """
        V = self.hidden_subspace()
        if not V.shape[1]:
            return np.zeros(0, complex), np.zeros((len(self.scale), 0), complex)
        X = np.linalg.lstsq(np.hstack([V, self.E]), self.A @ V, rcond=None)[0][: V.shape[1]]
        values, inner = np.linalg.eig(X.astype(complex))
        values = np.where(abs(np.imag(values)) <= _SPLIT * self.size, np.real(values), values)
        directions = self.scale[:, None] * (V @ inner)
        return values.astype(complex), directions / np.linalg.norm(directions, axis=0)

    def input_is_hidden(self) -> bool:
        """True where some unknown input moves the state inside the hidden subspace: it leaves no trace at all."""
        V = self.hidden_subspace()
        return bool(V.shape[1] and self.E.shape[1] and np.min(subspace_angles(V, self.E)) < _ANGLE)


def kernel(M: np.ndarray, size: float) -> np.ndarray:
    """Return an orthonormal basis of the null space; singular values up to RELATIVE_TOLERANCE * size count as zero.

    Args:
        M: matrix, (m, n).
        size: yardstick, usually the norm of the matrix M was made from.
    """
    if not M.shape[0]:
        return np.eye(M.shape[1])
    _, values, right = np.linalg.svd(M)
    return right[int(np.sum(values > RELATIVE_TOLERANCE * size)) :].T


def span(M: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis of the column space of a matrix with columns of about unit length, (n, rank).

    Args:
        M: matrix whose columns span the subspace.
    """
    if not M.shape[1]:
        return M
    left, values, _ = np.linalg.svd(M, full_matrices=False)
    return left[:, values > RELATIVE_TOLERANCE]


def points(system: System, linear_part: bool) -> Iterator[Point]:
    """Yield (parameter values, A, C, E) at the vertices and the middle of the box a design must cover.

    Unmeasured parameters stay at their middle. A Jacobian box adds its varying entries: A stands for A + F J H.

    Args:
        system: plant.
        linear_part: True leaves the nonlinearity out.
    """
    f = None if linear_part else system.nonlinearity
    boxed = f is not None and f.jacobian_lower is not None
    box = error_box(system) if boxed else system.scheduling_box
    names, known = system.scheduling_names, dict(system.uncertainty)
    matrices = [getattr(system, letter) for letter in "ACEF"]
    slope = jacobian(system) if boxed else None
    for values in _corners({name: ends for name, ends in box.items() if ends[0] < ends[1]}):
        full = {name: values.get(name, ends[0]) for name, ends in box.items()}
        where = {name: full[name] for name in names} | known
        A, C, E, F = (np.asarray(M(where), dtype=float) for M in matrices)
        if f is not None and slope is not None:
            A = A + F @ np.asarray(slope(full)) @ np.asarray(f.H)
        yield values, A, C, E


def _corners(box: Mapping[str, tuple[float, float]]) -> Iterator[dict[str, float]]:
    middle = {name: 0.5 * (ends[0] + ends[1]) for name, ends in box.items()}
    if 2 ** len(box) <= _MOST_VERTICES:
        yield from (dict(zip(box, corner, strict=True)) for corner in product(*box.values()))
    else:
        yield from (middle | {name: end} for name, ends in box.items() for end in ends)
    if box:
        yield middle


def _unit_columns(M: np.ndarray) -> np.ndarray:
    length = np.linalg.norm(M, axis=0, keepdims=True)
    return M / np.where(length > 0, length, 1.0)
