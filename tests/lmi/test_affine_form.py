"""The numeric form of an affine expression must equal what cvxpy evaluates."""

import cvxpy as cp
import numpy as np
import pytest

from luenberger.core import BadInput
from luenberger.lmi.affine_form import Memo, stacked

generator = np.random.default_rng(1)
M = generator.normal(size=(3, 3))
P = cp.Variable((3, 3), symmetric=True)
Y = cp.Variable((3, 2))
s = cp.Variable()
v = cp.Variable(4)
EXPRESSIONS = {
    "scalar times matrix": s * M,
    "left product": M @ P,
    "right product": P @ M,
    "rectangular": Y @ generator.normal(size=(2, 3)),
    "transpose": Y.T,
    "sum": P @ M + (P @ M).T + 0.6 * P - s * np.eye(3),
    "index": P[0:2, 1:3],
    "quotient": P / 3,
    "diagonal": cp.diag(v),
    "elementwise": cp.multiply(M, P),
    "kronecker": cp.kron(np.eye(2), Y),
    "blocks": cp.bmat([[P, Y], [Y.T, s * np.eye(2)]]),
    "trace": cp.trace(P) * np.eye(2),
}


@pytest.mark.parametrize("name", EXPRESSIONS)
def test_equals_cvxpy(name: str) -> None:
    expression = EXPRESSIONS[name]
    K = stacked(expression, [P, Y, s, v], {})
    half = generator.normal(size=(3, 3))
    P.value, Y.value, s.value, v.value = half + half.T, generator.normal(size=(3, 2)), 0.7, generator.normal(size=4)
    x = np.concatenate([np.ravel(np.asarray(w.value), order="F") for w in (P, Y, s, v)] + [np.ones(1)])
    # A handful of products of numbers of size one.
    np.testing.assert_allclose(K @ x, np.reshape(expression.value, -1), atol=1e-13)


def test_unlisted_variable_is_named() -> None:
    with pytest.raises(BadInput, match="does not list"):
        stacked(P @ M, [Y], {})


def test_products_of_variables_are_refused() -> None:
    with pytest.raises(BadInput, match="not affine"):
        stacked(cp.square(s), [s], {})


def test_the_trace_of_a_single_number_has_a_form() -> None:
    # cvxpy gives this gradient as a plain number.
    Z = cp.Variable((1, 1), symmetric=True)
    K = stacked(cp.reshape(cp.trace(Z), (1, 1), order="F"), [Z], {})
    np.testing.assert_array_equal(K @ np.array([3.0, 1.0]), [3.0])


def test_identities_of_passing_expressions_are_not_mixed_up() -> None:
    # An expression that nobody keeps gives its place in memory, and so its identity, to the next one.
    x = cp.Variable(name="x")
    memo: Memo = {}
    for k in range(200):
        np.testing.assert_allclose(stacked(k * x + 1.0, [x], memo), [[k, 1.0]])
