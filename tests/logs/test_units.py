"""Every unit a log may use reaches SI, and an unknown one is refused with the nearest."""

import numpy as np
import pytest

from luenberger.core import BadInput
from luenberger.logs.units import unit_named


@pytest.mark.parametrize(
    ("text", "si", "logged", "value"),
    [
        ("deg", "rad", 180.0, np.pi),
        ("deg/s", "rad/s", -90.0, -np.pi / 2),
        ("°/s", "rad/s", 90.0, np.pi / 2),
        ("km/h", "m/s", 36.0, 10.0),
        ("kph", "m/s", 36.0, 10.0),
        ("mph", "m/s", 100.0, 44.704),
        ("g", "m/s^2", 1.0, 9.80665),
        ("m/s2", "m/s^2", 3.0, 3.0),
        ("ms", "s", 20.0, 0.02),
        ("ns", "s", 5e8, 0.5),
        ("kN", "N", -1.5, -1500.0),
        ("Nm", "N m", 2.0, 2.0),
        ("rpm", "rad/s", 60.0, 2 * np.pi),
        ("degC", "K", 20.0, 293.15),
        ("%", "", 50.0, 0.5),
        (" - ", "", 2.0, 2.0),
    ],
)
def test_a_logged_number_reaches_si(text: str, si: str, logged: float, value: float) -> None:
    unit = unit_named(text)
    assert unit.si == si
    # One multiplication away from the exact factor: a few units in the last place.
    assert unit.to_si(np.array([logged]))[0] == pytest.approx(value, rel=1e-15)


def test_an_unknown_unit_gets_the_nearest() -> None:
    with pytest.raises(BadInput, match=r"unit `deg/sec` is not known. Did you mean `deg/s"):
        unit_named("deg/sec")
