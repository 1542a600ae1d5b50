"""Outward-rounded real arithmetic: an interval between two exact 128-bit endpoints (python-flint).

Endpoints are kept instead of flint's midpoint and 30-bit radius, so that wide intervals are not widened: sums and
products of a few doubles stay exact, and |3.33 cos(x)| <= 3.33 is provable as it stands, for the double 3.33.
"""

import math
from collections.abc import Callable
from fractions import Fraction
from functools import wraps
from typing import Any, Concatenate, ParamSpec, TypeVar

import numpy as np
from flint import arb, ctx, fmpq, fmpz

from luenberger.core import BadInput

PRECISION = 128

P = ParamSpec("P")
S = TypeVar("S")
T = TypeVar("T")
_NUMBERS = (int, float, fmpq, Fraction, np.integer, np.floating)
_ONE = arb(1)


class OutsideDomain(BadInput):
    """An operation is not defined on the whole interval it was given (division by zero, root of a negative number)."""


def at_working_precision(function: Callable[P, T]) -> Callable[P, T]:
    """Run `function` at 128 bits and leave flint's global precision as it was found.

    A wrong precision would cost tightness only: flint rounds outward at any precision.
    """

    @wraps(function)
    def run(*args: P.args, **options: P.kwargs) -> T:
        found = ctx.prec
        if found == PRECISION:
            return function(*args, **options)
        ctx.prec = PRECISION
        try:
            return function(*args, **options)
        finally:
            ctx.prec = found

    return run


def _binary(function: Callable[["Ball", "Ball"], T]) -> Callable[["Ball", Any], T]:
    """Lift the right operand, or leave the operation to it (NumPy arrays, polynomials)."""
    inner = at_working_precision(function)

    @wraps(function)
    def run(self: "Ball", other: Any) -> T:
        if not isinstance(other, Ball):
            if not isinstance(other, _NUMBERS):
                return NotImplemented
            other = Ball.exact(other)
        return inner(self, other)

    return run


def _increasing(name: str, above: int | None = None, below: int | None = None, sense: int = 1) -> Callable[["Ball"], "Ball"]:
    """Return a monotone function of flint as a method; its values are known to lie in [above, below]."""

    @at_working_precision
    def run(self: "Ball") -> "Ball":
        first, last = (self._lower, self._upper) if sense > 0 else (self._upper, self._lower)
        lower, upper = getattr(first, name)().lower(), getattr(last, name)().upper()
        if not (lower.is_finite() and upper.is_finite()):
            raise OutsideDomain(f"`{name}` of {self} has no finite value; it needs an argument inside its domain.")
        return Ball(lower if above is None else lower.max(arb(above)), upper if below is None else upper.min(arb(below)))

    run.__name__, run.__doc__ = name, f"Return the enclosure of {name}."
    return run


