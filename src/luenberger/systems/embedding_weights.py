"""Lipschitz constants with weights: the smallest ellipsoid-like set |W^-1 (J - K) V^-1| <= 1 around given Jacobians."""

from dataclasses import dataclass, replace
from math import gamma, pi
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from scipy.optimize import minimize

from luenberger.algebra.definiteness import exact, positive_definite
from luenberger.algebra.endpoint import rational
from luenberger.core import NotAccepted, Outcome
from luenberger.systems.nonlinearity import Nonlinearity
from luenberger.systems.system import System

_DRAWS = 20000
_SEED = 19980101
# Weights stay within this logarithm of their start, where doubles do not overflow.
_REACH = 8.0


@dataclass(frozen=True, eq=False)
class WeightedNorm:
    """The set of Jacobians {J: |W^-1 (J - K) V^-1| <= constant}, W = diag(rows), V = diag(columns).

    Args:
        centre: K, shape (nf, nz).
        rows: diagonal of W, shape (nf,).
        columns: diagonal of V, shape (nz,).
        constant: proved to be large enough for every given Jacobian.
    """

    centre: np.ndarray
    rows: np.ndarray
    columns: np.ndarray
    constant: float

    @staticmethod
    def around(f: Nonlinearity, *, weighted: bool = True) -> "WeightedNorm":
        """Enclose the Jacobian set of a nonlinearity: its hull where it has one, else its box.

        Args:
            f: nonlinearity with a Jacobian box or hull.
            weighted: choose weights for the least volume; False takes the plain spectral norm.

        Raises:
            NotAccepted: no Jacobian box.
        """
        if f.jacobian_lower is None or f.jacobian_upper is None:
            raise NotAccepted("Weights are chosen for a Jacobian set; give the nonlinearity a Jacobian box or a hull.")
        middle = 0.5 * (f.jacobian_lower + f.jacobian_upper)
        varying = f.jacobian_lower < f.jacobian_upper
        # Among all matrices of a box about K, the one farthest from K in every entry has the largest weighted norm.
        sets = [(f.jacobian_upper - middle)[None]]
        if f.jacobian_vertices is not None:
            sets.append(f.jacobian_vertices - middle)
        found: list[WeightedNorm] = []
        for offsets in sets:
            centre, rows, columns = middle, np.ones(middle.shape[0]), np.ones(middle.shape[1])
            if weighted and varying.any():
                shift, rows, columns = _weights(offsets, varying)
                centre = middle + shift
            vertices = None if offsets is sets[0] else f.jacobian_vertices
            constant = _certified(centre, (f.jacobian_lower, f.jacobian_upper), vertices, rows, columns)
            found.append(WeightedNorm(centre, rows, columns, constant))
        return min(found, key=lambda norm: norm.volume(varying))

    def volume(self, varying: np.ndarray) -> float:
        """Return the volume of the set among matrices that differ from K in the varying entries only.

        Args:
            varying: True for these entries, shape (nf, nz).
        """
        m = int(varying.sum())
        sizes = self.constant * np.outer(self.rows, self.columns)
        whole = float(np.prod(sizes[varying]))
        if min(varying.any(axis=1).sum(), varying.any(axis=0).sum()) <= 1:
            return whole * pi ** (m / 2) / gamma(m / 2 + 1)
        draws = np.zeros((_DRAWS, *varying.shape))
        draws[:, varying] = np.random.default_rng(_SEED).uniform(-1.0, 1.0, (_DRAWS, m))
        return whole * 2.0**m * float(np.mean(np.linalg.norm(draws, 2, axis=(1, 2)) <= 1.0))

    @property
    def radius(self) -> float:
        """Largest |J - K| in the set."""
        return float(self.constant * self.rows.max() * self.columns.max())


def lipschitz_plant(plant: System, *, weighted: bool = True) -> System:
    """Return the same plant with F f(H x) written as F K H x + (F W) g(V H x), g having a proved Lipschitz constant.

    Args:
        plant: plant whose nonlinearity has a Jacobian box or hull; constant matrices.
        weighted: choose W and V for the least volume of the set of Jacobians; False takes the plain norm.

    Raises:
        NotAccepted: no nonlinearity, no Jacobian box, or matrices that depend on parameters.
    """
    f = plant.nonlinearity
    if f is None or plant.parameters:
        raise NotAccepted(f"`{plant.name}` has no nonlinearity, or depends on parameters; nothing has a constant here.")
    norm = WeightedNorm.around(f, weighted=weighted)
    inner, K = f.function, norm.centre
    rows, columns = norm.rows, norm.columns

    def scaled(z: Any, u: Any) -> jax.Array:
        own = z / columns.astype(z.dtype)
        return (jnp.atleast_1d(inner(own, u)) - (K.astype(z.dtype) * own).sum(axis=1)) / rows.astype(z.dtype)

    A, F, H = np.asarray(plant.at("A")), np.asarray(plant.at("F")), np.asarray(f.H)
    g = Nonlinearity.bounded(scaled, columns[:, None] * H, size=f.size, lipschitz=norm.constant, domain=f.domain)
    g = replace(g, bound_status=f.bound_status)
    return plant.replace(A=A + F @ K @ H, F=F * rows, nonlinearity=g)


