"""A true claim is proved; a spoiled gain, bound, matrix or plant is refused, with the point where it fails."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.linalg import solve_continuous_lyapunov

from luenberger.algebra import Polynomial
from luenberger.certify import Claim, certify_claims, prove
from luenberger.core import BadInput, Outcome
from luenberger.systems import MatrixFunction, Nonlinearity, Parameter, System

# e' = (A(r) - L C) e with A = [[-1, r], [0, -2]]: with P = I the storage falls at rate a where
# [[-2+2a, r], [r, -4+2a]] < 0, that is (2-2a)(4-2a) > r^2; for r = 1 the limit is a = (3 - sqrt(2)) / 2.
LIMIT = (3 - np.sqrt(2)) / 2
A = Polynomial.affine(np.diag([-1.0, -2.0]), r=np.array([[0.0, 1.0], [0.0, 0.0]]))
PLANT = System.lpv(A, C=[[1.0, 0.0]], E=[[1.0], [0.0]], parameters=[Parameter("r", -1.0, 1.0)])
ZERO = Polynomial.constant(np.zeros((2, 1)))


def test_decay_is_proved_below_the_limit_and_refuted_above_it() -> None:
    proof = prove(PLANT, ZERO, Claim("decay", LIMIT - 1e-9, np.eye(2)))
    assert proof.outcome is Outcome.PROVED
    spoiled = prove(PLANT, ZERO, Claim("decay", LIMIT + 1e-9, np.eye(2)))
    assert spoiled.outcome is Outcome.REFUTED
    assert abs(spoiled.point["r"]) == 1.0
    assert "r = " in spoiled.reason


def test_margin_is_proved_and_nearly_tight() -> None:
    proof = prove(PLANT, ZERO, Claim("decay", 0.0, np.eye(2)))
    truth = -np.linalg.eigvalsh(np.array([[-2.0, 1.0], [1.0, -4.0]]))[-1]
    # One percent of the estimated margin is given away so that it can be proved.
    assert 0.98 * truth <= proof.margin <= truth


def test_spoiled_gain_is_refuted() -> None:
    assert prove(PLANT, Polynomial.constant([[-1.5], [0.0]]), Claim("decay", 0.0, np.eye(2))).outcome is Outcome.REFUTED


@pytest.mark.parametrize("P", [np.diag([1.0, -1.0]), np.diag([1.0, 0.0]), np.array([[1.0, 2.0], [2.0, 1.0]])])
def test_spoiled_storage_is_refuted(P: np.ndarray) -> None:
    proof = prove(PLANT, ZERO, Claim("decay", 0.0, P))
    assert proof.outcome is Outcome.REFUTED
    assert "positive definite" in proof.reason


def test_storage_of_the_wrong_size_is_refuted() -> None:
    assert prove(PLANT, ZERO, Claim("decay", 0.0, np.eye(3))).outcome is Outcome.REFUTED


def test_weight_of_the_wrong_size_is_refuted() -> None:
    claim = Claim("l2_gain", 10.0, np.eye(2), weight=np.eye(3), inputs="disturbance")
    assert prove(PLANT, ZERO, claim).outcome is Outcome.REFUTED


def test_l2_gain_against_the_known_norm() -> None:
    # 1/(s+1) has norm one; the storage (e^2) of the scalar bounded-real lemma is exact there.
    plant = System.linear([[-1.0]], C=[[1.0]], E=[[1.0]])
    gain = Polynomial.constant([[0.0]])

    def claim(level: float) -> Claim:
        return Claim("l2_gain", level, np.eye(1), weight=np.eye(1), inputs="disturbance")

    assert prove(plant, gain, claim(1.0 + 1e-9)).outcome is Outcome.PROVED
    assert prove(plant, gain, claim(1.0 - 1e-9)).outcome is Outcome.REFUTED


def test_noise_enters_through_the_gain() -> None:
    plant = System.linear([[-1.0]], C=[[1.0]], E=[[1.0]])
    # e' = -2 e - v with L = 1: gain 1/2, storage 2 e^2 ... P = 1/2 gives -2 + 1 + (1/4)/g^2 < 0 for g > 1/2.
    claim = [Claim("l2_gain", g, 0.5 * np.eye(1), weight=np.eye(1), inputs="noise") for g in (0.5 + 1e-9, 0.5 - 1e-9)]
    outcomes = [p.outcome for p in certify_claims(plant, Polynomial.constant([[1.0]]), claim).proofs]
    assert outcomes == [Outcome.PROVED, Outcome.REFUTED]


def test_gain_bound_is_the_norm_over_the_box() -> None:
    gain = Polynomial.affine([[0.0], [0.0]], r=np.array([[3.0], [4.0]]))
    assert prove(PLANT, gain, Claim("gain_bound", 5.0 + 1e-9)).outcome is Outcome.PROVED
    spoiled = prove(PLANT, gain, Claim("gain_bound", 5.0 - 1e-9))
    assert spoiled.outcome is Outcome.REFUTED
    assert abs(spoiled.point["r"]) == 1.0


def test_quadratic_dependence_is_proved_between_the_vertices() -> None:
    # a(r) = r^2 - 1.5 is negative at both ends and in between; -a(r) is positive in the middle only when turned round.
    def plant(sign: float, constant: float) -> System:
        A = Polynomial(("r",), {(0,): np.array([[constant]]), (2,): np.array([[sign]])})
        return System.lpv(A, C=[[1.0]], parameters=[Parameter("r", -1.0, 1.0)])

    gain, claim = Polynomial.constant([[0.0]]), Claim("decay", 0.0, np.eye(1))
    assert prove(plant(1.0, -1.5), gain, claim).outcome is Outcome.PROVED
    hidden = prove(plant(-2.0, 1.0), gain, claim)  # 1 - 2 r^2: negative at both vertices, +1 in the middle
    assert hidden.outcome is Outcome.REFUTED
    assert abs(hidden.point["r"]) < 0.7072


def test_jacobian_box_is_part_of_the_continuum() -> None:
    def plant(slope: float) -> System:
        f = Nonlinearity.bounded(lambda z, u: jnp.sin(z), [[1.0]], jacobian=([[-slope]], [[slope]]))
        return System.nonlinear([[-1.0]], C=[[1.0]], F=[[1.0]], nonlinearity=f)

    claim = Claim("decay", 0.0, np.eye(1))
    assert prove(plant(0.999), ZERO_1, claim).outcome is Outcome.PROVED
    spoiled = prove(plant(1.001), ZERO_1, claim)
    assert spoiled.outcome is Outcome.REFUTED
    assert spoiled.point == {"df1_dz1": 1.001}


ZERO_1 = Polynomial.constant([[0.0]])


def test_lipschitz_channel_needs_its_multiplier() -> None:
    f = Nonlinearity.bounded(lambda z, u: jnp.sin(z), [[1.0]], lipschitz=0.9)
    plant = System.nonlinear([[-1.0]], C=[[1.0]], F=[[1.0]], nonlinearity=f)
    # [[-2 + s g^2, 1], [1, -s]] < 0 needs s near 1/g; s = 0 never works.
    assert prove(plant, ZERO_1, Claim("decay", 0.0, np.eye(1), multiplier=1.1)).outcome is Outcome.PROVED
    assert prove(plant, ZERO_1, Claim("decay", 0.0, np.eye(1), multiplier=0.0)).outcome is Outcome.REFUTED


@pytest.mark.parametrize(
    ("factor", "outcome"), [(0.81, Outcome.PROVED), (0.79, Outcome.REFUTED), (1.0, Outcome.REFUTED)]
)
def test_discrete_factor(factor: float, outcome: Outcome) -> None:
    plant = System.linear([[0.8]], C=[[1.0]], dt=0.1)
    assert prove(plant, ZERO_1, Claim("decay", factor, np.eye(1))).outcome is outcome


def test_function_matrices_are_proved_with_balls() -> None:
    def plant(top: float) -> System:
        A = MatrixFunction(lambda p: jnp.array([[jnp.sin(p["r"]) - top]]), ("r",), (1, 1))
        return System.lpv(A, C=[[1.0]], parameters=[Parameter("r", -3.0, 3.0)])

    claim = Claim("decay", 0.0, np.eye(1))
    assert prove(plant(1.01), ZERO_1, claim).outcome is Outcome.PROVED
    spoiled = prove(plant(0.99), ZERO_1, claim)
    assert spoiled.outcome is Outcome.REFUTED
    assert np.sin(spoiled.point["r"]) > 0.99


def test_claims_without_witness_or_level_are_refused() -> None:
    for bad in (
        lambda: Claim("decay", -1.0, np.eye(2)),
        lambda: Claim("decay", 1.0),
        lambda: Claim("decay", float("nan"), np.eye(2)),
    ):
        with pytest.raises(BadInput):
            bad()
    with pytest.raises(BadInput, match="symmetric"):
        Claim("decay", 1.0, np.array([[1.0, 0.1], [0.0, 1.0]]))


def test_assumptions_name_every_bound() -> None:
    text = " ".join(certify_claims(PLANT, ZERO, []).assumptions)
    assert "r is measured exactly and stays in [-1, 1]" in text
    assert certify_claims(PLANT, ZERO, []).outcome is Outcome.UNDECIDED


def test_h2_level_against_the_grammian() -> None:
    plant = System.linear([[0.0, 1.0], [-2.0, -3.0]], C=[[1.0, 0.0]], E=[[0.0], [1.0]])
    gain, W = Polynomial.constant(np.zeros((2, 1))), np.array([[1.0, 0.5]])
    A, B = np.array([[0.0, 1.0], [-2.0, -3.0]]), np.array([[0.0], [1.0]])
    norm = float(np.sqrt((W @ solve_continuous_lyapunov(A, -B @ B.T) @ W.T)[0, 0]))
    # P = level inv(X) and Z = W X W' / level are exact at the norm; a slightly larger X makes the inequality strict.
    X = solve_continuous_lyapunov(A, -B @ B.T - 1e-6 * np.eye(2))
    for level, outcome in ((norm * (1 + 1e-4), Outcome.PROVED), (norm * (1 - 1e-4), Outcome.REFUTED)):
        P = level * np.linalg.inv(X)
        Z = W @ np.linalg.inv(P) @ W.T * (1 + 1e-9)
        claim = Claim("h2_gain", level, (P + P.T) / 2, weight=W, inputs="disturbance", trace=Z)
        assert prove(plant, gain, claim).outcome is outcome


def test_storage_that_moves_with_the_scheduling() -> None:
    # e' = -(1 + r) e with P = 1 + r: V' = (r' - 2 (1 + r)^2) e^2; at r = 0 it falls where r' < 2.
    law = Polynomial.affine(np.array([[-1.0]]), r=np.array([[-1.0]]))
    P = Polynomial.affine(np.eye(1), r=np.eye(1))
    for rate, outcome in ((1.9, Outcome.PROVED), (2.1, Outcome.REFUTED)):
        plant = System.lpv(law, C=[[1.0]], parameters=[Parameter("r", 0.0, 1.0, rate=rate)])
        proof = prove(plant, Polynomial.constant([[0.0]]), Claim("decay", 0.0, P))
        assert proof.outcome is outcome
    assert (
        "changes by at most"
        in certify_claims(plant, Polynomial.constant([[0.0]]), [Claim("decay", 0.0, P)]).assumptions[1]
    )


def test_storage_that_moves_is_saved() -> None:
    claim = Claim("decay", 0.5, Polynomial.affine(np.eye(2), r=0.25 * np.eye(2)))
    again = Claim.from_text(claim.as_text())
    assert isinstance(again.storage, Polynomial)
    np.testing.assert_array_equal(again.storage({"r": 2.0}), 1.5 * np.eye(2))


def test_scheduling_error_is_part_of_the_claim() -> None:
    # e' = -e + (r - m) u with m = f r: |r - m| <= 0.1 * 2 makes the gain from u 0.2.
    exact = System.lpv(
        [[-1.0]], Polynomial.affine(np.zeros((1, 1)), r=np.eye(1)), parameters=[Parameter("r", 0.0, 2.0)]
    )
    erring = exact.replace(parameters=[Parameter("r", 0.0, 2.0, factor=(0.9, 1.1))])
    for level, outcome in ((0.21, Outcome.PROVED), (0.19, Outcome.REFUTED)):
        claim = Claim("l2_gain", level, np.eye(1), weight=np.eye(1), inputs="scheduling")
        assert prove(erring, Polynomial.constant([[0.0]]), claim).outcome is outcome
    with pytest.raises(BadInput, match="has no input"):
        prove(exact, Polynomial.constant([[0.0]]), claim)
