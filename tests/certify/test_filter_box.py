"""Filter boxes: proved a hair above the exact sum, refuted a hair below, and never about a design without a filter."""

import numpy as np
import pytest

from luenberger.algebra import Polynomial
from luenberger.certify import Claim, certify_claims
from luenberger.certify.filter_box import filter_box_verdict
from luenberger.core import BadInput, NotAccepted, Outcome
from luenberger.systems import System

# e+ = (0.5 - 0.5 K) e + d - 0.5 K v with |d| <= 1, |v| <= 2; at K = 1/2 it ends in (1 + 0.5) / (1 - 0.25) = 2, and what
# y leaves, 0.5 e - 0.5 v, in 1 + 1 = 2.
SCALAR = System.linear([[0.5]], C=[[1.0]], E=[[1.0]], dt=0.1, disturbance_bound=[1.0], noise_bound=[2.0])
HALF = Polynomial.constant([[0.5]])
NOISY = System.build(
    [[0.9, 0.2], [-0.3, 0.8]],
    [[1.0], [0.5]],
    [[1.0, 0.4]],
    [[0.2]],
    E=[[1.0], [0.3]],
    G=[[1.0, 0.0]],
    N=[[0.5, 1.0]],
    dt=0.1,
    disturbance_bound=[0.2],
    noise_bound=[0.1, 0.05],
)
GAIN = np.array([[0.3], [-0.2]])


def claim(vector: object, P: object = None, level: float | None = None) -> Claim:
    box = np.asarray(vector, dtype=float)
    storage = np.eye(len(box)) if P is None else np.asarray(P, dtype=float)
    return Claim("filter_box", float(box.max()) if level is None else level, storage, vector=box)


def verdict(system: System, gain: Polynomial, vector: object, **options: object) -> tuple[str, Outcome]:
    failed, found = filter_box_verdict(system, gain, claim(vector, **options))  # type: ignore[arg-type]
    return failed, found.outcome


def plain_box(plant: System, K: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The exact box by sums of powers, and a storage of the loop."""
    A, B, C, D, E, G, N = (np.asarray(plant.at(k)) for k in "ABCDEGN")
    disturbance, noise = np.array(plant.disturbance_bound), np.array(plant.noise_bound)
    F, seen = A - A @ K @ C, G - D @ N
    drive = np.hstack([E * disturbance, -(B @ N + A @ K @ seen) * noise])
    powers = [np.linalg.matrix_power(F, k) for k in range(600)]
    box = sum(np.abs((np.eye(len(A)) - K @ C) @ X @ drive).sum(axis=1) for X in powers)
    P = sum(X.T @ X for X in (np.linalg.matrix_power(F / 0.97, k) for k in range(600)))
    return box + np.abs(K @ seen * noise).sum(axis=1), 0.5 * (P + P.T)


def test_the_exact_sum_divides_what_is_proved_from_what_is_refuted() -> None:
    assert verdict(SCALAR, HALF, [2.0 * (1 + 1e-9)]) == ("", Outcome.PROVED)
    assert verdict(SCALAR, HALF, [2.0 * (1 - 1e-9)]) == ("filter_box", Outcome.REFUTED)
    box, P = plain_box(NOISY, GAIN)
    gain = Polynomial.constant(GAIN)
    assert verdict(NOISY, gain, box * (1 + 1e-9), P=P) == ("", Outcome.PROVED)
    for k in range(2):
        assert verdict(NOISY, gain, box * (1 + 1e-9 - 2e-9 * np.eye(2)[k]), P=P) == ("filter_box", Outcome.REFUTED)


def test_mutations_are_caught() -> None:
    # The prediction's box is 2 here too, so another noise bound tells them apart: 1.25 / 0.75, and 0.5 of that plus 0.5.
    quieter = SCALAR.replace(noise_bound=[1.0])
    prediction, direct = 1.25 / 0.75, 0.5
    right = 0.5 * prediction + direct
    assert verdict(quieter, HALF, [right * (1 + 1e-9)])[1] is Outcome.PROVED
    for wrong in (0.5 * prediction, direct, 0.5 * (1 / 0.75) + direct):
        assert verdict(quieter, HALF, [wrong])[1] is Outcome.REFUTED
    # Noise that reaches input and output counts once a sample: a plant that takes it for two is wider.
    box, P = plain_box(NOISY, GAIN)
    apart = NOISY.replace(G=[[1.0, 0.0, 0.0]], N=[[0.0, 1.0, 0.5]], noise_bound=[0.1, 0.05, 0.1])
    wider, _ = plain_box(apart, GAIN)
    assert (wider > box * 1.001).all()
    assert verdict(apart, Polynomial.constant(GAIN), box * 1.001, P=P)[1] is Outcome.REFUTED


def test_a_filter_that_trusts_the_output_is_left_with_its_noise() -> None:
    # K = 1: nothing of the prediction is left.
    one = Polynomial.constant([[1.0]])
    assert verdict(SCALAR, one, [2.0 + 1e-12]) == ("", Outcome.PROVED)
    assert verdict(SCALAR, one, [2.0 - 1e-12])[1] is Outcome.REFUTED
    # Not even a perfect one lets an error of the prediction grow: F = 0.5 - 0.5 K at K = 4 is -1.5.
    assert verdict(SCALAR, Polynomial.constant([[4.0]]), [100.0]) == ("contraction", Outcome.REFUTED)
    assert verdict(SCALAR, HALF, [3.0], P=[[-1.0]]) == ("storage", Outcome.REFUTED)
    assert verdict(SCALAR, HALF, [3.0], level=2.5) == ("vector", Outcome.REFUTED)


def test_the_certificate_says_what_it_is_about() -> None:
    made = claim([2.0 + 1e-6])
    proved = certify_claims(SCALAR, HALF, [made], filter_gain=HALF)
    assert proved.outcome is Outcome.PROVED
    assert "left by the current output ends in |e| <= (2)" in made.sentence(discrete=True)
    # The gain of the prediction does not stand in for that of the filter.
    (proof,) = certify_claims(SCALAR, HALF, [made]).proofs
    assert proof.outcome is Outcome.REFUTED
    assert "no filter gain" in proof.reason
    again = Claim.from_text(made.as_text())
    np.testing.assert_array_equal(again.vector, made.vector)
    assert certify_claims(SCALAR, HALF, [again], filter_gain=HALF * 3.0).outcome is Outcome.REFUTED


def test_what_has_no_filter_box_is_refused() -> None:
    box = claim([3.0])
    with pytest.raises(NotAccepted, match="discrete linear plant"):
        filter_box_verdict(SCALAR.replace(dt=None), HALF, box)
    with pytest.raises(BadInput, match="a steady box needs bounds"):
        filter_box_verdict(SCALAR.replace(noise_bound=None), HALF, box)
    scheduled = Polynomial.affine([[0.5]], p=[[0.1]])
    for gain in (scheduled, Polynomial.constant([[0.5, 0.5]])):
        with pytest.raises(BadInput, match="is needed"):
            filter_box_verdict(SCALAR, gain, box)
    with pytest.raises(BadInput, match="needs one for each"):
        filter_box_verdict(SCALAR, HALF, claim([3.0, 3.0]))
    with pytest.raises(BadInput, match="A filter box needs `vector`"):
        Claim("filter_box", 3.0, np.eye(1))
    with pytest.raises(NotAccepted, match="constant storage"):
        filter_box_verdict(SCALAR, HALF, Claim("width", 3.0, vector=np.array([3.0])))
