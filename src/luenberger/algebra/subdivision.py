"""Branch and bound over a box: which piece to halve, along which axis, and how tight a piece is bounded."""

# pyright: reportUnknownMemberType=false, reportUnknownArgumentType=false
import heapq
from collections.abc import Callable
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

_SAMPLES = 500
_SEED = 20240229


class Piece(NamedTuple):
    """A sub-box with bounds of the function on it.

    Args:
        left: lower ends, shape (n,).
        right: upper ends, shape (n,).
        lower: proved lower bounds of all entries in a row, -inf where there is none.
        upper: proved upper bounds, inf where there is none.
        variation: largest change of every entry (rows) along every axis, or None where it was not needed or not known.
        error: why a bound is missing.
    """

    left: np.ndarray
    right: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    variation: np.ndarray | None = None
    error: OutsideDomain | None = None


class Search:
    """Bounds of one function on one box, refined where they overshoot most.

    Args:
        function: pure JAX function of one vector to one array.
        left: lower ends of the box, shape (n,).
        right: upper ends of the box, shape (n,).
        tolerance: allowed overshoot, relative to the range of each entry.
        max_pieces: largest number of pieces.

    Raises:
        BadInput: the function cannot be read or returns more than one array.
    """

    def __init__(
        self, function: Callable[..., Any], left: np.ndarray, right: np.ndarray, tolerance: float, max_pieces: int
    ):
        self.function, self.left, self.right = function, left, right
        self.tolerance, self.max_pieces = tolerance, max_pieces
        self.trace = self._traced(function)
        self.shape = self.trace.outputs[0].shape
        entries = self.trace.outputs[0].size
        self.seen_lower = np.full(entries, np.inf)
        self.seen_upper = np.full(entries, -np.inf)
        self.plain_width = np.zeros(entries)
        self.pieces: list[Piece] = []

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
    def refine(self) -> bool:
        """Halve the worst piece until all are tight (True) or the pieces are spent (False)."""
        self._sample(self._first_points())
        order = count()
        first, _ = self._plain(self.left, self.right)
        self.plain_width = first.upper - first.lower
        heap = [(-np.inf, next(order), self._piece(self.left, self.right, first))]
        while True:
            piece = heap[0][2]
            worst = self._excess(piece).max(initial=0.0)
            if worst > 1.0 and worst < -min((entry[0] for entry in heap[1:3]), default=np.inf):
                # Values seen since this piece was stored have caught up with it; another one is worse now.
                heapq.heapreplace(heap, (-worst, next(order), piece))
                continue
            axis = self._axis(piece)
            if worst <= 1.0 or len(heap) >= self.max_pieces or axis is None:
                self.pieces = [entry[2] for entry in heap]
                return bool(worst <= 1.0)
            heapq.heappop(heap)
            for left, right in _halves(piece, axis):
                self._sample(self._inside(left, right))
                half = self._piece(left, right, piece)
                heapq.heappush(heap, (-self._excess(half).max(initial=0.0), next(order), half))

    def doubts(self, left: np.ndarray, right: np.ndarray) -> set[str]:
        """Return what may keep the function from being continuous on a piece, in words."""
        piece, steps = self._plain(left, right)
        return {f"continuity across {step}" for step in steps} | ({str(piece.error)} if piece.error else set())

    def _plain(self, left: np.ndarray, right: np.ndarray) -> tuple[Piece, set[str]]:
        """Bounds by plain ball arithmetic, and the undecided steps met."""
        arithmetic = BallArithmetic()
        values, error = _evaluated(self.trace, list(map(Ball.hull, left, right)), arithmetic)
        return Piece(left, right, _ends(values, 0), _ends(values, 1), None, error), arithmetic.steps

    def _piece(self, left: np.ndarray, right: np.ndarray, parent: Piece) -> Piece:
        """Bounds by plain ball arithmetic and, where that is not tight, by the mean-value form."""
        plain, steps = self._plain(left, right)
        plain = plain._replace(lower=np.maximum(plain.lower, parent.lower), upper=np.minimum(plain.upper, parent.upper))
        if plain.error or steps or self.derivative is None or not (self._excess(plain) > 1.0).any():
            return plain
        slopes, error = _evaluated(self.derivative, list(map(Ball.hull, left, right)), BallArithmetic())
        slopes = slopes.reshape(-1, self.left.size)
        variation = np.maximum(abs(_ends(slopes, 0)), abs(_ends(slopes, 1))) * (right - left)
        centre, outside = self._centre(left, right)
        if error or outside:
            return plain._replace(variation=variation)
        # f(middle) + J (x - middle) with J over the whole piece: it overshoots with the square of the piece only.
        middle = _middle(left, right)
        offsets = np.array([Ball.hull(a, b) - m for a, b, m in zip(left, right, middle, strict=True)], dtype=object)
        form = centre + slopes @ offsets
        lower, upper = np.maximum(plain.lower, _ends(form, 0)), np.minimum(plain.upper, _ends(form, 1))
        return plain._replace(lower=lower, upper=upper, variation=variation)

    def _centre(self, left: np.ndarray, right: np.ndarray) -> tuple[np.ndarray, OutsideDomain | None]:
        return _evaluated(self.trace, list(map(Ball.exact, _middle(left, right))), BallArithmetic())

    def _excess(self, piece: Piece) -> np.ndarray:
        """Overshoot of a piece's bounds over the values seen, in units of what is allowed."""
        with np.errstate(invalid="ignore"):
            size = np.maximum(abs(self.seen_lower), abs(self.seen_upper))
            span = self.seen_upper - self.seen_lower
            # An entry that looks constant has no range to be relative to, and would take all pieces for itself.
            whole = np.where(np.isfinite(self.plain_width), self.plain_width, 0.0)
            span = np.where(span <= 1e-9 * np.maximum(size, whole), whole, span)
            allowed = self.tolerance * span + 8 * np.spacing(size)
            over = np.maximum(piece.upper - self.seen_upper, self.seen_lower - piece.lower)
            return np.nan_to_num(over / allowed, nan=np.inf, posinf=np.inf)

    def _axis(self, piece: Piece) -> int | None:
        """Axis along which the worst entry varies most; None where the piece cannot be halved."""
        middle = _middle(piece.left, piece.right)
        divisible = (piece.left < middle) & (middle < piece.right)
        if not divisible.any():
            return None
        share = (piece.right - piece.left) / np.where(self.right > self.left, self.right - self.left, 1.0)
        if piece.variation is not None:
            variation = piece.variation[np.argmax(self._excess(piece))]
            if np.isfinite(variation).all() and variation.max() > 0:
                # No axis is forgotten for good, even where the variation along it looks small.
                share = variation / variation.max() + 1e-3 * share
        return int(np.argmax(np.where(divisible, share, -1.0)))

    def _first_points(self) -> np.ndarray:
        """Random points of the box, its faces and corners, and its middle."""
        generator = np.random.default_rng(_SEED)
        n = self.left.size
        inside = np.clip(generator.uniform(-0.5, 1.5, (_SAMPLES, n)), 0.0, 1.0)
        weights = np.vstack([inside, generator.integers(0, 2, (_SAMPLES, n)), np.full((1, n), 0.5)])
        return np.clip(self.left + weights * (self.right - self.left), self.left, self.right)

    def _inside(self, left: np.ndarray, right: np.ndarray) -> np.ndarray:
        """The middle of a piece, and the same moved to the faces of the box that the piece touches."""
        middle = _middle(left, right)
        return np.vstack([middle, np.where(left == self.left, left, np.where(right == self.right, right, middle))])

    def _sample(self, points: np.ndarray) -> None:
        """Take the function's doubles at some points, side by side, into the values seen."""
        values = self.trace.run(list(points.T), FLOAT)
        for entry, k in enumerate(self.trace.outputs[0].flat):
            column = np.atleast_1d(np.asarray(values[k], dtype=float))
            column = column[np.isfinite(column)]
            if column.size:
                self.seen_lower[entry] = min(self.seen_lower[entry], column.min())
                self.seen_upper[entry] = max(self.seen_upper[entry], column.max())


