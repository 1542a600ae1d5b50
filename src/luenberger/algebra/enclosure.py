"""Proved bounds of a JAX function, or of its Jacobian, over a box: ball arithmetic and adaptive subdivision."""

import heapq
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import count
from typing import Any, NamedTuple

import jax
import numpy as np

from luenberger.algebra.arithmetic import FLOAT, BallArithmetic
from luenberger.algebra.ball import Ball
from luenberger.algebra.endpoint import OutsideDomain, at_working_precision
from luenberger.algebra.jaxpr import Trace, trace
from luenberger.core import BadInput
from luenberger.core.checks import finite_array

_SAMPLES = 500
_SEED = 20240229
_STEPS = frozenset(("select", "sign", "floor", "ceil", "rem"))


@dataclass(frozen=True, eq=False)
class Enclosure:
    """Bounds that hold for every argument in a box, entry by entry.

    Args:
        lower: proved lower bounds, in the shape of the function's result.
        upper: proved upper bounds.
        inner_lower: least value seen at sampled arguments (rounded; no proof).
        inner_upper: greatest value seen.
        pieces: number of sub-boxes in the end.
        tight: True where no bound overshoots the values seen by more than the tolerance times their range.
        assumptions: what a Jacobian box takes on trust before it bounds difference quotients: continuity across a
            branch or step that stays undecided on part of the box, or derivative rules written by hand. Empty: nothing.
    """

    lower: np.ndarray
    upper: np.ndarray
    inner_lower: np.ndarray
    inner_upper: np.ndarray
    pieces: int
    tight: bool
    assumptions: tuple[str, ...] = ()


class _Piece(NamedTuple):
    left: np.ndarray
    right: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    slopes: np.ndarray | None


def enclose(
    function: Callable[..., Any], lower: Any, upper: Any, *, tolerance: float = 1e-3, max_pieces: int = 2000
) -> Enclosure:
    """Bound every entry of a function over a box of its argument vector.

    Each piece is bounded by the function in ball arithmetic and, where that is not tight enough and the function has
    no undecided branch there, by its mean-value form; the piece that overshoots most is halved until all bounds are
    tight or the pieces are spent.

    Assumes: numbers in `function` and in the box are the exact doubles; a subexpression without the argument is the
    double it evaluates to; derivatives that JAX forms from its own rules are those of the function.

    Args:
        function: pure JAX function of one vector, shape (n,), to an array of any shape.
        lower: lower ends of the box, shape (n,).
        upper: upper ends of the box, shape (n,).
        tolerance: wanted overshoot, relative to the range of each entry.
        max_pieces: largest number of sub-boxes.

    Raises:
        BadInput: an inverted or non-finite box, a function that cannot be read, or one that is not defined on the whole
            box as far as `max_pieces` sub-boxes can tell.
    """
    left, right = _box(lower, upper, tolerance, max_pieces)
    return _Search(function, left, right).enclose(tolerance, max_pieces)


def enclose_jacobian(
    function: Callable[..., Any], lower: Any, upper: Any, *, tolerance: float = 1e-3, max_pieces: int = 2000
) -> Enclosure:
    """Bound every entry of the Jacobian of a function over a box; the result has shape (*function shape, n).

    Where `assumptions` is empty, f(x) - f(z) = J (x - z) for x, z in the box with every row of J inside the bounds.
    See `enclose` for the arguments and errors.

    Args:
        function: pure JAX function of one vector, shape (n,).
        lower: lower ends of the box, shape (n,).
        upper: upper ends of the box, shape (n,).
        tolerance: wanted overshoot, relative to the range of each entry.
        max_pieces: largest number of sub-boxes.
    """
    left, right = _box(lower, upper, tolerance, max_pieces)
    search = _Search(jax.jacfwd(function), left, right)
    found = search.enclose(tolerance, max_pieces)
    original = _Search(function, left, right)
    doubts = {f"the derivative rule of `{name}`" for name in original.trace.handmade}
    if original.natural(left, right)[2]:
        for piece in search.pieces:
            doubts |= {f"continuity across {step}" for step in original.natural(piece.left, piece.right)[2]}
    return Enclosure(
        found.lower, found.upper, found.inner_lower, found.inner_upper, found.pieces, found.tight, tuple(sorted(doubts))
    )


