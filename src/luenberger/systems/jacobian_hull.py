"""A tight convex hull of the Jacobians of a nonlinearity, guessed from samples and proved by ball arithmetic.

The box around all Jacobians forgets how their entries move together: for (1 - x1^2) x2 on [-5, 5]^2 its corners
(+-50, 1) are never met, and a gain that serves them is three times larger than needed. A polytope with a few vertices
remembers. Samples only suggest it; the proof halves the state box until, for each piece and each facet, an enclosure of
the Jacobian stays below the facet. Facets are exact rationals, and pieces are bounded by plain ball arithmetic or by
the mean-value form along the facet's normal, which overshoots with the square of the piece only.
"""

# pyright: reportUnknownMemberType=false, reportUnknownArgumentType=false
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import product
from typing import Any, NamedTuple

import jax
import numpy as np
from scipy.spatial import ConvexHull

from luenberger.algebra.arithmetic import BallArithmetic
from luenberger.algebra.ball import Ball
from luenberger.algebra.endpoint import OutsideDomain, at_working_precision
from luenberger.core import BadInput, NotCertified
from luenberger.core.checks import finite_array, matrix
from luenberger.systems.embedding_jacobian import JacobianMap, argument_box
from luenberger.systems.embedding_polytope import facets, outer_polytope
from luenberger.systems.nonlinearity import Nonlinearity

Function = Callable[..., jax.Array]

_ROUNDS = 4
_LARGEST = 6
# Where a hull takes away less than this share of the box, the box with its exact corners serves.
_WORTH = 0.01


class _Piece(NamedTuple):
    """A sub-box of the arguments with the facets that are still to be proved on it."""

    left: np.ndarray
    right: np.ndarray
    open: tuple[int, ...]
    share: float


@dataclass(frozen=True, eq=False)
class _Surface:
    """Facets n' y <= b as balls, which decide, and as doubles, which only say where asking the balls is worth while."""

    balls: list[tuple[list[Ball], Ball]]
    normals: np.ndarray
    offsets: np.ndarray

    @staticmethod
    def of(corners: np.ndarray) -> "_Surface":
        balls = [([Ball.exact(n) for n in normal], Ball.exact(offset)) for normal, offset in facets(corners)]
        normals = np.array([[n.lower for n in normal] for normal, _ in balls])
        return _Surface(balls, normals, np.array([offset.lower for _, offset in balls]))

    def worst(self, box: list[Ball]) -> np.ndarray:
        """Largest n' y over a box, in doubles."""
        low, high = np.array([y.lower for y in box]), np.array([y.upper for y in box])
        return np.maximum(self.normals, 0.0) @ high + np.minimum(self.normals, 0.0) @ low

    def steepness(self, slopes: np.ndarray) -> np.ndarray:
        """Largest |n' dy/dw_j| for slopes (m, nw), in doubles, shape (facets, nw)."""
        low, high = (np.array([[getattr(x, end) for x in row] for row in slopes]) for end in ("lower", "upper"))
        rise, fall = np.maximum(self.normals, 0.0), np.minimum(self.normals, 0.0)
        return np.maximum(abs(rise @ high + fall @ low), abs(rise @ low + fall @ high))

    def holds(self, k: int, box: list[Ball], guess: np.ndarray) -> bool:
        """True where a box is proved to lie below a facet."""
        normal, offset = self.balls[k]
        return bool(guess[k] <= self.offsets[k]) and (_dot(normal, box) <= offset) is True

    def holds_moved(self, k: int, centre: list[Ball], slopes: np.ndarray, moves: list[Ball], guess: np.ndarray) -> bool:
        """True where the mean-value form is proved to lie below a facet."""
        if guess[k] > self.offsets[k]:
            return False
        normal, offset = self.balls[k]
        total = _dot(normal, centre)
        for j, move in enumerate(moves):
            total = total + _dot(normal, slopes[:, j]) * move
        return (total <= offset) is True

    def escaped(self, left: tuple[int, ...], centre: list[Ball]) -> np.ndarray | None:
        """The entries at a point where they are proved to lie above an open facet, else None."""
        guess = self.worst(centre)
        for k in left:
            normal, offset = self.balls[k]
            if guess[k] > self.offsets[k] and (_dot(normal, centre) > offset) is True:
                return np.array([0.5 * (y.lower + y.upper) for y in centre])
        return None