class Ball:
    """All real numbers between two exact endpoints; operations enclose every result.

    Comparisons answer True or False where that holds for all members, and None where members differ; None is falsy,
    so ``if a < b`` means "certainly below", but ``not a < b`` does not mean "at or above". A ball carries no identity:
    ``b * b`` encloses products of two independent members; use `square` for the square of one.

    Args:
        lower: exact flint number.
        upper: exact flint number, not below `lower`.
    """

    __slots__ = ("_lower", "_upper")

    def __init__(self, lower: arb, upper: arb):
        self._lower = lower
        self._upper = upper

    @staticmethod
    def exact(value: Any) -> "Ball":
        """Enclose one number: a point where 128 bits hold it, else the tightest interval around it.

        Args:
            value: finite float, integer, `Fraction` or flint rational; a float means exactly that binary double.

        Raises:
            OutsideDomain: NaN or infinite.
        """
        return Ball.hull(value, value)

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
        low = lower._lower if isinstance(lower, Ball) else _number(lower).lower()
        high = upper._upper if isinstance(upper, Ball) else _number(upper).upper()
        if low > high:
            raise BadInput(f"The interval [{lower}, {upper}] is inverted; lower <= upper is needed.")
        return Ball(low, high)

    @property
    def lower(self) -> float:
        """Largest double at or below the lower endpoint."""
        value = float(self._lower)
        while arb(value) > self._lower:
            value = math.nextafter(value, -math.inf)
        return value

    @property
    def upper(self) -> float:
        """Smallest double at or above the upper endpoint."""
        return -(-self).lower

    @property
    def lower_exact(self) -> fmpq:
        """The lower endpoint as a rational."""
        return self._lower.fmpq()

    @property
    def upper_exact(self) -> fmpq:
        """The upper endpoint as a rational."""
        return self._upper.fmpq()

    @property
    def width(self) -> float:
        """Upper bound on the distance between the endpoints."""
        return (self - self).upper

    @property
    def is_point(self) -> bool:
        """True where both endpoints agree."""
        return bool(self._lower == self._upper)

    @at_working_precision
    def as_arb(self) -> arb:
        """Return a flint ball (midpoint and radius) that contains this interval, possibly a little wider."""
        return self._lower.union(self._upper)

    def contains(self, value: Any) -> bool:
        """True where `value`, taken exactly, lies between the endpoints (they count as inside)."""
        if isinstance(value, Ball):
            return bool(self._lower <= value._lower and value._upper <= self._upper)
        if isinstance(value, float | np.floating) and not math.isfinite(value):
            return False
        number = fmpq(*value.as_integer_ratio()) if isinstance(value, float | Fraction | np.floating) else value
        return bool(self.lower_exact <= number <= self.upper_exact)

    def union(self, other: "Ball") -> "Ball":
        """Return the smallest interval that holds both."""
        return Ball(min(self._lower, other._lower), max(self._upper, other._upper))

    @_binary
    def __add__(self, other: "Ball") -> "Ball":
        return Ball((self._lower + other._lower).lower(), (self._upper + other._upper).upper())

    __radd__ = __add__

    @_binary
    def __sub__(self, other: "Ball") -> "Ball":
        return Ball((self._lower - other._upper).lower(), (self._upper - other._lower).upper())

    @_binary
    def __rsub__(self, other: "Ball") -> "Ball":
        return other - self

    @_binary
    def __mul__(self, other: "Ball") -> "Ball":
        a, b, c, d = self._lower, self._upper, other._lower, other._upper
        if a >= 0:
            return Ball(((a if c >= 0 else b) * c).lower(), ((b if d >= 0 else a) * d).upper())
        if b <= 0:
            return Ball(((b if d <= 0 else a) * d).lower(), ((a if c <= 0 else b) * c).upper())
        if c >= 0:
            return Ball((a * d).lower(), (b * d).upper())
        if d <= 0:
            return Ball((b * c).lower(), (a * c).upper())
        return Ball(min((a * d).lower(), (b * c).lower()), max((a * c).upper(), (b * d).upper()))

    __rmul__ = __mul__

    @_binary
    def __truediv__(self, other: "Ball") -> "Ball":
        a, b, c, d = self._lower, self._upper, other._lower, other._upper
        if c <= 0 <= d:
            raise OutsideDomain(f"{self} is divided by {other}, which contains zero; keep the divisor away from zero.")
        if d < 0:
            a, b, c, d = -b, -a, -d, -c
        return Ball((a / (d if a >= 0 else c)).lower(), (b / (c if b >= 0 else d)).upper())

    @_binary
    def __rtruediv__(self, other: "Ball") -> "Ball":
        return other / self

    def __neg__(self) -> "Ball":
        return Ball(-self._upper, -self._lower)

    def __pos__(self) -> "Ball":
        return self

    def __abs__(self) -> "Ball":
        if self._lower >= 0:
            return self
        return -self if self._upper <= 0 else Ball(arb(0), max(-self._lower, self._upper))

    def __pow__(self, exponent: Any) -> "Ball":
        return self.integer_pow(exponent) if isinstance(exponent, int | np.integer) else self.power(exponent)

    @_binary
    def __lt__(self, other: "Ball") -> bool | None:
        return True if self._upper < other._lower else (False if self._lower >= other._upper else None)

    @_binary
    def __le__(self, other: "Ball") -> bool | None:
        return True if self._upper <= other._lower else (False if self._lower > other._upper else None)

    def __gt__(self, other: Any) -> bool | None:
        return (-self).__lt__(-other)

    def __ge__(self, other: Any) -> bool | None:
        return (-self).__le__(-other)

    @_binary
    def equals(self, other: "Ball") -> bool | None:
        """Answer self == other: True for equal points, False for disjoint intervals, else None."""
        if self._upper < other._lower or self._lower > other._upper:
            return False
        return True if self.is_point and other.is_point else None

    @_binary
    def maximum(self, other: "Ball") -> "Ball":
        """Return the enclosure of max(self, other)."""
        return Ball(max(self._lower, other._lower), max(self._upper, other._upper))

    @_binary
    def minimum(self, other: "Ball") -> "Ball":
        """Return the enclosure of min(self, other)."""
        return Ball(min(self._lower, other._lower), min(self._upper, other._upper))

    @at_working_precision
    def square(self) -> "Ball":
        """Return the enclosure of x * x for one x, never negative."""
        size = abs(self)
        return Ball((size._lower * size._lower).lower(), (size._upper * size._upper).upper())

    @at_working_precision
    def integer_pow(self, exponent: int) -> "Ball":
        """Return the enclosure of x**exponent for a whole exponent of either sign."""
        if exponent < 0:
            return 1 / self.integer_pow(-exponent)
        base = self if exponent % 2 else abs(self)
        power = fmpz(int(exponent))
        return Ball((base._lower**power).lower(), (base._upper**power).upper())

    def power(self, exponent: Any) -> "Ball":
        """Return the enclosure of x**y for x > 0, or for x >= 0 where y > 0."""
        y = exponent if isinstance(exponent, Ball) else Ball.exact(exponent)
        if self._lower == 0 and y._lower > 0:
            return self if self._upper == 0 else Ball(arb(0), Ball(self._upper, self._upper).power(y)._upper)
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

    def logistic(self) -> "Ball":
        """Return the enclosure of 1 / (1 + exp(-x))."""
        return ((self * 0.5).tanh() + 1) * 0.5

    def cosh(self) -> "Ball":
        """Return the enclosure of cosh."""
        return _cosh_of_size(abs(self))

    @at_working_precision
    def sin(self) -> "Ball":
        """Return the enclosure of sin; a crest or trough inside the interval gives exactly 1 or -1."""
        return _wave(self._lower, self._upper, arb.sin, fmpq(1, 2))

    @at_working_precision
    def cos(self) -> "Ball":
        """Return the enclosure of cos; a crest or trough inside the interval gives exactly 1 or -1."""
        return _wave(self._lower, self._upper, arb.cos, fmpq(0))

    @at_working_precision
    def tan(self) -> "Ball":
        """Return the enclosure of tan on an interval without a pole."""
        if _may_hold(self._lower, self._upper, fmpq(1, 2), 1):
            raise OutsideDomain(f"tan of {self} meets a pole; the interval needs to lie between two odd multiples of pi/2.")
        return Ball(self._lower.tan().lower(), self._upper.tan().upper())

    @at_working_precision
    def atan2(self, x: "Ball") -> "Ball":
        """Return the enclosure of the angle of the point (x, self) on a box that does not meet the cut x <= 0, y = 0."""
        if x._lower <= 0 and self._lower <= 0 <= self._upper and (x._upper >= 0 or self._lower < 0):
            raise OutsideDomain(f"atan2 of y = {self}, x = {x} meets its cut (y = 0, x <= 0); keep the point off the cut.")
        # Without the origin and the cut, the angle is monotone along every edge, so the corners hold both extremes.
        corners = [arb.atan2(s, t) for s in (self._lower, self._upper) for t in (x._lower, x._upper)]
        return Ball(min(c.lower() for c in corners), max(c.upper() for c in corners))

    @at_working_precision
    def rem(self, divisor: "Ball") -> "Ball":
        """Return the enclosure of x - c trunc(x / c), the remainder with the sign of x."""
        turns = self / divisor
        turns = turns.floor() if turns._lower >= 0 else turns.ceil() if turns._upper <= 0 else turns.floor().union(turns.ceil())
        if turns.is_point:
            return self - divisor * turns
        size = min(abs(divisor)._upper, abs(self)._upper)
        return Ball(-size if self._lower < 0 else arb(0), size if self._upper > 0 else arb(0))

    def __repr__(self) -> str:
        return f"[{self.lower!r}, {self.upper!r}]"