class _Search:
    """One function on one box: its traces, the values seen so far, and the heap of pieces."""

    def __init__(self, function: Callable[..., Any], left: np.ndarray, right: np.ndarray):
        self.function, self.left, self.right = function, left, right
        self.trace = self._traced(function)
        self.shape = self.trace.outputs[0].shape
        self.is_continuous = not any(operation.name in _STEPS for operation in self.trace.operations)
        self.seen_lower = np.full(self.shape, np.inf)
        self.seen_upper = np.full(self.shape, -np.inf)
        self.pieces: list[_Piece] = []
        self.reason: OutsideDomain | None = None

    @cached_property
    def derivative(self) -> Trace | None:
        """Jacobian of the function, where its derivative rules are JAX's own."""
        return None if self.trace.handmade else self._traced(jax.jacfwd(self.function))

    def _traced(self, function: Callable[..., Any]) -> Trace:
        found = trace(function, self.left)
        if len(found.outputs) != 1:
            raise BadInput(f"The function returns {len(found.outputs)} arrays; one array is needed. Stack them.")
        return found

    @at_working_precision
    def enclose(self, tolerance: float, max_pieces: int) -> Enclosure:
        """Halve the worst piece until all are tight or spent."""
        self._sample(self._first_points())
        order = count()
        heap = [(-np.inf, next(order), self._piece(self.left, self.right, None, tolerance))]
        while True:
            _, _, piece = heap[0]
            worst = self._excess(piece, tolerance).max(initial=0.0)
            tight = bool(worst <= 1.0)
            if not tight and len(heap) > 1 and worst < -min(h[0] for h in heap[1:3]):
                # Samples have caught up with this piece since it was stored; look at the next one first.
                heapq.heapreplace(heap, (-worst, next(order), piece))
                continue
            axis = self._axis(piece, tolerance)
            if tight or len(heap) >= max_pieces or axis is None:
                break
            heapq.heappop(heap)
            for left, right in _halves(piece, axis):
                half = self._piece(left, right, piece, tolerance)
                heapq.heappush(heap, (-self._excess(half, tolerance).max(initial=0.0), next(order), half))
        self.pieces = [piece for _, _, piece in heap]
        lower = np.min([p.lower for p in self.pieces], axis=0)
        upper = np.max([p.upper for p in self.pieces], axis=0)
        if not (np.isfinite(lower).all() and np.isfinite(upper).all()):
            raise BadInput(
                f"The function is not known to be defined on the whole box after {len(heap)} pieces: {self.reason} Shrink "
                "the box so that it keeps away from there, or raise `max_pieces`."
            )
        inner_lower, inner_upper = np.clip(self.seen_lower, lower, upper), np.clip(self.seen_upper, lower, upper)
        return Enclosure(lower, upper, inner_lower, inner_upper, len(heap), tight)

    def natural(self, left: np.ndarray, right: np.ndarray) -> tuple[np.ndarray, np.ndarray, set[str]]:
        """Bounds by plain ball arithmetic, and the undecided steps met."""
        arithmetic = BallArithmetic()
        values, error = _evaluated(self.trace, list(map(Ball.hull, left, right)), arithmetic)
        self.reason = error or self.reason
        return _ends(values, 0), _ends(values, 1), arithmetic.steps

    def _piece(self, left: np.ndarray, right: np.ndarray, parent: _Piece | None, tolerance: float) -> _Piece:
        lower, upper, steps = self.natural(left, right)
        slopes = None
        if parent is not None:
            self._sample(self._inside(left, right))
            lower, upper = np.maximum(lower, parent.lower), np.minimum(upper, parent.upper)
        piece = _Piece(left, right, lower, upper, None)
        defined = (lower > -np.inf).all() and (upper < np.inf).all()
        wanted = defined and not steps and (self._excess(piece, tolerance) > 1.0).any()
        if not wanted or self.derivative is None:
            return piece
        slopes, error = _evaluated(self.derivative, list(map(Ball.hull, left, right)), BallArithmetic())
        if error is None:
            form = self._mean_value(left, right, slopes)
            lower, upper = np.maximum(lower, _ends(form, 0)), np.minimum(upper, _ends(form, 1))
        least, greatest = _ends(slopes, 0), _ends(slopes, 1)
        if self.is_continuous:
            # Where a slope has one sign the extremes lie at the ends of that axis; inner ends belong to the neighbours.
            ends_left, ends_right = left == self.left, right == self.right
            no_maximum = ((least > 0) & ~ends_right) | ((greatest < 0) & ~ends_left)
            no_minimum = ((least > 0) & ~ends_left) | ((greatest < 0) & ~ends_right)
            upper = np.where(no_maximum.any(axis=-1), -np.inf, upper)
            lower = np.where(no_minimum.any(axis=-1), np.inf, lower)
        return _Piece(left, right, lower, upper, np.maximum(abs(least), abs(greatest)) * (right - left))

    def _mean_value(self, left: np.ndarray, right: np.ndarray, slopes: np.ndarray) -> np.ndarray:
        """f(middle) + J (x - middle), J over the whole piece: shrinks with the square of the piece."""
        middle = 0.5 * left + 0.5 * right
        centre, error = _evaluated(self.trace, list(map(Ball.exact, middle)), BallArithmetic())
        if error is not None:
            return centre
        offsets = np.array([Ball.hull(a, b) - m for a, b, m in zip(left, right, middle, strict=True)], dtype=object)
        return np.asarray(centre + slopes @ offsets, dtype=object)

    def _excess(self, piece: _Piece, tolerance: float) -> np.ndarray:
        """Overshoot of a piece's bounds over the values seen, in units of what is allowed."""
        with np.errstate(invalid="ignore"):
            size = np.maximum(abs(self.seen_lower), abs(self.seen_upper))
            # A few roundings are always allowed; the smallest double stands in for an entry that is zero throughout.
            allowed = tolerance * (self.seen_upper - self.seen_lower) + 8 * np.spacing(size)
            over = np.maximum(piece.upper - self.seen_upper, self.seen_lower - piece.lower)
            return np.nan_to_num(over / allowed, nan=np.inf)

    def _axis(self, piece: _Piece, tolerance: float) -> int | None:
        """Axis along which the worst entry varies most; None where the piece cannot be halved."""
        middle = 0.5 * piece.left + 0.5 * piece.right
        open_axes = (piece.left < middle) & (middle < piece.right)
        if not open_axes.any():
            return None
        share = (piece.right - piece.left) / np.where(self.right > self.left, self.right - self.left, 1.0)
        if piece.slopes is not None:
            worst = np.unravel_index(np.argmax(self._excess(piece, tolerance)), self.shape)
            smear = piece.slopes[worst]
            # An axis that was never halved is not forgotten, even where the slope along it looks small.
            if np.isfinite(smear).all() and smear.max(initial=0.0) > 0:
                share = smear / smear.max() + 1e-3 * share
        return int(np.argmax(np.where(open_axes, share, -1.0)))

    def _first_points(self) -> np.ndarray:
        """Random points of the box, its faces and corners, and its middle."""
        generator = np.random.default_rng(_SEED)
        weights = np.clip(generator.uniform(-0.5, 1.5, (_SAMPLES, self.left.size)), 0.0, 1.0)
        corners = generator.integers(0, 2, (_SAMPLES, self.left.size)).astype(float)
        weights = np.vstack([weights, corners, np.full((1, self.left.size), 0.5)])
        return np.clip(self.left + weights * (self.right - self.left), self.left, self.right)

    def _inside(self, left: np.ndarray, right: np.ndarray) -> np.ndarray:
        """The middle of a piece, and the same moved to the faces of the box that the piece touches."""
        middle = 0.5 * left + 0.5 * right
        moved = np.where(left == self.left, left, np.where(right == self.right, right, middle))
        return np.vstack([middle, moved])

    def _sample(self, points: np.ndarray) -> None:
        """Take the function's doubles at some points, side by side, into the values seen."""
        values = self.trace.run(list(points.T), FLOAT)
        for index, k in np.ndenumerate(self.trace.outputs[0]):
            column = np.atleast_1d(np.asarray(values[k], dtype=float))
            column = column[np.isfinite(column)]
            self.seen_lower[index] = column.min(initial=self.seen_lower[index])
            self.seen_upper[index] = column.max(initial=self.seen_upper[index])


