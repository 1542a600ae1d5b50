"""The Kalman filter and its extension to nonlinear plants by linearisation."""

from abc import abstractmethod
from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp

from luenberger.core import NotAccepted
from luenberger.observers.gaussian import Belief, GaussianFilter, Map, Model, linear_update
from luenberger.observers.observer import Estimate
from luenberger.observers.small_matrix import product, symmetrised
from luenberger.systems.system import System


class _Linearised(GaussianFilter):
    """Measurement update and time update with the matrices a subclass finds."""

    @abstractmethod
    def _output(self, model: Model, x: Any, u: Any, r: Any) -> tuple[Any, Any]:
        """Return the output and its matrix with respect to x."""

    @abstractmethod
    def _advance(self, model: Model, x: Any, u: Any, r: Any) -> tuple[Any, Any]:
        """Return the state one sample later and its matrix with respect to x."""

    def step(self, state: Belief, u: Any, y: Any, r: Any) -> tuple[Belief, Estimate]:
        """Advance by one sample; see `Observer.step`. An entry of y that is NaN corrects nothing."""
        dtype = state.x.dtype
        model = self.model.cast(dtype)
        u, y, r = (jnp.asarray(signal, dtype) for signal in (u, y, r))
        R, Q = (jnp.asarray(c, dtype) for c in (self.measurement_covariance, self.process_covariance))
        predicted, C = self._output(model, state.x, u, r)
        now = linear_update(state, y, predicted, C, R)
        x, A = self._advance(model, now.x, u, r)
        P = product(product(A, now.covariance), A.T) + Q
        return Belief(x, symmetrised(P)), Estimate(now.x, now.covariance)


class KalmanFilter(_Linearised):
    """Kalman filter of a linear or scheduled plant; the estimate at sample k has used y_k.

        x+ = A x + B u + w,  cov w = Q          y = C x + D u + v,  cov v = R

    Choose it as the baseline wherever the plant is linear and noise is the trouble; it proves nothing about
    model error. A continuous plant is sampled first by `method`.

    Assumes: no nonlinearity; w and v white, of zero mean, independent.

    Args:
        system: linear plant, continuous or discrete; unmeasured parameters sit at their midpoints.
        dt: sample time [s]; needed for a continuous plant.
        measurement_covariance: R, shape (ny, ny), of the sampled noise, positive definite; need not be diagonal.
        initial_covariance: of the first guess, shape (nx, nx).
        process_covariance: Q added at every sample, shape (nx, nx); give this or
        process_density: spectral density of the continuous process noise [unit^2/s], shape (nx, nx), used as Q = density dt.
        method: "exact" hold, "rk4" or "euler", for a continuous plant.
        substeps: parts of the sample time under "rk4" and "euler".

    Raises:
        NotAccepted: the plant has a nonlinearity.
        BadInput: wrong shapes, indefinite covariances, entries that are not finite, wrong sample time.

    Reference: R. Kalman, A New Approach to Linear Filtering and Prediction Problems (1960), theorem 3; covariance in Joseph form.
    """

    def __init__(
        self,
        system: System,
        dt: float | None = None,
        *,
        measurement_covariance: Any,
        initial_covariance: Any,
        process_covariance: Any = None,
        process_density: Any = None,
        method: str = "exact",
        substeps: int = 1,
    ):
        if system.nonlinearity is not None:
            raise NotAccepted(
                f"`{system.name}` has a nonlinearity; use `ExtendedKalmanFilter` or `UnscentedKalmanFilter`."
            )
        self._tune(
            system,
            dt,
            measurement_covariance=measurement_covariance,
            initial_covariance=initial_covariance,
            process_covariance=process_covariance,
            process_density=process_density,
            method=method,
            substeps=substeps,
        )

    def _output(self, model: Any, x: Any, u: Any, r: Any) -> tuple[Any, Any]:
        return model.output(x, u, r), jnp.asarray(model.output.system.at("C", r))

    def _advance(self, model: Any, x: Any, u: Any, r: Any) -> tuple[Any, Any]:
        # The map is linear, so its matrix is its response to the unit vectors with the input at rest.
        unit = jnp.eye(x.shape[0], dtype=x.dtype)
        A = jax.vmap(lambda e: model.advance(e, jnp.zeros_like(u), r), out_axes=1)(unit)
        return model.advance(x, u, r), A


class ExtendedKalmanFilter(_Linearised):
    """Kalman filter along the estimate, with Jacobians by automatic differentiation; the estimate at sample k has used y_k.

    Choose it for smooth plants whose estimate stays near the truth; it can diverge after a poor first guess, and its
    covariance is no guarantee.

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

    Raises:
        BadInput: wrong shapes, indefinite covariances, entries that are not finite, wrong sample time.

    Reference: A. Jazwinski, Stochastic Processes and Filtering Theory (1970), theorem 8.1; covariance in Joseph form.
    """

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

    def _output(self, model: Any, x: Any, u: Any, r: Any) -> tuple[Any, Any]:
        return _with_jacobian(model.output, x, u, r)

    def _advance(self, model: Any, x: Any, u: Any, r: Any) -> tuple[Any, Any]:
        return _with_jacobian(model.advance, x, u, r)


def _with_jacobian(function: Any, x: Any, u: Any, r: Any) -> tuple[Any, Any]:
    def twice(z: Any) -> tuple[Any, Any]:
        value = function(z, u, r)
        return value, value

    jacobian, value = jax.jacfwd(twice, has_aux=True)(x)
    return value, jacobian
