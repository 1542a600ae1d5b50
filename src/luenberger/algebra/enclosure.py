"""Proved bounds of a JAX function, or of its Jacobian, over a box: ball arithmetic and adaptive subdivision."""

# pyright: reportUnknownMemberType=false, reportUnknownArgumentType=false
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import jax
import numpy as np

from luenberger.algebra.subdivision import Search
from luenberger.core import BadInput
from luenberger.core.checks import finite_array


@dataclass(frozen=True, eq=False)
class Enclosure:
    """Bounds that hold for every argument in a box, entry by entry.

    Args:
        lower: proved lower bounds, in the shape of the function's result.
        upper: proved upper bounds.
        inner_lower: least value seen at sampled arguments (rounded; no proof).
        inner_upper: greatest value seen.
        pieces: number of sub-boxes in the end.
        tight: True where no bound overshoots the values seen by more than the tolerance times their range (for an entry
            that looks constant: times the width of plain ball arithmetic over the whole box).
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


def enclose(
    function: Callable[..., Any], lower: Any, upper: Any, *, tolerance: float = 1e-3, max_pieces: int = 2000
) -> Enclosure:
    """Bound every entry of a function over a box of its argument vector.

    Each piece is bounded by the function in ball arithmetic and, where that is not tight enough and the function has
    no undecided branch there, by its mean-value form; the piece that overshoots most is halved until all bounds are
    tight or the pieces are spent. Loose bounds are still proved.

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
    return _enclosure(Search(function, left, right, tolerance, max_pieces))


def enclose_jacobian(
    function: Callable[..., Any], lower: Any, upper: Any, *, tolerance: float = 1e-3, max_pieces: int = 2000
) -> Enclosure:
    """Bound every entry of the Jacobian of a function over a box; the result has shape (*function shape, n).

    Where `assumptions` is empty, f(x) - f(z) = J (x - z) for all x, z in the box with some J inside the bounds.
    See `enclose` for what is assumed of numbers, and for the errors.

    Args:
        function: pure JAX function of one vector, shape (n,).
        lower: lower ends of the box, shape (n,).
        upper: upper ends of the box, shape (n,).
        tolerance: wanted overshoot, relative to the range of each entry.
        max_pieces: largest number of sub-boxes.
    """
    left, right = _box(lower, upper, tolerance, max_pieces)
    search = Search(jax.jacfwd(function), left, right, tolerance, max_pieces)
    found = _enclosure(search)
    original = Search(function, left, right, tolerance, max_pieces)
    doubts = {f"the derivative rule of `{name}`" for name in original.trace.handmade}
    if original.doubts(left, right):
        doubts = doubts.union(*(original.doubts(piece.left, piece.right) for piece in search.pieces))
    return replace(found, assumptions=tuple(sorted(doubts)))


def _enclosure(search: Search) -> Enclosure:
    tight = search.refine()
    lower = np.min([piece.lower for piece in search.pieces], axis=0)
    upper = np.max([piece.upper for piece in search.pieces], axis=0)
    if not (np.isfinite(lower).all() and np.isfinite(upper).all()):
        error = next(piece.error for piece in search.pieces if piece.error is not None)
        raise BadInput(
            f"The function is not known to be defined on the whole box after {len(search.pieces)} pieces: {error} "
            "Shrink the box so that it keeps away from there, or raise `max_pieces`."
        )
    bounds = (lower, upper, *(np.clip(seen, lower, upper) for seen in (search.seen_lower, search.seen_upper)))
    return Enclosure(*(b.reshape(search.shape) for b in bounds), pieces=len(search.pieces), tight=tight)


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
