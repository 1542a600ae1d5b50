"""The unscented Kalman filter: the belief is carried through the plant by a few points instead of a Jacobian."""

from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from luenberger.core import BadInput
from luenberger.observers.gaussian import Belief, GaussianFilter, Map, masked
from luenberger.observers.observer import Estimate
from luenberger.observers.small_matrix import cholesky, product, solve_positive, symmetrised
from luenberger.systems.system import System


class UnscentedKalmanFilter(GaussianFilter):
    """Kalman-type filter with 2 nx + 1 scaled sigma points; the estimate at sample k has used y_k.

    Choose it where the output or the plant bends within the spread of the belief; it needs no derivative. Fresh points
    are drawn for the measurement and for the time update, so both noises are additive. With
    lambda = alpha^2 (nx + kappa) - nx the points lie at the mean and sqrt(nx + lambda) Cholesky columns from it.

    Args:
        plant: a `System`, continuous or discrete; or the pair (one-step map, output), JAX functions of (x, u, r).
        dt: sample time [s]; needed for a continuous plant and for functions.
        measurement_covariance: R, shape (ny, ny), of the sampled noise, positive definite; need not be diagonal.
        initial_covariance: of the first guess, shape (nx, nx).
        process_covariance: Q added at every sample, shape (nx, nx); give this or
        process_density: spectral density of the continuous process noise [unit^2/s], shape (nx, nx), used as Q = density dt.
        method: "rk4", "exact" or "euler", for a continuous `System`; see `one_step`.
        substeps: parts of the sample time.
        states: names of the states where the plant is given as functions.
        alpha: spread of the points; 1 keeps all digits, 1e-3 costs six of them to cancellation.
        beta: weight of the centre point in the covariance; 2 suits a Gaussian belief.
        kappa: second spread parameter, above -nx.

    Raises:
        BadInput: wrong shapes, indefinite covariances, entries that are not finite, wrong sample time or spread.

    Reference: E. Wan and R. van der Merwe, The Unscented Kalman Filter for Nonlinear Estimation (2000), equation 15 and
        table 1, with the points redrawn after the time update and noises additive.
    """

    alpha: float = eqx.field(static=True)
    beta: float = eqx.field(static=True)
    kappa: float = eqx.field(static=True)

    def __init__(
        self,
        plant: System | tuple[Map, Map],
        dt: float | None = None,
        *,
        measurement_covariance: Any,
        initial_covariance: Any,
        process_covariance: Any = None,
        process_density: Any = None,
        method: str = "rk4",
        substeps: int = 1,
        states: Sequence[str] = (),
        alpha: float = 1.0,
        beta: float = 2.0,
        kappa: float = 0.0,
    ):
        self._tune(
            plant,
            dt,
            measurement_covariance=measurement_covariance,
            initial_covariance=initial_covariance,
            process_covariance=process_covariance,
            process_density=process_density,
            method=method,
            substeps=substeps,
            states=states,
        )
        nx = len(self.states)
        if not (np.isfinite([alpha, beta, kappa]).all() and alpha > 0 and nx + kappa > 0):
            raise BadInput(
                f"The spread is alpha = {alpha}, beta = {beta}, kappa = {kappa} with {nx} states; alpha > 0 and kappa > -{nx} are needed."
            )
        self.alpha, self.beta, self.kappa = float(alpha), float(beta), float(kappa)

    def step(self, state: Belief, u: Any, y: Any, r: Any) -> tuple[Belief, Estimate]:
        """Advance by one sample; see `Observer.step`. An entry of y that is NaN corrects nothing."""
        dtype = state.x.dtype
        model = self.model.cast(dtype)
        u, y, r = (jnp.asarray(signal, dtype) for signal in (u, y, r))
        present, R = masked(y, jnp.asarray(self.measurement_covariance, dtype))
        points = self._points(state)
        predicted, spread = self._transformed(jax.vmap(lambda x: model.output(x, u, r))(points))
        spread = jnp.where(present, spread, 0.0)
        weighted = spread * self._covariance_weights(dtype)[:, None]
        S = product(weighted.T, spread) + R
        gain = solve_positive(S, product(weighted.T, points - state.x)).T
        x = state.x + product(gain, jnp.where(present, y - predicted, 0.0))
        now = Belief(x, symmetrised(state.covariance - product(product(gain, S), gain.T)))
        mean, spread = self._transformed(jax.vmap(lambda x: model.advance(x, u, r))(self._points(now)))
        P = product((spread * self._covariance_weights(dtype)[:, None]).T, spread)
        P = P + jnp.asarray(self.process_covariance, dtype)
        return Belief(mean, symmetrised(P)), Estimate(now.x, now.covariance)

    @property
    def _scale(self) -> float:
        """nx + lambda."""
        return self.alpha**2 * (len(self.states) + self.kappa)

    def _covariance_weights(self, dtype: Any) -> np.ndarray:
        nx = len(self.states)
        weights = np.full(2 * nx + 1, 0.5 / self._scale)
        weights[0] = 1.0 - nx / self._scale + 1.0 - self.alpha**2 + self.beta
        return weights.astype(dtype)

    def _points(self, belief: Belief) -> jax.Array:
        offsets = cholesky(belief.covariance).T * float(np.sqrt(self._scale))
        return belief.x + jnp.concatenate([jnp.zeros_like(offsets[:1]), offsets, -offsets])

    def _transformed(self, values: jax.Array) -> tuple[jax.Array, jax.Array]:
        """Return mean and deviations of transformed points; the mean is taken about the centre point to save digits."""
        mean = values[0] + jnp.sum(values[1:] - values[0], axis=0) * (0.5 / self._scale)
        return mean, values - mean
