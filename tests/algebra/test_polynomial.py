"""Laws of matrix polynomials: pointwise evaluation is the judge of every identity."""

import math
from collections.abc import Mapping
from fractions import Fraction
from itertools import pairwise, product
from typing import Any

import cvxpy as cp
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from flint import fmpq
from hypothesis import given, settings
from hypothesis import strategies as st

from luenberger.algebra import Polynomial
from luenberger.algebra.polynomial import as_fmpq, fraction
from luenberger.core import BadInput

# The run-time type checker samples containers at random, also where hypothesis builds polynomials; hypothesis seeds it.
pytestmark = pytest.mark.filterwarnings("ignore:Do not use the `random` module")

NAMES = ("a", "b")
BOX = {"a": (-1.5, 0.5), "b": (2.0, 3.0)}
# Coefficients are at most 4, exponents at most 3, arguments at most 3: values stay below 1e5, roundoff below 1e-9.
ROUNDOFF = 1e-9

numbers = st.integers(-4, 4).map(float)
points = st.fixed_dictionaries({"a": st.floats(-1.5, 0.5), "b": st.floats(2.0, 3.0)})


def matrices(rows: int, columns: int) -> st.SearchStrategy[np.ndarray]:
    size = rows * columns
    return st.lists(numbers, min_size=size, max_size=size).map(lambda c: np.reshape(c, (rows, columns)))


def polynomials(
    rows: int = 2, columns: int = 2, names: tuple[str, ...] = NAMES, degree: int = 2
) -> st.SearchStrategy[Polynomial]:
    exponents = st.tuples(*(st.integers(0, degree) for _ in names))
    terms = st.dictionaries(exponents, matrices(rows, columns), min_size=1, max_size=5)
    return terms.map(lambda found: Polynomial(names, found))


def plain(polynomial: Polynomial, at: Mapping[str, Any]) -> np.ndarray:
    """The textbook sum of monomials."""
    return sum(  # type: ignore[return-value]
        c * math.prod(at[n] ** k for n, k in zip(polynomial.names, e, strict=True)) for e, c in polynomial
    )


@given(polynomials(), points)
def test_evaluation_is_the_sum_of_monomials(p: Polynomial, at: dict[str, float]) -> None:
    np.testing.assert_allclose(p(at), plain(p, at), atol=ROUNDOFF)


@given(polynomials(2, 3), polynomials(2, 3, ("b", "c")), polynomials(3, 2, ("c",)), points, st.floats(-2, 2))
def test_arithmetic_commutes_with_evaluation(
    p: Polynomial, q: Polynomial, w: Polynomial, at: dict[str, float], c: float
) -> None:
    at = at | {"c": c}
    np.testing.assert_allclose((p + q)(at), p(at) + q(at), atol=ROUNDOFF)
    np.testing.assert_allclose((p - q)(at), p(at) - q(at), atol=ROUNDOFF)
    np.testing.assert_allclose((p @ w)(at), p(at) @ w(at), atol=ROUNDOFF)
    np.testing.assert_allclose((-p)(at), -p(at), atol=ROUNDOFF)
    np.testing.assert_allclose(p.T(at), p(at).T, atol=ROUNDOFF)
    np.testing.assert_allclose((p * 3.0)(at), 3.0 * p(at), atol=ROUNDOFF)
    np.testing.assert_array_equal((3.0 * p)(at), (p * 3.0)(at))


@given(polynomials(), points)
def test_plain_matrices_mix_in_from_both_sides(p: Polynomial, at: dict[str, float]) -> None:
    M = np.array([[1.0, 2.0], [-3.0, 0.5]])
    np.testing.assert_allclose((M @ p)(at), M @ p(at), atol=ROUNDOFF)
    np.testing.assert_allclose((p @ M)(at), p(at) @ M, atol=ROUNDOFF)
    np.testing.assert_allclose((M + p)(at), M + p(at), atol=ROUNDOFF)
    np.testing.assert_allclose((M - p)(at), M - p(at), atol=ROUNDOFF)
    np.testing.assert_allclose((p - M)(at), p(at) - M, atol=ROUNDOFF)
    np.testing.assert_allclose((np.float64(2.0) * p)(at), 2 * p(at), atol=ROUNDOFF)


@given(polynomials(), polynomials(1, 1, ("b", "c")), points, st.floats(-2, 2))
def test_a_scalar_polynomial_multiplies(p: Polynomial, s: Polynomial, at: dict[str, float], c: float) -> None:
    at = at | {"c": c}
    np.testing.assert_allclose((p * s)(at), p(at) * s(at)[0, 0], atol=ROUNDOFF)


