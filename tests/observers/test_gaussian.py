"""Covariances and sample times that no filter can use are refused with what is needed."""

import jax.numpy as jnp
import numpy as np
import pytest

from luenberger.core import BadInput
from luenberger.observers import Belief, ExtendedKalmanFilter, KalmanFilter, UnscentedKalmanFilter
from luenberger.observers.gaussian import checked_covariance, linear_update, masked
from observers.plants import DT, car, two_mass

GIVEN = {"process_covariance": np.eye(2), "measurement_covariance": [[1.0]], "initial_covariance": np.eye(2)}


@pytest.mark.parametrize("kind", [KalmanFilter, ExtendedKalmanFilter, UnscentedKalmanFilter])
@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"process_covariance": np.eye(3)},
            r"`process_covariance` has shape \(3, 3\) but there are 2 states; .* needs shape \(2, 2\)",
        ),
        ({"measurement_covariance": np.eye(2)}, r"`measurement_covariance` has shape \(2, 2\) but there are 1 outputs"),
        ({"measurement_covariance": [[0.0]]}, "`measurement_covariance` has the eigenvalue 0; .*positive definite"),
        (
            {"initial_covariance": [[1.0, 2.0], [2.0, 1.0]]},
            "`initial_covariance` has the eigenvalue -1; .*positive semidefinite",
        ),
        ({"initial_covariance": [[1.0, 0.2], [0.1, 1.0]]}, "`initial_covariance` differs from its transpose by 0.1"),
        ({"process_covariance": [[np.nan, 0.0], [0.0, 1.0]]}, r"`process_covariance` holds nan at index \(0, 0\)"),
        ({"process_covariance": None}, "Exactly one of `process_covariance`.*and `process_density`"),
        ({"process_density": np.eye(2)}, "Exactly one of"),
        ({"dt": None}, "`car` is continuous and `dt` is not given"),
        ({"dt": 0.0}, "`dt` is 0.*positive step"),
        ({"method": "rk5"}, "Did you mean `rk4`"),
        ({"substeps": 0}, "at least one sub-step"),
    ],
)
def test_bad_tunings_are_refused(kind: type, change: dict, message: str) -> None:
    with pytest.raises(BadInput, match=message):
        kind(car(), **({"dt": DT} | GIVEN | change))


@pytest.mark.parametrize("dt", [None, np.nan, -0.1])
def test_functions_need_a_sample_time(dt: float | None) -> None:
    with pytest.raises(BadInput, match="given as two functions a positive sample time"):
        ExtendedKalmanFilter((lambda x, u, r: x, lambda x, u, r: x[:1]), dt, **GIVEN)


def test_functions_have_numbered_states() -> None:
    observer = ExtendedKalmanFilter((lambda x, u, r: x, lambda x, u, r: x[:1]), DT, **GIVEN)
    assert observer.states == ("x1", "x2")
    assert (
        two_mass().states
        == KalmanFilter(
            two_mass(), DT, measurement_covariance=np.eye(2), process_density=np.eye(4), initial_covariance=np.eye(4)
        ).states
    )


def test_a_covariance_known_exactly_may_be_zero() -> None:
    assert np.array_equal(checked_covariance("P", np.zeros((2, 2)), 2, "states"), np.zeros((2, 2)))
    assert checked_covariance("P", 3.0, 1, "states").tolist() == [[3.0]]


def test_rounding_is_not_asymmetry() -> None:
    P = checked_covariance("P", [[1.0, 0.1], [0.1 + 1e-13, 1.0]], 2, "states")
    assert np.array_equal(P, P.T)


def test_absent_outputs_lose_their_correlations() -> None:
    present, R = masked(jnp.array([1.0, np.nan, 2.0]), jnp.array([[2.0, 0.5, 0.4], [0.5, 3.0, 0.6], [0.4, 0.6, 4.0]]))
    assert present.tolist() == [True, False, True]
    assert R.tolist() == [[2.0, 0.0, 0.4], [0.0, 1.0, 0.0], [0.4, 0.0, 4.0]]


def test_one_scalar_update_by_hand() -> None:
    belief = Belief(jnp.array([1.0, 0.0]), jnp.array([[3.0, 1.0], [1.0, 2.0]]))
    after = linear_update(belief, jnp.array([2.0]), jnp.array([1.0]), jnp.array([[1.0, 0.0]]), jnp.array([[1.0]]))
    # S = 4, K = (3/4, 1/4): dyadic numbers, so equality is exact.
    assert after.x.tolist() == [1.75, 0.25]
    assert after.covariance.tolist() == [[0.75, 0.25], [0.25, 1.75]]
