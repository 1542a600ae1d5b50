"""Claims about enclosures against plants whose answer is known by hand, spoiled gains and witnesses, and refusals."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from interval_plants import FLIP, printed_gain, thesis_car, uncertain_pair
from luenberger.algebra import Polynomial
from luenberger.certify import Claim, Proof, prove
from luenberger.core import BadInput, NotAccepted, Outcome
from luenberger.systems import Parameter, System
from luenberger.systems.enclosure_system import order_margin

NO_GAIN = Polynomial.constant(np.zeros((2, 1)))
SLIP_NAMES = ("inverse_speed", "acceleration")


def slip_gain(constant: list[float], slope: list[float]) -> Polynomial:
    """L = constant + slope / vx."""
    terms = {(0, 0): np.array(constant)[:, None], (1, 0): np.array(slope)[:, None]}
    return Polynomial(SLIP_NAMES, terms)


def decided(system: System, gain: Polynomial, kind: Any, level: float = 0.0, **witness: Any) -> Proof:
    return prove(system, gain, Claim(kind, level, **witness))


def scalar_plant(**options: Any) -> System:
    """x' = q x with q in [-2, -1], x measured."""
    A = Polynomial.affine(np.zeros((1, 1)), q=np.eye(1))
    return System.lpv(A, C=[[1.0]], parameters=[Parameter("q", -2.0, -1.0, measured=False)], **options)


def bent_plant(middle: float) -> System:
    """Off-diagonal entries (r - 1/2)^2 + middle for r in [0, 1]."""
    ones = np.array([[0.0, 1.0], [1.0, 0.0]])
    A = Polynomial(("r",), {(0,): (0.25 + middle) * ones - 5 * np.eye(2), (1,): -ones, (2,): ones})
    return System.lpv(A, C=[[1.0, 0.0]], parameters=[Parameter("r", 0.0, 1.0)])


def test_order_of_the_car_with_and_without_gain() -> None:
    # k = a b / Iz - 1/m < 0: without a gain order holds for (front, -rear) and not for (front, rear).
    assert decided(thesis_car(), NO_GAIN, "cooperative", transform=FLIP).outcome is Outcome.PROVED
    refuted = decided(thesis_car(), NO_GAIN, "cooperative")
    assert refuted.outcome is Outcome.REFUTED
    assert "entry (front_slip, rear_slip)" in refuted.reason


def test_printed_gain_keeps_order_up_to_its_speed_only() -> None:
    proof = decided(thesis_car(), printed_gain(True), "cooperative", transform=FLIP)
    assert proof.outcome is Outcome.REFUTED
    assert proof.point["inverse_speed"] == pytest.approx(3.6 / 150)
    slower = decided(thesis_car(fast=118.0), printed_gain(True), "cooperative", transform=FLIP)
    assert slower.outcome is Outcome.PROVED
    assert decided(thesis_car(), printed_gain(False), "cooperative").outcome is Outcome.REFUTED


@given(st.lists(st.integers(-20, 20).map(float), min_size=4, max_size=4), st.booleans())
def test_order_agrees_with_the_vertices(numbers: list[float], turned: bool) -> None:
    gain = slip_gain(numbers[:2], numbers[2:])
    T = FLIP if turned else None
    margin = order_margin(thesis_car(), gain, T).value
    proof = decided(thesis_car(), gain, "cooperative", transform=T)
    if abs(margin) > 1e-9:  # floats cannot tell the sign of less
        assert proof.outcome is (Outcome.PROVED if margin > 0 else Outcome.REFUTED)
    if proof.outcome is Outcome.REFUTED:
        assert margin < 1e-9


def test_entries_that_vanish_are_no_obstacle() -> None:
    decoupled = System.linear(-np.eye(2), C=[[1.0, 0.0]])
    assert decided(decoupled, NO_GAIN, "cooperative").outcome is Outcome.PROVED
    A = Polynomial.affine(-np.eye(2), r=np.array([[0.0, 1.0], [0.0, 0.0]]))
    edge = System.lpv(A, C=[[1.0, 0.0]], parameters=[Parameter("r", 0.0, 1.0)])
    assert decided(edge, NO_GAIN, "cooperative").outcome is Outcome.PROVED


def test_order_between_the_vertices() -> None:
    assert decided(bent_plant(0.01), NO_GAIN, "cooperative").outcome is Outcome.PROVED
    inside = decided(bent_plant(-0.01), NO_GAIN, "cooperative")
    assert inside.outcome is Outcome.REFUTED
    assert 0.4 < inside.point["r"] < 0.6
    # Zero at one inner point is allowed; subdivision by halves meets it, so at least it is not called wrong.
    assert decided(bent_plant(0.0), NO_GAIN, "cooperative").outcome is not Outcome.REFUTED


