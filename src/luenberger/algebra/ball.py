"""Outward-rounded real arithmetic: an interval between two exact 128-bit endpoints (python-flint).

Endpoints are kept instead of flint's midpoint and 30-bit radius, so that wide intervals are not widened: sums and
products of a few doubles stay exact, and |3.33 cos(x)| <= 3.33 is provable as it stands, for the double 3.33.
"""

import math
from collections.abc import Callable
from fractions import Fraction
from functools import wraps
from typing import Any, TypeVar

import numpy as np
from flint import arb, ctx, fmpq, fmpz

from luenberger.algebra.endpoint import PRECISION, OutsideDomain, at_working_precision, may_hold, number, rational, wave
from luenberger.core import BadInput

T = TypeVar("T")
_NUMBERS = (int, float, fmpq, Fraction, np.integer, np.floating)
_ZERO = arb(0)


def _binary(function: Callable[["Ball", "Ball"], T]) -> Callable[["Ball", Any], T]:
    """Lift the right operand, or leave the operation to it (NumPy arrays, polynomials)."""
    elsewhere = at_working_precision(function)

    @wraps(function)
    def run(self: "Ball", other: Any) -> T:
        if not isinstance(other, Ball):
            if not isinstance(other, _NUMBERS):
                return NotImplemented
            other = Ball.exact(other)
        # One call fewer where the precision is right: this is where proofs spend their time.
        return function(self, other) if ctx.prec == PRECISION else elsewhere(self, other)

    return run


def _increasing(
    name: str, above: int | None = None, below: int | None = None, sense: int = 1
) -> Callable[["Ball"], "Ball"]:
    """Return a monotone function of flint as a method; its values are known to lie in [above, below]."""

    @at_working_precision
    def run(self: "Ball") -> "Ball":
        first, last = (self.low, self.high) if sense > 0 else (self.high, self.low)
        lower, upper = getattr(first, name)().lower(), getattr(last, name)().upper()
        if not (lower.is_finite() and upper.is_finite()):
            raise OutsideDomain(f"`{name}` of {self} has no finite value; it needs an argument inside its domain.")
        return Ball(
            lower if above is None else max(lower, arb(above)), upper if below is None else min(upper, arb(below))
        )

    run.__name__, run.__doc__ = name, f"Return the enclosure of {name}."
    return run


