"""Polytopes around point sets: few vertices in floats, and their facets in exact rationals.

Floats only guide. `facets` takes the vertices as the exact doubles they are and answers with half-spaces whose
intersection is proved to lie in the convex hull of the vertices.
"""

from collections import Counter
from itertools import combinations

import numpy as np
from flint import fmpq, fmpq_mat
from scipy.spatial import ConvexHull, HalfspaceIntersection, QhullError

from luenberger.algebra.definiteness import exact
from luenberger.core import BadInput

Facet = tuple[np.ndarray, fmpq]

_ANGLES = 360
_EDGES = 60
_CANDIDATES = 40
_ROTATIONS = 32
_SEED = 20111
# A further cut has to take away this share of the volume to be worth its vertices.
_WORTH = 2e-3


def outer_polytope(points: np.ndarray, limit: int, inflation: float) -> np.ndarray:
    """Return at most `limit` vertices, shape (nk, m), of a small polytope that keeps `inflation` away from all points.

    Choose coordinates in which all ranges are alike, since `inflation` is a distance.

    Args:
        points: shape (n, m) with m >= 2.
        limit: largest number of vertices, at least m + 1.
        inflation: distance kept from the points, positive.
    """
    if points.shape[1] == 2:
        return _polygon(points, limit, inflation)
    directions = _directions(points)
    offsets = (points @ directions.T).max(axis=0) + inflation
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0)) if len(points) == 1 else points.mean(axis=0)
    kept, best = _start(points, limit, inflation, middle)
    volume = ConvexHull(best).volume
    while True:
        tries = [_cut(kept, np.append(d, -b), middle) for d, b in zip(directions, offsets, strict=True)]
        sizes = [np.inf if v is None or len(v) > limit else ConvexHull(v).volume for v in tries]
        k = int(np.argmin(sizes))
        found = tries[k]
        if found is None or not sizes[k] < (1.0 - _WORTH) * volume:
            return best
        kept, best, volume = np.vstack([kept, np.append(directions[k], -offsets[k])]), found, sizes[k]


def facets(vertices: np.ndarray) -> list[Facet]:
    """Return half-spaces (n, b), n' y <= b, whose intersection is proved to lie in the convex hull of the vertices.

    The simplices that qhull names need not be exact facets. It is enough that each has the middle of the vertices on
    its inner side or in its plane, that every ridge belongs to two of them, and that one ray from the middle meets
    exactly one and no flat cone: then almost every ray meets one that is not flat, hence every ray does, and what lies
    below it on that ray lies in a simplex of vertices.

    Args:
        vertices: shape (nk, m) with m >= 2; a float means exactly that double.

    Raises:
        BadInput: the vertices span fewer than m directions, or qhull's surface does not close.
    """
    m = vertices.shape[1]
    scale = np.ptp(vertices, axis=0)
    corners = exact(vertices)
    middle = corners.sum(axis=0) / fmpq(len(corners))
    # Above three dimensions neighbouring faces may be cut into simplices that do not match; joggled vertices do.
    for options in ("Qt", "QJ"):
        try:
            hull = ConvexHull(
                (vertices - vertices.mean(axis=0)) / np.where(scale > 0, scale, 1.0), qhull_options=options
            )
        except QhullError:
            raise BadInput(
                f"The {len(vertices)} vertices of the hull do not span the {m} Jacobian entries that vary; give at least "
                f"{m + 1} vertices in general position, e.g. by moving the given ones apart a little."
            ) from None
        found = _closed(corners, hull.simplices, middle)
        if found is not None:
            return found
    raise BadInput(
        f"No closed surface was found through the {len(vertices)} vertices of the hull; leave out vertices that nearly "
        "coincide or lie inside."
    )


def _closed(corners: np.ndarray, simplices: np.ndarray, middle: np.ndarray) -> list[Facet] | None:
    """Half-spaces below the simplices where these close around the middle, else None."""
    m = len(middle)
    shared = Counter(tuple(sorted(map(int, r))) for s in simplices for r in combinations(s, m - 1))
    cones = [fmpq_mat(m, m, list((corners[s] - middle).T.flat)) for s in simplices]
    solid = [k for k, cone in enumerate(cones) if cone.det() != 0]
    # A flat cone is harmless unless its simplex holds the middle, where directions would mean nothing.
    flat = [corners[simplices[k]] - middle for k in range(len(cones)) if k not in set(solid)]
    if set(shared.values()) != {2} or not solid or any(not (x @ x.sum(axis=0) > 0).all() for x in flat):
        return None
    # No simple weights, so that the ray keeps away from planes that many vertices share.
    weights = np.array([fmpq(7 + 2 * k, 13 + 3 * k) for k in range(m)], dtype=object)
    ray = weights @ (corners[simplices[solid[0]]] - middle)
    if sum(_meets(cone, ray) for cone in cones) != 1:
        return None
    return [_half_space(corners[simplices[k]], middle) for k in solid]


def _half_space(corners: np.ndarray, middle: np.ndarray) -> Facet:
    """Half-space of one simplex on the side of the middle."""
    m = len(middle)
    edges = corners[1:] - corners[0]
    # Cofactors of the edges are orthogonal to all of them.
    minors = [fmpq_mat(m - 1, m - 1, list(np.delete(edges, k, axis=1).flat)).det() * (-1) ** k for k in range(m)]
    normal = np.array(minors, dtype=object)
    offset = normal @ corners[0]
    return (normal, offset) if normal @ middle < offset else (-normal, -offset)


