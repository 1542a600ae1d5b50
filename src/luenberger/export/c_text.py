"""C expressions as a scalar arithmetic: a `Trace` evaluated in it writes one line of C99 for every operation."""

import math
from collections.abc import Callable, Mapping
from typing import Any

# What C and JAX call the same function, beside the name of the operation.
_LIBRARY = {
    "sqrt": "sqrt",
    "cbrt": "cbrt",
    "exp": "exp",
    "exp2": "exp2",
    "expm1": "expm1",
    "log": "log",
    "log1p": "log1p",
    "sin": "sin",
    "cos": "cos",
    "tan": "tan",
    "asin": "asin",
    "acos": "acos",
    "atan": "atan",
    "atan2": "atan2",
    "sinh": "sinh",
    "cosh": "cosh",
    "tanh": "tanh",
    "asinh": "asinh",
    "acosh": "acosh",
    "atanh": "atanh",
    "erf": "erf",
    "floor": "floor",
    "ceil": "ceil",
    "pow": "pow",
    "rem": "fmod",
    "abs": "fabs",
}
# These become one machine instruction or none; the others call the mathematical library.
_INLINE = ("fabs", "sqrt", "floor", "ceil")
_INFIX = {"add": "+", "sub": "-", "mul": "*", "div": "/"}
_COMPARISONS = {"eq": "==", "ne": "!=", "lt": "<", "le": "<=", "gt": ">", "ge": ">="}
_LOGIC = {"and": "&&", "or": "||"}


class CText:
    """Writes C99 for `Trace.run`; a scalar is a C expression without side effects.

    Every real operation becomes one `const` local, so the compiler sees static single assignment, and the text rounds as the traced
    operations do. Comparisons are kept as expressions inside the lines that use them.

    Args:
        real: "double" or "float".
    """

    def __init__(self, real: str):
        self.real = real
        self.suffix = "f" if real == "float" else ""
        self.lines: list[str] = []
        self.calls: set[str] = set()
        self.operations = 0
        self.functions: Mapping[str, Callable[..., str]] = {
            **{name: lambda a, b, s=sign: self.line(f"{a} {s} {b}") for name, sign in _INFIX.items()},
            **{name: lambda *xs, c=call: self.call(c, *xs) for name, call in _LIBRARY.items()},
            **{name: lambda a, b, s=sign: self.truth(f"{a} {s} {b}") for name, sign in _COMPARISONS.items()},
            **{name: lambda a, b, s=sign: self.truth(f"{a} {s} {b}") for name, sign in _LOGIC.items()},
            "xor": lambda a, b: self.truth(f"{a} != {b}"),
            "not": lambda a: self.truth(f"!{a}"),
            "neg": lambda a: self.line(f"-{a}"),
            "square": lambda a: self.line(f"{a} * {a}"),
            "rsqrt": lambda a: self.line(f"{self.constant(1.0)} / {self.call('sqrt', a)}"),
            "sign": self._sign,
            "max": lambda a, b: self._extreme(">", a, b),
            "min": lambda a, b: self._extreme("<", a, b),
            "integer_pow": self._power,
            "logistic": lambda a: self.line(
                f"{self.constant(1.0)} / ({self.constant(1.0)} + {self.call('exp', self.line(f'-{a}'))})"
            ),
            "is_nan": lambda a: self.truth(f"{a} != {a}"),
            "is_finite": lambda a: self.truth(f"({a} - {a}) == {self.constant(0.0)}"),
        }

    def line(self, expression: str) -> str:
        """Add a local of this value and return its name.

        Args:
            expression: C.
        """
        self.operations += 1
        name = f"t{len(self.lines)}"
        self.lines.append(f"const {self.real} {name} = {expression};")
        return name

    def truth(self, expression: str) -> str:
        """Add a truth value and return its name.

        Args:
            expression: C.
        """
        name = f"p{len(self.lines)}"
        self.lines.append(f"const int {name} = {expression};")
        return name

    def call(self, function: str, *operands: str) -> str:
        """Add a call and return the name of its value.

        Args:
            function: of <math.h>, its name for doubles.
            operands: C.
        """
        if function not in _INLINE:
            self.calls.add(function + self.suffix)
        return self.line(f"{function}{self.suffix}({', '.join(operands)})")

    def constant(self, value: float) -> str:
        """Return a literal that reads back as the same number; what is not finite by its macro.

        Args:
            value: the number.
        """
        if value != value:
            return f"({self.real})NAN"
        if math.isinf(value):
            return f"({'-' * (value < 0)}({self.real})INFINITY)"
        text = repr(float(value))
        text = text if any(c in text for c in ".e") else f"{text}.0"
        text = f"{text}{self.suffix}"
        return f"({text})" if text.startswith("-") else text

    def select(self, predicate: Any, when_true: Any, when_false: Any) -> str:
        """Return the chosen value; both are computed, as in JAX."""
        return self.line(f"{predicate} ? {when_true} : {when_false}")

    def _extreme(self, sign: str, a: str, b: str) -> str:
        # As in JAX a NaN on either side is the result; fmax would drop it.
        return self.line(f"({a} {sign} {b} || {a} != {a}) ? {a} : {b}")

    def _sign(self, a: str) -> str:
        zero, one = self.constant(0.0), self.constant(1.0)
        return self.line(f"{a} > {zero} ? {one} : ({a} < {zero} ? {self.constant(-1.0)} : {a})")

    def _power(self, a: str, exponent: int) -> str:
        base, left, total = a, abs(exponent), ""
        while left:
            if left & 1:
                total = base if not total else self.line(f"{total} * {base}")
            left >>= 1
            if left:
                base = self.line(f"{base} * {base}")
        total = total or self.constant(1.0)
        return total if exponent >= 0 else self.line(f"{self.constant(1.0)} / {total}")


def in_comment(text: str) -> str:
    """Return text that neither ends a C comment nor begins one inside, on one line.

    Args:
        text: what users wrote: names, units.
    """
    return " ".join(text.replace("*/", "* /").replace("/*", "/ *").splitlines())
