"""The nonlinearity as scalar channels, each with its own multiplier, and the dissipation inequality they give.

With q = x - zeta = (I - L2 C) e - L2 N v, zeta = xhat + L2 (y - C xhat) and N the noise of y - D u, the mean value theorem,
row by row, gives  f(H x) - f(H zeta) = J H q  with every entry of J inside the Jacobian box. A fixed slope K is split off and
the rest written as one channel for every varying entry (i, j):

    e' = (A + F K H - L1 C) e + sum_k b_k w_k - L1 N v + ...,      w_k = g_k p_j(k),   p = H q,   l_k <= g_k <= u_k
    L1 = L + F K H L2,  so that what is injected is  L = L1 - F K H L2

Each channel keeps (w_k - l_k p_j)(u_k p_j - w_k) >= 0, however the channels move together. With one multiplier tau_j for all
channels of an argument, tau_j p_j = (tau_j h_j - Lb_j C) e - Lb_j N v is linear in tau_j and Lb_j = tau_j h_j L2.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import cvxpy as cp
import numpy as np

from luenberger.algebra import Polynomial, symmetric
from luenberger.core import NotAccepted
from luenberger.systems import System
from luenberger.systems.jacobian_box import as_floats

Shift = Literal["none", "lower"]
SMALLEST_SHARE = 1e-7


@dataclass(frozen=True)
class Channels:
    """Scalar channels in units in which the larger slope of each is one and its direction and argument are of like size.

    Args:
        directions: b, scaled, shape (nx, nk).
        arguments: h, scaled, shape (na, nx); only arguments that a channel reads.
        pick: one 1 in each row: which argument a channel reads, shape (nk, na).
        lower: scaled slopes l <= 0, shape (nk,).
        upper: scaled slopes u >= 0, shape (nk,).
        fixed: K, the slope split off, shape (nf, nz), in the units of f.
    """

    directions: Polynomial
    arguments: np.ndarray
    pick: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    fixed: np.ndarray

    @staticmethod
    def of(system: System, shift: Shift = "none") -> "Channels":
        """Read the channels from plant and Jacobian box.

        Args:
            system: plant whose nonlinearity has a Jacobian box.
            shift: "none" splits a slope off only where zero lies outside [l, u] (the end nearer to zero), "lower" always l.

        Raises:
            NotAccepted: no entry of the Jacobian varies, or none reaches the state.
        """
        lower, upper, H = jacobian_box(system)
        varying = lower < upper
        near = np.where(lower > 0, lower, np.where(upper < 0, upper, 0.0))
        fixed = np.where(varying, lower if shift == "lower" else near, lower)
        F = as_floats(system.F)
        hull = [np.asarray(c) for c in F.bernstein(system.scheduling_box).values()]
        found = []
        for i, j in np.argwhere(varying):
            ends = float(lower[i, j] - fixed[i, j]), float(upper[i, j] - fixed[i, j])
            size = max(-ends[0], ends[1])
            reach, length = max(float(np.linalg.norm(c[:, i])) for c in hull), float(np.linalg.norm(H[j]))
            if reach * length > 0:
                found.append((int(i), int(j), ends, size, size * reach / length))
        if not found:
            raise NotAccepted(
                f"No varying entry of the Jacobian of `{system.name}` reaches a state; write f into `A` and use "
                "`PolytopicLuenberger`."
            )
        read = sorted({j for _, j, *_ in found})
        # p_j in units s_j and w_k in units s_j max |g_k|: direction and argument then share the size of their product.
        unit = {j: 1 / np.sqrt(max(weight for _, k, _, _, weight in found if k == j)) for j in read}
        columns = np.zeros((lower.shape[0], len(found)))
        pick = np.zeros((len(found), len(read)))
        for k, (i, j, _, size, _) in enumerate(found):
            columns[i, k] = size * unit[j]
            pick[k, read.index(j)] = 1.0
        arguments = np.array([H[j] / unit[j] for j in read])
        low, high = (np.array([ends[e] / size for _, _, ends, size, _ in found]) for e in (0, 1))
        return Channels(F @ columns, arguments, pick, low, high, fixed)

    def behind(self, L2: Polynomial, C: Polynomial, box: Mapping[str, tuple[float, float]]) -> "Channels":
        """Return the channels behind a given L2: each with a multiplier of its own, in units that suit what L2 leaves to it.

        Args:
            L2: argument gain, (nx, ny).
            C: output matrix, (ny, nx).
            box: scheduling box.
        """
        own = self.pick @ self.arguments
        left = [np.asarray(c) for c in (own - own @ L2 @ C).bernstein(box).values()]
        share = np.max([np.linalg.norm(c, axis=1) for c in left], axis=0) / np.linalg.norm(own, axis=1)
        # An argument that is measured, all but rounding, would want a multiplier without end.
        unit = np.sqrt(np.maximum(share, SMALLEST_SHARE))
        one = np.eye(len(unit))
        return Channels(self.directions @ np.diag(unit), own / unit[:, None], one, self.lower, self.upper, self.fixed)

    @property
    def is_separate(self) -> bool:
        """True where one multiplier an argument is one a channel, and L2 moves all arguments freely."""
        one_each = self.pick.shape[0] == self.pick.shape[1]
        return one_each and row_space(self.arguments).shape[1] == len(self.arguments)

    @property
    def is_shifted(self) -> bool:
        """True where a slope was split off, so that what is injected is not L1."""
        return bool(np.any(self.fixed))

    def inequality(
        self,
        corner: Polynomial,
        PB: Polynomial,
        multipliers: Any,
        seen: Polynomial,
        driven: tuple[Polynomial, Polynomial, Any] | None = None,
    ) -> Polynomial:
        """Return the matrix over (e, w, inputs) that must be negative definite, squares of arguments by Schur complement.

        Args:
            corner: symmetric part of e alone, (nx, nx).
            PB: storage times directions, (nx, nk).
            multipliers: tau, one for each argument, shape (na, 1).
            seen: tau_j times argument j as a function of e, (na, nx).
            driven: for inputs of the error their columns in the rows of e, (nx, nw), in tau times the arguments,
                (na, nw), and the squared gain; None without inputs.
        """
        each = self.pick @ multipliers
        middle, squares = 0.5 * (self.lower + self.upper), self.pick.T @ (-self.lower * self.upper)
        bent = np.flatnonzero(squares > 0)
        mean, root = middle[:, None] * self.pick, np.diag(np.sqrt(squares))[bent]
        first, second = [corner, PB + (mean @ seen).T], [diagonal(-each)]
        third: list[Any] = []
        if driven is not None:
            columns, blurred, squared = driven
            first, second = [*first, columns], [*second, mean @ blurred]
            third = [Polynomial.constant(-squared * np.eye(columns.shape[1]))]
        rows = [first, second, *([third] if third else [])]
        if bent.size:
            beside = [(root @ seen).T, 0, *([] if driven is None else [(root @ driven[1]).T])]
            rows = [[*row, extra] for row, extra in zip(rows, beside, strict=True)]
            rows.append([diagonal(-(np.eye(len(squares))[bent] @ multipliers))])
        return symmetric(rows)


def jacobian_box(system: System) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (lower, upper, H) of the nonlinearity.

    Args:
        system: plant.

    Raises:
        NotAccepted: no nonlinearity, or one without Jacobian box.
    """
    f = system.nonlinearity
    if f is None:
        raise NotAccepted(f"`{system.name}` has no nonlinearity; use `PolytopicLuenberger`.")
    if f.jacobian_lower is None or f.jacobian_upper is None:
        raise NotAccepted(
            f"`{system.name}` has a Lipschitz bound but no Jacobian box; give `jacobian=(lower, upper)`, let "
            "`Nonlinearity.enclosed` prove one, or use `StructuredLipschitz`."
        )
    return np.asarray(f.jacobian_lower), np.asarray(f.jacobian_upper), np.asarray(f.H)


def row_space(arguments: np.ndarray) -> np.ndarray:
    """Return orthonormal columns that span the rows of a matrix, shape (nx, rank).

    Args:
        arguments: shape (na, nx).
    """
    _, sizes, rows = np.linalg.svd(arguments)
    return rows[: int((sizes > 1e-9 * sizes[0]).sum())].T


def diagonal(entries: Any) -> Polynomial:
    """Return the diagonal matrix of affine expressions or numbers.

    Args:
        entries: column, shape (n, 1) with n > 0.
    """
    n = entries.shape[0]
    if isinstance(entries, np.ndarray):
        return Polynomial.constant(np.diag(entries[:, 0]))
    return Polynomial.constant(cp.multiply(np.eye(n), entries @ np.ones((1, n))))
