"""The largest and the smallest drift of a plant over everything that nobody measures, in plain scalar operations.

Matrices that are multi-affine in the unknowns have their extremes at vertices. Unknowns that share no monomial are maximised
apart, so that two stiffnesses cost two comparisons and not four vertices; what a monomial couples is branched on. All of it
happens when the step is traced: what is left are sums, products and comparisons of scalars.
"""

import math
from collections import Counter
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp

# Evaluations of the drift a sub-step. The enclosure holds for any number, since what the truncated series leaves out is
# added; with four, that is less than a thousandth of what the state moves in a sub-step.
ORDER = 4
# Weights of the chained Euler steps whose sum is the Taylor polynomial of the exponential: T(z) = sum_k w_k (1 + z)^k. None is
# negative, which is why the sum keeps the order that every Euler step keeps.
WEIGHTS = [
    sum((-1) ** i / math.factorial(i) for i in range(ORDER - k + 1)) / math.factorial(k) for k in range(ORDER + 1)
]

# A scalar that is multi-affine in unknowns: the set of unknowns in a monomial -> its coefficient.
Terms = dict[frozenset[Hashable], Any]
Ends = Mapping[Hashable, tuple[Any, Any]]


@dataclass(frozen=True)
class Bounds:
    """Bounds of z, followed by those of how far C x has moved since the sample.

    Args:
        lower: nx + ny scalars.
        upper: nx + ny scalars.
    """

    lower: list[Any]
    upper: list[Any]


@dataclass(frozen=True)
class Drift:
    """The largest and smallest drift at one sample, as scalars in plain operations.

    Args:
        loop: (nx)(nx) terms of T (A - L C) T^-1.
        gain: (nx)(ny) entries of T L.
        motion: (ny)(nx) terms of C A T^-1.
        forcing: (nx + ny) terms of what does not depend on z.
        slack: (nx + ny) numbers.
        ends: unknown -> interval.
    """

    loop: list[list[Terms]]
    gain: list[list[Any]]
    motion: list[list[Terms]]
    forcing: list[Terms]
    slack: list[Any]
    ends: Ends

    @property
    def ny(self) -> int:
        """Number of outputs whose motion between samples counts."""
        return len(self.motion)

    def advance(self, start: Bounds, h: float, remainder: Any) -> Bounds:
        """Return the bounds one sub-step later.

        Args:
            start: bounds now.
            h: sub-step [s].
            remainder: what the series leaves out, per unit of |h slope|.
        """
        none = [jnp.zeros_like(b) for b in start.lower]

        def stage(carry: Any, weight: Any) -> tuple[Any, None]:
            here, total, fastest = Bounds(*carry[0]), Bounds(*carry[1]), carry[2]
            falling, rising = self.slopes(here)
            for side in (falling, rising):
                fastest = [jnp.maximum(f, jnp.abs(s)) for f, s in zip(fastest, side, strict=True)]
            here = _moved(here, falling, rising, h)
            total = _moved(total, here.lower, here.upper, weight)
            return ((here.lower, here.upper), (total.lower, total.upper), fastest), None

        total = _moved(Bounds(none, none), start.lower, start.upper, WEIGHTS[0])
        begin = ((start.lower, start.upper), (total.lower, total.upper), none)
        (_, (lower, upper), fastest), _ = jax.lax.scan(stage, begin, jnp.asarray(WEIGHTS[1:], none[0].dtype))
        left = self._left_out(start, fastest, h, remainder)
        return Bounds(
            [b - e for b, e in zip(lower, left, strict=True)], [b + e for b, e in zip(upper, left, strict=True)]
        )

    def slopes(self, bounds: Bounds) -> tuple[list[Any], list[Any]]:
        """Return the slopes of the lower and of the upper bounds."""
        nx = len(self.loop)
        moved = list(zip(bounds.lower[nx:], bounds.upper[nx:], strict=True))
        falling, rising = [], []
        for i, row in enumerate(self.loop):
            pushes = [[self.gain[i][o] * end for end in pair] for o, pair in enumerate(moved)]
            for side, sign, out in ((bounds.lower, -1.0, falling), (bounds.upper, 1.0, rising)):
                terms = self.forcing[i]
                for cell, z in zip(row, side[:nx], strict=True):
                    terms = plus(terms, times(cell, z))
                total = sign * largest(times(terms, sign), self.ends) + sign * self.slack[i]
                extreme = jnp.maximum if sign > 0 else jnp.minimum
                out.append(total + sum(extreme(*pair) for pair in pushes))
        ends = {**self.ends, **{("state", j): (bounds.lower[j], bounds.upper[j]) for j in range(nx)}}
        for o, row in enumerate(self.motion):
            terms = self.forcing[nx + o]
            for j, cell in enumerate(row):
                terms = plus(terms, {key | {("state", j)}: c for key, c in cell.items()})
            falling.append(-largest(times(terms, -1.0), ends) - self.slack[nx + o])
            rising.append(largest(terms, ends) + self.slack[nx + o])
        return falling, rising

    def _left_out(self, start: Bounds, fastest: list[Any], h: float, remainder: Any) -> list[Any]:
        """Bound what the Taylor polynomial of the true motion leaves out, from the fastest slope of its bounds."""
        slope = list(fastest)
        for i, row in enumerate(self.loop):
            # Where z lies inside its bounds the diagonal entry may add its share of the width to the slope.
            width = start.upper[i] - start.lower[i]
            slope[i] = slope[i] + jnp.maximum(largest(times(row[i], -1.0), self.ends), 0.0) * width
        table = jnp.asarray(remainder, slope[0].dtype)
        return [sum(table[i, j] * s for j, s in enumerate(slope)) * h for i in range(len(slope))]


def largest(terms: Terms, ends: Ends) -> Any:
    """Return the maximum of a multi-affine scalar over intervals of its unknowns.

    Args:
        terms: set of unknowns -> coefficient.
        ends: unknown -> (lower, upper), numbers or traced scalars.
    """
    total: Any = terms.get(frozenset(), 0.0)
    for part in _apart([key for key in terms if key]):
        count = Counter(name for key in part for name in sorted(key, key=str))
        name, _ = count.most_common(1)[0]
        values = []
        for end in ends[name]:
            left: Terms = {}
            for key in part:
                left = plus(left, {key - {name}: terms[key] * end if name in key else terms[key]})
            values.append(largest(left, ends))
        total = total + jnp.maximum(*values)
    return total


def _apart(keys: Sequence[frozenset[Hashable]]) -> list[list[frozenset[Hashable]]]:
    """Sort monomials into groups that share no unknown."""
    groups: list[list[frozenset[Hashable]]] = []
    for key in keys:
        touching = [g for g in groups if any(key & other for other in g)]
        groups = [g for g in groups if g not in touching] + [[k for g in touching for k in g] + [key]]
    return groups


def plus(left: Terms, right: Terms) -> Terms:
    """Return the sum of two multi-affine scalars.

    Args:
        left: monomials and coefficients.
        right: monomials and coefficients.
    """
    return left | {key: left[key] + c if key in left else c for key, c in right.items()}


def times(terms: Terms, factor: Any) -> Terms:
    """Return a multi-affine scalar times a known number.

    Args:
        terms: monomials and coefficients.
        factor: the number.
    """
    return {key: c * factor for key, c in terms.items()}


def _moved(start: Bounds, falling: list[Any], rising: list[Any], h: Any) -> Bounds:
    return Bounds(
        [b + h * s for b, s in zip(start.lower, falling, strict=True)],
        [b + h * s for b, s in zip(start.upper, rising, strict=True)],
    )