def _meets(cone: fmpq_mat, ray: np.ndarray) -> bool:
    """True where a ray lies in the cone of a simplex, its boundary included, or in the span of a flat cone."""
    m = len(ray)
    if cone.det() != 0:
        return all(w >= 0 for w in cone.solve(fmpq_mat(m, 1, list(ray))).entries())
    rows = [*([cone[i, j] for j in range(m)] + [ray[i]] for i in range(m))]
    return fmpq_mat(m, m + 1, [x for row in rows for x in row]).rank() == cone.rank()


def _polygon(points: np.ndarray, limit: int, inflation: float) -> np.ndarray:
    """Tangent polygon: of very many tangents the one whose removal adds least area goes.

    It ends where `limit` are left and the next would cost more than a tenth of what the inflation costs.
    """
    angles = np.linspace(0.0, 2.0 * np.pi, _ANGLES, endpoint=False)
    # Only long edges of the hull can be edges of a polygon with few.
    edges = _hull_normals(points)[:_EDGES]
    angles = np.unique(np.round(np.append(angles, np.arctan2(edges[:, 1], edges[:, 0]) % (2.0 * np.pi)), 9))
    normals = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    offsets = (normals @ points[_extreme(points)].T).max(axis=1) + inflation
    while True:
        before, after = np.roll(np.arange(len(offsets)), 1), np.roll(np.arange(len(offsets)), -1)
        open_angle = (np.arctan2(normals[after, 1], normals[after, 0]) - np.arctan2(*normals[before].T[::-1])) % (
            2.0 * np.pi
        )
        here = _crossings(normals, offsets)
        with np.errstate(divide="ignore", invalid="ignore"):
            tip = _crossing(normals[before], offsets[before], normals[after], offsets[after])
        u, v = tip - here[before], here - here[before]
        added = np.where(open_angle < np.pi - 1e-6, 0.5 * abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]), np.inf)
        k = int(np.argmin(added))
        if len(offsets) <= max(3, limit) and not (len(offsets) > 3 and added[k] < 0.1 * inflation):
            return _crossings(normals, offsets)
        normals, offsets = np.delete(normals, k, axis=0), np.delete(offsets, k)


def _crossings(normals: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """Corner between each tangent and the next."""
    return _crossing(normals, offsets, np.roll(normals, -1, axis=0), np.roll(offsets, -1))


def _crossing(n: np.ndarray, b: np.ndarray, N: np.ndarray, B: np.ndarray) -> np.ndarray:
    determinant = n[:, 0] * N[:, 1] - n[:, 1] * N[:, 0]
    return np.stack([b * N[:, 1] - B * n[:, 1], n[:, 0] * B - N[:, 0] * b], axis=1) / determinant[:, None]


def _hull_normals(points: np.ndarray) -> np.ndarray:
    """Outward normals of the convex hull of the points, largest facets first; none where they are flat."""
    try:
        hull = ConvexHull(points)
    except QhullError:
        return np.empty((0, points.shape[1]))
    corners = points[hull.simplices]
    sizes = np.linalg.norm(np.ptp(corners, axis=1), axis=1)
    return hull.equations[np.argsort(-sizes), :-1]


def _extreme(points: np.ndarray) -> np.ndarray:
    try:
        return ConvexHull(points).vertices
    except QhullError:
        return np.arange(len(points))


def _directions(points: np.ndarray) -> np.ndarray:
    """Normals worth trying: axes, principal axes, and facets of the hull that differ from those before."""
    principal = np.linalg.eigh(np.cov(points.T))[1].T
    eye = np.eye(points.shape[1])
    chosen = [*eye, *-eye]
    for normal in [*principal, *-principal, *_hull_normals(points[_extreme(points)])]:
        if len(chosen) >= _CANDIDATES:
            break
        if max(normal @ c for c in chosen) < 0.98:
            chosen.append(normal)
    return np.array(chosen)


def _start(points: np.ndarray, limit: int, inflation: float, middle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Half-spaces and vertices of the box around the points, or of the smallest of some simplices where 2^m are too many."""
    m = points.shape[1]
    if 2**m <= limit:
        frames = [np.vstack([np.eye(m), -np.eye(m)])]
    else:
        generator = np.random.default_rng(_SEED)
        corner = np.vstack([np.eye(m), np.full(m, (1.0 - np.sqrt(m + 1.0)) / m)])
        corner = corner - corner.mean(axis=0)
        frames = [corner @ np.linalg.qr(generator.normal(size=(m, m)))[0] for _ in range(_ROTATIONS)]
    tried: list[tuple[float, np.ndarray, np.ndarray]] = []
    for frame in frames:
        normals = frame / np.linalg.norm(frame, axis=1, keepdims=True)
        spaces = np.column_stack([normals, -(points @ normals.T).max(axis=0) - inflation])
        corners = _cut(spaces[1:], spaces[0], middle)
        if corners is not None:
            tried.append((float(ConvexHull(corners).volume), spaces, corners))
    _, spaces, corners = min(tried, key=lambda entry: entry[0])
    return spaces, corners


def _cut(spaces: np.ndarray, further: np.ndarray, middle: np.ndarray) -> np.ndarray | None:
    """Vertices of an intersection of half-spaces (n, -b); None where qhull finds none."""
    try:
        found = HalfspaceIntersection(np.vstack([spaces, further]), middle).intersections
    except QhullError:
        return None
    if not np.isfinite(found).all():
        return None
    return np.unique(np.round(found, 9), axis=0)
