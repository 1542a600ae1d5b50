"""Endpoints of outward-rounded intervals: exact flint numbers, their precision, and where waves turn."""

import math
from collections.abc import Callable
from fractions import Fraction
from functools import wraps
from typing import Any, ParamSpec, TypeVar

import numpy as np
from flint import arb, ctx, fmpq

from luenberger.core import BadInput

PRECISION = 128

P = ParamSpec("P")
T = TypeVar("T")


class OutsideDomain(BadInput):
    """An operation is not defined on the whole interval it was given (division by zero, root of a negative number)."""


def at_working_precision(function: Callable[P, T]) -> Callable[P, T]:
    """Run `function` at 128 bits and leave flint's global precision as it was found.

    The precision is global to flint, so balls belong to one thread.
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


def rational(value: Any) -> fmpq:
    """Return the exact value of a float (that very double), integer, `Fraction` or flint rational.

    Raises:
        OutsideDomain: NaN or infinite.
        BadInput: not a real number.
    """
    if isinstance(value, fmpq):
        return value
    if isinstance(value, np.integer):
        value = int(value.item())
    if not isinstance(value, int | float | Fraction | np.floating):
        raise BadInput(
            f"{value!r} of type {type(value).__name__} is not a real number; give a float, int, Fraction or fmpq."
        )
    try:
        return fmpq(*value.as_integer_ratio())
    except (ValueError, OverflowError):
        raise OutsideDomain(f"{value} is not a finite number; a finite number is needed.") from None


def number(value: Any) -> arb:
    """Return a real number as a flint ball: exact for doubles, rounded outward where the precision does not hold it.

    Args:
        value: float, integer or rational.

    Raises:
        OutsideDomain: NaN or infinite.
        BadInput: not a real number.
    """
    return arb(value) if isinstance(value, float) and math.isfinite(value) else arb(rational(value))


PI = at_working_precision(arb.pi)()


def may_hold(lower: arb, upper: arb, phase: fmpq, period: int) -> bool:
    """False where no number (phase + period k) pi, k whole, lies in [lower, upper]; True may be a doubt."""
    last = ((upper / PI - phase) / period).upper().floor()
    return bool((PI * (last * period + phase)).upper() >= lower)


def wave(lower: arb, upper: arb, function: Callable[[arb], arb], crest: fmpq) -> tuple[arb, arb]:
    """Return the least and greatest value of sin or cos between two endpoints.

    Args:
        lower: left end.
        upper: right end.
        function: sin or cos.
        crest: place of one maximum, in units of pi.
    """
    left, right = function(lower), function(upper)
    high = arb(1) if may_hold(lower, upper, crest, 2) else min(max(left.upper(), right.upper()), arb(1))
    low = -arb(1) if may_hold(lower, upper, crest + 1, 2) else max(min(left.lower(), right.lower()), -arb(1))
    return low, high
