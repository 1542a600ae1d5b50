"""The unscented filter against filterpy on nonlinear plants, and against moments known in closed form."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from filterpy.kalman import MerweScaledSigmaPoints
from filterpy.kalman import UnscentedKalmanFilter as Filterpy

from luenberger.core import BadInput
from luenberger.observers import UnscentedKalmanFilter
from luenberger.systems.discretize import one_step
from observers.plants import DT, car, drive, pendulum

GIVEN = {
    "process_covariance": np.diag([1e-4, 1e-3]),
    "measurement_covariance": [[0.02]],
    "initial_covariance": [[0.3, 0.1], [0.1, 0.4]],
}


@pytest.mark.parametrize(("alpha", "beta", "kappa"), [(1.0, 2.0, 0.0), (0.5, 2.0, 1.0), (1.0, 0.0, 1.0)])
def test_equals_filterpy_on_a_nonlinear_plant(alpha: float, beta: float, kappa: float) -> None:
    plant, log = pendulum(), drive(pendulum(), 100)
    step = eqx.filter_jit(one_step(plant, DT))
    u, y = log.table(plant.inputs), log.table(plant.outputs)
    other = Filterpy(
        2,
        1,
        DT,
        hx=lambda x: np.sin(x[:1]),
        fx=lambda x, dt, u: np.asarray(step(x, u, jnp.zeros(0))),
        points=MerweScaledSigmaPoints(2, alpha, beta, kappa),
    )
    other.x, other.P = np.array([1.0, 0.0]), np.array(GIVEN["initial_covariance"])
    other.Q, other.R = GIVEN["process_covariance"], np.array(GIVEN["measurement_covariance"])
    # filterpy draws its points in the time update only, so its first measurement needs them drawn by hand.
    other.sigmas_f = other.points_fn.sigma_points(other.x, other.P)
    advance = one_step(plant, DT)
    observer = UnscentedKalmanFilter(
        (advance, lambda x, u, r: jnp.sin(x[:1])), DT, alpha=alpha, beta=beta, kappa=kappa, **GIVEN
    )
    state, ours = observer.init([1.0, 0.0]), eqx.filter_jit(observer.step)
    for k in range(100):
        state, estimate = ours(state, u[k], y[k], jnp.zeros(0))
        other.update(y[k])
        # The same points and weights; means summed about the centre point here, plainly there.
        np.testing.assert_allclose(estimate.x, other.x, rtol=1e-9, atol=1e-10)
        np.testing.assert_allclose(estimate.covariance, other.P, rtol=1e-9, atol=1e-10)
        other.predict(u=u[k])


def test_moments_of_a_square_are_exact() -> None:
    observer = UnscentedKalmanFilter(
        (lambda x, u, r: x**2, lambda x, u, r: x), 1.0, process_covariance=[[0.0]], measurement_covariance=[[1.0]], initial_covariance=[[4.0]],
        beta=0.0, kappa=2.0,
    )  # fmt: skip
    state, _ = observer.step(observer.init([3.0]), np.zeros(0), np.array([np.nan]), np.zeros(0))
    # x ~ N(3, 4): E x^2 = 9 + 4, var x^2 = 2 * 16 + 4 * 9 * 4; nx + kappa = 3 matches the fourth moment of a Gaussian.
    assert float(state.x[0]) == pytest.approx(13.0, rel=1e-14)
    assert float(state.covariance[0, 0]) == pytest.approx(176.0, rel=1e-14)


def test_small_alpha_still_follows_the_linear_filter() -> None:
    log = drive(car(), 50)
    record = [log.table(names) for names in (car().inputs, car().outputs, car().scheduling_names)]
    wide, narrow = (UnscentedKalmanFilter(car(), DT, alpha=a, **GIVEN) for a in (1.0, 1e-3))
    a, b = (jax.lax.scan(lambda s, v, o=o: o.step(s, *v), o.init(np.ones(2)), tuple(record))[1] for o in (wide, narrow))
    # Weights of 1e6 cost six of sixteen digits.
    np.testing.assert_allclose(b.x, a.x, atol=1e-7)
    np.testing.assert_allclose(b.covariance, a.covariance, atol=1e-7)


def test_an_indefinite_belief_is_not_repaired() -> None:
    def fold(x: jax.Array, u: jax.Array, r: jax.Array) -> jax.Array:
        return x**2

    # alpha = 1, beta = 0, kappa = -0.9: the centre weight is -9, so the variance of a square comes out negative.
    observer = UnscentedKalmanFilter(
        (fold, lambda x, u, r: x), 1.0, process_covariance=[[0.0]], measurement_covariance=[[1.0]], initial_covariance=[[1.0]],
        beta=0.0, kappa=-0.9,
    )  # fmt: skip
    state = observer.init([0.0])
    for _ in range(2):
        state, _ = observer.step(state, np.zeros(0), np.array([np.nan]), np.zeros(0))
    assert np.isnan(np.asarray(state.covariance)).all()


@pytest.mark.parametrize("spread", [{"alpha": 0.0}, {"alpha": -1.0}, {"kappa": -2.0}, {"beta": np.nan}])
def test_a_spread_without_points_is_refused(spread: dict) -> None:
    with pytest.raises(BadInput, match="with 2 states; alpha > 0 and kappa > -2 are needed"):
        UnscentedKalmanFilter(car(), DT, **spread, **GIVEN)