@given(polynomials(), polynomials(), polynomials(), points)
def test_products_distribute(p: Polynomial, q: Polynomial, w: Polynomial, at: dict[str, float]) -> None:
    # Three factors of at most 5 * 4 * 3^4 each make values up to 1e10, whose roundoff is about 1e-5.
    np.testing.assert_allclose((p @ (q + w))(at), (p @ q + p @ w)(at), rtol=1e-12, atol=1e-5)
    np.testing.assert_allclose((p @ q).T(at), (q.T @ p.T)(at), rtol=1e-12, atol=1e-5)


@given(polynomials(), points)
def test_substitution_in_parts_is_substitution_at_once(p: Polynomial, at: dict[str, float]) -> None:
    half = p.substitute({"a": at["a"]})
    assert half.names == ("b",)
    np.testing.assert_allclose(half({"b": at["b"]}), p(at), atol=ROUNDOFF)


@given(polynomials(), points)
def test_rewriting_over_more_names_changes_nothing(p: Polynomial, at: dict[str, float]) -> None:
    wide = p.over(("z", "b", "a"))
    assert wide.names == ("z", "b", "a")
    np.testing.assert_allclose(wide(at | {"z": 7.0}), p(at), atol=ROUNDOFF)


@given(polynomials(), points, st.sampled_from(NAMES))
def test_partial_derivative_matches_finite_differences(p: Polynomial, at: dict[str, float], name: str) -> None:
    h = 1e-5
    up, down = p(at | {name: at[name] + h}), p(at | {name: at[name] - h})
    # The central difference of a quadratic is exact; roundoff of values up to 2e3 over 2 h stays below 1e-6.
    np.testing.assert_allclose(p.partial(name)(at), (up - down) / (2 * h), atol=1e-6)


def test_partial_of_an_absent_parameter_is_zero() -> None:
    p = Polynomial(("a",), {(2,): np.eye(2)})
    np.testing.assert_array_equal(p.partial("z")({"a": 3.0}), np.zeros((2, 2)))
    np.testing.assert_array_equal(Polynomial.constant(np.eye(2)).partial("a")({}), np.zeros((2, 2)))


@given(polynomials(), points, st.integers(0, 2))
def test_the_bernstein_hull_contains_every_value(p: Polynomial, at: dict[str, float], extra: int) -> None:
    coefficients = np.array(list(p.bernstein(BOX, extra).values()))
    value = p(at)
    assert (value <= coefficients.max(axis=0) + ROUNDOFF).all()
    assert (value >= coefficients.min(axis=0) - ROUNDOFF).all()


@given(polynomials(), points)
def test_bernstein_coefficients_weigh_to_the_value(p: Polynomial, at: dict[str, float]) -> None:
    degree = {"a": 3, "b": 2}
    share = {n: (at[n] - BOX[n][0]) / (BOX[n][1] - BOX[n][0]) for n in NAMES}
    total = np.zeros(p.shape)
    for index, coefficient in p.bernstein(BOX, degree).items():
        weight = math.prod(
            math.comb(degree[n], i) * share[n] ** i * (1 - share[n]) ** (degree[n] - i)
            for n, i in zip(NAMES, index, strict=True)
        )
        total = total + weight * coefficient
    np.testing.assert_allclose(total, p(at), atol=ROUNDOFF)


@given(polynomials(degree=1))
def test_multi_affine_coefficients_are_the_vertex_values(p: Polynomial) -> None:
    assert p.is_multi_affine
    for index, coefficient in p.bernstein(BOX, {"a": 1, "b": 1}).items():
        vertex = {n: BOX[n][i] for n, i in zip(NAMES, index, strict=True)}
        np.testing.assert_allclose(coefficient, p(vertex), atol=ROUNDOFF)


@given(polynomials(1, 1, degree=3))
def test_degree_elevation_tightens_monotonically(p: Polynomial) -> None:
    upper = [max(c[0, 0] for c in p.bernstein(BOX, extra).values()) for extra in range(5)]
    lower = [min(c[0, 0] for c in p.bernstein(BOX, extra).values()) for extra in range(5)]
    assert all(after <= before + ROUNDOFF for before, after in pairwise(upper))
    assert all(after >= before - ROUNDOFF for before, after in pairwise(lower))


def test_elevation_converges_to_the_range() -> None:
    # x^2 on [-1, 1] has the range [0, 1]; its lowest coefficient of degree n is -1/(n - 1) for even n.
    square = Polynomial(("x",), {(2,): np.array([[1.0]])})
    for degree in (2, 4, 8, 16):
        lowest = min(c[0, 0] for c in square.bernstein({"x": (-1.0, 1.0)}, {"x": degree}).values())
        assert lowest == pytest.approx(-1 / (degree - 1), abs=1e-12)