def proved_hull(
    function: Nonlinearity | Function,
    H: Any = None,
    domain: tuple[Any, Any] | None = None,
    *,
    inputs: tuple[Any, Any] | None = None,
    vertices: int = 32,
    inflation: float = 1e-3,
    tolerance: float = 1e-3,
    max_pieces: int = 20000,
) -> Nonlinearity:
    """Return the nonlinearity with a convex hull of few vertices that is proved to hold its Jacobian on the whole domain.

    Choose it where several entries of the Jacobian vary together; the vertex methods then ask less than on the box. One
    varying entry gives its interval, none a single matrix.

    Args:
        function: a nonlinearity, whose H and domain then serve, or a JAX function of (z, u) with z = H x.
        H: what enters, z = H x, shape (nz, nx); rows that mix states are bounded one by one.
        domain: state box (lower, upper), each (nx,).
        inputs: box (lower, upper) of u, each (nu,), for a function that reads it; left out: u has length zero.
        vertices: largest number of vertices; in the plane every one more helps, with the square of their number.
        inflation: distance from the sampled Jacobians to the hull, as a share of half the range of each entry. Smaller is
            tighter and takes more pieces to prove.
        tolerance: wanted relative overestimation of the entrywise box.
        max_pieces: how many pieces of the domain may be bounded before giving up.

    Raises:
        BadInput: no or inverted domain, a function that cannot be read, too few vertices,
            or more than six varying entries.
        NotCertified: the hull could not be proved within `max_pieces`; says what share of the domain is open.
    """
    plain, f = _plain(function, H, domain, inputs, tolerance)
    m = f.size
    if m > _LARGEST or vertices < m + 1:
        raise BadInput(
            f"{m} independent entries of the Jacobian vary; a hull with {vertices} vertices was asked. It needs at least "
            f"{m + 1} vertices and at most {_LARGEST} such entries; use the box (`Nonlinearity.enclosed`)."
        )
    if not inflation > 0:
        raise BadInput(f"`inflation` is {inflation}; a positive share is needed, e.g. 0.001, for a proof to have room.")
    lower, upper = f.ends()
    if m <= 1:
        return _with_hull(plain, f, f.filled(np.stack([lower, upper])[: m + 1]))
    middle, half = 0.5 * (lower + upper), 0.5 * (upper - lower)
    points = (f.samples() - middle) / half
    for last in (False,) * (_ROUNDS - 1) + (True,):
        found = outer_polytope(points, vertices, inflation)
        if 2**m <= vertices and _fills_its_box(found):
            return _with_hull(plain, f, f.filled(np.array(list(product(*zip(lower, upper, strict=True))))))
        corners = _short(middle + half * found)
        escaped = _proved(f, corners, max_pieces, raising=last)
        if not len(escaped):
            return _with_hull(plain, f, f.filled(corners))
        points = np.vstack([points, (escaped - middle) / half])
    raise AssertionError("the last round raises")


def prove_hull(
    function: Nonlinearity | Function,
    hull: Any,
    H: Any = None,
    domain: tuple[Any, Any] | None = None,
    *,
    inputs: tuple[Any, Any] | None = None,
    max_pieces: int = 20000,
) -> Nonlinearity:
    """Return the nonlinearity with a given hull of its Jacobian once that is proved.

    Args:
        function: a nonlinearity, or a JAX function of (z, u); see `proved_hull`.
        hull: matrices, shape (nk, nf, nz), whose convex hull is said to hold the Jacobian on the domain.
        H: selection of the states that enter, shape (nz, nx).
        domain: state box (lower, upper), each (nx,).
        inputs: box (lower, upper) of u, each (nu,).
        max_pieces: how many pieces of the domain may be bounded before giving up.

    Raises:
        BadInput: shapes that differ, vertices that do not span the varying entries; see `proved_hull`.
        NotCertified: a Jacobian lies outside, or the proof stays open on a share of the domain.
    """
    plain, f = _plain(function, H, domain, inputs, 1e-6)
    corners = finite_array("hull", hull)
    if corners.ndim != 3 or corners.shape[1:] != f.lower.shape or not len(corners):
        raise BadInput(f"`hull` has shape {corners.shape}; matrices df/dz of shape (nk, *{f.lower.shape}) are needed.")
    f = f.seen_by(corners)
    if f.size > 1:
        _proved(f, corners[:, *f.coordinates], max_pieces, raising=True)
        return _with_hull(plain, f, corners)
    lower, upper = corners.min(axis=0), corners.max(axis=0)
    if (outside := (f.lower < lower) | (f.upper > upper)).any():
        i, j = np.argwhere(outside)[0]
        raise NotCertified(
            f"df{i + 1}/dz{j + 1} is proved to lie in [{f.lower[i, j]:.9g}, {f.upper[i, j]:.9g}], which the hull's "
            f"[{lower[i, j]:.9g}, {upper[i, j]:.9g}] does not hold; widen it."
        )
    return _with_hull(plain, f, corners)