def test_order_under_a_scheduling_error() -> None:
    # Exactly at the limit for exact scheduling: l1 = -k Cr s needs room where the speed is read too high.
    gain = slip_gain([0.02, -0.02], [6.0, -8.0])
    options: dict[str, Any] = {"scale_error": ((-0.2, 0.2), (0.0, 0.0))}
    assert decided(thesis_car(), gain, "cooperative").outcome is Outcome.PROVED
    proof = decided(thesis_car(**options), gain, "cooperative")
    assert proof.outcome is Outcome.REFUTED
    assert proof.point["inverse_speed_factor"] == pytest.approx(1 / 1.2)


def test_width_decays_as_fast_as_the_largest_matrix() -> None:
    # Mbar = [[-0.9, 0.7], [0.5, -1.7]] at q = 1; he(Mbar) = [[-1.8, 1.2], [1.2, -3.4]] has the largest eigenvalue -1.158.
    fine = decided(uncertain_pair(), NO_GAIN, "width_decay", 0.57, storage=np.eye(2))
    assert fine.outcome is Outcome.PROVED
    assert decided(uncertain_pair(), NO_GAIN, "width_decay", 0.59, storage=np.eye(2)).outcome is Outcome.REFUTED


def test_width_witnesses_are_checked() -> None:
    off = np.array([[1.0, 0.1], [0.1, 1.0]])
    proof = decided(uncertain_pair(), NO_GAIN, "width_decay", 0.1, storage=off)
    assert proof.outcome is Outcome.REFUTED
    assert "diagonal storage" in proof.reason
    assert decided(uncertain_pair(), NO_GAIN, "width_decay", 0.1, storage=-np.eye(2)).outcome is Outcome.REFUTED
    # With this gain the first state pulls the second one down: no order, so nothing about widths either.
    spoiled = decided(
        uncertain_pair(), Polynomial.constant(np.array([[0.0], [3.0]])), "width_decay", 0.1, storage=np.eye(2)
    )
    assert "entry (x2, x1)" in spoiled.reason


@pytest.mark.parametrize(("inputs", "bound", "optimum"), [("residual", None, 1.0), ("mismatch", [3.0], 3.0)])
def test_width_gain_of_a_scalar(inputs: str, bound: list[float] | None, optimum: float) -> None:
    # Slowest rate 1, range of q is 1: residual -> width has gain 1; |x| / 3 -> width has gain 3.
    witness = {"weight": np.eye(1), "inputs": inputs, "state_bound": None if bound is None else np.array(bound)}
    for level, P, outcome in ((1.01, 1.0, Outcome.PROVED), (0.99, 1.0, Outcome.REFUTED)):
        proof = decided(scalar_plant(), Polynomial.constant(np.zeros((1, 1))), "width_gain", level * optimum, storage=np.array([[P]]), **witness)  # fmt: skip
        assert proof.outcome is outcome


def test_width_gain_with_noise() -> None:
    # e' = (q - 2) e, residual 1, noise 2 * |L| * 0.25 = 1: two directions of size 1 over the rate 3 give sqrt(2)/3.
    system = scalar_plant(noise_bound=(0.25,))
    gain = Polynomial.constant(np.array([[2.0]]))
    for inputs in ("residual+noise", "mismatch+noise"):
        witness = {"storage": np.array([[1 / 3]]), "weight": np.eye(1), "inputs": inputs}
        assert decided(system, gain, "width_gain", np.sqrt(2) / 3 * 1.001, **witness).outcome is Outcome.PROVED
        assert decided(system, gain, "width_gain", np.sqrt(2) / 3 * 0.999, **witness).outcome is Outcome.REFUTED
    with pytest.raises(NotAccepted, match="noise_bound"):
        decided(scalar_plant(), gain, "width_gain", 1.0, **witness)
    with pytest.raises(BadInput, match="inputs"):
        decided(system, gain, "width_gain", 1.0, **(witness | {"inputs": "mismatch+disturbance"}))


def test_width_of_a_scalar_is_met_exactly() -> None:
    # -3 v + range 1 * |x| 4 + 2 * (2 * 0.25) + 2 * 0.5 = 0 at v = 2, in numbers that doubles hold.
    system = scalar_plant(noise_bound=(0.25,), E=[[1.0]], disturbance_bound=(0.5,))
    gain = Polynomial.constant(np.array([[2.0]]))
    for v, outcome in ((2.0, Outcome.PROVED), (2.0 - 1e-9, Outcome.REFUTED)):
        proof = decided(system, gain, "width", 2.0, vector=np.array([v]), state_bound=np.array([4.0]))
        assert proof.outcome is outcome
    assert "row x1" in proof.reason


