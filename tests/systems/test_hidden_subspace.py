"""The subspace recursion against constructions whose answer is known."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from luenberger.algebra import Polynomial
from luenberger.systems import Nonlinearity, Parameter, System
from luenberger.systems.hidden_subspace import Balanced, kernel, points, span


def pair(A: object, C: object, E: object = None) -> Balanced:
    A, C = np.array(A, dtype=float), np.array(C, dtype=float)
    return Balanced.of(A, C, np.zeros((len(A), 0)) if E is None else np.array(E, dtype=float))


@given(st.integers(0, 10**6), st.integers(1, 4), st.integers(0, 3))
def test_a_hidden_block_is_found_with_its_eigenvalues(seed: int, shown: int, hidden: int) -> None:
    generator = np.random.default_rng(seed)
    n = shown + hidden
    A = np.diag(np.concatenate([generator.uniform(-9, -5, shown), -1.0 - np.arange(hidden)]))
    A[shown:, :shown] = generator.normal(size=(hidden, shown))
    C = np.hstack([np.ones((1, shown)), np.zeros((1, hidden))])
    C = np.vstack([C, np.hstack([generator.normal(size=(shown, shown)), np.zeros((shown, hidden))])])
    T = np.linalg.qr(generator.normal(size=(n, n)))[0]
    values, directions = pair(T @ A @ T.T, C @ T.T).hidden_modes()
    # Simple eigenvalues one apart of a matrix of norm below 20: digits are lost only to their condition, below 1e4.
    np.testing.assert_allclose(np.sort(values.real), np.sort(-1.0 - np.arange(hidden)), atol=1e-9)
    np.testing.assert_allclose(C @ T.T @ directions, 0, atol=1e-9)
    np.testing.assert_allclose(T @ A @ T.T @ directions, directions * values, atol=1e-8)


def test_badly_scaled_states_change_nothing() -> None:
    scale = np.diag([1e6, 1.0, 1e-5])
    A = np.array([[-1.0, 2.0, 0.0], [0.0, -2.0, 0.0], [1.0, 1.0, -3.0]])
    values, directions = pair(scale @ A @ np.linalg.inv(scale), [[1e-6, 0.0, 0.0]]).hidden_modes()
    np.testing.assert_allclose(values, [-3.0], rtol=1e-12)
    np.testing.assert_allclose(abs(directions[:, 0]), [0, 0, 1], atol=1e-12)


def test_fast_and_slow_modes_keep_their_digits() -> None:
    # Powers of this A span (1e4)^5 = 1e20, more than doubles resolve; the pair is observable all the same.
    A = np.diag([-1e4, -5e3, -4.0, -3.0, -2.0, -1.0])
    assert pair(A, np.ones((1, 6))).hidden_subspace().shape == (6, 0)


def test_nothing_measured_hides_everything() -> None:
    assert pair([[0.0, 1.0], [0.0, 0.0]], np.zeros((0, 2))).hidden_subspace().shape == (2, 2)
    assert pair([[0.0, 1.0], [0.0, 0.0]], [[0.0, 0.0]]).hidden_subspace().shape == (2, 2)


def test_a_repeated_hidden_eigenvalue_stays_real() -> None:
    A = np.array([[-1.0, 1.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -2.0]])
    T = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    values, _ = pair(T @ A @ T.T, np.array([[0.0, 0.0, 1.0]]) @ T.T).hidden_modes()
    assert len(values) == 2
    assert np.isreal(values).all()
    # A double eigenvalue splits by the root of the machine precision.
    np.testing.assert_allclose(values.real, -1.0, atol=1e-7)


def test_an_input_inside_the_hidden_subspace_is_noticed() -> None:
    assert pair(np.diag([-1.0, -2.0]), [[1.0, 0.0]], [[0.0], [1.0]]).input_is_hidden()
    assert not pair([[0.0, 1.0], [0.0, 0.0]], [[1.0, 0.0]], [[0.0], [1.0]]).input_is_hidden()
    assert not pair(np.diag([-1.0, -2.0]), [[1.0, 0.0]]).input_is_hidden()


def test_kernel_and_span_are_complements() -> None:
    M = np.array([[1.0, 2.0, 3.0], [2.0, 4.0, 6.0]])
    null, rows = kernel(M, 1.0), span(M.T)
    assert null.shape == (3, 2)
    assert rows.shape == (3, 1)
    np.testing.assert_allclose(M @ null, 0, atol=1e-14)
    np.testing.assert_allclose(null.T @ rows, 0, atol=1e-14)


def test_points_are_the_vertices_and_the_middle() -> None:
    A = Polynomial.affine(np.zeros((1, 1)), a=[[1.0]], b=[[10.0]], q=[[100.0]])
    box = [Parameter("a", 0, 1), Parameter("b", 2, 4), Parameter("fixed", 5, 5), Parameter("q", 1, 3, measured=False)]
    found = {tuple(where.values()): float(A[0, 0]) for where, A, _, _ in points(System.lpv(A, parameters=box), False)}
    assert set(found) == {*itertools.product((0, 1), (2, 4)), (0.5, 3)}
    assert all(value == a + 10 * b + 200 for (a, b), value in found.items())


def test_a_constant_plant_has_one_point() -> None:
    assert [where for where, *_ in points(System.linear([[1.0]]), False)] == [{}]


def test_a_jacobian_box_adds_its_entries() -> None:
    f = Nonlinearity.bounded(lambda z, u: z, [[1.0]], jacobian=([[-1.0]], [[3.0]]))
    plant = System.nonlinear([[10.0]], F=[[2.0]], nonlinearity=f)
    assert sorted(A[0, 0] for _, A, _, _ in points(plant, False)) == [8.0, 12.0, 16.0]
    assert [A[0, 0] for _, A, _, _ in points(plant, True)] == [10.0]


@pytest.mark.parametrize("count", [11, 14])
def test_many_parameters_are_sampled_at_their_ends(count: int) -> None:
    names = [f"p{k}" for k in range(count)]
    A = Polynomial.affine(np.zeros((1, 1)), **{n: [[1.0]] for n in names})
    plant = System.lpv(A, parameters=[Parameter(n, -1, 1) for n in names])
    assert len(list(points(plant, False))) == 2 * count + 1
