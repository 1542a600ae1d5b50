"""Square blocks that are affine in the decision variables and in a multiplier's own unknowns, and matrices made of them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp


@dataclass(frozen=True)
class Affine:
    """vec(block) = K @ [x; 1] + W @ w, rows in C order.

    Args:
        K: shape (rows, nx + 1).
        W: shape (rows, nw).
    """

    K: np.ndarray
    W: sp.csr_array

    def __add__(self, other: "Affine") -> "Affine":
        return Affine(self.K + other.K, self.W + other.W)

    def __mul__(self, number: float) -> "Affine":
        return Affine(self.K * number, self.W * number)

    def at(self, rows: np.ndarray) -> "Affine":
        """Return some rows.

        Args:
            rows: their numbers, in the wanted order.
        """
        return Affine(self.K[rows], self.W[rows])

    @property
    def T(self) -> "Affine":
        """The transposed square block."""
        n = round(np.sqrt(self.K.shape[0]))
        return self.at(np.arange(n * n).reshape(n, n).T.ravel())


class Unknowns:
    """Counts a multiplier's own unknowns and makes blocks of them; the width is known once all are counted.

    Args:
        columns: nx + 1, width of K.
        width: nw, upper bound of the number of unknowns.
    """

    def __init__(self, columns: int, width: int):
        self.columns, self.width, self.count = columns, width, 0

    def symmetric(self, n: int) -> Affine:
        """Return a free symmetric block.

        Args:
            n: its size.
        """
        rows, columns = np.tril_indices(n)
        return self._made(n, [(rows, columns, 1.0), (columns, rows, 1.0)], len(rows))

    def skew(self, n: int) -> Affine:
        """Return a free skew-symmetric block.

        Args:
            n: its size.
        """
        rows, columns = np.tril_indices(n, -1)
        return self._made(n, [(rows, columns, 1.0), (columns, rows, -1.0)], len(rows))

    def zero(self, n: int) -> Affine:
        """Return the zero block.

        Args:
            n: its size.
        """
        return Affine(np.zeros((n * n, self.columns)), sp.csr_array((n * n, self.width)))

    def known(self, K: np.ndarray) -> Affine:
        """Return a block without unknowns.

        Args:
            K: numeric form.
        """
        return Affine(K, sp.csr_array((K.shape[0], self.width)))

    def _made(self, n: int, entries: list[tuple[np.ndarray, np.ndarray, float]], count: int) -> Affine:
        place = self.count + np.arange(count)
        self.count += count
        cells: dict[tuple[int, int], float] = {}
        for rows, columns, sign in entries:
            # A diagonal entry of a symmetric block is met twice and counts once.
            cells |= {(int(r) * n + int(c), int(k)): sign for r, c, k in zip(rows, columns, place, strict=True)}
        index = np.array(list(cells), dtype=int).reshape(-1, 2)
        W = sp.csr_array((np.array(list(cells.values())), (index[:, 0], index[:, 1])), shape=(n * n, self.width))
        return Affine(np.zeros((n * n, self.columns)), W)


def part(whole: Affine, blocks: int, a: int, b: int) -> Affine:
    """Return block (a, b) of a square block matrix.

    Args:
        whole: the matrix.
        blocks: number of its block rows.
        a: block row.
        b: block column.
    """
    side = round(np.sqrt(whole.K.shape[0]))
    n = side // blocks
    return whole.at((np.arange(a * n, (a + 1) * n)[:, None] * side + np.arange(b * n, (b + 1) * n)).ravel())


def assembled(blocks: Sequence[Sequence[Affine]]) -> Affine:
    """Return the square block matrix of square blocks of one size.

    Args:
        blocks: rows of blocks.
    """
    q, cells = len(blocks), blocks[0][0].K.shape[0]
    n = round(np.sqrt(cells))
    order = np.arange(q * q * cells).reshape(q, q, n, n).transpose(0, 2, 1, 3).ravel()
    flat = [block for row in blocks for block in row]
    W: Any = sp.vstack([f.W for f in flat], format="csr")
    return Affine(np.vstack([f.K for f in flat])[order], sp.csr_array(W[order]))
