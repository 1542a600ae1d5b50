"""What a sensor does to a signal: delay, bias, noise, quantisation and dropout, in this order."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from luenberger.core import BadInput, Signal, Trajectory


@dataclass(frozen=True)
class Sensor:
    """One measured channel; what is left out is perfect.

    Args:
        channel: channel of the trajectory that is measured.
        noise: standard deviation of white Gaussian noise [unit of the channel].
        bias: constant offset [unit of the channel].
        delay: time by which the reading lags [s]; the first value is held before the record.
        quantum: step of the reading [unit of the channel], 0 for none.
        dropout: probability that a sample is lost; a lost sample is NaN.
        bound: half width of white uniform noise on top [unit of the channel]; with no other fault no error exceeds it.
        name: name of the measured channel; default the channel with "_measured".

    Raises:
        BadInput: a negative or non-finite number, or a dropout outside [0, 1).
    """

    channel: str
    noise: float = 0.0
    bias: float = 0.0
    delay: float = 0.0
    quantum: float = 0.0
    dropout: float = 0.0
    bound: float = 0.0
    name: str = ""

    def __post_init__(self) -> None:
        for word in ("noise", "delay", "quantum", "dropout", "bound"):
            value = getattr(self, word)
            if not (np.isfinite(value) and value >= 0):
                raise BadInput(
                    f"`{word}` of the sensor on `{self.channel}` is {value}; a finite number >= 0 is needed."
                )
        if not np.isfinite(self.bias):
            raise BadInput(f"`bias` of the sensor on `{self.channel}` is {self.bias}; a finite number is needed.")
        if self.dropout >= 1:
            raise BadInput(
                f"`dropout` of the sensor on `{self.channel}` is {self.dropout}; a probability below 1 is needed."
            )

    @property
    def measured_name(self) -> str:
        """Name of the channel that the sensor writes."""
        return self.name or f"{self.channel}_measured"

    def apply(
        self, time: Float[Array | np.ndarray, "nt"], values: Float[Array | np.ndarray, "nt"], key: Any
    ) -> Float[Array, "nt"]:
        """Return the reading, shape (nt,); a pure function, so Monte Carlo is a vmap over keys.

        Args:
            time: sample times [s].
            values: true signal.
            key: `jax.random` key.
        """
        noise_key, dropout_key = jax.random.split(key)
        reading = jnp.asarray(values)
        time = jnp.asarray(time)
        if self.delay:
            reading = jnp.interp(time - self.delay, time, reading)
        reading = reading + self.bias
        if self.noise:
            reading = reading + self.noise * jax.random.normal(noise_key, reading.shape, reading.dtype)
        if self.bound:
            # A key of its own, so that readings without a bound stay what they were.
            uniform = jax.random.uniform(jax.random.fold_in(key, 2), reading.shape, reading.dtype, -1.0, 1.0)
            reading = reading + self.bound * uniform
        if self.quantum:
            reading = self.quantum * jnp.round(reading / self.quantum)
        if self.dropout:
            reading = jnp.where(jax.random.bernoulli(dropout_key, self.dropout, reading.shape), jnp.nan, reading)
        return reading


def measure(trajectory: Trajectory, sensors: Sequence[Sensor], seed: int = 0) -> Trajectory:
    """Return the trajectory with the readings of the sensors as further channels.

    The noise of a sensor depends on the seed and its place in the list, so a run can be repeated exactly.

    Args:
        trajectory: true signals.
        sensors: sensors, each writing its own channel.
        seed: seed of the random numbers.

    Raises:
        BadInput: a channel is missing, or two sensors write one channel.
    """
    names = [sensor.measured_name for sensor in sensors]
    if repeated := sorted({name for name in names if names.count(name) > 1}):
        raise BadInput(f"Two sensors write {repeated}; give each its own `name`.")
    readings = []
    for k, sensor in enumerate(sensors):
        true = trajectory[sensor.channel]
        values = sensor.apply(trajectory.time, true.values, jax.random.fold_in(jax.random.key(seed), k))
        readings.append(Signal(sensor.measured_name, true.unit, np.asarray(values), f"{sensor} on {true.name}"))
    return trajectory.with_signals(*readings)
