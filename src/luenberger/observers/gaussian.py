"""What all Kalman-type filters share: the belief, the plant as two maps, checked covariances, one masked update."""

from collections.abc import Callable, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from luenberger.core import BadInput
from luenberger.core.checks import matrix
from luenberger.observers.observer import Observer
from luenberger.observers.plant import Fixed, sample_time, state_vector
from luenberger.observers.small_matrix import product, solve_positive, symmetrised
from luenberger.systems.discretize import one_step
from luenberger.systems.system import System

Map = Callable[[Any, Any, Any], Any]
# Entries of a covariance may differ from symmetry or definiteness by rounding of this relative size.
ROUNDING = 1e-10


class Belief(eqx.Module):
    """State of a Kalman-type filter, predicted for the next sample.

    Args:
        x: mean, shape (nx,).
        covariance: shape (nx, nx).
    """

    x: jax.Array
    covariance: jax.Array


class Output(eqx.Module):
    """The output map of a plant, (x, u, r) -> C(r) x + D(r) u."""

    system: System

    def __call__(self, x: Any, u: Any, r: Any) -> jax.Array:
        """Return the output, shape (ny,)."""
        y = product(self.system.at("C", r), x)
        return y + product(self.system.at("D", r), u) if self.system.nu else y


class Model(eqx.Module):
    """A sampled plant as two maps of (x, u, r): the state one sample later, and the output."""

    advance: Map
    output: Map


class GaussianFilter(Observer):
    """Common parts of the Kalman filters; the arguments are explained there."""

    process_covariance: jax.Array | np.ndarray
    measurement_covariance: jax.Array | np.ndarray
    initial_covariance: jax.Array | np.ndarray
    dt: float = eqx.field(static=True)
    model: Fixed[Model] = eqx.field(static=True)
    states: tuple[str, ...] = eqx.field(static=True)

    def _tune(
        self,
        plant: System | tuple[Map, Map],
        dt: float | None,
        *,
        measurement_covariance: Any,
        initial_covariance: Any,
        process_covariance: Any,
        process_density: Any,
        method: str,
        substeps: int,
        states: Sequence[str] = (),
    ) -> None:
        """Check the arguments of a constructor and fill the fields."""
        if isinstance(plant, System):
            self.dt = sample_time(plant, dt)
            plant = plant.freeze(**plant.uncertainty)
            nx, ny, self.states = plant.nx, plant.ny, plant.states
            self.model = Fixed(Model(one_step(plant, self.dt, method, substeps), Output(plant)))
        else:
            if dt is None or not (np.isfinite(dt) and dt > 0):
                raise BadInput(
                    f"`dt` is {dt}; with the plant given as two functions a positive sample time in seconds is needed."
                )
            self.dt = float(dt)
            nx, ny = (
                matrix(n, c).shape[0]
                for n, c in (
                    ("initial_covariance", initial_covariance),
                    ("measurement_covariance", measurement_covariance),
                )
            )
            self.states = tuple(states) or tuple(f"x{k + 1}" for k in range(nx))
            self.model = Fixed(Model(*plant))
        if (process_covariance is None) == (process_density is None):
            raise BadInput(
                "Exactly one of `process_covariance` (added at every sample) and `process_density` (per second, multiplied by dt) is needed."
            )
        if process_covariance is None:
            process = checked_covariance("process_density", process_density, nx, "states") * self.dt
        else:
            process = checked_covariance("process_covariance", process_covariance, nx, "states")
        self.process_covariance = process
        self.measurement_covariance = checked_covariance(
            "measurement_covariance", measurement_covariance, ny, "outputs", definite=True
        )
        self.initial_covariance = checked_covariance("initial_covariance", initial_covariance, nx, "states")

    @property
    def reads(self) -> System | None:
        """The plant whose signals it reads."""
        return output.system if isinstance(output := self.model.value.output, Output) else None

    def init(self, x0: Any) -> Belief:
        """Return the start belief: the first guess with the initial covariance.

        Args:
            x0: first guess, shape (nx,); float32 here makes the whole run float32.
        """
        x = state_vector(x0, len(self.states))
        return Belief(x, jnp.asarray(self.initial_covariance, x.dtype))


def checked_covariance(name: str, value: Any, size: int, of: str, *, definite: bool = False) -> np.ndarray:
    """Return a covariance as a symmetric float64 matrix.

    Args:
        name: how the argument is called in messages.
        value: nested numbers, shape (size, size).
        size: wanted number of rows.
        of: what the rows stand for, in the plural.
        definite: refuse a zero eigenvalue as well.

    Raises:
        BadInput: wrong shape, entries that are not finite, asymmetry, or an eigenvalue of the wrong sign.
    """
    P = matrix(name, value, size, size, f"there are {size} {of}")
    scale = float(np.abs(P).max(initial=0.0))
    if (skew := float(np.abs(P - P.T).max(initial=0.0))) > ROUNDING * scale:
        raise BadInput(
            f"`{name}` differs from its transpose by {skew:.3g}; a covariance needs to be symmetric. Give (P + P')/2."
        )
    P = 0.5 * (P + P.T)
    smallest = float(np.linalg.eigvalsh(P).min(initial=np.inf))
    if smallest < -ROUNDING * scale or (definite and smallest <= 0.0):
        wanted = "positive definite" if definite else "positive semidefinite"
        raise BadInput(
            f"`{name}` has the eigenvalue {smallest:.3g}; a covariance of this kind needs to be {wanted}. Check signs and correlations."
        )
    return P


def masked(y: Float[Array, "ny"], measurement_covariance: Float[Array, "ny ny"]) -> tuple[Array, Float[Array, "ny ny"]]:
    """Return which outputs are present (not NaN), and R with a unit variance and no correlation for each absent one.

    Args:
        y: measurement; NaN marks a missing entry.
        measurement_covariance: R.
    """
    present = ~jnp.isnan(y)
    both = present[:, None] & present[None, :]
    return present, jnp.where(both, measurement_covariance, jnp.eye(y.shape[0], dtype=y.dtype))


def linear_update(
    belief: Belief,
    y: Float[Array, "ny"],
    predicted: Float[Array, "ny"],
    C: Float[Array, "ny nx"],
    measurement_covariance: Float[Array, "ny ny"],
) -> Belief:
    """Return the belief after a measurement, with the covariance in Joseph form; entries of y that are NaN correct nothing.

    Args:
        belief: before the measurement.
        y: measurement.
        predicted: output expected.
        C: output matrix.
        measurement_covariance: R.

    Reference: R. Bucy and P. Joseph, Filtering for Stochastic Processes (1968), chapter 16 (the form (I - K C) P (I - K C)' + K R K').
    """
    present, R = masked(y, measurement_covariance)
    C = jnp.where(present[:, None], C, 0.0)
    innovation = jnp.where(present, y - predicted, 0.0)
    PC = product(belief.covariance, C.T)
    gain = solve_positive(product(C, PC) + R, PC.T).T
    kept = jnp.eye(C.shape[1], dtype=C.dtype) - product(gain, C)
    P = product(product(kept, belief.covariance), kept.T) + product(product(gain, R), gain.T)
    return Belief(belief.x + product(gain, innovation), symmetrised(P))