def _evaluated(
    function: Trace, arguments: list[Ball], arithmetic: BallArithmetic
) -> tuple[np.ndarray, OutsideDomain | None]:
    """Entries as balls, None where one is undefined, with the first reason."""
    values = function.run(arguments, arithmetic)
    out = np.empty(function.outputs[0].shape, dtype=object)
    error = None
    for index, k in np.ndenumerate(function.outputs[0]):
        if isinstance(values[k], Ball):
            out[index] = values[k]
        else:
            error = error or values[k]
    return out, error


def _ends(values: np.ndarray, side: int) -> np.ndarray:
    """Outward-rounded ends of balls: side 0 the lower, 1 the upper; infinite where there is no ball."""
    out = np.full(values.shape, np.inf if side else -np.inf)
    for index, ball in np.ndenumerate(values):
        if ball is not None:
            out[index] = ball.upper if side else ball.lower
    return out


def _halves(piece: _Piece, axis: int) -> list[tuple[np.ndarray, np.ndarray]]:
    middle = 0.5 * piece.left[axis] + 0.5 * piece.right[axis]
    inner_right, inner_left = piece.right.copy(), piece.left.copy()
    inner_right[axis] = inner_left[axis] = middle
    return [(piece.left, inner_right), (inner_left, piece.right)]


def _box(lower: Any, upper: Any, tolerance: float, max_pieces: int) -> tuple[np.ndarray, np.ndarray]:
    left, right = finite_array("lower", lower), finite_array("upper", upper)
    if left.ndim != 1 or left.shape != right.shape:
        raise BadInput(f"`lower` has shape {left.shape} and `upper` {right.shape}; both need one shape (n,).")
    if (left > right).any():
        k = int(np.argmax(left > right))
        raise BadInput(f"The box is inverted in entry {k}: [{left[k]}, {right[k]}]; lower <= upper is needed.")
    if not tolerance > 0 or max_pieces < 1:
        raise BadInput(f"`tolerance` is {tolerance} and `max_pieces` {max_pieces}; both need to be positive.")
    return left, right
