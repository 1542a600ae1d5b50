"""Stationary Kalman gains with proved convergence."""

import numpy as np
import pytest

from lipschitz_plants import pendulum
from luenberger.algebra import Polynomial
from luenberger.core import BadInput, NotAccepted, NotCertified, Outcome
from luenberger.methods.kalman_gain import KalmanGain
from luenberger.synthesize import synthesize
from luenberger.systems import Parameter, System

TRACK = System.linear([[1.0, 0.1], [0.0, 1.0]], C=[[1.0, 0.0]], dt=0.1, name="track")


def scheduled(width: float = 1.0) -> System:
    A = Polynomial.affine([[0.0, 1.0], [-1.0, -0.2]], stiffness=[[0.0, 0.0], [-3.0, 0.0]])
    return System.lpv(A, C=[[1.0, 0.0]], parameters=[Parameter("stiffness", 0.0, width)])


def test_continuous_gain_in_closed_form() -> None:
    # x' = w, y = x + v: p^2 / r = q, L = p / r = sqrt(q / r).
    design = synthesize(System.linear([[0.0]], C=[[1.0]]), KalmanGain([[4.0]], [[0.25]]))
    assert design.gain_at() == pytest.approx(np.array([[4.0]]), rel=1e-7)
    assert design.certificate.level("decay") == pytest.approx(0.95 * 4.0)
    assert design.certificate.outcome is Outcome.PROVED


def test_discrete_gain_is_the_limit_of_the_recursion() -> None:
    Q, R = np.diag([1e-3, 1e-2]), np.array([[0.1]])
    A, C = np.asarray(TRACK.at("A")), np.asarray(TRACK.at("C"))
    P = np.eye(2)
    for _ in range(2000):
        L = A @ P @ C.T @ np.linalg.inv(C @ P @ C.T + R)
        P = A @ P @ A.T - L @ C @ P @ A.T + Q
    design = synthesize(TRACK, KalmanGain(Q, R))
    # Rounding of the gain to seven digits.
    np.testing.assert_allclose(design.gain_at(), L, rtol=2e-7)
    level = design.certificate.level("decay")
    assert level is not None
    assert np.abs(np.linalg.eigvals(A - L @ C)).max() < level < 1


def test_scheduled_gain_is_exact_where_the_fit_can_be() -> None:
    method = KalmanGain(np.eye(2), [[0.1]], points=2)
    design = synthesize(scheduled(), method)
    assert design.certificate.outcome is Outcome.PROVED
    # Two points and an affine gain: the fit interpolates.
    for r in (0.0, 1.0):
        np.testing.assert_allclose(design.gain_at(stiffness=r), method.gain_at(scheduled(), (r,)), rtol=1e-6)
    assert design.statistics["misfit"] < 1e-12
    fine = synthesize(scheduled(), KalmanGain(np.eye(2), [[0.1]], points=7))
    assert fine.statistics["misfit"] > 1e-3
    assert fine.statistics["grid_points"] == 7


def test_gain_bound_covers_the_box() -> None:
    design = synthesize(scheduled(), KalmanGain(np.eye(2), [[0.1]]))
    bound = design.certificate.level("gain_bound")
    assert bound is not None
    norms = [np.linalg.norm(design.gain_at(stiffness=r), 2) for r in np.linspace(0, 1, 21)]
    assert max(norms) <= bound <= max(norms) * (1 + 1e-5)


def test_plant_without_quadratic_storage_over_the_box_is_refused() -> None:
    # Stiffness from 1 to 301 with hardly any correction: stable frozen, not under fast switching.
    with pytest.raises(NotCertified, match="arbitrarily fast scheduling"):
        synthesize(scheduled(100.0), KalmanGain(1e-6 * np.eye(2), [[1e3]]))


@pytest.mark.parametrize(
    ("process", "measurement", "message"),
    [
        (np.diag([1.0, -1.0]), [[1.0]], r"`process_covariance` has the eigenvalue -1; .* >= 0"),
        (np.eye(2), [[0.0]], r"`measurement_covariance` has the eigenvalue 0; .* > 0"),
        ([[1.0, 0.5], [0.0, 1.0]], [[1.0]], "not symmetric"),
        (np.eye(3), [[1.0]], r"`process_covariance` has shape \(3, 3\) but the system has 2 states"),
        (np.eye(2), np.eye(2), r"`measurement_covariance` has shape \(2, 2\) but the system has 1 outputs"),
    ],
)
def test_bad_covariances(process: object, measurement: object, message: str) -> None:
    with pytest.raises(BadInput, match=message):
        synthesize(TRACK, KalmanGain(np.array(process), np.array(measurement)))


def test_refusals() -> None:
    with pytest.raises(BadInput, match="nan"):
        KalmanGain([[np.nan]], [[1.0]])
    with pytest.raises(NotAccepted, match="nonlinearity"):
        synthesize(pendulum(), KalmanGain(np.eye(2), [[1.0]]))
    with pytest.raises(BadInput, match="unobservable mode"):
        synthesize(System.linear([[1.0, 0.0], [0.0, 2.0]], C=[[1.0, 0.0]]), KalmanGain(np.eye(2), [[1.0]]))
    with pytest.raises(BadInput, match="`points` is 1"):
        synthesize(scheduled(), KalmanGain(np.eye(2), [[1.0]], points=1))
    for plant in (TRACK, System.linear([[0.0, 1.0], [0.0, 0.0]], C=[[1.0, 0.0]])):
        with pytest.raises(NotAccepted, match="no stabilising solution"):
            synthesize(plant, KalmanGain(np.zeros((2, 2)), [[1.0]]))
