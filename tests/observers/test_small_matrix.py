"""Unrolled factorisations against NumPy, and their behaviour on singular and indefinite matrices."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from luenberger.observers.small_matrix import cholesky, solve_lower, solve_positive, solve_upper, symmetrised

sizes = st.integers(1, 10)
seeds = st.integers(0, 2**31)


def positive(n: int, seed: int) -> tuple[np.ndarray, np.random.Generator]:
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(n, n))
    return root @ root.T + np.eye(n), rng


@given(n=sizes, seed=seeds)
def test_cholesky_equals_numpy(n: int, seed: int) -> None:
    A, _ = positive(n, seed)
    # Both are backward stable; the condition number is below 1e3, so ten digits are far from rounding.
    np.testing.assert_allclose(cholesky(jnp.asarray(A)), np.linalg.cholesky(A), rtol=1e-10, atol=1e-10)


@given(n=sizes, seed=seeds, k=st.integers(1, 4))
def test_solutions_equal_numpy(n: int, seed: int, k: int) -> None:
    A, rng = positive(n, seed)
    b, L = jnp.asarray(rng.normal(size=(n, k))), jnp.asarray(np.linalg.cholesky(A))
    np.testing.assert_allclose(solve_positive(jnp.asarray(A), b), np.linalg.solve(A, b), rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(L @ solve_lower(L, b), b, rtol=1e-10, atol=1e-11)
    np.testing.assert_allclose(L.T @ solve_upper(L, b), b, rtol=1e-10, atol=1e-11)


def test_only_the_lower_triangle_counts() -> None:
    A, _ = positive(4, 0)
    spoiled = A + np.triu(np.full((4, 4), 7.0), 1)
    assert np.array_equal(cholesky(jnp.asarray(spoiled)), cholesky(jnp.asarray(A)))


def test_a_state_known_exactly_has_a_zero_column() -> None:
    A = np.zeros((3, 3))
    A[np.ix_([0, 2], [0, 2])] = [[4.0, 2.0], [2.0, 3.0]]
    L = np.asarray(cholesky(jnp.asarray(A)))
    np.testing.assert_allclose(L @ L.T, A, atol=1e-15)
    assert np.array_equal(L[:, 1], np.zeros(3))


@given(n=st.integers(2, 8), rank=st.integers(1, 7), seed=seeds)
def test_semidefinite_matrices_are_factored_within_rounding(n: int, rank: int, seed: int) -> None:
    root = np.random.default_rng(seed).normal(size=(n, min(rank, n - 1)))
    L = np.asarray(cholesky(jnp.asarray(root @ root.T)))
    # A lost pivot is zero to rounding, but its column is divided by a root of rounding size: half the digits remain.
    np.testing.assert_allclose(L @ L.T, root @ root.T, atol=1e-6 * (1 + np.abs(root).max() ** 2))


@pytest.mark.parametrize("A", [[[-1.0]], [[1.0, 2.0], [2.0, 1.0]], [[0.0, 1.0], [1.0, 0.0]]])
def test_indefinite_matrices_are_never_repaired_in_silence(A: list) -> None:
    L = np.asarray(cholesky(jnp.asarray(A)))
    if A[0][0] == 0.0:
        # A zero pivot hides the entry beside it; the product then shows the fault.
        assert not np.allclose(L @ L.T, A)
    else:
        assert np.isnan(L).any()


def test_inverse_runs_in_float32_under_jit_and_vmap() -> None:
    batch = jnp.asarray(np.stack([positive(3, s)[0] for s in range(4)]), jnp.float32)
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
