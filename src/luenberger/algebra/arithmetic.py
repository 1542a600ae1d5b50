"""Scalar arithmetics in which a JAX function can be read: plain floats and outward-rounded balls."""

# pyright: reportMissingTypeStubs=false, reportUnknownLambdaType=false, reportUnknownArgumentType=false
# pyright: reportUnknownVariableType=false, reportUnknownMemberType=false
import operator
from collections.abc import Callable, Mapping
from typing import Any, Protocol, runtime_checkable

import numpy as np
from scipy import special

from luenberger.algebra.ball import Ball
from luenberger.algebra.endpoint import OutsideDomain


@runtime_checkable
class Arithmetic(Protocol):
    """What a scalar type needs so that a `Trace` can be evaluated in it.

    `functions` maps operation names to functions of scalars: add, sub, mul, div, neg, abs, sign, max, min, square,
    integer_pow (scalar, int), pow, sqrt, rsqrt, exp, exp2, expm1, log, log1p, sin, cos, tan, asin, acos, atan, atan2,
    sinh, cosh, tanh, asinh, acosh, atanh, logistic, erf, floor, ceil, rem; eq, ne, lt, le, gt, ge, is_finite, is_nan
    give predicates; and, or, xor, not take them. An arithmetic may leave out what it does not know.
    """

    @property
    def functions(self) -> Mapping[str, Callable[..., Any]]:
        """Operation name -> function of scalars."""
        ...

    def constant(self, value: float) -> Any:
        """Return the scalar that stands for a double."""
        ...

    def select(self, predicate: Any, when_true: Any, when_false: Any) -> Any:
        """Return `when_true` where the predicate holds, else `when_false`; either may be an `OutsideDomain`."""
        ...


_FLOAT_FUNCTIONS: Mapping[str, Callable[..., Any]] = {
    "add": np.add,
    "sub": np.subtract,
    "mul": np.multiply,
    "div": np.divide,
    "neg": np.negative,
    "abs": np.abs,
    "sign": np.sign,
    "max": np.maximum,
    "min": np.minimum,
    "square": np.square,
    "integer_pow": lambda x, exponent: np.asarray(x)[()] ** exponent,
    "pow": np.power,
    "sqrt": np.sqrt,
    "rsqrt": lambda x: 1.0 / np.sqrt(x),
    "cbrt": np.cbrt,
    "exp": np.exp,
    "exp2": np.exp2,
    "expm1": np.expm1,
    "log": np.log,
    "log1p": np.log1p,
    "sin": np.sin,
    "cos": np.cos,
    "tan": np.tan,
    "asin": np.arcsin,
    "acos": np.arccos,
    "atan": np.arctan,
    "atan2": np.arctan2,
    "sinh": np.sinh,
    "cosh": np.cosh,
    "tanh": np.tanh,
    "asinh": np.arcsinh,
    "acosh": np.arccosh,
    "atanh": np.arctanh,
    "logistic": special.expit,
    "erf": special.erf,
    "floor": np.floor,
    "ceil": np.ceil,
    "rem": np.fmod,
    "eq": np.equal,
    "ne": np.not_equal,
    "lt": np.less,
    "le": np.less_equal,
    "gt": np.greater,
    "ge": np.greater_equal,
    "is_finite": np.isfinite,
    "is_nan": np.isnan,
    "and": np.logical_and,
    "or": np.logical_or,
    "xor": np.logical_xor,
    "not": np.logical_not,
}


class FloatArithmetic:
    """Doubles, or NumPy arrays of doubles that are evaluated side by side."""

    def __init__(self) -> None:
        self.functions = _FLOAT_FUNCTIONS

    def constant(self, value: float) -> np.float64:
        """Return the double itself."""
        return np.float64(value)

    def select(self, predicate: Any, when_true: Any, when_false: Any) -> Any:
        """Return the chosen value, entry by entry."""
        return np.where(predicate, when_true, when_false)[()]


def _negated(predicate: bool | None) -> bool | None:
    return None if predicate is None else not predicate


def _both(left: bool | None, right: bool | None) -> bool | None:
    if left is False or right is False:
        return False
    return None if left is None or right is None else True


def _differ(left: bool | None, right: bool | None) -> bool | None:
    return None if left is None or right is None else left is not right


class BallArithmetic:
    """Balls; predicates have the three values True, False and None.

    A branch whose predicate is undecided gives the hull of both sides. `steps` gathers the names of operations that may
    jump inside the interval they were given, so that a caller who needs continuity can tell.
    """

    def __init__(self) -> None:
        self.steps: set[str] = set()
        self.functions: Mapping[str, Callable[..., Any]] = {
            **_BALL_FUNCTIONS,
            **{name: self._stepping(name, step) for name, step in _BALL_STEPS.items()},
            "rem": self._remainder,
        }

    def constant(self, value: float) -> Ball:
        """Return the point of exactly this double."""
        return Ball.exact(value)

    def select(self, predicate: bool | None, when_true: Any, when_false: Any) -> Any:
        """Return the chosen side, or the hull of both where the predicate is undecided."""
        if predicate is not None:
            return when_true if predicate else when_false
        for side in (when_true, when_false):
            if isinstance(side, OutsideDomain):
                raise side
        if not when_true.equals(when_false):
            self.steps.add("a branch")
        return when_true.union(when_false)

    def _stepping(self, name: str, function: Callable[[Ball], Ball]) -> Callable[[Ball], Ball]:
        def run(x: Ball) -> Ball:
            result = function(x)
            if not result.is_point:
                self.steps.add(name)
            return result

        return run

    def _remainder(self, x: Ball, divisor: Ball) -> Ball:
        if not (x / divisor).trunc().is_point:
            self.steps.add("rem")
        return x.rem(divisor)


_BALL_FUNCTIONS: Mapping[str, Callable[..., Any]] = {
    "add": operator.add,
    "sub": operator.sub,
    "mul": operator.mul,
    "div": operator.truediv,
    "neg": operator.neg,
    "abs": operator.abs,
    "max": Ball.maximum,
    "min": Ball.minimum,
    "square": Ball.square,
    "integer_pow": Ball.integer_pow,
    "pow": Ball.power,
    "sqrt": Ball.sqrt,
    "rsqrt": lambda x: 1 / x.sqrt(),
    "exp": Ball.exp,
    "exp2": lambda x: Ball.exact(2).power(x),
    "expm1": Ball.expm1,
    "log": Ball.log,
    "log1p": Ball.log1p,
    "sin": Ball.sin,
    "cos": Ball.cos,
    "tan": Ball.tan,
    "asin": Ball.asin,
    "acos": Ball.acos,
    "atan": Ball.atan,
    "atan2": Ball.atan2,
    "sinh": Ball.sinh,
    "cosh": Ball.cosh,
    "tanh": Ball.tanh,
    "asinh": Ball.asinh,
    "acosh": Ball.acosh,
    "atanh": Ball.atanh,
    "logistic": Ball.logistic,
    "erf": Ball.erf,
    "eq": Ball.equals,
    "ne": lambda a, b: _negated(a.equals(b)),
    "lt": operator.lt,
    "le": operator.le,
    "gt": operator.gt,
    "ge": operator.ge,
    "is_finite": lambda x: True,
    "is_nan": lambda x: False,
    "and": _both,
    "or": lambda a, b: _negated(_both(_negated(a), _negated(b))),
    "xor": _differ,
    "not": _negated,
}

_BALL_STEPS: Mapping[str, Callable[[Ball], Ball]] = {"sign": Ball.sign, "floor": Ball.floor, "ceil": Ball.ceil}

FLOAT = FloatArithmetic()
BALL = BallArithmetic()