def test_width_counts_uncertain_inputs() -> None:
    # Row 2 at q = +-1: 0.5 v1 - 1.7 v2 + 0.2 |x1| + 0.6 |x2| + 0.4 |u|; row 1: -0.9 v1 + 0.7 v2 + 0.2 |x1| + 0.4 |x2|.
    M = np.array([[-0.9, 0.7], [0.5, -1.7]])
    b = np.array([0.2 + 0.4, 0.2 + 0.6 + 0.4 * 0.5])
    v = np.linalg.solve(-M, b)
    bound = np.array([1.0, 1.0, 0.5])
    system = uncertain_pair()
    proof = decided(system, NO_GAIN, "width", 10.0, vector=1.001 * v, state_bound=bound)
    assert proof.outcome is Outcome.PROVED
    assert decided(system, NO_GAIN, "width", 10.0, vector=0.999 * v, state_bound=bound).outcome is Outcome.REFUTED
    # Both widths hold, and the claimed largest lies between them.
    between = decided(system, NO_GAIN, "width", v.mean(), vector=1.001 * v, state_bound=bound)
    assert between.outcome is Outcome.REFUTED
    assert "vector" in between.reason
    assert decided(system, NO_GAIN, "width", 10.0, vector=-v, state_bound=bound).outcome is Outcome.REFUTED
    with pytest.raises(NotAccepted, match="input matrix"):
        decided(system, NO_GAIN, "width", 10.0, vector=v, state_bound=bound[:2])
    with pytest.raises(NotAccepted, match="`state_bound`, 2 numbers"):
        decided(system, NO_GAIN, "width", 10.0, vector=v)
    with pytest.raises(BadInput, match="vector"):
        decided(system, NO_GAIN, "width", 10.0, vector=v[:1], state_bound=bound)


def test_negative_widths_prove_nothing() -> None:
    # x' = q x with q in [1, 2] runs away, although 2 v + |x| <= 0 at v = -1.
    A = Polynomial.affine(np.zeros((1, 1)), q=np.eye(1))
    runaway = System.lpv(A, C=[[1.0]], parameters=[Parameter("q", 1.0, 2.0, measured=False)])
    proof = decided(
        runaway, Polynomial.constant(np.zeros((1, 1))), "width", 1.0, vector=np.array([-1.0]), state_bound=np.ones(1)
    )
    assert proof.outcome is Outcome.REFUTED


def test_containment_needs_order_and_bounds() -> None:
    gain = slip_gain([0.0, 0.0], [0.0, 0.0])
    assert decided(thesis_car(), gain, "containment", transform=FLIP).outcome is Outcome.PROVED
    assert decided(thesis_car(), gain, "containment").outcome is Outcome.REFUTED
    noisy = thesis_car(noise=(1e-3, 0.02, 5e-3), force_offset=30.0)
    assert decided(noisy, gain, "containment", transform=FLIP).outcome is Outcome.PROVED
    for part, name in (("noise_bound", "noises"), ("disturbance_bound", "unknown inputs")):
        with pytest.raises(NotAccepted, match=name):
            decided(noisy.replace(**{part: None}), gain, "containment", transform=FLIP)


def test_containment_needs_vertices() -> None:
    A = Polynomial(("q",), {(0,): 0.5 - 2 * np.eye(2), (2,): np.array([[0.0, 1.0], [1.0, 0.0]])})
    system = System.lpv(A, C=[[1.0, 0.0]], parameters=[Parameter("q", -1.0, 1.0, measured=False)])
    assert decided(system, NO_GAIN, "cooperative").outcome is Outcome.PROVED
    with pytest.raises(NotAccepted, match="power above one"):
        decided(system, NO_GAIN, "containment")


def test_claims_survive_a_change_of_units_and_order_of_rows() -> None:
    # Positive rows of T only rescale widths: order, containment and decay are the same statements.
    T = np.diag([4.0, 0.5]) @ np.array([[0.0, -1.0], [1.0, 0.0]])
    assert decided(thesis_car(), NO_GAIN, "cooperative", transform=T).outcome is Outcome.PROVED
    claim = Claim("width_decay", 1.0, np.eye(2), transform=FLIP)
    scaled = replace(claim, storage=np.diag([1 / 0.0625, 1 / 0.25]) * 0.0625, transform=np.diag([0.25, -0.5]))
    proofs = [prove(thesis_car(), NO_GAIN, c) for c in (claim, scaled)]
    assert [p.outcome for p in proofs] == [Outcome.PROVED] * 2
