"""What the sensors of a car do to its signals, in numbers with a source; ready for `simulate.Sensor`.

sensors = [Sensor(**data.arguments()) for data in car_sensors]
"""

from dataclasses import dataclass, replace
from math import isfinite
from typing import Any

from luenberger.core import BadInput
from luenberger.core.checks import known_keys

_CHOSEN = "chosen for comparisons at 100 Hz, in the range of production sensors of stability control; not measured"
_BOUND = "chosen hard bound for set-membership tests; about a third to twice the deviation of the Gaussian sensor"
_FAULT = "assumed: an uncalibrated sensor read over a bus, to see what an observer makes of what it does not model"


@dataclass(frozen=True, kw_only=True)
class SensorData:
    """One sensor in numbers; its fields other than `bound`, `unit` and `source` are those of `simulate.Sensor`.

    Args:
        channel: channel that is measured.
        unit: SI unit of the channel.
        noise: standard deviation of Gaussian noise [unit].
        bias: constant offset [unit].
        delay: lag of the reading [s].
        quantum: step of the reading [unit], 0 for none.
        dropout: probability that a sample is lost.
        bound: greatest error of the reading [unit] where one is promised, None where not.
        source: where the numbers were taken from.

    Raises:
        BadInput: a negative or non-finite number.
    """

    channel: str
    unit: str
    noise: float = 0.0
    bias: float = 0.0
    delay: float = 0.0
    quantum: float = 0.0
    dropout: float = 0.0
    bound: float | None = None
    source: str = "not stated"

    def __post_init__(self) -> None:
        for word in ("noise", "delay", "quantum", "dropout", "bound"):
            value = getattr(self, word)
            if value is not None and not (isfinite(value) and value >= 0):
                raise BadInput(
                    f"`{word}` of the sensor on `{self.channel}` is {value}; a finite number >= 0 is needed."
                )
        if not isfinite(self.bias):
            raise BadInput(f"`bias` of the sensor on `{self.channel}` is {self.bias}; a finite number is needed.")

    def arguments(self) -> dict[str, Any]:
        """Return the arguments of `simulate.Sensor` for Gaussian noise, under the names they have there."""
        return {k: getattr(self, k) for k in ("channel", "noise", "bias", "delay", "quantum", "dropout")}

    def bounded_arguments(self) -> dict[str, Any]:
        """Return the arguments of a `simulate.Sensor` whose error is uniform within `bound`, and nothing else.

        Raises:
            BadInput: no bound is promised.
        """
        if self.bound is None:
            raise BadInput(
                f"The sensor on `{self.channel}` promises no `bound`; give one [{self.unit}], or use Gaussian noise."
            )
        return {"channel": self.channel, "bound": self.bound}


car_sensors = (
    SensorData(channel="yaw_rate", unit="rad/s", noise=3e-3, bound=5e-3, source=f"{_CHOSEN}; {_BOUND}"),
    SensorData(channel="steering", unit="rad", noise=1e-3, bound=1e-3, source=f"{_CHOSEN}; {_BOUND}"),
    SensorData(channel="steering_rate", unit="rad/s", noise=2e-2, bound=2e-2, source=f"{_CHOSEN}; {_BOUND}"),
    SensorData(channel="speed", unit="m/s", noise=0.05, source=_CHOSEN),
    SensorData(channel="acceleration", unit="m/s^2", noise=0.1, source=_CHOSEN),
    SensorData(channel="lateral_acceleration", unit="m/s^2", noise=0.1, source=_CHOSEN),
)

# Offset, lag and step laid over the noise above.
_FAULTS = {
    "yaw_rate": {"bias": 5e-3, "delay": 0.01, "quantum": 1e-3},
    "steering": {"bias": 2e-3, "delay": 0.01, "quantum": 1e-4},
    "steering_rate": {"delay": 0.01, "quantum": 5e-3},
    "speed": {"delay": 0.02, "quantum": 0.01},
    "acceleration": {"bias": 0.1, "delay": 0.01, "quantum": 0.02},
    "lateral_acceleration": {"bias": 0.1, "delay": 0.01, "quantum": 0.02},
}
faulty_car_sensors = tuple(
    replace(data, bound=None, source=f"{_CHOSEN}; {_FAULT}", **_FAULTS[data.channel]) for data in car_sensors
)

SENSOR_SETS = {"car_sensors": car_sensors, "faulty_car_sensors": faulty_car_sensors}


def sensors_on(sensors: tuple[SensorData, ...], *channels: str) -> tuple[SensorData, ...]:
    """Return the sensors of a set on the wanted channels, in that order.

    Args:
        sensors: a sensor set.
        channels: channels that are measured.

    Raises:
        BadInput: a channel that the set does not measure; the nearest is named.
    """
    known = {data.channel: data for data in sensors}
    known_keys("The list of channels", channels, list(known))
    return tuple(known[channel] for channel in channels)