def _number(value: Any) -> arb:
    if isinstance(value, float | np.floating):
        if not math.isfinite(value):
            raise OutsideDomain(f"{value} is not a finite number; an endpoint needs to be finite.")
        return arb(float(value))
    if isinstance(value, Fraction):
        return arb(fmpq(value.numerator, value.denominator))
    if isinstance(value, fmpq):
        return arb(value)
    if isinstance(value, int | np.integer):
        return arb(fmpz(int(value)))
    raise BadInput(f"{value!r} of type {type(value).__name__} is not a real number; give a float, int, Fraction or fmpq.")


_cosh_of_size = _increasing("cosh", above=1)


def _may_hold(lower: arb, upper: arb, phase: fmpq, period: int) -> bool:
    """False where no number (phase + period k) pi, k whole, lies in [lower, upper]; True may be a doubt."""
    last = ((upper / arb.pi() - phase) / period).upper().floor()
    return bool((arb.pi() * (last * period + phase)).upper() >= lower)


def _wave(lower: arb, upper: arb, function: Callable[[arb], arb], crest: fmpq) -> Ball:
    left, right = function(lower), function(upper)
    high = _ONE if _may_hold(lower, upper, crest, 2) else max(left.upper(), right.upper()).min(_ONE)
    low = -_ONE if _may_hold(lower, upper, crest + 1, 2) else min(left.lower(), right.lower()).max(-_ONE)
    return Ball(low, high)