def _evaluated(
    function: Trace, arguments: list[Ball], arithmetic: BallArithmetic
) -> tuple[np.ndarray, OutsideDomain | None]:
    """Entries in a row as balls, None where one is undefined, with the first reason."""
    values = function.run(arguments, arithmetic)
    out = np.empty(function.outputs[0].size, dtype=object)
    error: OutsideDomain | None = None
    for entry, k in enumerate(function.outputs[0].flat):
        if isinstance(values[k], Ball):
            out[entry] = values[k]
        elif error is None:
            error = values[k]
    return out, error


def _ends(values: np.ndarray, side: int) -> np.ndarray:
    """Outward-rounded ends of balls: side 0 the lower, 1 the upper; infinite where there is no ball."""
    out = np.full(values.shape, np.inf if side else -np.inf)
    for index, ball in np.ndenumerate(values):
        if ball is not None:
            out[index] = ball.upper if side else ball.lower
    return out


def _middle(left: np.ndarray, right: np.ndarray) -> np.ndarray:
    return np.clip(0.5 * left + 0.5 * right, left, right)


def _halves(piece: Piece, axis: int) -> list[tuple[np.ndarray, np.ndarray]]:
    inner_right, inner_left = piece.right.copy(), piece.left.copy()
    inner_right[axis] = inner_left[axis] = _middle(piece.left, piece.right)[axis]
    return [(piece.left, inner_right), (inner_left, piece.right)]
