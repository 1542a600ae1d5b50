"""The Van der Pol oscillator on a square, with the box, a hull or the Lipschitz constant of its nonlinearity."""

from collections.abc import Sequence
from fractions import Fraction
from itertools import pairwise
from math import inf, isfinite, isqrt, nextafter
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from luenberger.core import BadInput
from luenberger.systems import Nonlinearity, System

# Gains as printed, (5.62).
PRINTED_GAIN, PRINTED_ARGUMENT_GAIN = np.array([[17.5846], [63.8993]]), np.array([[0.3639], [0.6864]])
# Contacts of a finer polygon are hardly apart from each other any more.
_MOST_SIDES = 4096


def van_der_pol(radius: float, *, hull: Any = None, lipschitz: bool = False, mu: float = 1.0) -> System:
    """Return the oscillator x1' = x2, x2' = -x1 + mu (1 - x1^2) x2 with its position measured.

    The limit cycle for mu = 1 stays within |x1| <= 2.01, |x2| <= 2.68. Bounds are those of |x| <= radius, rounded outward.

    Args:
        radius: r; the nonlinearity is bounded for |x1|, |x2| <= r.
        hull: matrices, shape (nk, 1, 2), whose convex hull is said to hold the Jacobian (-2 mu x1 x2, mu (1 - x1^2)), as
            `tangent_polygon` gives for mu = 1; left out: its box, [-2 r^2, 2 r^2] and [1 - r^2, 1] times mu.
        lipschitz: give the Lipschitz constant on the square alone, mu max(1, sqrt(4 r^4 + (1 - r^2)^2)).
        mu: strength of the damping, positive.

    Raises:
        BadInput: radius or mu not positive, or a hull beside `lipschitz`.

    Reference: Y. Wang, dissertation 2014, (5.57) to (5.61).

    Example:
        >>> from luenberger.experiment.published.van_der_pol import van_der_pol
        >>> van_der_pol(5.0).nonlinearity.jacobian_lower.tolist()
        [[-50.0, -24.0]]
    """
    r, m = _positive("radius", radius), _positive("mu", mu)
    if hull is not None and lipschitz:
        raise BadInput("`hull` and `lipschitz` both bound the nonlinearity; give one of them.")

    def damping(z: Any, u: Any) -> jax.Array:
        return jnp.stack([mu * (1.0 - z[0] ** 2) * z[1]])

    bounds: dict[str, Any] = {"hull": hull}
    if lipschitz:
        # |J|^2 = 4 s r^2 + (1 - s)^2 is convex in s = x1^2, so that one end of [0, r^2] has the largest.
        bounds = {"lipschitz": _root_above(m**2 * max(Fraction(1), 4 * r**4 + (1 - r**2) ** 2))}
    elif hull is None:
        lower, upper = (-2 * r**2 * m, (1 - r**2) * m), (2 * r**2 * m, m)
        bounds = {"jacobian": ([[_below(v) for v in lower]], [[_above(v) for v in upper]])}
    square = np.full(2, -float(radius)), np.full(2, float(radius))
    return System.nonlinear(
        [[0.0, 1.0], [-1.0, 0.0]],
        C=[[1.0, 0.0]],
        F=[[0.0], [1.0]],
        nonlinearity=Nonlinearity.bounded(damping, np.eye(2), domain=square, **bounds),
        states=("position", "velocity"),
        outputs=("position_sensor",),
        name=f"Van der Pol oscillator on |x| <= {radius:g}",
    )


def tangent_polygon(radius: float, sides: int) -> np.ndarray:
    """Return matrices whose convex hull holds every Jacobian (-2 x1 x2, 1 - x1^2) of the oscillator with |x1|, |x2| <= r.

    With q = |x1| and s = q^2 = 1 - g2 the Jacobians (g1, g2) fill the set |g1| <= 2 r sqrt(s), 0 <= s <= r^2. For every
    t > 0 the mean of t and s / t is at least sqrt(s), so r (t + s / t) >= 2 r sqrt(s): the lines g1 = +-r (t + s / t),
    tangents at s = t^2, bound the set from outside. Neighbours t, t' meet at s = t t' in g1 = r (t + t'), the first at
    s = 0 in g1 = r t, the last, t = r, at s = r^2 in g1 = 2 r^2. These are the vertices, t a multiple of r / n,
    n = (sides - 2) / 2. In floats g2 is rounded first (the last one down), and g1 then up from the larger of both tangents
    at that very g2; between neighbours the chord of the raised ends stays above their common tangent.

    Args:
        radius: r, the half side of the square.
        sides: number of sides, which is the number of vertices; even, 4 to 4096.

    Returns:
        Vertices in order around the polygon, shape (sides, 1, 2).

    Raises:
        BadInput: radius not positive, or a number of sides that is odd or out of range.

    Example:
        >>> from luenberger.experiment.published.van_der_pol import tangent_polygon
        >>> tangent_polygon(1.0, 4)[:, 0].tolist()
        [[1.0, 1.0], [2.0, 0.0], [-2.0, 0.0], [-1.0, 1.0]]
    """
    r = _positive("radius", radius)
    if sides % 2 or not 4 <= sides <= _MOST_SIDES:
        raise BadInput(
            f"`sides` is {sides}; an even number from 4 to {_MOST_SIDES} is needed, half of them on each side."
        )
    count = sides // 2 - 1
    # Where the lines touch matters for tightness only, so these need not be rounded with care.
    touches = [Fraction(k * radius / count) for k in range(1, count)] + [r]
    right = [(_above(_tangent(r, touches[:1], Fraction(0))), 1.0)]
    for first, second in pairwise(touches):
        g2 = float(1 - first * second)
        right.append((_above(_tangent(r, [first, second], 1 - Fraction(g2))), g2))
    end = _below(1 - r**2)
    right.append((_above(_tangent(r, touches[-1:], 1 - Fraction(end))), end))
    left = [(-g1, g2) for g1, g2 in reversed(right)]
    return np.array(right + left)[:, None, :]


def _tangent(r: Fraction, touches: Sequence[Fraction], s: Fraction) -> Fraction:
    return max(r * (t + s / t) for t in touches)


def _above(exact: Fraction) -> float:
    """The least float that is not below."""
    near = float(exact)
    return near if Fraction(near) >= exact else nextafter(near, inf)


def _below(exact: Fraction) -> float:
    return 0.0 - _above(-exact)


def _root_above(exact: Fraction) -> float:
    """The float next to a bound of the square root with forty digits, rounded up."""
    scale = 1 << 120
    square = exact * scale * scale
    whole = -(-square.numerator // square.denominator)
    root = isqrt(whole)
    return _above(Fraction(root + (root * root < whole), scale))


def _positive(name: str, value: float) -> Fraction:
    if not (isfinite(value) and value > 0):
        raise BadInput(f"`{name}` is {value}; a finite number above zero is needed.")
    return Fraction(float(value))
