"""The entries of a Jacobian that vary, over a box: their proved bounds, samples, and which of them determine the others."""

# pyright: reportUnknownMemberType=false, reportUnknownArgumentType=false
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Literal

import jax
import jax.numpy as jnp
import numpy as np
from flint import fmpq

from luenberger.algebra.arithmetic import FLOAT
from luenberger.algebra.definiteness import exact
from luenberger.algebra.enclosure import enclose_jacobian
from luenberger.algebra.endpoint import rational
from luenberger.algebra.jaxpr import Trace, trace
from luenberger.systems.embedding_relation import independent, polynomial_forms
from luenberger.systems.embedding_split import ancestors

_SAMPLES = 20000
_SEED = 20110701

Coordinates = tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True, eq=False)
class JacobianMap:
    """df/dz over a box of arguments w = (z, u), and coordinates: varying entries of which the others are affine functions.

    Args:
        left: lower ends of w, shape (nw,).
        right: upper ends of w, shape (nw,).
        lower: proved lower bounds of df/dz, shape (nf, nz).
        upper: proved upper bounds.
        status: "proved", or "declared" where continuity across a branch or a derivative rule is taken on trust.
        entries: the Jacobian as scalar operations.
        slopes: derivative of the Jacobian with respect to w, or None where its rules are written by hand.
        coordinates: rows and columns of the entries that serve as coordinates.
        followers: (row, column) of every other varying entry -> exact weights of the coordinates, then a constant.
    """

    left: np.ndarray
    right: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    status: Literal["declared", "proved"]
    entries: Trace
    slopes: Trace | None
    coordinates: Coordinates
    followers: dict[tuple[int, int], np.ndarray]

    @staticmethod
    def of(
        function: Callable[..., jax.Array],
        z: tuple[np.ndarray, np.ndarray],
        u: tuple[np.ndarray, np.ndarray],
        tolerance: float,
        known: Any = None,
    ) -> "JacobianMap":
        """Read and enclose the Jacobian of a function.

        Args:
            function: JAX function of (z, u).
            z: box of the argument, each (nz,).
            u: box of the inputs, each (nu,); of length zero where the function does not read them.
            tolerance: wanted relative overestimation of the box.
            known: proved bounds (lower, upper) of df/dz, which are then not sought again, or None.

        Raises:
            BadInput: the function cannot be read, or its Jacobian is not known to be bounded.
        """
        nz = len(z[0])
        left, right = np.concatenate([z[0], u[0]]), np.concatenate([z[1], u[1]])

        def whole(w: Any) -> jax.Array:
            return jnp.atleast_1d(function(w[:nz], w[nz:]))

        def slope(w: Any) -> jax.Array:
            return jax.jacfwd(lambda z: whole(jnp.concatenate([z, w[nz:]])))(w[:nz])

        if known is None:
            lower, upper, trusted = _row_by_row(whole, left, right, tolerance)
            lower, upper = lower[:, :nz], upper[:, :nz]
        else:
            lower, upper, trusted = known[0], known[1], False
        entries = trace(slope, left)
        slopes = None if entries.handmade else trace(jax.jacfwd(slope), left)
        status: Literal["declared", "proved"] = "declared" if trusted else "proved"
        coordinates, followers = _coordinates(entries, lower < upper)
        return JacobianMap(left, right, lower, upper, status, entries, slopes, coordinates, followers)

    @property
    def size(self) -> int:
        """Number of coordinates."""
        return len(self.coordinates[0])

    def ends(self) -> tuple[np.ndarray, np.ndarray]:
        """Bounds of the coordinates."""
        return self.lower[self.coordinates], self.upper[self.coordinates]

    def samples(self) -> np.ndarray:
        """Return coordinates at many arguments: inside the box, on its faces and at its corners, shape (n, size)."""
        generator = np.random.default_rng(_SEED)
        shape = (_SAMPLES, len(self.left))
        shares = [generator.uniform(size=shape), np.clip(generator.uniform(-0.5, 1.5, shape), 0.0, 1.0)]
        shares += [generator.integers(0, 2, (2000, len(self.left))).astype(float), np.full((1, len(self.left)), 0.5)]
        points = np.clip(self.left + np.vstack(shares) * (self.right - self.left), self.left, self.right)
        values = self.entries.run(list(points.T), FLOAT)
        places = self.entries.outputs[0][self.coordinates]
        found = np.stack([np.broadcast_to(np.asarray(values[k], dtype=float), len(points)) for k in places], axis=1)
        return found[np.isfinite(found).all(axis=1)]

    def filled(self, corners: np.ndarray) -> np.ndarray:
        """Return whole Jacobians, shape (n, nf, nz), for values of the coordinates, shape (n, size).

        Followers are rounded where their exact value is no double: then, and only then, they are widened into two
        Jacobians each, so that the convex hull still holds every Jacobian whose coordinates lie in that of `corners`.

        Args:
            corners: coordinates; a float means exactly that double.
        """
        found = np.repeat(self.lower[None], len(corners), axis=0)
        found[:, *self.coordinates] = corners
        for place, weights in self.followers.items():
            value = exact(corners) @ weights[:-1] + weights[-1]
            low = np.array([_rounded(v, -np.inf) for v in value])
            high = np.array([_rounded(v, np.inf) for v in value])
            found[:, *place] = low
            if (low < high).any():
                other = found.copy()
                other[:, *place] = high
                found, corners = np.vstack([found, other]), np.vstack([corners, corners])
        return found

    def seen_by(self, vertices: np.ndarray) -> "JacobianMap":
        """Return the same map with coordinates fit for given vertices: those here where all followers agree, else all entries.

        Args:
            vertices: shape (nk, nf, nz).
        """
        corners = exact(vertices[:, *self.coordinates])
        for place, weights in self.followers.items():
            if any(
                a != b for a, b in zip(corners @ weights[:-1] + weights[-1], exact(vertices[:, *place]), strict=True)
            ):
                every = np.nonzero(self.lower < self.upper)
                return replace(self, coordinates=(every[0], every[1]), followers={})
        return self


