"""What a relaxation hands to a solver, and what numbers for its unknowns prove about the inequality it stands for.

A multiplier has unknowns w of its own beside the decision variables x. Its matrices are larger than the inequality: the level
enters the leading block only, and side conditions (a multiplier is definite, say) have no level at all. So the margin of the
inequality is not an eigenvalue of any of these matrices; it is computed here from all of them.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

# How far the block beside the level is pushed below zero before it is eliminated, relative to the matrix; the best one counts.
PUSHES = 10.0 ** np.arange(-14, -2)

ROUNDING = 8 * np.finfo(float).eps


@dataclass(frozen=True)
class Condition:
    """One matrix inequality  M(x, w) <= level diag(unit)  with  vec(M) = K @ [x; 1] + W @ w,  rows in C order.

    Args:
        size: M has shape (size, size).
        K: constant part and dependence on the decision variables, shape (size^2, nx + 1).
        W: dependence on the relaxation's own unknowns, shape (size^2, nw); None where there are none.
        unit: 1 where the level counts and 0 elsewhere, shape (size,); all zero for a side condition.
        reach: what a violation of 1 outside the unit block can add to the largest value of the inequality on the box.
    """

    size: int
    K: np.ndarray
    W: sp.csr_array | None
    unit: np.ndarray
    reach: float = 0.0

    def value(self, x: np.ndarray, w: np.ndarray) -> np.ndarray:
        """Return M, symmetrised.

        Args:
            x: decision variables with a one at the end, shape (nx + 1,).
            w: the relaxation's own unknowns, shape (nw,).
        """
        vector = self.K @ x if self.W is None else self.K @ x + self.W @ w
        M = vector.reshape(self.size, self.size)
        return 0.5 * (M + M.T)

    def level(self, M: np.ndarray) -> float:
        """Return the smallest level, raised by what violations outside the unit block may cost.

        For a matrix that is all unit block that is its largest eigenvalue. Else M <= level E + rest (I - E), with the
        level by a Schur complement; the rest is paid for by `reach`. For a side condition the level is that price alone.

        Args:
            M: value of the condition.
        """
        inside = self.unit > 0
        if inside.all():
            # An eigenvalue is known to rounding only; a margin of that size is none.
            return float(np.linalg.eigvalsh(M)[-1] + ROUNDING * self.size * np.abs(M).max())
        outer = M[np.ix_(~inside, ~inside)]
        if not inside.any():
            return self.reach * max(float(np.linalg.eigvalsh(outer)[-1]), 0.0)
        values, vectors = np.linalg.eigh(outer)
        corner, beside = M[np.ix_(inside, inside)], M[np.ix_(inside, ~inside)] @ vectors
        rests = np.maximum(values[-1], 0.0) + PUSHES * (1.0 + float(np.abs(M).max()))
        schur = corner + (beside / (rests[:, None, None] - values)) @ beside.T
        return float((np.linalg.eigvalsh(schur)[:, -1] + self.reach * rests).min())


@dataclass(frozen=True)
class Relaxed:
    """Conditions that together imply  F <= level I  on a part of the box, and the number of unknowns they bring along.

    Args:
        conditions: one with a level, and side conditions.
        unknowns: number of entries of w.
    """

    conditions: tuple[Condition, ...]
    unknowns: int = 0

    def level(self, x: np.ndarray, w: np.ndarray) -> tuple[float, float]:
        """Return (level that these numbers prove for F on the part, size of the matrices they were read from).

        Args:
            x: decision variables with a one at the end.
            w: the relaxation's own unknowns.
        """
        total, size = 0.0, 0.0
        for condition in self.conditions:
            M = condition.value(x, w)
            total += condition.level(M)
            if condition.unit.any():
                size = max(size, float(np.abs(M).max()))
        return total, size

    @property
    def rows(self) -> int:
        """Number of rows of all matrices together."""
        return sum(c.size for c in self.conditions)


def plain(K: np.ndarray) -> Relaxed:
    """Return the condition that one matrix without further unknowns is at most level I.

    Args:
        K: numeric form, shape (n^2, nx + 1).
    """
    n = side(K)
    return Relaxed((Condition(n, K, None, np.ones(n)),))


def side(K: np.ndarray) -> int:
    """Return n of a numeric form with n^2 rows.

    Args:
        K: numeric form.
    """
    return round(np.sqrt(K.shape[0]))
