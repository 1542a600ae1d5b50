"""How hidden motions are put into words."""

import math

import numpy as np
import pytest

from luenberger.systems import System
from luenberger.systems.mode import Mode, Report, in_words, named_modes, place, slowest_first


def mode(eigenvalue: complex, dt: float | None = None, roundoff: float = 0.0) -> Mode:
    return Mode(eigenvalue, np.array([1.0]), "x1", {}, dt, roundoff)


@pytest.mark.parametrize(
    ("vector", "text"),
    [
        ([1.0, 1.0, 0.0], "0.71*front_slip + 0.71*rear_slip"),
        ([-1.0, 0.0, 0.0], "front_slip"),
        ([-1.0, 2.0, 0.0], "-0.45*front_slip + 0.89*rear_slip"),
        ([1.0, 0.0, -1.0], "0.71*front_slip - 0.71*yaw_rate"),
        ([1.0, 1e-4, 0.0], "front_slip"),
        ([1.0, 1j, 0.0], "plane of 0.71*front_slip and 0.71*rear_slip"),
        ([1j, 1j, 0.0], "0.71*front_slip + 0.71*rear_slip"),
    ],
)
def test_directions_in_state_names(vector: list[complex], text: str) -> None:
    assert in_words(np.array(vector), ["front_slip", "rear_slip", "yaw_rate"]) == text


def test_places() -> None:
    assert place({}) == ""
    assert place({"vx": 20.0, "mu": 0.35}) == " at vx = 20, mu = 0.35"


def test_decay_of_continuous_and_discrete_modes() -> None:
    assert mode(-3 + 4j).decay == 3
    assert mode(0.5j, dt=0.1).decay == pytest.approx(math.log(2) / 0.1)
    assert mode(0, dt=0.1).decay == math.inf


def test_fading_is_strict_and_leaves_room_for_roundoff() -> None:
    assert mode(-3.0).fades(2.9)
    assert not mode(-3.0).fades(3.0)
    assert not mode(-1e-12, roundoff=1e-9).fades(0.0)
    assert mode(0.9, dt=0.1).fades(1.0)
    assert not mode(0.9, dt=0.1).fades(1.1)
    assert not mode(1.0, dt=0.1).fades(0.0)


def test_values_carry_their_unit() -> None:
    assert mode(-3.627).value == "-3.63 1/s"
    assert mode(-1 + 2j).value == "-1 +/- 2j 1/s"
    assert mode(0.95, dt=0.1).value == "0.95 a step"


def test_one_mode_of_a_pair_is_named() -> None:
    plant = System.linear(np.zeros((2, 2)), states=["a", "b"])
    found = named_modes(plant, {}, np.array([1j, -1j]), np.array([[1, 1], [1j, -1j]]) / math.sqrt(2), 0.0)
    assert [m.eigenvalue for m in found] == [1j]


def test_order_and_report() -> None:
    ordered = slowest_first([mode(-5.0), mode(1.0), mode(-1.0)])
    assert [m.eigenvalue for m in ordered] == [1.0, -1.0, -5.0]
    report = Report("observability", False, ordered, ("One.", "Two."), 1, np.zeros(1))
    assert not report
    assert str(report) == "One.\nTwo."
