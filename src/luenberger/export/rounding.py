"""How far two correct evaluations of a step in finite precision may lie apart: a bound from the operations, not from trials."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from luenberger.algebra.arithmetic import BallArithmetic
from luenberger.algebra.ball import Ball
from luenberger.algebra.endpoint import OutsideDomain
from luenberger.export.program import Program

# Unit roundoff, and what an underflow may cost.
UNITS = {"double": (2.0**-53, 2.0**-1074), "float": (2.0**-24, 2.0**-149)}
# These round nothing: their result is one of their arguments up to its sign, or a truth value.
_EXACT = frozenset(
    [
        "neg",
        "abs",
        "max",
        "min",
        "sign",
        "floor",
        "ceil",
        "eq",
        "ne",
        "lt",
        "le",
        "gt",
        "ge",
        "is_finite",
        "is_nan",
        "and",
        "or",
        "xor",
        "not",
    ]
)
# A mathematical library is trusted to be right within this many units; correctly rounded ones are within one.
_LIBRARY_UNITS = 4.0
_BASIC = frozenset(["add", "sub", "mul", "div", "square", "sqrt"])


class RoundedArithmetic(BallArithmetic):
    """Balls that hold every result an evaluation in finite precision can have, whatever its rounding of each operation.

    Args:
        precision: "double" or "float".
    """

    def __init__(self, precision: str):
        super().__init__()
        self._unit, self._tiny = UNITS[precision]
        self.functions = {
            name: function if name in _EXACT else self._rounding(name, function)
            for name, function in self.functions.items()
        }

    def constant(self, value: float) -> Ball:
        """Return the ball of a literal, which is rounded when it is read."""
        exact = Ball.exact(value)
        return exact if self._unit < 1e-12 or float(np.float32(value)) == value else self._widened(exact, 1.0)

    def _rounding(self, name: str, function: Callable[..., Ball]) -> Callable[..., Ball]:
        units = 1.0 if name in _BASIC else _LIBRARY_UNITS

        def run(*operands: Any) -> Ball:
            return self._widened(function(*operands), units)

        return run

    def _widened(self, ball: Ball, units: float) -> Ball:
        size = max(abs(ball.lower), abs(ball.upper))
        # The first factor covers the rounding of this very product.
        slack = 1.0001 * units * self._unit * size + self._tiny
        return ball + Ball.hull(-slack, slack)


def run_bound(read: Program, precision: str, x0: Any, u: Any, y: Any, r: Any) -> np.ndarray:
    """Return by how much two evaluations of a run may differ, for every sample and entry of the estimate, shape (nt, ne).

    Both sides of a branch that rounding may decide either way are taken in. Infinite where an entry has no bound, e.g. a root of what
    may be negative; bounds grow with the length of the run.

    Args:
        read: program of the observer.
        precision: "double" or "float".
        x0: first guess, shape (nx,).
        u: inputs, shape (nt, nu).
        y: outputs, shape (nt, ny).
        r: scheduling signals, shape (nt, nr).
    """
    arithmetic = RoundedArithmetic(precision)
    # Entries that are not finite are no inputs of any operation.
    tables = [arithmetic.constant(v) if math.isfinite(v) else None for table in read.tables for v in table.values]
    found = read.init.run([*tables, *_exactly(x0)], arithmetic)
    state = [found[int(k)] for array in read.init.outputs for k in array.flat]
    count, rows = len(read.state), []
    for k in range(len(y)):
        found = read.step.run([*tables, *state, *_exactly(u[k]), *_exactly(y[k]), *_exactly(r[k])], arithmetic)
        state = [found[int(i)] for array in read.step.outputs[:count] for i in array.flat]
        shown = [found[int(i)] for array in read.step.outputs[count : count + len(read.estimate)] for i in array.flat]
        rows.append([np.inf if isinstance(value, OutsideDomain) else value.width for value in shown])
    return np.array(rows)


def _exactly(values: Any) -> list[Ball]:
    return [Ball.exact(float(v)) for v in np.ravel(values)]
