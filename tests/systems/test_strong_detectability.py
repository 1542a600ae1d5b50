"""Invariant zeros against hand examples, python-control, and the compressed generalised eigenvalue problem."""

import warnings

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import eig

from luenberger.algebra import Polynomial
from luenberger.systems import Parameter, System
from luenberger.systems.strong_detectability import strong_detectability


def plant(A: object, E: object, C: object, dt: float | None = None) -> System:
    return System.linear(A, C=C, E=E, dt=dt)


def test_position_and_velocity_show_a_force() -> None:
    report = strong_detectability(plant([[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], np.eye(2)))
    assert report
    assert report.matching
    assert report.modes == ()
    assert report.rank == 3
    assert "strong* detectable" in str(report)


def test_position_alone_needs_a_derivative() -> None:
    report = strong_detectability(plant([[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], [[1.0, 0.0]]))
    assert report
    assert report.matching is False
    assert "would need derivatives of y" in str(report)


def test_velocity_alone_hides_the_position() -> None:
    report = strong_detectability(plant([[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], [[0.0, 1.0]]))
    assert not report
    assert [m.text for m in report.modes] == ["0 1/s (x1)"]
    assert "an invariant zero that does not die out" in str(report)


@pytest.mark.parametrize(("zero", "holds"), [(-3.0, True), (2.0, False), (0.0, False)])
def test_the_side_of_the_zero_decides(zero: float, holds: bool) -> None:
    # (s - zero) / (s^2 + 3 s + 2) in companion form.
    report = strong_detectability(plant([[0.0, 1.0], [-2.0, -3.0]], [[0.0], [1.0]], [[-zero, 1.0]]))
    assert bool(report) is holds
    assert report.modes[0].eigenvalue == pytest.approx(zero, abs=1e-12)


@pytest.mark.parametrize(("zero", "holds"), [(0.5, True), (-0.99, True), (1.0, False), (-1.5, False)])
def test_the_unit_circle_decides_for_a_discrete_plant(zero: float, holds: bool) -> None:
    report = strong_detectability(plant([[0.0, 1.0], [-0.02, 0.3]], [[0.0], [1.0]], [[-zero, 1.0]], dt=0.1))
    assert bool(report) is holds


def test_more_unknown_inputs_than_outputs_leave_no_trace() -> None:
    report = strong_detectability(plant(np.diag([-1.0, -2.0]), np.eye(2), [[1.0, 1.0]]))
    assert not report
    assert "normal rank 3, 4 is needed" in str(report)


def test_an_input_the_sensor_never_sees_leaves_no_trace() -> None:
    report = strong_detectability(plant(np.diag([-1.0, -2.0]), [[0.0], [1.0]], [[1.0, 0.0]]))
    assert not report
    assert "leaves no trace" in str(report)
    assert report.rank == 2


def test_dependent_columns_count_once() -> None:
    E = np.array([[0.0, 0.0], [1.0, -2.0]])
    report = strong_detectability(plant([[0.0, 1.0], [0.0, 0.0]], E, np.eye(2)))
    assert report
    assert report.rank == 3


def test_without_unknown_input_it_is_detectability() -> None:
    assert strong_detectability(System.linear(np.diag([-1.0, 2.0]), C=[[0.0, 1.0]]))
    assert not strong_detectability(System.linear(np.diag([1.0, 2.0]), C=[[0.0, 1.0]]))


def test_a_scheduled_plant_fails_where_one_vertex_fails() -> None:
    A = Polynomial.affine([[-1.0, 0.0], [0.0, -2.0]], vx=[[0.0, 1.0], [0.0, 0.0]])
    scheduled = System.lpv(A, C=[[1.0, 0.0]], E=[[0.0], [1.0]], parameters=[Parameter("vx", 0.0, 30.0)])
    assert not strong_detectability(scheduled)
    assert strong_detectability(scheduled.freeze(vx=5.0))


def compressed_zeros(A: np.ndarray, E: np.ndarray, C: np.ndarray, seed: int) -> list[complex]:
    """Zeros of a square system made of random output combinations, kept where the full pencil loses rank too."""
    n, m = E.shape
    mix = np.random.default_rng(seed).normal(size=(m, C.shape[0]))
    left = np.block([[A, E], [mix @ C, np.zeros((m, m))]])
    right = np.block([[np.eye(n), np.zeros((n, m))], [np.zeros((m, n + m))]])
    alpha, beta = eig(left, right, right=False, homogeneous_eigvals=True)
    found = []
    for a, b in zip(alpha, beta, strict=True):
        if abs(b) < 1e-6 * abs(a):
            continue
        pencil = np.block([[A - a / b * np.eye(n), E], [C, np.zeros((len(C), m))]])
        if np.linalg.svd(pencil, compute_uv=False)[-1] < 1e-7:
            found.append(a / b)
    return found


def both_halves(report_values: list[complex]) -> np.ndarray:
    pairs = [z for s in report_values for z in ({s} if s.imag == 0 else {s, s.conjugate()})]
    return np.array(sorted(pairs, key=lambda z: (round(z.real, 6), z.imag)))


@given(st.integers(0, 10**6), st.integers(1, 2), st.integers(0, 2))
def test_zeros_are_those_of_the_compressed_pencil(seed: int, nd: int, extra: int) -> None:
    generator = np.random.default_rng(seed)
    A, E, C = (generator.normal(size=s) for s in ((4, 4), (4, nd), (nd + extra, 4)))
    if extra:
        # A tall pencil has no zeros by chance; a state that nothing but the unknown input reads makes one at -0.5.
        A[:, 3], C[:, 3] = [0, 0, 0, -0.5], 0
        E[:, 0] += 2.0
    report = strong_detectability(plant(A, E, C))
    expected = compressed_zeros(A, E, C, seed + 1)
    expected = both_halves(
        [complex(z) for z in expected if z.imag > 1e-7] + [complex(z.real) for z in expected if abs(z.imag) <= 1e-7]
    )
    found = both_halves([m.eigenvalue for m in report.modes])
    # Gaussian plants: zeros are seldom worse conditioned than 1e6.
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("seed", range(8))
def test_square_zeros_are_those_of_python_control(seed: int) -> None:
    generator = np.random.default_rng(seed)
    A, E, C = (generator.normal(size=s) for s in ((5, 5), (5, 2), (2, 5)))
    with warnings.catch_warnings():
        # Without slycot python-control takes SciPy's pencil and says so.
        warnings.simplefilter("ignore")
        expected = control.zeros(control.ss(A, E, C, np.zeros((2, 2))))
    found = both_halves([m.eigenvalue for m in strong_detectability(plant(A, E, C)).modes])
    finite = np.array(sorted(expected[abs(expected) < 1e6], key=lambda z: (round(z.real, 6), z.imag)))
    np.testing.assert_allclose(found, finite, rtol=1e-7, atol=1e-7)


def test_zeros_at_infinity_never_become_finite_ones() -> None:
    # A chain of six integrators from force to measurement has no finite zero, only six at infinity.
    A = np.diag(np.ones(5), 1)
    report = strong_detectability(plant(A, np.eye(6)[:, 5:], np.eye(6)[:1]))
    assert report
    assert report.modes == ()
