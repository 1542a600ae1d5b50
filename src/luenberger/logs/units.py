"""Units at the door: what a log may be written in, and the factor that brings it to SI."""

from dataclasses import dataclass
from math import pi

import numpy as np

from luenberger.core import BadInput
from luenberger.core.checks import nearest


@dataclass(frozen=True)
class Unit:
    """One unit a log may use: SI value = factor * value + offset.

    Args:
        si: the SI unit as text, what the signal carries afterwards.
        factor: multiplies the logged number.
        offset: added after the factor, in SI (temperatures).
    """

    si: str
    factor: float = 1.0
    offset: float = 0.0

    def to_si(self, values: np.ndarray) -> np.ndarray:
        """Return the values in SI.

        Args:
            values: numbers in this unit, any shape.
        """
        return values * self.factor + self.offset


STANDARD_GRAVITY = 9.80665
_DEGREE = pi / 180.0
_UNITS = {
    "": Unit(""),
    "1": Unit(""),
    "%": Unit("", 0.01),
    "rad": Unit("rad"),
    "mrad": Unit("rad", 1e-3),
    "deg": Unit("rad", _DEGREE),
    "rad/s": Unit("rad/s"),
    "mrad/s": Unit("rad/s", 1e-3),
    "deg/s": Unit("rad/s", _DEGREE),
    "rpm": Unit("rad/s", pi / 30.0),
    "rad/s^2": Unit("rad/s^2"),
    "deg/s^2": Unit("rad/s^2", _DEGREE),
    "m": Unit("m"),
    "mm": Unit("m", 1e-3),
    "cm": Unit("m", 1e-2),
    "km": Unit("m", 1e3),
    "ft": Unit("m", 0.3048),
    "mile": Unit("m", 1609.344),
    "m/s": Unit("m/s"),
    "mm/s": Unit("m/s", 1e-3),
    "km/h": Unit("m/s", 1.0 / 3.6),
    "mph": Unit("m/s", 0.44704),
    "knot": Unit("m/s", 1852.0 / 3600.0),
    "ft/s": Unit("m/s", 0.3048),
    "m/s^2": Unit("m/s^2"),
    "g": Unit("m/s^2", STANDARD_GRAVITY),
    "mg": Unit("m/s^2", 1e-3 * STANDARD_GRAVITY),
    "s": Unit("s"),
    "ms": Unit("s", 1e-3),
    "us": Unit("s", 1e-6),
    "ns": Unit("s", 1e-9),
    "min": Unit("s", 60.0),
    "h": Unit("s", 3600.0),
    "kg": Unit("kg"),
    "t": Unit("kg", 1e3),
    "N": Unit("N"),
    "kN": Unit("N", 1e3),
    "N m": Unit("N m"),
    "kN m": Unit("N m", 1e3),
    "Pa": Unit("Pa"),
    "kPa": Unit("Pa", 1e3),
    "MPa": Unit("Pa", 1e6),
    "bar": Unit("Pa", 1e5),
    "K": Unit("K"),
    "degC": Unit("K", 1.0, 273.15),
    "V": Unit("V"),
    "mV": Unit("V", 1e-3),
    "A": Unit("A"),
    "mA": Unit("A", 1e-3),
    "W": Unit("W"),
    "kW": Unit("W", 1e3),
    "Hz": Unit("Hz"),
}
_OTHER_SPELLINGS = {
    "-": "",
    "degree": "deg",
    "degrees": "deg",
    "°": "deg",
    "°/s": "deg/s",
    "dps": "deg/s",
    "kph": "km/h",
    "kmh": "km/h",
    "mi/h": "mph",
    "kn": "knot",
    "G": "g",
    "m/s2": "m/s^2",
    "m/s²": "m/s^2",
    "m/s/s": "m/s^2",
    "rad/s2": "rad/s^2",
    "rad/s²": "rad/s^2",
    "deg/s2": "deg/s^2",
    "deg/s²": "deg/s^2",
    "µs": "us",
    "Nm": "N m",
    "N*m": "N m",
    "kNm": "kN m",
    "°C": "degC",
    "1/min": "rpm",
}


def unit_named(text: str) -> Unit:
    """Return the unit of a name such as "deg/s", "km/h" or "g" (standard gravity, not gram).

    Args:
        text: unit as written in a channel map.

    Raises:
        BadInput: unknown unit; the nearest known one is named.
    """
    word = text.strip()
    word = _OTHER_SPELLINGS.get(word, word)
    if word not in _UNITS:
        raise BadInput(f"The unit `{text}` is not known.{nearest(word, [u for u in _UNITS if u])}")
    return _UNITS[word]