def test_a_bulge_in_the_middle_is_not_called_negative() -> None:
    # F = 1 - 2 lam^2 is -1 at both ends of [-1, 1] and +1 in the middle: the vertices alone would accept it.
    bulge = Polynomial(("lam",), {(0,): np.array([[1.0]]), (2,): np.array([[-2.0]])})
    assert bulge({"lam": 1.0})[0, 0] < 0
    assert bulge({"lam": -1.0})[0, 0] < 0
    for extra in range(6):
        assert max(c[0, 0] for c in bulge.bernstein({"lam": (-1.0, 1.0)}, extra).values()) > 0


@given(st.lists(st.fractions(-3, 3, max_denominator=50), min_size=3, max_size=3))
def test_exact_coefficients_stay_exact(c: list[Fraction]) -> None:
    p = Polynomial(("x",), {(k,): np.array([[as_fmpq(value)]], dtype=object) for k, value in enumerate(c)})
    low, high = Fraction(1, 10), Fraction(7, 3)
    found = p.bernstein({"x": (low, high)})
    # Polar form of the quadratic: values at the ends, and c0 + c1 (l + h) / 2 + c2 l h between.
    between = c[0] + c[1] * (low + high) / 2 + c[2] * low * high
    assert all(isinstance(b[0, 0], fmpq) for b in found.values())
    assert fraction(found[0,][0, 0]) == c[0] + c[1] * low + c[2] * low**2
    assert fraction(found[1,][0, 0]) == between
    assert fraction(found[2,][0, 0]) == c[0] + c[1] * high + c[2] * high**2


def test_a_float_interval_end_means_that_binary_number() -> None:
    p = Polynomial(("x",), {(1,): np.array([[fmpq(1)]], dtype=object)})
    assert fraction(p.bernstein({"x": (0.1, 1.0)})[0,][0, 0]) == Fraction(*(0.1).as_integer_ratio())
    assert fraction(p.bernstein({"x": (0.1, 1.0)})[0,][0, 0]) != Fraction(1, 10)


def test_cvxpy_coefficients_follow_the_same_arithmetic() -> None:
    P = cp.Variable((2, 2), symmetric=True)
    A = Polynomial.affine([[0.0, 1.0], [-2.0, -1.0]], a=[[0.0, 0.0], [1.0, 0.0]])
    posed = Polynomial.constant(P) @ A + A.T @ P + Polynomial.affine(P, a=P) * 0.5
    P.value = np.array([[2.0, 0.3], [0.3, 1.0]])
    for corner, coefficient in zip((-1.0, 3.0), posed.bernstein({"a": (-1.0, 3.0)}).values(), strict=True):
        at = A({"a": corner})
        expected = P.value @ at + at.T @ P.value + 0.5 * (1 + corner) * P.value
        np.testing.assert_allclose(coefficient.value, expected, atol=1e-12)
        assert coefficient.is_affine()


def test_jax_coefficients_run_under_jit_grad_and_vmap() -> None:
    def value(slope: jax.Array, a: jax.Array) -> jax.Array:
        return Polynomial.affine(jnp.eye(2), a=slope)({"a": a})[0, 0]

    slope = jnp.array([[2.0, 0.0], [0.0, 0.0]])
    assert jax.jit(value)(slope, 3.0) == 7.0
    assert jax.grad(value, argnums=1)(slope, 3.0) == 2.0
    np.testing.assert_array_equal(jax.vmap(value, in_axes=(None, 0))(slope, jnp.arange(3.0)), [1.0, 3.0, 5.0])


def test_tree_round_trip_keeps_names_terms_and_shape() -> None:
    p = Polynomial(NAMES, {(0, 0): np.eye(2), (2, 1): np.ones((2, 2))})
    leaves, form = jax.tree_util.tree_flatten(p)
    again = jax.tree_util.tree_unflatten(form, leaves)
    assert (again.names, tuple(again.terms), again.shape) == (p.names, tuple(p.terms), p.shape)
    assert hash(form) == hash(jax.tree_util.tree_structure(p * 2.0))
    doubled = jax.tree.map(lambda c: 2 * c, p)
    np.testing.assert_array_equal(doubled({"a": 1.0, "b": 2.0}), 2 * p({"a": 1.0, "b": 2.0}))


def test_a_batch_of_polynomials_is_mapped() -> None:
    p = Polynomial.affine(np.eye(2), a=np.ones((2, 2)))
    batch = jax.tree.map(lambda c: jnp.stack([c, 3.0 * c]), p)
    found = jax.vmap(lambda one: one({"a": 2.0}))(batch)
    np.testing.assert_array_equal(found, np.stack([p({"a": 2.0}), 3 * p({"a": 2.0})]))