def _weights(offsets: np.ndarray, varying: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Centre and diagonals for which all offsets have a weighted norm of at most one and the set has the least volume.

    Volume counts varying entries only, else zeros of the Jacobian would draw the weights to their limits.
    """
    nf, nz = varying.shape
    size = abs(offsets).max(axis=0)
    floor = 1e-3 * size.max()
    start = np.log(np.concatenate([np.maximum(size.max(axis=1), floor), np.maximum(size.max(axis=0), floor)]))
    start[nf:] -= start[:nf].max()
    start[:nf] += np.log(_largest(offsets, np.exp(start[:nf]), np.exp(start[nf:])))
    moves = len(offsets) > 1

    def parts(w: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        shift = np.zeros((nf, nz))
        shift[varying] = w[nf + nz :] * size[varying] if moves else 0.0
        return shift, np.exp(w[:nf]), np.exp(w[nf : nf + nz])

    def logarithm(w: np.ndarray) -> float:
        # The second term keeps what the volume does not see (a factor between W and V) from drifting.
        return float((w[:nf, None] + w[None, nf : nf + nz])[varying].sum() + 1e-4 * ((w - begin) ** 2).sum())

    def room(w: np.ndarray) -> np.ndarray:
        shift, rows, columns = parts(w)
        return 1.0 - np.linalg.norm((offsets - shift) / np.outer(rows, columns), 2, axis=(1, 2))

    begin = np.concatenate([start, np.zeros(int(varying.sum()) if moves else 0)])
    reach = np.where(np.arange(len(begin)) < nf + nz, _REACH, 1.0)
    found = minimize(
        logarithm,
        begin,
        method="SLSQP",
        bounds=list(zip(begin - reach, begin + reach, strict=True)),
        constraints={"type": "ineq", "fun": room},
        options={"maxiter": 300},
    )
    best = begin
    if np.isfinite(found.x).all():
        shift, rows, columns = parts(found.x)
        # SLSQP stops a little outside; what it gained must survive the correction.
        corrected = found.x.copy()
        corrected[:nf] += np.log(_largest(offsets - shift, rows, columns))
        best = corrected if logarithm(corrected) < logarithm(begin) else begin
    shift, rows, columns = parts(best)
    # Short numbers, so that scaling a plant by them rounds as little as possible.
    short = [np.array([float(f"{x:.4g}") for x in part.flat]).reshape(part.shape) for part in (shift, rows, columns)]
    return short[0], short[1], short[2]


def _largest(offsets: np.ndarray, rows: np.ndarray, columns: np.ndarray) -> float:
    return float(np.linalg.norm(offsets / np.outer(rows, columns), 2, axis=(1, 2)).max())


def _certified(
    centre: np.ndarray,
    box: tuple[np.ndarray, np.ndarray],
    vertices: np.ndarray | None,
    rows: np.ndarray,
    columns: np.ndarray,
) -> float:
    """A double at or above the largest weighted norm, shown by exact rationals: constant^2 I - M' M is positive definite."""
    middle = exact(centre)
    if vertices is not None:
        offsets = [exact(J) - middle for J in vertices]
    else:
        # The centre is rounded: the larger of both distances bounds every entry.
        low, high = (exact(end) for end in box)
        offsets = [np.where(high - middle >= middle - low, high - middle, middle - low)]
    scaled = [M / exact(rows)[:, None] / exact(columns)[None, :] for M in offsets]
    if not any(x != 0 for M in scaled for x in M.flat):
        return 0.0
    floats = np.array([[[float(x.p) / float(x.q) for x in row] for row in M] for M in scaled])
    constant = float(np.linalg.norm(floats, 2, axis=(1, 2)).max()) * (1.0 + 1e-12)
    while True:
        square = rational(constant) ** 2
        if all(positive_definite(exact(np.eye(M.shape[1])) * square - M.T @ M) is Outcome.PROVED for M in scaled):
            return constant
        constant *= 1.0 + 1e-9
