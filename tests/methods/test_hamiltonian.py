"""Riccati equations and H-infinity norms from Hamiltonian matrices."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from luenberger.core import BadInput
from luenberger.methods.hamiltonian import (
    hamiltonian,
    hinf_peak,
    positive_solution,
    riccati_residual,
    riccati_solution,
)

seeds = st.integers(0, 10_000)


def random_plant(seed: int, n: int = 4) -> tuple[np.ndarray, np.ndarray]:
    generator = np.random.default_rng(seed)
    return generator.normal(size=(n, n)), generator.normal(size=(2, n))


@given(seeds)
def test_largest_solution_is_antistabilising_and_above_the_smallest(seed: int) -> None:
    A, C = random_plant(seed)
    Q = 1e-3 * np.eye(4) - 5.0 * C.T @ C
    R = np.eye(4)
    high, low = riccati_solution(A, R, Q), riccati_solution(A, R, Q, "minimal")
    if high is None or low is None:
        # No solution is only allowed with eigenvalues on the imaginary axis.
        assert np.abs(np.linalg.eigvals(hamiltonian(A, R, Q)).real).min() < 1e-6
        return
    for P in (high, low):
        # Refined solutions leave only rounding of the largest term.
        assert np.abs(riccati_residual(P, A, R, Q)).max() < 1e-10 * (1 + np.abs(P @ P).max())
        np.testing.assert_array_equal(P, P.T)
    assert np.linalg.eigvals(A + R @ high).real.min() > 0
    assert np.linalg.eigvals(A + R @ low).real.max() < 0
    assert np.linalg.eigvalsh(high - low)[0] > -1e-9 * (1 + np.abs(high).max())


def test_scalar_solutions_are_the_roots_of_the_quadratic() -> None:
    # p^2 + 2 a p + q = 0 with a = 1, q = -3 has the roots 1 and -3.
    one = np.eye(1)
    assert riccati_solution(one, one, -3 * one) == pytest.approx(np.array([[1.0]]), rel=1e-14)
    assert riccati_solution(one, one, -3 * one, "minimal") == pytest.approx(np.array([[-3.0]]), rel=1e-14)


def test_no_solution_with_imaginary_eigenvalues() -> None:
    # p^2 + q = 0 has no real root for q > 0.
    one = np.eye(1)
    assert riccati_solution(0 * one, one, one) is None
    assert riccati_solution(0 * one, one, -one) == pytest.approx(one)


def test_positive_solution_refuses_an_indefinite_one() -> None:
    A, Q = np.diag([0.0, 3.0]), np.diag([-1.0, 0.1])
    P = riccati_solution(A, np.eye(2), Q)
    assert P is not None
    assert np.linalg.eigvalsh(P)[0] < 0 < np.linalg.eigvalsh(P)[1]
    assert positive_solution(A, np.eye(2), Q) is None


@settings(max_examples=20)
@given(seeds)
def test_norm_is_the_top_of_a_dense_sweep(seed: int) -> None:
    A, C = random_plant(seed)
    A = A - (np.linalg.eigvals(A).real.max() + 0.3) * np.eye(4)
    B = np.random.default_rng(seed + 1).normal(size=(4, 2))
    peak = hinf_peak(A, B, C)
    response = [np.linalg.norm(C @ np.linalg.solve(1j * w * np.eye(4) - A, B), 2) for w in np.linspace(0, 30, 3001)]
    assert peak.level >= max(response) * (1 - 1e-9)
    # A step of 0.01 rad/s misses a peak of width 0.3 rad/s by less than (0.005 / 0.3)^2.
    assert peak.level <= max(response) * (1 + 3e-4)
    there = np.linalg.norm(C @ np.linalg.solve(1j * peak.frequency * np.eye(4) - A, B), 2)
    assert there == pytest.approx(peak.level, rel=1e-12)


def test_norm_of_a_resonance_between_the_start_frequencies() -> None:
    # G = 1 / (s^2 + 2 d s + 1) peaks with 1 / (2 d sqrt(1 - d^2)) at sqrt(1 - 2 d^2).
    d = 0.3
    peak = hinf_peak(np.array([[0.0, 1.0], [-1.0, -2 * d]]), np.array([[0.0], [1.0]]), np.array([[1.0, 0.0]]))
    assert peak.level == pytest.approx(1 / (2 * d * np.sqrt(1 - d * d)), rel=1e-9)
    assert peak.frequency == pytest.approx(np.sqrt(1 - 2 * d * d), rel=1e-4)


def test_norm_refuses_an_unstable_matrix() -> None:
    with pytest.raises(BadInput, match=r"real part 0.5 1/s; the norm needs a stable matrix"):
        hinf_peak(np.array([[0.5]]), np.eye(1), np.eye(1))