def _plain(
    function: Nonlinearity | Function, H: Any, domain: Any, inputs: Any, tolerance: float
) -> tuple[Nonlinearity, JacobianMap]:
    known = None
    if isinstance(function, Nonlinearity):
        if function.is_clipped:
            raise BadInput("The nonlinearity is clipped, so its domain is no bound; give it as it was before.")
        if domain is None and H is None and function.bound_status == "proved":
            # Bounds that were proved before need no second proof, and know which entries stand still.
            known = None if function.jacobian_lower is None else (function.jacobian_lower, function.jacobian_upper)
        H, domain = (function.H if H is None else H), (function.domain if domain is None else domain)
        function = function.function
    if H is None or domain is None:
        raise BadInput(
            "A hull is proved over a box; give `H` and `domain` = (lower, upper), or a nonlinearity with both."
        )
    H = matrix("H", H)
    # Checks the shapes of the domain in the same words.
    given = Nonlinearity.bounded(function, H, lipschitz=0.0, domain=domain)
    assert given.domain is not None
    u = (np.zeros(0), np.zeros(0)) if inputs is None else _input_box(inputs)
    f = JacobianMap.of(function, argument_box(H, given.domain), u, tolerance, known)
    return replace(given, size=f.lower.shape[0], lipschitz=None), f


def _input_box(inputs: Any) -> tuple[np.ndarray, np.ndarray]:
    lower, upper = finite_array("inputs lower", inputs[0]), finite_array("inputs upper", inputs[1])
    if lower.ndim != 1 or lower.shape != upper.shape or (lower > upper).any():
        raise BadInput(
            f"`inputs` has the ends {lower.tolist()} and {upper.tolist()}; two vectors (nu,), lower <= upper, are needed."
        )
    return lower, upper


def _fills_its_box(corners: np.ndarray) -> bool:
    return ConvexHull(corners).volume > (1.0 - _WORTH) * float(np.prod(np.ptp(corners, axis=0)))


def _short(corners: np.ndarray) -> np.ndarray:
    """Round to 24 bits, so that entries which follow from others by short factors are doubles too."""
    return corners.astype(np.float32).astype(np.float64)


def _with_hull(plain: Nonlinearity, f: JacobianMap, vertices: np.ndarray) -> Nonlinearity:
    box = vertices.min(axis=0), vertices.max(axis=0)
    return replace(
        plain, jacobian_lower=box[0], jacobian_upper=box[1], jacobian_vertices=vertices, bound_status=f.status
    )


@at_working_precision
def _proved(f: JacobianMap, corners: np.ndarray, max_pieces: int, raising: bool) -> np.ndarray:
    """Prove that the varying entries stay in the hull of some corners; return entries seen outside, none where proved."""
    spaces = _Surface.of(corners)
    queue = deque([_Piece(f.left, f.right, tuple(range(len(spaces.normals))), 1.0)])
    seen = 0
    while queue and seen < max_pieces:
        piece = queue.popleft()
        seen += 1
        left, axis, outside = _step(f, spaces, piece)
        if outside is not None:
            if raising:
                raise NotCertified(
                    f"The Jacobian entries {np.round(outside, 9).tolist()} at {_middle(piece).tolist()} (z, then u) lie "
                    "outside the hull; give vertices around them, or a larger `inflation`."
                )
            # One escape is enough: the next guess is made with this point and all its like.
            return outside[None]
        if left and axis is None:
            break
        if left:
            middle = _middle(piece)[axis]
            for side in (0, 1):
                ends = (piece.left.copy(), piece.right.copy())
                ends[1 - side][axis] = middle
                queue.append(_Piece(ends[0], ends[1], left, 0.5 * piece.share))
    if queue:
        share = sum(piece.share for piece in queue)
        raise NotCertified(
            f"The hull is still open on {100 * share:.2g} % of the domain after {seen} pieces; raise `inflation` (more "
            "room between Jacobian and hull), raise `max_pieces`, or shrink the domain."
        )
    return np.empty((0, corners.shape[1]))