class Ball:
    """All real numbers between two exact endpoints; operations enclose every result.

    Comparisons answer True or False where that holds for all members, and None where members differ; None is falsy,
    so ``if a < b`` means "certainly below", but ``not a < b`` does not mean "at or above". A ball carries no identity:
    ``b * b`` encloses products of two independent members; use `square` for the square of one.

    Args:
        low: lower endpoint as a flint number; its own lower end counts where it has a radius.
        high: upper endpoint, not below `low`; use `Ball.exact` and `Ball.hull` to build balls from numbers.
    """

    __slots__ = ("high", "low")

    def __init__(self, low: arb, high: arb):
        # The one place where ends are rounded, outward at whatever precision: no operation can leave a radius behind.
        self.low = low if low.is_exact() else low.lower()
        self.high = high if high.is_exact() else high.upper()

    @staticmethod
    @at_working_precision
    def exact(value: Any) -> "Ball":
        """Enclose one number: a point where 128 bits hold it, else the tightest interval around it.

        Args:
            value: finite float, integer, `Fraction` or flint rational; a float means exactly that binary double.

        Raises:
            OutsideDomain: NaN or infinite.
        """
        point = number(value)
        return Ball(point, point)

    @staticmethod
    @at_working_precision
    def hull(lower: Any, upper: Any) -> "Ball":
        """Enclose all numbers from `lower` to `upper`.

        Args:
            lower: number, or a ball whose lower endpoint counts.
            upper: number not below `lower`, or a ball whose upper endpoint counts.

        Raises:
            OutsideDomain: NaN or infinite endpoint.
            BadInput: not a number, or lower > upper.
        """
        low = lower.low if isinstance(lower, Ball) else number(lower).lower()
        high = upper.high if isinstance(upper, Ball) else number(upper).upper()
        if low > high:
            raise BadInput(f"The interval [{lower}, {upper}] is inverted; lower <= upper is needed.")
        return Ball(low, high)

    @property
    def lower(self) -> float:
        """Largest double at or below the lower endpoint."""
        value = float(self.low)
        while arb(value) > self.low:
            value = math.nextafter(value, -math.inf)
        return value

    @property
    def upper(self) -> float:
        """Smallest double at or above the upper endpoint."""
        # Subtracted from zero, so that no bound reads -0.0.
        return 0.0 - (-self).lower

    @property
    def lower_exact(self) -> fmpq:
        """The lower endpoint as a rational."""
        return self.low.fmpq()

    @property
    def upper_exact(self) -> fmpq:
        """The upper endpoint as a rational."""
        return self.high.fmpq()

    @property
    def width(self) -> float:
        """Upper bound on the distance between the endpoints."""
        return (self - self).upper

    @property
    def is_point(self) -> bool:
        """True where both endpoints agree."""
        return bool(self.low == self.high)

    @at_working_precision
    def as_arb(self) -> arb:
        """Return a flint ball (midpoint and radius) that contains this interval, possibly a little wider."""
        return self.low.union(self.high)

    def contains(self, value: Any) -> bool:
        """True where `value`, taken exactly, lies between the endpoints (they count as inside)."""
        if isinstance(value, Ball):
            return bool(self.low <= value.low and value.high <= self.high)
        if isinstance(value, float) and not math.isfinite(value):
            return False
        return bool(self.lower_exact <= rational(value) <= self.upper_exact)

    def union(self, other: "Ball") -> "Ball":
        """Return the smallest interval that holds both."""
        return Ball(min(self.low, other.low), max(self.high, other.high))

    @_binary
    def __add__(self, other: "Ball") -> "Ball":
        return Ball(self.low + other.low, self.high + other.high)

    __radd__ = __add__

    @_binary
    def __sub__(self, other: "Ball") -> "Ball":
        return Ball(self.low - other.high, self.high - other.low)

    @_binary
    def __rsub__(self, other: "Ball") -> "Ball":
        return other - self

    @_binary
    def __mul__(self, other: "Ball") -> "Ball":
        a, b, c, d = self.low, self.high, other.low, other.high
        if a >= _ZERO:
            return Ball((a if c >= _ZERO else b) * c, (b if d >= _ZERO else a) * d)
        if b <= _ZERO:
            return Ball((b if d <= _ZERO else a) * d, (a if c <= _ZERO else b) * c)
        if c >= _ZERO:
            return Ball(a * d, b * d)
        if d <= _ZERO:
            return Ball(b * c, a * c)
        return Ball(min((a * d).lower(), (b * c).lower()), max((a * c).upper(), (b * d).upper()))

    __rmul__ = __mul__

    @_binary
    def __truediv__(self, other: "Ball") -> "Ball":
        a, b, c, d = self.low, self.high, other.low, other.high
        if c <= _ZERO <= d:
            raise OutsideDomain(f"{self} is divided by {other}, which contains zero; keep the divisor away from zero.")
        if d < _ZERO:
            a, b, c, d = -b, -a, -d, -c
        return Ball(a / (d if a >= _ZERO else c), b / (c if b >= _ZERO else d))

    @_binary
    def __rtruediv__(self, other: "Ball") -> "Ball":
        return other / self

    @at_working_precision
    def __neg__(self) -> "Ball":
        return Ball(-self.high, -self.low)

    def __pos__(self) -> "Ball":
        return self

    @at_working_precision
    def __abs__(self) -> "Ball":
        if self.low >= 0:
            return self
        return -self if self.high <= 0 else Ball(_ZERO, max(-self.low, self.high))

    def __pow__(self, exponent: Any) -> "Ball":
        return self.integer_pow(exponent) if isinstance(exponent, int) else self.power(exponent)

    @_binary
    def __lt__(self, other: "Ball") -> bool | None:
        return True if self.high < other.low else (False if self.low >= other.high else None)

    @_binary
    def __le__(self, other: "Ball") -> bool | None:
        return True if self.high <= other.low else (False if self.low > other.high else None)

    def __gt__(self, other: Any) -> bool | None:
        return (-self).__lt__(-other)

    def __ge__(self, other: Any) -> bool | None:
        return (-self).__le__(-other)

    @_binary
    def equals(self, other: "Ball") -> bool | None:
        """Answer self == other: True for equal points, False for disjoint intervals, else None."""
        if self.high < other.low or self.low > other.high:
            return False
        return True if self.is_point and other.is_point else None

    @_binary
    def maximum(self, other: "Ball") -> "Ball":
        """Return the enclosure of max(self, other)."""
        return Ball(max(self.low, other.low), max(self.high, other.high))

    @_binary
    def minimum(self, other: "Ball") -> "Ball":
        """Return the enclosure of min(self, other)."""
        return Ball(min(self.low, other.low), min(self.high, other.high))

    @at_working_precision
    def square(self) -> "Ball":
        """Return the enclosure of x * x for one x, never negative."""
        size = abs(self)
        return Ball(size.low * size.low, size.high * size.high)

    @at_working_precision
    def integer_pow(self, exponent: int) -> "Ball":
        """Return the enclosure of x**exponent for a whole exponent of either sign."""
        if exponent < 0:
            return 1 / self.integer_pow(-exponent)
        base = self if exponent % 2 else abs(self)
        power = fmpz(exponent)
        return Ball(base.low**power, base.high**power)

    def power(self, exponent: Any) -> "Ball":
        """Return the enclosure of x**y for x > 0, or for x >= 0 where y > 0."""
        y = exponent if isinstance(exponent, Ball) else Ball.exact(exponent)
        if self.low == 0 and y.low > 0:
            return self if self.high == 0 else Ball(_ZERO, Ball(self.high, self.high).power(y).high)
        return (y * self.log()).exp()

    exp = _increasing("exp", above=0)
    expm1 = _increasing("expm1", above=-1)
    log = _increasing("log")
    log1p = _increasing("log1p")
    sqrt = _increasing("sqrt", above=0)
    sinh = _increasing("sinh")
    tanh = _increasing("tanh", above=-1, below=1)
    atan = _increasing("atan")
    asin = _increasing("asin")
    acos = _increasing("acos", sense=-1)
    asinh = _increasing("asinh")
    acosh = _increasing("acosh", above=0)
    atanh = _increasing("atanh")
    erf = _increasing("erf", above=-1, below=1)
    floor = _increasing("floor")
    ceil = _increasing("ceil")
    sign = _increasing("sgn")

    @at_working_precision
    def trunc(self) -> "Ball":
        """Return the enclosure of the whole part, rounded towards zero."""
        return Ball(*((end.floor() if end >= _ZERO else end.ceil()) for end in (self.low, self.high)))

    def logistic(self) -> "Ball":
        """Return the enclosure of 1 / (1 + exp(-x))."""
        return ((self * 0.5).tanh() + 1) * 0.5

    def cosh(self) -> "Ball":
        """Return the enclosure of cosh."""
        return _cosh_of_size(abs(self))

    @at_working_precision
    def sin(self) -> "Ball":
        """Return the enclosure of sin; a crest or trough inside the interval gives exactly 1 or -1."""
        return Ball(*wave(self.low, self.high, arb.sin, fmpq(1, 2)))

    @at_working_precision
    def cos(self) -> "Ball":
        """Return the enclosure of cos; a crest or trough inside the interval gives exactly 1 or -1."""
        return Ball(*wave(self.low, self.high, arb.cos, fmpq(0)))

    @at_working_precision
    def tan(self) -> "Ball":
        """Return the enclosure of tan on an interval without a pole."""
        if may_hold(self.low, self.high, fmpq(1, 2), 1):
            raise OutsideDomain(
                f"tan of {self} meets a pole; the interval needs to lie between two odd multiples of pi/2."
            )
        return Ball(self.low.tan(), self.high.tan())

    @at_working_precision
    def atan2(self, x: "Ball") -> "Ball":
        """Return the enclosure of the angle of the points (x, self) on a box off the cut x <= 0, y = 0."""
        if x.low <= 0 and self.low <= 0 <= self.high and (x.high >= 0 or self.low < 0):
            raise OutsideDomain(
                f"atan2 of y = {self}, x = {x} meets its cut (y = 0, x <= 0); keep the point off the cut."
            )
        # Without the origin and the cut, the angle is monotone along every edge, so the corners hold both extremes.
        corners = [arb.atan2(s, t) for s in (self.low, self.high) for t in (x.low, x.high)]
        return Ball(min(c.lower() for c in corners), max(c.upper() for c in corners))

    @at_working_precision
    def rem(self, divisor: "Ball") -> "Ball":
        """Return the enclosure of x - c trunc(x / c), the remainder with the sign of x."""
        turns = (self / divisor).trunc()
        if turns.is_point:
            return self - divisor * turns
        size = min(abs(divisor).high, abs(self).high)
        return Ball(-size if self.low < _ZERO else _ZERO, size if self.high > _ZERO else _ZERO)

    def __repr__(self) -> str:
        return f"[{self.lower!r}, {self.upper!r}]"


_cosh_of_size = _increasing("cosh", above=1)
