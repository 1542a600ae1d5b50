"""Rows of A z + s = b, collected cone by cone in the order that Clarabel wants them."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import clarabel
import cvxpy as cp
import numpy as np
import scipy.sparse as sp
from cvxpy.atoms.norm1 import norm1
from cvxpy.atoms.pnorm import Pnorm
from cvxpy.constraints.nonpos import Inequality
from cvxpy.constraints.psd import PSD
from cvxpy.constraints.zero import Equality

from luenberger.lmi.affine_form import Memo, stacked

# The extension module comes without stubs.
_solver: Any = clarabel


@dataclass
class Part:
    """Rows of one cone: A over all entries of the variables, over the multipliers' unknowns and over further ones, and b.

    Args:
        size: of the cone: its number of rows, or of rows of the matrix where it is definite.
        left: A over the entries, shape (rows, entries).
        b: right-hand side.
        W: A over the multipliers' unknowns.
        further: (row, number of the further unknown, value).
    """

    size: int
    left: np.ndarray
    b: np.ndarray
    W: sp.csr_array | None = None
    further: Sequence[tuple[int, int, float]] = ()


class Rows:
    """Collects rows of A z + s = b by kind of cone.

    Args:
        variables: their entries, stacked, are the columns.
        memo: forms of shared sub-expressions.
    """

    def __init__(self, variables: Sequence[cp.Variable], memo: Memo):
        self.variables, self.memo = variables, memo
        sizes = [v.size for v in variables]
        self.entries, self.further = sum(sizes), 0
        self.place = {v.id: sum(sizes[:k]) for k, v in enumerate(variables)}
        self.parts: dict[str, list[Part]] = {"zero": [], "nonneg": [], "soc": [], "psd": []}
        self.counts = dict.fromkeys(self.parts, 0)

    def add(self, kind: str, size: int, left: np.ndarray, b: np.ndarray, W: sp.csr_array | None = None) -> int:
        """Add the rows of one cone; return the first among those of its kind.

        Args:
            kind: "zero", "nonneg", "soc" or "psd".
            size: as in `Part`.
            left: A over the entries, not scaled.
            b: right-hand side, scaled.
            W: A over the multipliers' unknowns, scaled.
        """
        first = self.counts[kind]
        self.parts[kind].append(Part(size, left, b, W))
        self.counts[kind] += len(b)
        return first

    def affine(self, expression: Any, kind: str) -> None:
        """Say that an expression lies in a cone.

        Args:
            expression: affine.
            kind: "zero" or "nonneg".
        """
        K = stacked(expression, self.variables, self.memo)
        self.add(kind, K.shape[0], -K[:, :-1], K[:, -1])

    def constraint(self, constraint: Any) -> bool:
        """Add a cvxpy constraint; False where it is none of the known kinds.

        Args:
            constraint: affine (in)equality, definiteness, or a Euclidean norm bounded by an affine scalar.
        """
        if isinstance(constraint, PSD) and constraint.args[0].is_affine():
            K = stacked(constraint.args[0], self.variables, self.memo)
            n = round(np.sqrt(K.shape[0]))
            order, scale, _ = triangle(n)
            K = (0.5 * (K + K[np.arange(n * n).reshape(n, n).T.ravel()]))[order]
            self.add("psd", n, -K[:, :-1], K[:, -1] * scale)
            return True
        if isinstance(constraint, Equality) and all(a.is_affine() for a in constraint.args):
            self.affine(constraint.args[1] - constraint.args[0], "zero")
            return True
        if not isinstance(constraint, Inequality) or not constraint.args[1].is_affine():
            return False
        small, large = constraint.args
        if small.is_affine():
            self.affine(large - small, "nonneg")
            return True
        inner = small.args[0] if len(small.args) == 1 else None
        if inner is None or not inner.is_affine() or large.size != 1:
            return False
        if isinstance(small, Pnorm) and small.p == 2 and small.axis is None:
            self._bounded(large, inner, np.eye(inner.size), "soc")
        elif isinstance(small, norm1) and inner.size == 1:
            self._bounded(large, inner, np.array([[-1.0], [1.0]]), "nonneg")
        else:
            return False
        return True

    def _bounded(self, large: Any, inner: Any, signs: np.ndarray, kind: str) -> None:
        """norm(inner) <= t <= large with a further unknown t, as the modelling layer has it: the last digits depend on it."""
        column, self.further = self.further, self.further + 1
        K = signs @ stacked(inner, self.variables, self.memo)
        if kind == "soc":
            K = np.vstack([np.zeros((1, K.shape[1])), K])
        self.add(kind, len(K), -K[:, :-1], K[:, -1])
        self.parts[kind][-1].further = [(k, column, -1.0) for k in range(1 if kind == "soc" else len(K))]
        self.affine(large, "nonneg")
        self.parts["nonneg"][-1].further = [(0, column, 1.0)]

    def collected(self, place: np.ndarray, width: int) -> tuple[sp.csc_array, np.ndarray, list[Any], int]:
        """Return A, b, the cones, and the first row of the definite ones.

        Args:
            place: coordinate of every entry.
            width: number of the multipliers' unknowns.
        """
        parts = [part for kind in self.parts.values() for part in kind]
        starts = np.cumsum([0, *(len(p.b) for p in parts)])
        known = merged(np.vstack([np.zeros((0, self.entries)), *(p.left for p in parts)]), place)
        definite = [triangle(p.size)[1] for p in self.parts["psd"]]
        if definite:
            known[starts[-1] - self.counts["psd"] :] *= np.concatenate(definite)[:, None]
        further = np.zeros((int(starts[-1]), self.further))
        for part, start in zip(parts, starts, strict=False):
            for row, column, value in part.further:
                further[start + row, column] = value
        A: Any = sp.csc_array(np.hstack([known, further]))
        if width:
            own = [sp.csr_array((len(p.b), width)) if p.W is None else p.W for p in parts]
            A = sp.hstack([A, sp.vstack(own, format="csr")], format="csc")
        cones = [
            cone(self.counts[kind])
            for kind, cone in (("zero", _solver.ZeroConeT), ("nonneg", _solver.NonnegativeConeT))
            if self.counts[kind]
        ]
        cones += [_solver.SecondOrderConeT(p.size) for p in self.parts["soc"]]
        cones += [_solver.PSDTriangleConeT(p.size) for p in self.parts["psd"]]
        first = sum(self.counts[k] for k in ("zero", "nonneg", "soc"))
        return sp.csc_array(A), np.concatenate([np.zeros(0), *(p.b for p in parts)]), cones, first


@lru_cache(maxsize=256)
def triangle(n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows of vec(M) that make the scaled upper triangle, column after column, their scales, and where the diagonal is in it.

    Args:
        n: M is (n, n).
    """
    columns, rows = np.tril_indices(n)
    return rows * n + columns, np.where(rows == columns, 1.0, np.sqrt(2.0)), np.flatnonzero(rows == columns)


def merged(left: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Return the columns of coordinates from those of entries; at most two entries share a coordinate.

    Args:
        left: shape (rows, entries).
        place: coordinate of every entry.
    """
    _, first = np.unique(place, return_index=True)
    second = np.setdiff1d(np.arange(len(place)), first)
    found = left[:, first]
    found[:, place[second]] += left[:, second]
    return found
