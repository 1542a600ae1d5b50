"""Relaxations with unknowns of their own: they see what a box says about products of parameters, and cost unknowns for it.

Both write F(s) as a quadratic form of (1, s_1, .., s_p) x I on the box [-1, 1]^p and subtract a matrix whose own form is known
to have one sign on the box: an unknown full block checked at the vertices, or one made from 1 - s_i^2 >= 0 with unknown weights.
"""

from dataclasses import dataclass
from itertools import product
from typing import Literal

import numpy as np

from luenberger.algebra import Polynomial
from luenberger.algebra.polynomial import Exponents
from luenberger.core import NotAccepted
from luenberger.lmi.affine_block import Affine, Unknowns, assembled, part
from luenberger.lmi.multiplier_lift import added, gram, gram_freedom, monomials, normalised
from luenberger.lmi.relaxation import Box
from luenberger.lmi.relaxed import Condition, Relaxed, plain, side


@dataclass(frozen=True)
class FullBlockMultiplier:
    """A full block V with G - V < 0, its form not positive at the vertices, and convex: so not positive on the box.

    Choose it for up to three parameters that enter quadratically; it has one side condition for each vertex. Without convexity,
    as printed, the vertices say nothing about the inside: 1 - 2 s^2 would be "below" -1 on [-1, 1]. So that is not offered.

    Assumes: F of total degree at most two.

    Args:
        convexity: "partial" asks it along each axis, V_ii >= 0, which is enough on a box; "full" asks it of the whole block
            of the parameters, which is harder to meet and needed on other polytopes only.

    Reference: Y. Wang, dissertation 2014, (5.47) to (5.50), with the convexity that is missing there.
    """

    convexity: Literal["partial", "full"] = "partial"

    def relaxed(self, matrix: Polynomial, box: Box) -> list[Relaxed]:
        """Return the conditions; see `Relaxation`.

        Args:
            matrix: polynomial of numeric forms.
            box: parameter name -> interval.

        Raises:
            NotAccepted: a term of degree three or more.
        """
        F = normalised(matrix, box)
        if not F.names:
            return [plain(next(iter(F.terms.values())))]
        if (highest := max(map(sum, F.terms))) > 2:
            raise NotAccepted(
                f"The inequality has a term of degree {highest}; a full block multiplier needs degree 2 at most. "
                "Use `StructuredMultiplier` or `Bernstein`."
            )
        n, p = side(next(iter(F.terms.values()))), len(F.names)
        q = p + 1
        free = Unknowns(next(iter(F.terms.values())).shape[1], q * n * (q * n + 1) // 2)
        V = free.symmetric(q * n)
        blocks = [[part(V, q, a, b) for b in range(q)] for a in range(q)]
        basis = monomials([1] * p, 1)
        G = gram({e: free.known(c) for e, c in F}, basis, free, n, skew=False)
        found = [_leading(G + V * -1.0, n, float(p))]
        for corner in product((-1.0, 1.0), repeat=p):
            point = (1.0, *corner)
            total = free.zero(n)
            for a, b in product(range(q), repeat=2):
                total = total + blocks[a][b] * (point[a] * point[b])
            found.append(_sided(total, 1.0))
        if self.convexity == "partial":
            found += [_sided(blocks[k][k] * -1.0, 1.0) for k in range(1, q)]
        else:
            inner = assembled([[blocks[a][b] * -1.0 for b in range(1, q)] for a in range(1, q)])
            found.append(_sided(inner, float(p)))
        return [Relaxed(tuple(found), free.count)]


@dataclass(frozen=True)
class StructuredMultiplier:
    """Unknown definite weights of 1 - s_i^2 >= 0, and the skew blocks whose form is zero: a matrix sum of squares.

    Choose it for four or more parameters, and for one parameter of any degree, where it is exact. Terms of degree above two are
    met by monomials of half the degree in the place of (1, s); for several parameters that grows fast, so consider `Bernstein`
    on a subdivision.

    Assumes: F of any degree.

    Args:
        skew: add the free skew blocks; without them the relaxation is the printed one, sound and looser.

    Reference: Y. Wang, dissertation 2014, (5.51) to (5.56), which lacks the skew blocks; for degrees above two, C. W. Scherer,
        C. W. J. Hol, Matrix sum-of-squares relaxations for robust semi-definite programs, Mathematical Programming 107, 2006.
    """

    skew: bool = True

    def relaxed(self, matrix: Polynomial, box: Box) -> list[Relaxed]:
        """Return the conditions; see `Relaxation`.

        Args:
            matrix: polynomial of numeric forms.
            box: parameter name -> interval.
        """
        F = normalised(matrix, box)
        if not F.names:
            return [plain(next(iter(F.terms.values())))]
        n = side(next(iter(F.terms.values())))
        basis, inner = lifted_bases(F)
        width = sum(len(m) * n * (len(m) * n + 1) // 2 for m in inner) + gram_freedom(basis, n, skew=self.skew)
        free = Unknowns(next(iter(F.terms.values())).shape[1], width)
        terms = {e: free.known(c) for e, c in F}
        weights = [free.symmetric(len(m) * n) for m in inner]
        for k, (weight, m) in enumerate(zip(weights, inner, strict=True)):
            # F + (1 - s_k^2) m' Gamma m is what has to be negative everywhere.
            for a, b in product(range(len(m)), repeat=2):
                exponents, block = added(m[a], m[b]), part(weight, len(m), a, b)
                raised = tuple(e + 2 * (j == k) for j, e in enumerate(exponents))
                terms[exponents] = terms[exponents] + block if exponents in terms else block
                terms[raised] = terms[raised] + block * -1.0 if raised in terms else block * -1.0
        M = gram(terms, basis, free, n, skew=self.skew)
        sides = [_sided(weight * -1.0, float(len(m))) for weight, m in zip(weights, inner, strict=True)]
        return [Relaxed((_leading(M, n, float(len(basis) - 1)), *sides), free.count)]


def lifted_bases(F: Polynomial) -> tuple[list[Exponents], list[list[Exponents]]]:
    """Return the monomials of half the degree of F, and for each parameter those that multiply its weight.

    Args:
        F: polynomial.
    """
    half = [-(-d // 2) for d in F.degree.values()]
    total = -(-max(map(sum, F.terms)) // 2)
    inner = [monomials([h - (j == k) for j, h in enumerate(half)], total - 1) for k in range(len(half))]
    return monomials(half, total), inner


def _leading(block: Affine, n: int, reach: float) -> Condition:
    size = round(np.sqrt(block.K.shape[0]))
    return Condition(size, block.K, block.W, (np.arange(size) < n).astype(float), reach)


def _sided(block: Affine, reach: float) -> Condition:
    size = round(np.sqrt(block.K.shape[0]))
    return Condition(size, block.K, block.W, np.zeros(size), reach)
