"""Steady boxes: proved a hair above the exact sum, refuted a hair below, refused where a witness or a bound is missing."""

import numpy as np
import pytest

from luenberger.algebra import Polynomial
from luenberger.certify import Claim
from luenberger.certify.steady_box import steady_box_verdict
from luenberger.core import BadInput, NotAccepted, Outcome
from luenberger.systems import Parameter, System

# e+ = 0.5 e + d - 0.1 v with |d| <= 1, |v| <= 2: the steady half width is (1 + 0.2) / (1 - 0.5) = 2.4.
SCALAR = System.linear([[0.6]], C=[[1.0]], E=[[1.0]], dt=0.1, disturbance_bound=[1.0], noise_bound=[2.0])
TENTH = Polynomial.constant([[0.1]])
# A quarter turn that shrinks by half each step: powers come back to the axes, so the sum is 1 / (1 - 1/4) and half of it.
TURN = System.linear(
    [[0.0, -0.5], [0.5, 0.0]], C=[[1.0, 0.0]], E=[[1.0], [0.0]], dt=1.0, disturbance_bound=[1.0], noise_bound=[0.0]
)
STILL = Polynomial.constant([[0.0], [0.0]])
EXACT = np.array([4 / 3, 2 / 3])


def claim(vector: object, P: object = None, level: float | None = None) -> Claim:
    """What the proof reads of a claim: the box, the witness and the largest half width."""
    box = np.asarray(vector, dtype=float)
    storage = np.eye(len(box)) if P is None else np.asarray(P, dtype=float)
    return Claim("width", float(box.max()) if level is None else level, storage, vector=box)


def verdict(system: System, gain: Polynomial, vector: object, **options: object) -> tuple[str, Outcome]:
    failed, found = steady_box_verdict(system, gain, claim(vector, **options))  # type: ignore[arg-type]
    return failed, found.outcome


def test_the_exact_sum_divides_what_is_proved_from_what_is_refuted() -> None:
    # The doubles 0.6 and 0.1 leave a loop of 0.5 up to 1e-16, far below the step taken here.
    assert verdict(SCALAR, TENTH, [2.4 * (1 + 1e-9)]) == ("", Outcome.PROVED)
    assert verdict(SCALAR, TENTH, [2.4 * (1 - 1e-9)]) == ("steady_box", Outcome.REFUTED)
    assert verdict(TURN, STILL, EXACT * (1 + 1e-12)) == ("", Outcome.PROVED)
    assert verdict(TURN, STILL, EXACT * [1 + 1e-12, 1 - 1e-12]) == ("steady_box", Outcome.REFUTED)


def test_the_verdict_tells_the_room_and_what_is_reached() -> None:
    _, proved = steady_box_verdict(SCALAR, TENTH, claim([3.0]))
    # What is left of the sum when the proof ends counts against the room.
    assert 0.0 < proved.margin <= 0.6
    _, refuted = steady_box_verdict(SCALAR, TENTH, claim([2.0]))
    assert list(refuted.point) == ["x1"]
    assert 2.0 < refuted.point["x1"] <= 2.4


def test_mutations_of_the_drive_are_caught() -> None:
    # Dropping the noise generator, or taking its bound for the disturbance's, claims a box that is refuted.
    dropped, swapped = 1.0 / 0.5, (2.0 + 0.1 * 1.0) / 0.5
    assert verdict(SCALAR, TENTH, [dropped])[1] is Outcome.REFUTED
    other = SCALAR.replace(disturbance_bound=[2.0], noise_bound=[1.0])
    assert verdict(other, TENTH, [2.4 * (1 + 1e-6)])[1] is Outcome.REFUTED
    assert verdict(other, TENTH, [swapped * (1 + 1e-6)])[1] is Outcome.PROVED
    # A geometric sum with the wrong constant: 1 / (1 - rho^2) of the largest term is too little.
    assert verdict(SCALAR, TENTH, [1.2 / (1 - 0.25)])[1] is Outcome.REFUTED


def test_noise_of_inputs_is_one_generator_with_that_of_the_outputs() -> None:
    # v enters x through -B N = -1 and y through G - D N = 0.5: |-1 - 0.1 * 0.5| = 1.05, not 1 + 0.05 with signs apart.
    plant = System.linear([[0.6]], [[1.0]], [[1.0]], [[0.5]], G=[[1.0]], N=[[1.0]], dt=0.1, noise_bound=[1.0])
    assert verdict(plant, TENTH, [1.05 / 0.5 * (1 + 1e-9)]) == ("", Outcome.PROVED)
    negative = Polynomial.constant([[-0.1]])
    # |-1 + 0.05| over 1 - 0.7: the two parts cancel.
    assert verdict(plant, negative, [0.95 / 0.3 * (1 + 1e-9)]) == ("", Outcome.PROVED)


