"""The driven error: boxes by plain sums, gradients by differences, the filter by its own recursion, and the witnesses."""

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

from luenberger.core import BadInput, NotAccepted, NotCertified
from luenberger.methods.zonotopic_plant import DrivenError, fading_storage, filter_box, no_gain, require_driven
from luenberger.systems import System

NOISY: dict[str, object] = {
    "E": [[1.0], [0.3]],
    "G": [[1.0, 0.0]],
    "N": [[0.5, 1.0]],
    "dt": 0.1,
    "disturbance_bound": [0.2],
    "noise_bound": [0.1, 0.05],
}
PLANT = System.build([[0.9, 0.2], [-0.3, 0.8]], [[1.0], [0.5]], [[1.0, 0.4]], [[0.2]], **NOISY)  # type: ignore[arg-type]
L = np.array([[0.4], [0.1]])


def test_the_box_is_the_sum_of_the_powers() -> None:
    error = DrivenError.of(PLANT)
    A, B, C, D, E, G, N = (np.asarray(PLANT.at(k)) for k in "ABCDEGN")
    drive = np.hstack([E * 0.2, -(B @ N + L @ (G - D @ N)) * [0.1, 0.05]])
    np.testing.assert_allclose(error.drive(L), drive, atol=1e-15)
    plain = sum(np.abs(np.linalg.matrix_power(A - L @ C, k) @ drive).sum(axis=1) for k in range(500))
    # The sum ends where the rest is below a billionth.
    np.testing.assert_allclose(error.box(L), plain, rtol=1e-8)
    assert np.isinf(error.box(np.array([[-3.0], [0.0]]))).all()


def cut_box(plant: System, K: np.ndarray) -> np.ndarray:
    """The exact steady box of the prediction with gain A K, cut by the strip of one more measurement."""
    A, C, D, G, N = (np.asarray(plant.at(k)) for k in "ACDGN")
    cut, seen = np.eye(2) - K @ C, (G - D @ N) * [0.1, 0.05]
    return sum(np.abs(cut @ X).sum(axis=1) for X in DrivenError.of(plant).terms(A @ K)) + np.abs(K @ seen).sum(axis=1)


def test_the_filter_box_is_the_prediction_cut_by_the_strip() -> None:
    K = np.array([[0.3], [-0.2]])
    known = PLANT.replace(N=np.zeros((1, 2)))
    np.testing.assert_allclose(DrivenError.filtered(known).box(K), cut_box(known, K), rtol=1e-8)
    assert DrivenError.filtered(PLANT).radius(K) == pytest.approx(
        DrivenError.of(PLANT).radius(np.asarray(PLANT.at("A")) @ K)
    )
    # With noisy inputs one noise is taken for two: never narrower.
    assert (DrivenError.filtered(PLANT).box(K) > cut_box(PLANT, K)).all()
    for plant in (known, PLANT):
        np.testing.assert_allclose(filter_box(plant, K), cut_box(plant, K), rtol=1e-12)
    assert np.isinf(filter_box(PLANT, 30.0 * K)).all()


@pytest.mark.parametrize("kind", [DrivenError.of, DrivenError.filtered])
def test_the_slope_is_that_of_differences(kind: object) -> None:
    error = kind(PLANT)  # type: ignore[operator]
    weights, step = np.array([1.0, 3.0]), 1e-6
    ways = np.eye(2)[:, :, None] * step
    differences = [weights @ (error.box(L + d) - error.box(L - d)) / (2 * step) for d in ways]
    # No term is near a change of sign here; differences of order two leave 1e-8.
    np.testing.assert_allclose(error.slope(L, weights)[:, 0], differences, rtol=1e-5)


def test_the_start_is_the_kalman_gain() -> None:
    error = DrivenError.of(PLANT)
    found = error.kalman()
    assert found is not None
    Q, R, both = error.base @ error.base.T, error.seen @ error.seen.T, error.base @ error.seen.T
    P = solve_discrete_are(error.A.T, error.C.T, Q, R, s=both)
    exact = (error.A @ P @ error.C.T + both) / (error.C @ P @ error.C.T + R)
    # A millionth of the size of the plant is added to both covariances.
    np.testing.assert_allclose(found, exact, atol=1e-4)
    quiet = PLANT.replace(noise_bound=[0.0, 0.0], disturbance_bound=[0.0])
    assert DrivenError.of(quiet).kalman() is not None
    hidden = System.build([[1.1, 0.0], [0.0, 0.5]], None, [[0.0, 1.0]], dt=1.0, noise_bound=[1.0])
    assert DrivenError.of(hidden).kalman() is None


def test_witnesses_survive_their_rounding() -> None:
    F = np.array([[0.9, 5.0], [0.0, 0.9]])
    factor, P = fading_storage(F, "plant")
    assert 0.9 < factor < 1
    assert np.linalg.eigvalsh(F.T @ P @ F - factor**2 * P).max() < 0 < np.linalg.eigvalsh(P).min()
    with pytest.raises(NotCertified, match="too near one"):
        fading_storage(np.eye(2), "plant")


def test_plants_without_a_steady_box_are_refused() -> None:
    require_driven(PLANT)
    with pytest.raises(NotAccepted, match="discrete linear plant"):
        require_driven(PLANT.replace(dt=None))
    with pytest.raises(BadInput, match="needs bounds"):
        require_driven(PLANT.replace(noise_bound=None))
    hidden = System.build([[1.1, 0.0], [0.0, 0.5]], None, [[0.0, 1.0]], dt=1.0, noise_bound=[1.0])
    with pytest.raises((BadInput, NotAccepted), match="unobservable mode"):
        require_driven(hidden)
    assert "no stable loop" in str(no_gain(hidden, "Guessing"))
