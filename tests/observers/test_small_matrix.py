"""Unrolled factorisations against NumPy, and their behaviour on singular and indefinite matrices."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from luenberger.observers.small_matrix import cholesky, solve_lower, solve_positive, solve_upper, symmetrised

COUNT = 50


def positive(n: int, shift: float = 1.0, rank: int = 10) -> tuple[np.ndarray, np.random.Generator]:
    rng = np.random.default_rng(n)
    roots = rng.normal(size=(COUNT, n, min(n, rank)))
    return roots @ roots.transpose(0, 2, 1) + shift * np.eye(n), rng


@pytest.mark.parametrize("n", [1, 2, 3, 8])
def test_factors_and_solutions_equal_numpy(n: int) -> None:
    A, rng = positive(n)
    b = rng.normal(size=(COUNT, n, 3))
    L = jax.jit(jax.vmap(cholesky))(A)
    # All are backward stable; the condition numbers are below 1e3, so ten digits are far from rounding.
    np.testing.assert_allclose(L, np.linalg.cholesky(A), rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(jax.jit(jax.vmap(solve_positive))(A, b), np.linalg.solve(A, b), rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(L @ jax.jit(jax.vmap(solve_lower))(L, b), b, rtol=1e-10, atol=1e-11)
    np.testing.assert_allclose(L.mT @ jax.jit(jax.vmap(solve_upper))(L, b), b, rtol=1e-10, atol=1e-11)


def test_only_the_lower_triangle_counts() -> None:
    A = positive(4)[0][0]
    spoiled = A + np.triu(np.full((4, 4), 7.0), 1)
    assert np.array_equal(cholesky(jnp.asarray(spoiled)), cholesky(jnp.asarray(A)))


def test_a_state_known_exactly_has_a_zero_column() -> None:
    A = np.zeros((3, 3))
    A[np.ix_([0, 2], [0, 2])] = [[4.0, 2.0], [2.0, 3.0]]
    L = np.asarray(cholesky(jnp.asarray(A)))
    np.testing.assert_allclose(L @ L.T, A, atol=1e-15)
    assert np.array_equal(L[:, 1], np.zeros(3))


@pytest.mark.parametrize(("n", "rank"), [(2, 1), (4, 2), (7, 6), (8, 3)])
def test_semidefinite_matrices_are_factored_within_rounding(n: int, rank: int) -> None:
    A, _ = positive(n, 0.0, rank)
    L = np.asarray(jax.jit(jax.vmap(cholesky))(A))
    # A lost pivot is zero to rounding, but its column is divided by a root of rounding size: half the digits remain.
    np.testing.assert_allclose(L @ L.mT, A, atol=1e-6 * np.abs(A).max())


@pytest.mark.parametrize("A", [[[-1.0]], [[1.0, 2.0], [2.0, 1.0]], [[0.0, 1.0], [1.0, 0.0]]])
def test_indefinite_matrices_are_never_repaired_in_silence(A: list) -> None:
    L = np.asarray(cholesky(jnp.asarray(A)))
    if A[0][0] == 0.0:
        # A zero pivot hides the entry beside it; the product then shows the fault.
        assert not np.allclose(L @ L.T, A)
    else:
        assert np.isnan(L).any()


def test_inverse_runs_in_float32_under_jit_and_vmap() -> None:
    batch = jnp.asarray(positive(3)[0][:4], jnp.float32)
    inverse = jax.jit(jax.vmap(lambda A: solve_positive(A, jnp.eye(3, dtype=A.dtype))))(batch)
    assert inverse.dtype == jnp.float32
    # Seven digits, condition number below 100.
    np.testing.assert_allclose(inverse @ batch, np.broadcast_to(np.eye(3), (4, 3, 3)), atol=1e-4)


def test_no_library_factorisation_is_called() -> None:
    text = str(jax.make_jaxpr(lambda A: solve_positive(A, jnp.eye(5)))(jnp.eye(5)))
    assert "cholesky" not in text
    assert "triangular_solve" not in text
    assert "custom_call" not in text


def test_symmetrised_is_the_symmetric_part() -> None:
    assert symmetrised(jnp.array([[1.0, 2.0], [4.0, 3.0]])).tolist() == [[1.0, 3.0], [3.0, 3.0]]
