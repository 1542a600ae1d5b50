"""Laws of definiteness: eigenvalues of the double matrix judge where they are clear, exact arithmetic elsewhere."""

import numpy as np
import pytest
from flint import fmpq
from hypothesis import given, settings
from hypothesis import strategies as st

from luenberger.algebra.ball import Ball
from luenberger.algebra.definiteness import definite, direction_of_failure, exact, positive_definite
from luenberger.core import BadInput, Outcome

pytestmark = pytest.mark.filterwarnings("ignore:Do not use the `random` module")
law = settings(deadline=None, max_examples=80, derandomize=True)


@st.composite
def symmetric(draw: st.DrawFn) -> np.ndarray:
    n = draw(st.integers(1, 6))
    entries = st.integers(-8, 8).map(lambda k: k / 4)
    half = np.reshape(draw(st.lists(entries, min_size=n * n, max_size=n * n)), (n, n))
    shift = draw(st.integers(0, 40)) / 4
    return half + half.T + shift * np.eye(n)


def widened(matrix: np.ndarray, radius: float) -> np.ndarray:
    return np.vectorize(lambda x: Ball.hull(x - radius, x + radius), otypes=[object])(matrix)


@law
@given(matrix=symmetric())
def test_rationals_are_always_decided_and_agree_with_eigenvalues(matrix: np.ndarray) -> None:
    outcome = positive_definite(exact(matrix))
    least = np.linalg.eigvalsh(matrix)[0]
    assert outcome in (Outcome.PROVED, Outcome.REFUTED)
    # Entries are below 16 and the size below 7: eigenvalues in doubles are good to 1e-13.
    if abs(least) > 1e-12:
        assert (outcome is Outcome.PROVED) == (least > 0)


@law
@given(matrix=symmetric())
def test_a_refused_matrix_has_a_direction_that_shows_it(matrix: np.ndarray) -> None:
    rational = exact(matrix)
    if positive_definite(rational) is Outcome.PROVED:
        with pytest.raises(BadInput, match="no direction"):
            direction_of_failure(rational)
        return
    v = direction_of_failure(rational)
    assert any(x != 0 for x in v)
    assert v @ rational @ v <= 0


@law
@given(matrix=symmetric(), radius=st.sampled_from([0.0, 1e-6, 0.01, 0.3]), seed=st.integers(0, 999))
def test_answers_about_balls_hold_for_members(matrix: np.ndarray, radius: float, seed: int) -> None:
    outcome = positive_definite(widened(matrix, radius))
    generator = np.random.default_rng(seed)
    for corner in (True, False):
        shift = generator.uniform(-radius, radius, matrix.shape)
        shift = np.tril(np.sign(shift) * radius if corner else shift)
        member = matrix + shift + np.tril(shift, -1).T
        least = np.linalg.eigvalsh(member)[0]
        if outcome is Outcome.PROVED:
            assert least > -1e-12
        if outcome is Outcome.REFUTED:
            assert least < 1e-12


@law
@given(matrix=symmetric())
def test_thin_balls_are_decided_where_doubles_are_clear(matrix: np.ndarray) -> None:
    least = np.linalg.eigvalsh(matrix)[0]
    outcome = positive_definite(widened(matrix, 0.0))
    # A zero pivot on the way leaves balls undecided, also where an eigenvalue is clearly negative: the direction decides.
    if abs(least) > 1e-9:
        assert outcome is (Outcome.PROVED if least > 0 else Outcome.REFUTED)


def test_decision_on_the_boundary_is_exact() -> None:
    # The double 0.1 is not 1/10: 0.1 * 10 - 1 is 5.6e-17, and only exact arithmetic sees on which side it lies.
    gap = fmpq(*(0.1).as_integer_ratio()) * 10 - 1
    matrix = exact([[10.0, 1.0], [1.0, 0.1]])
    assert gap > 0
    assert positive_definite(matrix) is Outcome.PROVED
    below = exact([[10.0, 1.0], [1.0, np.nextafter(0.1, 0.0)]])
    assert positive_definite(below) is Outcome.REFUTED
    assert positive_definite(exact([[1.0, 1.0], [1.0, 1.0]])) is Outcome.REFUTED
    v = direction_of_failure(exact([[1.0, 1.0, 0.0], [1.0, 1.0, 1e-30], [0.0, 1e-30, 5.0]]))
    assert v @ exact([[1.0, 1.0, 0.0], [1.0, 1.0, 1e-30], [0.0, 1e-30, 5.0]]) @ v <= 0


def test_a_direction_that_doubles_cannot_show_comes_from_the_leading_block() -> None:
    # Indefinite by 1e-40: the eigenvector in doubles gives a positive form.
    tiny = fmpq(1, 10**40)
    matrix = exact([[1.0, 3.0], [3.0, 9.0]])
    matrix[1, 1] -= tiny
    matrix[0, 1] = matrix[1, 0] = fmpq(3)
    v = direction_of_failure(matrix)
    assert v @ matrix @ v <= 0
    assert any(x != 0 for x in v)


@pytest.mark.parametrize("seed", [2, 3, 8])
def test_scaling_proves_what_elimination_in_balls_does_not(seed: int) -> None:
    # Eight strongly coupled states with radii of 5 % of every entry: plain elimination lets the balls grow over zero.
    half = np.random.default_rng(seed).normal(size=(8, 8))
    matrix = half @ half.T / 3 + np.eye(8)
    relative = np.vectorize(lambda x: Ball.hull(x - 0.05 * abs(x), x + 0.05 * abs(x)), otypes=[object])
    assert positive_definite(relative(matrix)) is Outcome.PROVED
    # A radius of 1 goes beyond the least eigenvalue (just above 1): no proof may appear.
    assert positive_definite(widened(matrix, 1.0)) is not Outcome.PROVED


def test_either_sign() -> None:
    assert definite(exact(-np.eye(3))) is Outcome.PROVED
    assert definite(exact(np.eye(3))) is Outcome.PROVED
    assert definite(exact(np.diag([1.0, -1.0]))) is Outcome.REFUTED
    assert definite(widened(np.diag([1.0, 0.0]), 0.5)) is Outcome.UNDECIDED


def test_exact_means_the_double() -> None:
    assert exact([0.1])[0] == fmpq(3602879701896397, 2**55)
    assert exact(np.array([np.int64(3), fmpq(1, 3)], dtype=object)).tolist() == [fmpq(3), fmpq(1, 3)]
    assert exact(2.5).shape == ()
    with pytest.raises(BadInput, match="finite"):
        exact([1.0, np.nan])
    with pytest.raises(BadInput, match="not a real number"):
        exact([[1.0], [2.0, 3.0]])


def test_whole_numbers_and_zeros_may_be_mixed_in() -> None:
    matrix = np.array([[fmpq(2), 0], [0, 1]], dtype=object)
    assert positive_definite(matrix) is Outcome.PROVED
    matrix[1, 1] = Ball.hull(-1, 1)
    assert positive_definite(matrix) is Outcome.UNDECIDED
    assert positive_definite(np.empty((0, 0), dtype=object)) is Outcome.PROVED


def test_what_is_no_symmetric_matrix_is_refused() -> None:
    with pytest.raises(BadInput, match="object array"):
        positive_definite(np.eye(2))
    with pytest.raises(BadInput, match="square"):
        positive_definite(exact(np.ones((2, 3))))
    with pytest.raises(BadInput, match=r"holds 2 at \(0, 1\)"):
        positive_definite(exact([[1.0, 2.0], [0.0, 1.0]]))
    with pytest.raises(BadInput, match="balls"):
        direction_of_failure(widened(np.eye(2), 0.1))