def test_every_witness_that_contracts_proves_the_same_box() -> None:
    rng = np.random.default_rng(3)
    A = rng.normal(size=(3, 3))
    A *= 0.8 / np.abs(np.linalg.eigvals(A)).max()
    plant = System.linear(
        A, C=rng.normal(size=(1, 3)), E=rng.normal(size=(3, 2)), dt=1.0, disturbance_bound=[1.0, 0.3], noise_bound=[0.2]
    )
    gain = Polynomial.constant(0.01 * rng.normal(size=(3, 1)))
    F = A - gain({}) @ plant.at("C")
    drive = np.hstack([plant.at("E") * [1.0, 0.3], -0.2 * gain({})])
    exact = sum(np.abs(np.linalg.matrix_power(F, k) @ drive).sum(axis=1) for k in range(400))
    for factor in (0.9, 0.99):
        P = np.zeros((3, 3)) + sum(
            np.linalg.matrix_power(F.T / factor, k) @ np.linalg.matrix_power(F / factor, k) for k in range(4000)
        )
        P = 0.5 * (P + P.T)
        assert verdict(plant, gain, exact * (1 + 1e-9), P=P) == ("", Outcome.PROVED)
        assert verdict(plant, gain, exact * (1 - 1e-9), P=P)[1] is Outcome.REFUTED


def test_slow_loops_are_decided_too() -> None:
    slow = System.linear([[0.999]], C=[[1.0]], E=[[1.0]], dt=1.0, disturbance_bound=[1.0], noise_bound=[0.0])
    none = Polynomial.constant([[0.0]])
    exact = 1 / (1 - 0.999)
    assert verdict(slow, none, [exact * 1.001]) == ("", Outcome.PROVED)
    assert verdict(slow, none, [exact * 0.999]) == ("steady_box", Outcome.REFUTED)


def test_too_few_terms_leave_it_undecided() -> None:
    # A slow turn by 45 degrees: the bound of the rest takes every term in its worst direction.
    A = 0.99 * np.sqrt(0.5) * np.array([[1.0, -1.0], [1.0, 1.0]])
    plant = System.linear(A, C=[[1.0, 0.0]], E=[[1.0], [0.0]], dt=1.0, disturbance_bound=[1.0], noise_bound=[0.0])
    exact = sum(np.abs(np.linalg.matrix_power(A, k)[:, 0]) for k in range(5000))
    box = claim(exact * (1 + 1e-6))
    failed, found = steady_box_verdict(plant, STILL, box, steps=20)
    assert (failed, found.outcome) == ("steady_box", Outcome.UNDECIDED)
    assert steady_box_verdict(plant, STILL, box)[1].outcome is Outcome.PROVED


def test_a_loop_that_forgets_in_finite_time_still_needs_room() -> None:
    # F = 0: the error is d itself. It is 1 in the limit of no room, which is no proof that it stays below 1.
    dead = System.linear([[0.0]], C=[[1.0]], E=[[1.0]], dt=1.0, disturbance_bound=[1.0], noise_bound=[0.0])
    none = Polynomial.constant([[0.0]])
    assert verdict(dead, none, [1.0])[1] is not Outcome.PROVED
    assert verdict(dead, none, [1.0 + 1e-12]) == ("", Outcome.PROVED)


def test_witnesses_that_show_nothing_are_refused() -> None:
    assert verdict(TURN, STILL, [2.0, 1.0], P=np.diag([1.0, -1.0])) == ("storage", Outcome.REFUTED)
    # The loop turns what a long axis holds: V does not fall for this P though the loop is stable.
    assert verdict(TURN, STILL, [2.0, 1.0], P=np.diag([1.0, 9.0])) == ("contraction", Outcome.REFUTED)
    assert verdict(SCALAR, Polynomial.constant([[-0.5]]), [100.0]) == ("contraction", Outcome.REFUTED)
    assert verdict(TURN, STILL, [2.0, 1.0], level=1.5) == ("vector", Outcome.REFUTED)
    assert verdict(TURN, STILL, [2.0, 0.0]) == ("vector", Outcome.REFUTED)


def test_plants_without_a_steady_box_are_refused() -> None:
    box = claim([3.0])
    with pytest.raises(NotAccepted, match="discrete linear plant"):
        steady_box_verdict(SCALAR.replace(dt=None), TENTH, box)
    scheduled = System.lpv(
        Polynomial.affine([[0.5]], p=[[0.1]]),
        C=[[1.0]],
        parameters=[Parameter("p", 0.0, 1.0)],
        dt=0.1,
        noise_bound=[1.0],
    )
    with pytest.raises(NotAccepted, match="constant matrices"):
        steady_box_verdict(scheduled, TENTH, box)
    for missing in ({"noise_bound": None}, {"disturbance_bound": None}):
        with pytest.raises(BadInput, match="a steady box needs bounds"):
            steady_box_verdict(SCALAR.replace(**missing), TENTH, box)
    with pytest.raises(BadInput, match="needs one for each"):
        steady_box_verdict(SCALAR, TENTH, claim([3.0, 3.0]))
    with pytest.raises(NotAccepted, match="constant storage"):
        steady_box_verdict(SCALAR, TENTH, Claim("width", 3.0, vector=np.array([3.0])))
