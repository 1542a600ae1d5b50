"""What a polynomial is at most, at least and in range over the parameters that nobody measures.

A polynomial that is multi-affine in the hidden parameters is largest at one of their vertices; which one may change over
the box of the others. The functions here return the vertex values that are largest somewhere: at every point one of them
is the maximum, so an inequality that holds for each of them holds for the maximum.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np

from luenberger.algebra import Polynomial
from luenberger.algebra.polynomial import as_fmpq, fraction
from luenberger.core import NotAccepted

Box = Mapping[str, tuple[float, float]]
# More candidates mean that the box is too large to say which vertex is worst; a smaller box decides.
MOST_CANDIDATES = 4096
# Vertex values of float polynomials that differ by less, relative to their size, are one.
_SAME = 1e-12


def largest(scalar: Polynomial, hidden: Sequence[str], box: Box) -> list[Polynomial]:
    """Return the values of a scalar at those vertices of the hidden parameters where it is largest somewhere.

    Args:
        scalar: shape (1, 1), numeric coefficients (floats or exact rationals).
        hidden: parameters to maximise over.
        box: interval of every parameter.

    Raises:
        NotAccepted: a hidden parameter enters with a power above one.
    """
    return undominated(vertices(scalar, hidden, box), box)


def spread(scalar: Polynomial, hidden: Sequence[str], box: Box) -> list[Polynomial]:
    """Return largest minus smallest of a scalar over the hidden parameters; see `largest`."""
    values = vertices(scalar, hidden, box)
    tops, bottoms = undominated(values, box), undominated([-v for v in values], box)
    return undominated([top + bottom for top in tops for bottom in bottoms], box)


def size(scalar: Polynomial, hidden: Sequence[str], box: Box) -> list[Polynomial]:
    """Return the largest absolute value of a scalar over the hidden parameters; see `largest`."""
    values = vertices(scalar, hidden, box)
    return undominated([*values, *(-v for v in values)], box)


def vertices(value: Polynomial, hidden: Sequence[str], box: Box) -> list[Polynomial]:
    """Return the values of a matrix at all vertices of the hidden parameters that it depends on.

    Args:
        value: any shape.
        hidden: parameters to replace.
        box: their intervals.

    Raises:
        NotAccepted: a hidden parameter enters with a power above one, so that vertices prove nothing.
    """
    degree = value.degree
    names = [n for n in hidden if degree.get(n, 0)]
    if bent := [n for n in names if degree[n] > 1]:
        raise NotAccepted(
            f"The unmeasured {bent} enter with a power above one, so the largest drift is not at a vertex; introduce the power "
            "as a parameter of its own."
        )
    is_exact = any(getattr(c, "dtype", None) == np.dtype(object) for _, c in value)
    number: Callable[[Any], Any] = (lambda x: as_fmpq(fraction(x))) if is_exact else float
    idle = {n: number(0.0) for n in hidden if n in degree and n not in names}
    corners = product(*(box[n] for n in names))
    return [value.substitute(idle | {n: number(x) for n, x in zip(names, corner, strict=True)}) for corner in corners]


def undominated(values: Sequence[Polynomial], box: Box) -> list[Polynomial]:
    """Return those of some scalars that are largest somewhere on the box, as far as Bernstein coefficients can tell.

    Args:
        values: shape (1, 1) each.
        box: interval of every parameter.
    """
    kept: list[Polynomial] = []
    for value in values:
        if any(_at_most(value, other, box) for other in kept):
            continue
        kept = [other for other in kept if not _at_most(other, value, box)] + [value]
    return kept


def entry(value: Polynomial, i: int, j: int) -> Polynomial:
    """Return one entry as a polynomial of shape (1, 1), in any arithmetic.

    Args:
        value: the matrix.
        i: row.
        j: column.
    """
    rows, columns = value.shape

    def pick(coefficient: Any) -> Any:
        if isinstance(coefficient, np.ndarray):
            return coefficient[i : i + 1, j : j + 1]
        # Selection matrices work for decision variables too.
        return np.eye(1, rows, i) @ coefficient @ np.eye(columns, 1, -j)

    return value.map(pick)


def entrywise(value: Polynomial, candidates: Callable[[Polynomial], list[Polynomial]]) -> list[Polynomial]:
    """Return all matrices whose entries are candidates for the entries of a matrix.

    Args:
        value: the matrix.
        candidates: takes one entry.

    Raises:
        NotAccepted: more than `MOST_CANDIDATES` matrices.
    """
    places = [(i, j) for i in range(value.shape[0]) for j in range(value.shape[1])]
    cells = [candidates(entry(value, i, j)) for i, j in places]
    count = math.prod(map(len, cells))
    if count > MOST_CANDIDATES:
        raise NotAccepted(
            f"{count} vertices may be the worst one, more than {MOST_CANDIDATES}; cut the scheduling box into parts."
        )
    return [_assembled(places, choice, value) for choice in product(*cells)] if cells else [value]


def _at_most(one: Polynomial, other: Polynomial, box: Box) -> bool:
    gaps = [c[0, 0] for c in (other - one).bernstein(box).values()]
    if any(not isinstance(g, float) for g in gaps):
        return bool(all(g >= 0 for g in gaps))
    scale = max(abs(float(c[0, 0])) for p in (one, other) for c in p.bernstein(box).values())
    return bool(min(gaps) >= -_SAME * scale)


def _assembled(places: Sequence[tuple[int, int]], entries: Sequence[Polynomial], like: Polynomial) -> Polynomial:
    total: Polynomial | None = None
    for (i, j), scalar in zip(places, entries, strict=True):

        def place(c: np.ndarray, i: int = i, j: int = j) -> np.ndarray:
            out = np.zeros_like(c, shape=like.shape)
            out[i, j] = c[0, 0]
            return out

        placed = scalar.map(place)
        total = placed if total is None else total + placed
    assert total is not None
    return total
