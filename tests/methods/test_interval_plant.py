"""What all interval designs share: order as inequalities, the margin of the linear programme, and the gain back in x."""

import numpy as np
import pytest

from interval_plants import FLIP, lateral_car, printed_gain, slip_transform, thesis_car, uncertain_pair
from luenberger.algebra import Polynomial
from luenberger.certify import prove
from luenberger.core import Infeasible, Outcome
from luenberger.lmi import Bernstein
from luenberger.methods.interval_plant import Coordinates, gain_of, refusal
from luenberger.methods.method import gain_bound
from luenberger.systems import System


def at(plant: System, T: np.ndarray) -> Coordinates:
    return Coordinates.of(plant, T, Bernstein())


def test_margin_is_the_certificate_that_no_gain_keeps_order() -> None:
    # a21 of the lateral car spans +-1.543 1/s and y = r does not show vy: no gain helps, whatever the sign.
    for T in (np.eye(2), FLIP):
        margin, name = at(lateral_car(), T).margin()
        assert margin == pytest.approx(-1.543, abs=1e-3)
        assert "yaw_rate, lateral_speed" in name
        assert at(lateral_car(), T).hopeless()
    mixed = at(lateral_car(), slip_transform())
    assert mixed.margin()[0] > 0
    assert not mixed.hopeless()


def test_one_state_keeps_any_order() -> None:
    assert at(System.linear([[-1.0]], C=[[1.0]]), np.eye(1)).margin() == (1.0, "")


def test_entries_are_named_with_their_sign() -> None:
    here = at(thesis_car(), FLIP)
    assert here.named(0, 1) == "entry (front_slip, -rear_slip)"
    assert at(lateral_car(), slip_transform()).named(0, 1) == "entry (z1, z2)"
    assert [b.name for b in here.order()] == ["entry (front_slip, -rear_slip)", "entry (-rear_slip, front_slip)"]
    # Column 1 of C is zero for the lateral car: only the entry in column 2 can be moved.
    assert [b.name for b in at(lateral_car(), np.eye(2)).order()] == ["entry (lateral_speed, yaw_rate)"]


def test_gain_is_taken_back_to_the_states() -> None:
    T, P = np.array([[1.0, 0.3], [-0.2, 0.7]]), np.diag([2.0, 0.5])
    here = at(uncertain_pair(), T)
    L = np.array([[0.7], [-0.4]])
    for _, y in here.Y:
        y.value = P @ T @ L
    np.testing.assert_allclose(gain_of(T, P, here.Y)({}), L, rtol=1e-12)


def test_gain_bound_covers_scheduling_that_is_read_wrong() -> None:
    plant = thesis_car(scale_error=((-0.1, 0.1), (-0.15, 0.15)))
    claim, plain = gain_bound(plant, printed_gain(True)), gain_bound(thesis_car(), printed_gain(True))
    assert claim.level > plain.level
    assert prove(plant, printed_gain(True), claim).outcome is Outcome.PROVED
    assert prove(plant, printed_gain(True), plain).outcome is Outcome.REFUTED


def test_refusal_names_what_stands_in_the_way() -> None:
    order = refusal(lateral_car(), [at(lateral_car(), T) for T in (np.eye(2), FLIP)], 0.0, lambda T: None)
    assert "any of the 2 coordinates" in str(order)
    assert order.nearest == pytest.approx(-1.543, abs=1e-3)
    decay = refusal(thesis_car(), [at(thesis_car(), FLIP)], 5.0, lambda T: 2.5)
    assert "the closest found was 2.5 1/s" in str(decay)
    assert isinstance(decay, Infeasible)
    assert decay.nearest == 2.5


def test_a_given_gain_leaves_the_storage_free() -> None:
    here = Coordinates.of(thesis_car(), FLIP, Bernstein(), gain=Polynomial.constant(np.zeros((2, 1))))
    assert set(here.variables) == {"diagonal"}
