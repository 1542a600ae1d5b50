"""The constant gain with the narrowest guaranteed steady box."""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar

import numpy as np
from scipy.optimize import minimize

from luenberger.algebra import Polynomial
from luenberger.core import BadInput, NotAccepted
from luenberger.methods.method import Candidate
from luenberger.methods.zonotopic_plant import DrivenError, no_gain, require_driven, steady_claims
from luenberger.systems import System

# How much the noise counts in the Kalman gains the search starts from.
RATIOS = (0.01, 0.1, 1.0, 10.0, 100.0)
# Best ends of the smooth search from which the direct search goes on.
_FINISHED = 3
# A loop that is not stable costs this many times the best start, and more the faster it grows.
_UNSTABLE = 1e3


@dataclass(frozen=True)
class SteadyWidth:
    """Constant gain that leaves the smallest box around the error once the start is forgotten.

    Choose it where bounds of disturbance and noise are known in numbers and the guaranteed box is what matters: it is narrower
    than that of gains that are best in an energy or mean-square sense, most where disturbances are few and act along directions.
    Not where the decay of the start counts more than the steady box.

    Assumes: x+ = A x + B u + E d, y = C x + D u + G v, u measured as u + N v, constant matrices, |d| <= disturbance_bound,
    |v| <= noise_bound.
    Certifies: every error ends in the reported box, and stays in it once in the smallest invariant set (steady_box);
    e' P e falls by the square of the reported factor a step without disturbance and noise; |L| <= the reported bound. With the
    current measurement also where every error ends that it leaves (filter_box).

    The half widths of the exact steady set are w(L) = sum over k of |(A - L C)^k [E dbar, -(B N + L (G - D N)) vbar]| 1. They
    are neither smooth nor convex in L, so the search starts from several Kalman gains, follows the gradient, and ends with a
    direct search. In the plane it was within a thousandth of the best of a scan over all gains; no such check is made at run time.

    Args:
        weights: how much the half width of each state counts [1/state units], nx numbers >= 0; None: one each. States of
            different units want weights.
        measure: "sum" of the weighted half widths, which lets every state count, or "largest" of them.
        uses: "previous" for a predictor with y up to the last sample; "current" for a filter that cuts the prediction by the strips
            of the current y: then the box after the cut is minimised, the design carries the filter gain K, and its other claims
            are about the prediction, with L = A K.

    Reference: the steady set is that of I. Kolmanovsky, E. Gilbert, Math. Probl. Eng. 4 (1998) 317-367; minimising its box
    over the gain directly is ours. The set that runs with the gain: C. Combastel, Automatica 55 (2015) 265-273, section 3.

    Example:
        >>> import luenberger as lb
        >>> from luenberger.methods.zonotopic_width import SteadyWidth
        >>> plant = lb.System.linear(
        ...     [[0.9]], C=[[1.0]], E=[[1.0]], dt=0.1, disturbance_bound=[1.0], noise_bound=[20.0])
        >>> best = SteadyWidth().best(plant)
        >>> bool(abs(best[0, 0]) < 1e-2)
        True
    """

    weights: Sequence[float] | np.ndarray | None = None
    measure: str = "sum"
    uses: str = "previous"

    references: ClassVar[tuple[str, ...]] = (
        "I. Kolmanovsky, E. Gilbert, Theory and computation of disturbance invariant sets for discrete-time linear systems, "
        "Math. Probl. Eng. 4 (1998) 317-367",
        "C. Combastel, Zonotopes and Kalman observers, Automatica 55 (2015) 265-273",
    )

    def __post_init__(self) -> None:
        if self.weights is not None:
            object.__setattr__(self, "weights", tuple(np.ravel(np.asarray(self.weights, dtype=float)).tolist()))

    def accept(self, system: System) -> None:
        """Refuse plants without a constant steady box and weights that do not fit; see `Method`."""
        require_driven(system)
        w = self.weights
        if w is not None and (len(w) != system.nx or not np.isfinite(w).all() or min(w) < 0 or max(w) == 0):
            raise BadInput(f"`weights` is {w}; {system.nx} finite numbers >= 0, not all zero, are needed.")
        if self.measure not in ("sum", "largest") or self.uses not in ("previous", "current"):
            raise BadInput(
                f'`measure` is "{self.measure}" and `uses` "{self.uses}"; "sum" or "largest", and "previous" or "current", are needed.'
            )

    def design(self, system: System) -> Candidate:
        """Search; see `Method`."""
        start = time.perf_counter()
        found, count = self._search(system)
        known = self._error(system).kalman()
        facts: dict[str, Any] = {
            "solver": "direct search",
            "solver_seconds": time.perf_counter() - start,
            "starts": count,
            "optimum": self.cost(system, found),
            "kalman": None if known is None else self.cost(system, known),
        }
        claims = partial(steady_claims, system)
        if self.uses == "previous":
            return Candidate(Polynomial.constant(found), claims, facts)
        L = np.asarray(system.at("A")) @ found
        return Candidate(Polynomial.constant(L), claims, facts, filter_gain=Polynomial.constant(found))

    def best(self, system: System) -> np.ndarray:
        """Return the gain, shape (nx, ny), L or with the current measurement K, with full digits and nothing proved.

        Args:
            system: plant.

        Raises:
            NotAccepted: see `accept`.
            BadInput: see `accept`.
        """
        self.accept(system)
        return self._search(system)[0]

    def filter_gain(self, system: System) -> np.ndarray:
        """Return K, shape (nx, ny), for `ZonotopicStripFilter` with its strips together.

        Args:
            system: plant.

        Raises:
            NotAccepted: a predictor has none; see `accept`.
            BadInput: see `accept`.
        """
        if self.uses == "previous":
            raise NotAccepted('A predictor has no filter gain; ask for `SteadyWidth(uses="current")`.')
        return self.best(system)

    def cost(self, system: System, gain: Any) -> float:
        """Return the weighted measure of the steady box of a given gain; infinite where its loop is not stable.

        Args:
            system: plant.
            gain: L, or with the current measurement K, shape (nx, ny).
        """
        K = np.asarray(gain, dtype=float).reshape(system.nx, system.ny)
        sizes = self._weights(system) * self._error(system).box(K)
        return float(sizes.sum() if self.measure == "sum" else sizes.max())

    def _error(self, system: System) -> DrivenError:
        return DrivenError.of(system) if self.uses == "previous" else DrivenError.filtered(system)

    def _weights(self, system: System) -> np.ndarray:
        return np.ones(system.nx) if self.weights is None else np.array(self.weights)

    def _search(self, system: System) -> tuple[np.ndarray, int]:
        error, weights = self._error(system), self._weights(system)
        starts = [L for ratio in RATIOS if (L := error.kalman(ratio)) is not None]
        if error.radius(still := np.zeros((system.nx, system.ny))) < 1:
            starts.append(still)
        if not starts:
            raise no_gain(system, "No Riccati equation")
        costs = [self.cost(system, L) for L in starts]
        # What is left of a box without disturbance and noise is zero at every gain.
        far = _UNSTABLE * (min(costs) or 1.0)
        smooth = partial(_cost_and_slope, error, weights, self.measure, far)
        ends = list(zip(costs, starts, strict=True))
        for L in starts:
            found = minimize(smooth, L.ravel(), jac=True, method="BFGS", options={"maxiter": 200})
            ends.append((float(found.fun), found.x.reshape(L.shape)))
        ends.sort(key=lambda end: end[0])
        finished = ends[:1]
        for _, L in ends[:_FINISHED]:
            found = minimize(
                lambda z: smooth(z)[0],
                L.ravel(),
                method="Nelder-Mead",
                options={
                    "initial_simplex": _simplex(L.ravel()),
                    "fatol": 1e-7 * far / _UNSTABLE,
                    "maxfev": 150 * L.size,
                },
            )
            finished.append((float(found.fun), found.x.reshape(L.shape)))
        return min(finished, key=lambda end: end[0])[1], len(starts)


def _cost_and_slope(
    error: DrivenError, weights: np.ndarray, measure: str, far: float, z: np.ndarray
) -> tuple[float, np.ndarray]:
    L = z.reshape(len(error.A), len(error.C))
    radius = error.radius(L)
    if not radius < 1 - 1e-6:
        return far * radius, np.zeros_like(z)
    sizes = weights * error.box(L)
    counted = weights if measure == "sum" else weights * (np.arange(len(weights)) == int(sizes.argmax()))
    cost = float(sizes.sum() if measure == "sum" else sizes.max())
    return min(cost, far), error.slope(L, counted).ravel()


def _simplex(z: np.ndarray) -> np.ndarray:
    """A first simplex a tenth of the gain wide."""
    size = 0.1 * max(float(np.abs(z).max()), 1e-3)
    return np.vstack([z, z + size * np.eye(z.size)])
