"""Input and scheduling signals as functions of time: sampled and held, or sampled and joined by straight lines."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from luenberger.core import BadInput
from luenberger.core.checks import finite_array, nearest


class HeldSamples(eqx.Module):
    """A sampled signal that keeps each value until the next sample, as a digital actuator does.

    Args:
        time: sample times [s], shape (nt,).
        values: samples, shape (nt, nc).
    """

    time: Float[Array | np.ndarray, "nt"]
    values: Float[Array | np.ndarray, "nt nc"]

    def __call__(self, t: Any) -> jax.Array:
        """Return the last sample at or before t, shape (nc,); the first one before the record."""
        index = jnp.searchsorted(jnp.asarray(self.time), t, side="right") - 1
        return jnp.asarray(self.values)[jnp.clip(index, 0, self.values.shape[0] - 1)]


class LinearSamples(eqx.Module):
    """A sampled signal joined by straight lines, the ends held outside the record.

    Args:
        time: sample times [s], shape (nt,).
        values: samples, shape (nt, nc).
    """

    time: Float[Array | np.ndarray, "nt"]
    values: Float[Array | np.ndarray, "nt nc"]

    def __call__(self, t: Any) -> jax.Array:
        """Return the interpolated value at t, shape (nc,)."""
        time, values = jnp.asarray(self.time), jnp.asarray(self.values)
        left = jnp.clip(jnp.searchsorted(time, t, side="right") - 1, 0, values.shape[0] - 2)
        share = jnp.clip((t - time[left]) / (time[left + 1] - time[left]), 0.0, 1.0)
        return values[left] + share * (values[left + 1] - values[left])


class FunctionOfTime(eqx.Module):
    """A user's function of time, its result made a vector.

    Args:
        function: JAX function t -> scalar or (nc,).
    """

    function: Any = eqx.field(static=True)

    def __call__(self, t: Any) -> jax.Array:
        """Return the value at t, shape (nc,)."""
        return jnp.atleast_1d(jnp.asarray(self.function(t), dtype=float))


Input = HeldSamples | LinearSamples | FunctionOfTime


def as_input(name: str, value: Any, time: np.ndarray, count: int, interpolation: str) -> Input:
    """Return a signal as a function of time, checked against the number of channels.

    Args:
        name: how the argument is called in messages.
        value: None (only for no channels), JAX function of time, or samples (nt, nc); (nt,) does for one channel.
        time: sample times [s], shape (nt,).
        count: number of channels nc that the model needs.
        interpolation: "held" or "linear", for samples.

    Raises:
        BadInput: missing, wrong shape, entries that are not finite, unknown interpolation.
    """
    if interpolation not in ("held", "linear"):
        raise BadInput(f"`interpolation` is `{interpolation}`.{nearest(interpolation, ['held', 'linear'])}")
    if value is None:
        if count:
            raise BadInput(
                f"`{name}` is not given but the model has {count} channels of it; give a function of time or samples."
            )
        value = np.zeros((time.size, 0))
    if callable(value):
        signal = value if isinstance(value, Input) else FunctionOfTime(value)
        shape = jax.eval_shape(signal, jax.ShapeDtypeStruct((), float)).shape
        if shape != (count,):
            raise BadInput(
                f"`{name}` returns shape {shape} but the model has {count} channels of it; ({count},) is needed."
            )
        return signal
    samples = finite_array(name, value)
    if samples.ndim == 1 and count == 1:
        samples = samples[:, None]
    if samples.shape != (time.size, count):
        raise BadInput(
            f"`{name}` has shape {samples.shape} but there are {time.size} times and {count} channels; ({time.size}, {count}) is needed."
        )
    return HeldSamples(time, samples) if interpolation == "held" else LinearSamples(time, samples)


def jumps(signal: Input) -> np.ndarray:
    """Return the times at which a held signal changes its value [s]; none for the other kinds."""
    if not isinstance(signal, HeldSamples):
        return np.zeros(0)
    values = np.asarray(signal.values)
    return np.asarray(signal.time)[1:][np.any(values[1:] != values[:-1], axis=1)]
