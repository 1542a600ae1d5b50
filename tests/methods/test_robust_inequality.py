"""The scaled inequalities: slopes in the gain, levels by hand, coordinates, and claims that can be proved."""

import numpy as np
import pytest

from luenberger.algebra import Polynomial
from luenberger.certify import certify_claims
from luenberger.core import NotAccepted, Outcome
from luenberger.methods.robust_inequality import Affine, GivenGain, Norm, at_measured, trace_of
from luenberger.systems import MatrixFunction, Parameter, System
from luenberger.systems.error_system import ErrorSystem, Form


def two_springs() -> System:
    """Three states, two outputs, one stiffness measured with an offset and a factor."""
    A = Polynomial.affine(
        [[-1.0, 1.0, 0.0], [0.0, -2.0, 1.0], [-1.0, 0.0, -3.0]], k=np.array([[0, 0, 0], [-1.0, 0, 0], [0, -0.5, 0]])
    )
    k = Parameter("k", 1.0, 2.0, factor=(0.95, 1.05), error=0.05)
    return System.lpv(A, [[0.0], [1.0], [0.0]], [[1.0, 0, 0], [0, 1.0, 0]], parameters=[k], G=0.3 * np.eye(2))


def noisy_scalar() -> System:
    """x' = -x + d, y = x + v: e' = -(1 + L) e + d - L v."""
    return System.linear([[-1.0]], C=[[1.0]], E=[[1.0]])


GAIN = Polynomial.constant(np.array([[0.5, 0.1], [0.2, 0.3], [-0.1, 0.2]]))


def test_level_of_a_scalar_gain_by_hand() -> None:
    L = Polynomial.constant([[0.7]])
    norms: tuple[Norm, ...] = ("h2", "l2")
    h2, l2 = (GivenGain(noisy_scalar(), L, n, "both").level() for n in norms)
    # Variance (1 + L^2) / (2 (1 + L)); peak of the response at zero frequency.
    assert h2 == pytest.approx(np.sqrt((1 + 0.49) / (2 * 1.7)), rel=1e-6)
    assert l2 == pytest.approx(np.sqrt(1 + 0.49) / 1.7, rel=1e-6)


@pytest.mark.parametrize("form", ["plant", "estimate"])
def test_slopes_in_the_gain_are_those_of_the_error_system(form: Form) -> None:
    plant, generator = two_springs(), np.random.default_rng(0)
    L = generator.normal(size=(3, 2))
    error, parts = ErrorSystem.of(plant, Polynomial.constant(L), form=form), Affine.of(plant, "scheduling+noise", form)
    point = {n: generator.uniform(*i) for n, i in error.box.items()}

    def at(matrix: Polynomial) -> np.ndarray:
        return np.asarray(matrix({n: point[n] for n in matrix.names}))

    np.testing.assert_allclose(at(parts.A) - L @ at(parts.CA), at(error.A), atol=1e-13)
    np.testing.assert_allclose(at(parts.B) - L @ at(parts.CB), at(error.joined("scheduling+noise")), atol=1e-13)
    T = parts.shrunk(4.0)
    moved = parts.seen_from(T)
    np.testing.assert_allclose(T @ (at(moved.A) - np.linalg.inv(T) @ L @ at(moved.CA)), at(error.A) @ T, atol=1e-12)
    # What the outputs show is shrunk, what they do not show is left alone.
    assert np.linalg.eigvalsh(T) == pytest.approx([0.25, 0.25, 1.0])


@pytest.mark.parametrize("norm", ["h2", "l2"])
@pytest.mark.parametrize("form", ["plant", "estimate"])
def test_claim_of_a_given_gain_is_proved_and_a_lower_one_is_not(norm: Norm, form: Form) -> None:
    given = GivenGain(two_springs(), GAIN, norm, "scheduling+noise", form)
    level, claim = given.level(), given.claim()
    assert level is not None
    assert claim is not None
    # Two percent of the square are given away.
    assert level < claim.level <= level * 1.0101
    assert certify_claims(given.system, GAIN, [claim]).outcome is Outcome.PROVED
    low = type(claim)(claim.kind, 0.95 * level, claim.storage, None, claim.weight, claim.inputs, form, claim.trace)
    assert certify_claims(given.system, GAIN, [low]).outcome is Outcome.REFUTED


def test_coordinates_change_nothing_but_the_numbers() -> None:
    T = np.array([[1.0, 0.5, 0.0], [0.0, 2.0, 0.3], [0.1, 0.0, 1.0]])
    plain = GivenGain(two_springs(), GAIN, "l2", "scheduling+noise")
    moved = GivenGain(two_springs(), GAIN, "l2", "scheduling+noise", coordinates=T)
    # 1e-6 is the residual a solver is held to.
    assert plain.level() == pytest.approx(moved.level(), rel=1e-5)
    claim = moved.claim()
    assert claim is not None
    assert certify_claims(two_springs(), GAIN, [claim]).outcome is Outcome.PROVED


def test_weight_picks_part_of_the_error() -> None:
    whole = GivenGain(two_springs(), GAIN, "h2", "noise").level()
    part = GivenGain(two_springs(), GAIN, "h2", "noise", weight=np.array([[0.0, 0.0, 1.0]])).level()
    assert whole is not None
    assert part is not None
    assert part < whole


def test_a_gain_that_destabilises_has_no_level() -> None:
    assert GivenGain(noisy_scalar(), Polynomial.constant([[-2.0]]), "l2", "both").level() is None
    assert GivenGain(noisy_scalar(), Polynomial.constant([[-2.0]]), "h2", "both").claim() is None


def test_measured_scheduling_is_put_in() -> None:
    gain = Polynomial.affine(np.zeros((1, 1)), k=np.ones((1, 1)))
    moved = at_measured(two_springs(), gain)
    assert set(moved.names) == {"k", "k_factor", "k_offset"}
    assert float(moved({"k": 2.0, "k_factor": 1.05, "k_offset": -0.05})[0, 0]) == pytest.approx(2.05)
    with pytest.raises(NotAccepted, match="function"):
        at_measured(two_springs(), MatrixFunction(lambda p: np.eye(1) * p["k"], ("k",), (1, 1)))


@pytest.mark.parametrize("n", [1, 2, 3])
def test_trace_is_a_trace(n: int) -> None:
    cp = pytest.importorskip("cvxpy")
    Z = cp.Variable((n, n), symmetric=True)
    value = np.random.default_rng(n).normal(size=(n, n))
    Z.value = value + value.T
    assert trace_of(Z).value[0, 0] == pytest.approx(np.trace(value + value.T))