def _row_by_row(
    function: Callable[[Any], jax.Array], left: np.ndarray, right: np.ndarray, tolerance: float
) -> tuple[np.ndarray, np.ndarray, bool]:
    """Bounds of the whole Jacobian, each row over the arguments that it reads only, and whether something is taken on trust."""
    read = trace(function, left)
    reads = ancestors(read.operations)
    places = read.outputs[0]
    lower, upper = np.zeros((len(places), len(left))), np.zeros((len(places), len(left)))
    trusted = False
    for k, place in enumerate(places):
        used = np.array(sorted(reads[place]), dtype=int)
        if not used.size:
            continue
        # Columns of the identity put the arguments of this row back in their places.
        into, rest = np.eye(len(left))[:, used], left * ~np.isin(np.arange(len(left)), used)

        def row(v: Any, k: int = k, into: np.ndarray = into, rest: np.ndarray = rest) -> jax.Array:
            return function((into * v).sum(axis=1) + rest)[k : k + 1]

        found = enclose_jacobian(row, left[used], right[used], tolerance=tolerance)
        lower[k, used], upper[k, used] = found.lower[0], found.upper[0]
        trusted = trusted or bool(found.assumptions)
    return lower, upper, trusted


def argument_box(H: np.ndarray, domain: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Return a box that holds z = H x for every x in a box; exact where every row of H picks one state.

    Args:
        H: shape (nz, nx).
        domain: (lower, upper), each (nx,).
    """
    rise, fall = np.maximum(H, 0.0), np.minimum(H, 0.0)
    lower, upper = rise @ domain[0] + fall @ domain[1], rise @ domain[1] + fall @ domain[0]
    mixed = ((H != 0) & (H != 1)).any(axis=1) | ((H != 0).sum(axis=1) != 1)
    # More than the rounding of a scalar product of nx terms.
    slack = mixed * np.spacing(abs(H) @ np.maximum(abs(domain[0]), abs(domain[1]))) * (H.shape[1] + 1)
    return lower - slack, upper + slack


def _coordinates(entries: Trace, varying: np.ndarray) -> tuple[Coordinates, dict[tuple[int, int], np.ndarray]]:
    """Choose varying entries that determine the others by exact affine relations read off the operations."""
    places = np.argwhere(varying)
    forms = polynomial_forms(entries.operations)
    chosen, followers = independent([forms[entries.outputs[0][i, j]] for i, j in places])
    exactly = {(int(places[k][0]), int(places[k][1])): np.array(w, dtype=object) for k, w in followers.items()}
    return (places[chosen, 0], places[chosen, 1]), exactly


def _rounded(value: fmpq, towards: float) -> float:
    """The double nearest to a rational, or the next one in a direction where it lies on the wrong side."""
    found = float(value.p) / float(value.q) if value.q != 1 else float(int(value.p))
    difference = rational(found) - value
    if difference == 0 or (difference < 0) == (towards < 0):
        return found
    return float(np.nextafter(found, towards))