@settings(max_examples=20)
@given(polynomials(1, 1))
def test_degree_is_read_off_the_exponents(p: Polynomial) -> None:
    assert p.degree == {n: max(e[k] for e in p.terms) for k, n in enumerate(NAMES)}
    assert p.is_multi_affine == all(d <= 1 for d in p.degree.values())


def test_lifting_keeps_a_polynomial_and_reads_lists() -> None:
    p = Polynomial.affine([[1.0]], a=[[2.0]])
    assert Polynomial.constant(p) is p
    assert Polynomial.constant([[1.0, 2.0]]).shape == (1, 2)


def test_rational_conversions() -> None:
    assert fraction(fmpq(2, 6)) == Fraction(1, 3)
    assert fraction(np.float64(0.5)) == Fraction(1, 2)
    assert as_fmpq(Fraction(-3, 7)) == fmpq(-3, 7)


@pytest.mark.parametrize(
    ("names", "terms", "message"),
    [
        ((), {}, "at least one term"),
        (("a",), {(0,): np.eye(2), (1,): np.eye(3)}, "all need one shape"),
        (("a",), {(0,): np.ones(2)}, "all need one shape"),
        (("a",), {(0, 1): np.eye(2)}, "needs 1 entries"),
        (("a",), {(-1,): np.eye(2)}, "entries >= 0"),
        (("a", "a"), {(0, 1): np.eye(2)}, "repeat a name"),
    ],
)
def test_malformed_polynomials_are_refused(names: tuple[str, ...], terms: dict[Any, Any], message: str) -> None:
    with pytest.raises(BadInput, match=message):
        Polynomial(names, terms)


def test_malformed_requests_are_refused() -> None:
    p = Polynomial(NAMES, {(2, 0): np.eye(2), (0, 1): np.eye(2)})
    with pytest.raises(BadInput, match=r"No value is given for \['b'\]"):
        p({"a": 1.0})
    with pytest.raises(BadInput, match=r"no interval for \['b'\]"):
        p.bernstein({"a": (0.0, 1.0)})
    with pytest.raises(BadInput, match=r"below the polynomial degree .* for \['a'\]"):
        p.bernstein(BOX, {"a": 1})
    with pytest.raises(BadInput, match=r"depends on \['a'\]"):
        p.over(("b", "c"))
    with pytest.raises(BadInput, match="use `@`"):
        p * p
    with pytest.raises(BadInput, match="use `@`"):
        p * np.ones((2, 2))


@pytest.mark.parametrize("end", [math.nan, math.inf])
def test_an_interval_without_a_finite_end_is_refused(end: float) -> None:
    p = Polynomial.affine([[1.0]], a=[[1.0]])
    with pytest.raises(BadInput, match="need to be finite"):
        p.bernstein({"a": (0.0, end)})


def test_a_parameter_of_degree_zero_needs_no_interval() -> None:
    p = Polynomial(NAMES, {(1, 0): np.eye(1)})
    assert set(p.bernstein({"a": (0.0, 2.0)})) == {(0, 0), (1, 0)}


def test_every_index_of_the_wanted_degree_appears() -> None:
    p = Polynomial(NAMES, {(1, 2): np.eye(1)})
    assert set(p.bernstein(BOX, 1)) == set(product(range(3), range(4)))


def test_compose_is_evaluation_of_evaluations() -> None:
    generator = np.random.default_rng(5)
    outer = Polynomial(("a", "b"), {e: generator.normal(size=(2, 2)) for e in [(0, 0), (2, 1), (1, 0), (0, 3)]})
    inner = Polynomial(("p", "b"), {(1, 0): np.array([[2.0]]), (1, 1): np.array([[-0.5]])})
    composed = outer.compose({"a": inner})
    assert set(composed.names) == {"b", "p"}
    point = {"p": 0.7, "b": -1.3}
    np.testing.assert_allclose(
        composed(point), outer({"a": inner(point)[0, 0], "b": point["b"]}), rtol=1e-13, atol=1e-13
    )


def test_compose_may_keep_a_name() -> None:
    # a -> a f: the name survives inside its own replacement.
    scaled = Polynomial(("a", "f"), {(1, 1): np.ones((1, 1))})
    composed = Polynomial(("a",), {(2,): np.eye(1), (0,): np.eye(1)}).compose({"a": scaled})
    assert float(composed({"a": 3.0, "f": 0.5})[0, 0]) == 1.0 + 1.5**2
