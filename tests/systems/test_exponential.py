"""The held solution equals SciPy's exponential for slow, fast, stiff and singular matrices."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.linalg
from hypothesis import given, settings
from hypothesis import strategies as st

from luenberger.core import BadInput
from luenberger.systems.exponential import affine_hold, hold_order, product


def by_scipy(M: np.ndarray, b: np.ndarray, x: np.ndarray, dt: float) -> np.ndarray:
    n = len(b)
    augmented = np.zeros((n + 1, n + 1))
    augmented[:n, :n], augmented[:n, n] = M * dt, b * dt
    whole = scipy.linalg.expm(augmented)
    return whole[:n, :n] @ x + whole[:n, n]


@pytest.mark.parametrize("norm", [0.0, 1e-9, 0.3, 1.0, 1.01, 4.0, 60.0, 3e3])
@settings(max_examples=25)
@given(seed=st.integers(0, 2**31), n=st.integers(1, 5))
def test_held_solution_equals_scipy(norm: float, seed: int, n: int) -> None:
    rng = np.random.default_rng(seed)
    M = rng.normal(size=(n, n))
    # Stable, so that the solution stays of order one and digits can be compared.
    M = M - (np.linalg.eigvals(M).real.max() + 0.1) * np.eye(n)
    M, dt = M / np.linalg.norm(M, 2) * norm, 0.5
    b, x = rng.normal(size=n), rng.normal(size=n)
    held = affine_hold(M, b, jnp.asarray(x), dt, hold_order(norm * dt))
    # Squaring s times loses about 2^s units in the last place, here at most 2^11; SciPy does the same.
    tolerance = 1e-13 * max(1.0, norm) * 10
    assert np.abs(held - by_scipy(M, b, x, dt)).max() <= tolerance * (1 + np.abs(by_scipy(M, b, x, dt)).max())


def test_double_integrator_is_exact() -> None:
    M = np.array([[0.0, 1.0], [0.0, 0.0]])
    held = affine_hold(M, np.array([0.0, 2.0]), jnp.array([1.0, 3.0]), 0.5, hold_order(0.5))
    # Every term is a dyadic number, so equality is exact.
    assert held.tolist() == [1.0 + 1.5 + 0.25, 4.0]


def test_order_grows_with_the_norm_and_truncates_below_rounding() -> None:
    orders = [hold_order(norm) for norm in (0.01, 0.5, 1.0, 10.0, 1e4)]
    assert [o.squarings == 0 for o in orders] == [True, True, True, False, False]
    assert orders[0].degree < orders[1].degree < orders[2].degree
    assert orders[3].squarings < orders[4].squarings


def test_a_norm_that_is_not_finite_is_refused() -> None:
    with pytest.raises(BadInput, match="finite norm is needed"):
        hold_order(np.inf)


def test_products_equal_matrix_products() -> None:
    rng = np.random.default_rng(0)
    A, B = rng.normal(size=(3, 4)), rng.normal(size=(4, 2))
    # Sums of four products in another order: a few units in the last place.
    np.testing.assert_allclose(product(A, B), A @ B, atol=1e-14)
    np.testing.assert_allclose(product(A, B[:, 0]), A @ B[:, 0], atol=1e-14)
    assert product(np.zeros((3, 0)), np.zeros(0)).tolist() == [0.0, 0.0, 0.0]


def test_derivative_passes_through() -> None:
    M = np.array([[-1.0, 2.0], [-2.0, -1.0]])
    order = hold_order(3.0 * 0.2)
    jacobian = jax.jacfwd(lambda x: affine_hold(M, jnp.zeros(2), x, 0.2, order))(jnp.ones(2))
    # The map is linear in x, its Jacobian the exponential; both to rounding.
    np.testing.assert_allclose(jacobian, scipy.linalg.expm(M * 0.2), atol=1e-15)
