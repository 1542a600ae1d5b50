"""Gram matrices of polynomials with affine blocks for coefficients, on a normalised box.

A matrix polynomial is written as  F(s) = (m(s) x I)' G (m(s) x I)  with monomials m of half its degree, on the box [-1, 1]^p.
G is not unique: what vanishes identically in that product is free, and a relaxation is only as tight as the freedom it uses.
"""

from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np

from luenberger.algebra import Polynomial
from luenberger.algebra.polynomial import Exponents
from luenberger.core import BadInput
from luenberger.lmi.affine_block import Affine, Unknowns, assembled


def normalised(matrix: Polynomial, box: Mapping[str, tuple[float, float]]) -> Polynomial:
    """Return the polynomial over s in [-1, 1]^p, r = middle + half-width s, without parameters that do not vary.

    Args:
        matrix: polynomial of numeric forms.
        box: parameter name -> interval.

    Raises:
        BadInput: a parameter without an interval.
    """
    if missing := [n for n, d in matrix.degree.items() if d and n not in box]:
        raise BadInput(f"The box gives no interval for {missing}; it needs one for each of {matrix.names}.")
    inner: dict[str, Polynomial] = {}
    for name in [n for n, d in matrix.degree.items() if d]:
        lower, upper = (float(v) for v in box[name])
        middle, half = 0.5 * (lower + upper), 0.5 * (upper - lower)
        terms: dict[Exponents, Any] = {(0,): np.array([[middle]])}
        inner[name] = Polynomial((name,), terms | ({(1,): np.array([[half]])} if half else {}))
    return pruned(matrix.compose(inner))


def pruned(matrix: Polynomial) -> Polynomial:
    """Return the polynomial without terms whose numbers are all zero and without parameters that no term has.

    Args:
        matrix: polynomial of arrays.
    """
    terms = {e: c for e, c in matrix if np.any(c)}
    kept = [k for k in range(len(matrix.names)) if any(e[k] for e in terms)]
    if not terms:
        terms = {(0,) * len(matrix.names): next(iter(matrix.terms.values()))}
    return Polynomial([matrix.names[k] for k in kept], {tuple(e[k] for k in kept): c for e, c in terms.items()})


def monomials(caps: Sequence[int], total: int) -> list[Exponents]:
    """Return the exponents with every entry and their sum bounded, the constant first.

    Args:
        caps: largest exponent of each parameter.
        total: largest sum.
    """
    found = [e for e in product(*(range(c + 1) for c in caps)) if sum(e) <= total]
    return sorted(found, key=lambda e: (sum(e), tuple(-k for k in e)))


def added(left: Exponents, right: Exponents) -> Exponents:
    """Return the exponents of a product of monomials.

    Args:
        left: exponents.
        right: exponents.
    """
    return tuple(a + b for a, b in zip(left, right, strict=True))


def pairs(basis: Sequence[Exponents]) -> dict[Exponents, list[tuple[int, int]]]:
    """Return, for every product of two monomials, the pairs (a <= b) that give it.

    Args:
        basis: monomials.
    """
    found: dict[Exponents, list[tuple[int, int]]] = {}
    for a, left in enumerate(basis):
        for b in range(a, len(basis)):
            found.setdefault(added(left, basis[b]), []).append((a, b))
    return found


def gram(
    coefficients: Mapping[Exponents, Affine], basis: Sequence[Exponents], free: Unknowns, size: int, *, skew: bool
) -> Affine:
    """Return the Gram matrix of a symmetric matrix polynomial with all its freedom, or without the skew part of it.

    Args:
        coefficients: exponents -> symmetric block.
        basis: monomials m.
        free: gives the free blocks.
        size: N.
        skew: let block (a, b) differ from block (b, a) by a free skew matrix.

    Raises:
        BadInput: a coefficient that no product of two monomials reaches.
    """
    q = len(basis)
    blocks: list[list[Affine]] = [[free.zero(size)] * q for _ in range(q)]

    def put(a: int, b: int, block: Affine) -> None:
        blocks[a][b] = blocks[a][b] + block
        if a != b:
            blocks[b][a] = blocks[b][a] + block.T

    products = pairs(basis)
    if missing := set(coefficients) - set(products):
        raise BadInput(f"The monomials {list(basis)} give no product with exponents {sorted(missing)}; add monomials.")
    for exponents, places in products.items():
        # What the first pair takes is what the others leave.
        left = coefficients.get(exponents, free.zero(size))
        for a, b in places[1:]:
            other = free.symmetric(size)
            put(a, b, other)
            left = left + other * (-1.0 if a == b else -2.0)
        for a, b in places if skew else ():
            if a != b:
                put(a, b, free.skew(size))
        a, b = places[0]
        put(a, b, left * (1.0 if a == b else 0.5))
    return assembled(blocks)


def gram_freedom(basis: Sequence[Exponents], size: int, *, skew: bool) -> int:
    """Return the number of unknowns that `gram` takes.

    Args:
        basis: monomials.
        size: N.
        skew: as in `gram`.
    """
    found = 0
    for places in pairs(basis).values():
        found += (len(places) - 1) * size * (size + 1) // 2
        found += skew * sum(a != b for a, b in places) * size * (size - 1) // 2
    return found
