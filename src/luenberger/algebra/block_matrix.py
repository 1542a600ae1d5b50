"""Block matrices of polynomials, the way a theorem prints them."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from luenberger.algebra.polynomial import Polynomial
from luenberger.core import BadInput


def symmetric(rows: Sequence[Sequence[Any]]) -> Polynomial:
    """Return the symmetric block matrix whose upper block triangle is given row by row.

    `symmetric([[a, b], [c]])` is [[a, b], [b.T, c]]; the number 0 stands for a zero block.

    Args:
        rows: rows of the upper block triangle, each one block shorter than the last.

    Raises:
        BadInput: no triangle, blocks that do not fit, or a block row whose size nothing tells.
    """
    lifted = [[*[None] * k, *map(_lifted, row)] for k, row in enumerate(rows)]
    if any(len(row) != len(lifted) for row in lifted):
        raise BadInput(f"Rows of {[len(row) for row in rows]} blocks make no triangle; each needs one block less.")
    columns = list(zip(*lifted, strict=True))
    sizes = [_size([*(b.T for b in columns[k] if b is not None), *lifted[k]], 0, f"Row {k}") for k in range(len(rows))]
    upper = block(lifted, sizes, sizes)
    strict = [[None if j <= i else item for j, item in enumerate(row)] for i, row in enumerate(lifted)]
    if all(item is None for row in strict for item in row):
        return upper
    return upper + block(strict, sizes, sizes).T


def block(rows: Sequence[Sequence[Any]], heights: Sequence[int] = (), widths: Sequence[int] = ()) -> Polynomial:
    """Return the block matrix of polynomials, matrices and zeros (the number 0, or None).

    Args:
        rows: blocks, row by row.
        heights: number of rows of each block row, found from the blocks where left out.
        widths: number of columns of each block column, found from the blocks where left out.

    Raises:
        BadInput: blocks that do not fit, or a block row or column whose size nothing tells.
    """
    lifted = [list(map(_lifted, row)) for row in rows]
    tall = list(heights) or [_size(row, 0, f"Row {k}") for k, row in enumerate(lifted)]
    wide = list(widths) or [_size(column, 1, f"Column {k}") for k, column in enumerate(zip(*lifted, strict=True))]
    total: Polynomial | None = None
    for i, row in enumerate(lifted):
        for j, item in enumerate(row):
            if item is None:
                continue
            if item.shape != (tall[i], wide[j]):
                raise BadInput(
                    f"Block ({i}, {j}) has shape {item.shape}; its row and column need {(tall[i], wide[j])}."
                )
            placed = item.map(_placer(sum(tall[:i]), sum(wide[:j]), sum(tall), sum(wide)))
            total = placed if total is None else total + placed
    if total is None:
        return Polynomial.constant(np.zeros((sum(tall), sum(wide))))
    return total


def _lifted(item: Any) -> Polynomial | None:
    return None if item is None or (isinstance(item, int) and item == 0) else Polynomial.constant(item)


def _size(items: Sequence[Polynomial | None], axis: int, what: str) -> int:
    for item in items:
        if item is not None:
            return item.shape[axis]
    raise BadInput(f"{what} of the block matrix holds zeros only, so its size is open; give one block as an array.")


def _placer(top: int, left: int, rows: int, columns: int) -> Callable[[Any], Any]:
    """Put a matrix of any arithmetic at (top, left) of a zero matrix."""

    def place(matrix: Any) -> Any:
        height, width = matrix.shape
        if type(matrix) is np.ndarray:
            out: Any = np.zeros_like(matrix, shape=(rows, columns))
            out[top : top + height, left : left + width] = matrix
            return out
        # Selection matrices work for every foreign matrix type, so cvxpy need not be known here.
        return np.eye(rows, height, -top) @ matrix @ np.eye(width, columns, left)

    return place