def _step(f: JacobianMap, surface: _Surface, piece: _Piece) -> tuple[tuple[int, ...], int | None, np.ndarray | None]:
    """Facets still open on a piece, the axis to halve, and the entries at its middle where they are surely outside."""
    arithmetic = BallArithmetic()
    ranges = list(map(Ball.hull, piece.left, piece.right))
    box = _entries(f, ranges, arithmetic)
    left = piece.open if box is None else tuple(k for k in piece.open if not surface.holds(k, box, surface.worst(box)))
    if not left:
        return (), None, None
    middle, width = _middle(piece), piece.right - piece.left
    centre = _entries(f, list(map(Ball.exact, middle)), BallArithmetic())
    if centre is not None and (escaped := surface.escaped(left, centre)) is not None:
        return left, None, escaped
    slopes = None
    if centre is not None and not arithmetic.steps and f.slopes is not None:
        places = f.slopes.outputs[0][f.coordinates].ravel()
        slopes = _picked(f.slopes.run(ranges, BallArithmetic()), places)
    if slopes is not None and centre is not None:
        rows = np.array(slopes, dtype=object).reshape(f.size, -1)
        steep = surface.steepness(rows)
        guess = surface.worst(centre) + steep @ (0.5 * width)
        offsets = [r - float(c) for r, c in zip(ranges, middle, strict=True)]
        left = tuple(k for k in left if not surface.holds_moved(k, centre, rows, offsets, guess))
        if not left:
            return (), None, None
        variation = (steep[list(left)] * width).max(axis=0)
    else:
        variation = _narrowing(f, surface, left, ranges, box)
    # No axis is forgotten for good, even where the variation along it looks small.
    share = variation / max(float(variation.max()), 1e-300) + 1e-3 * (width > 0)
    divisible = (piece.left < middle) & (middle < piece.right)
    axis = int(np.argmax(np.where(divisible, share, -1.0))) if divisible.any() else None
    return left, axis, None


def _narrowing(
    f: JacobianMap, surface: _Surface, left: tuple[int, ...], ranges: list[Ball], box: list[Ball] | None
) -> np.ndarray:
    """How much the plain bound of the worst open facet falls where one axis shrinks to a point."""
    widths = np.array([r.width for r in ranges])
    if box is None:
        return widths
    found, whole = widths.copy(), surface.worst(box)[list(left)]
    for j, r in enumerate(ranges):
        middle = Ball.exact(0.5 * (r.lower + r.upper))
        thin = _entries(f, [*ranges[:j], middle, *ranges[j + 1 :]], BallArithmetic())
        if thin is None:
            return widths
        found[j] = (whole - surface.worst(thin)[list(left)]).max()
    return np.maximum(found, 0.0)


def _entries(f: JacobianMap, arguments: list[Ball], arithmetic: BallArithmetic) -> list[Ball] | None:
    return _picked(f.entries.run(arguments, arithmetic), f.entries.outputs[0][f.coordinates])


def _picked(values: list[Any], places: np.ndarray) -> list[Ball] | None:
    found = [values[k] for k in places]
    return None if any(isinstance(v, OutsideDomain) for v in found) else found


def _dot(normal: list[Ball], values: Any) -> Ball:
    total = Ball.exact(0)
    for n, v in zip(normal, values, strict=True):
        total = total + n * v
    return total


def _middle(piece: _Piece) -> np.ndarray:
    return np.clip(0.5 * piece.left + 0.5 * piece.right, piece.left, piece.right)
