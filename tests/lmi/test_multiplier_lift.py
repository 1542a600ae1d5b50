"""A Gram matrix gives back its polynomial whatever its free unknowns are."""

import numpy as np
import pytest

from luenberger.algebra import Polynomial
from luenberger.core import BadInput
from luenberger.lmi.affine_block import Unknowns, part
from luenberger.lmi.multiplier_lift import gram, gram_freedom, monomials, normalised, pruned


@pytest.mark.parametrize("skew", [False, True])
@pytest.mark.parametrize(("caps", "total"), [((1, 1), 1), ((2,), 2), ((2, 1), 2)])
def test_form_of_the_gram_matrix_is_the_polynomial(caps: tuple[int, ...], total: int, skew: bool) -> None:
    generator = np.random.default_rng(0)
    n, basis = 3, monomials(caps, total)
    width = gram_freedom(basis, n, skew=skew)
    free = Unknowns(1, width)
    products = {tuple(a + b for a, b in zip(x, y, strict=True)) for x in basis for y in basis}
    known = {}
    for exponents in products:
        half = generator.normal(size=(n, n))
        known[exponents] = half + half.T
    M = gram({e: free.known(c.reshape(-1, 1)) for e, c in known.items()}, basis, free, n, skew=skew)
    assert free.count == width
    for _ in range(3):
        w, s = generator.normal(size=width), generator.uniform(-1, 1, len(caps))
        G = (M.K[:, 0] + M.W @ w).reshape(n * len(basis), -1)
        np.testing.assert_allclose(G, G.T, atol=1e-12)
        lift = np.vstack([np.prod(s ** np.array(e)) * np.eye(n) for e in basis])
        value = sum(np.prod(s ** np.array(e)) * c for e, c in known.items())
        np.testing.assert_allclose(lift.T @ G @ lift, value, atol=1e-12)


def test_monomials_that_do_not_reach_are_refused() -> None:
    free = Unknowns(1, 100)
    with pytest.raises(BadInput, match="add monomials"):
        gram({(3,): free.zero(2)}, monomials((1,), 1), free, 2, skew=True)


def test_normalised_has_the_same_values_on_the_unit_box() -> None:
    F = Polynomial(("a", "b"), {(2, 1): np.array([[2.0]]), (1, 0): np.array([[-1.0]]), (0, 2): np.array([[0.5]])})
    unit = normalised(F, {"a": (1.0, 4.0), "b": (-2.0, 0.5)})
    for s in (-1.0, 0.3, 1.0):
        for t in (-1.0, 0.1, 1.0):
            there = {"a": 2.5 + 1.5 * s, "b": -0.75 + 1.25 * t}
            assert unit({"a": s, "b": t})[0, 0] == pytest.approx(F(there)[0, 0], rel=1e-13)


def test_pruned_forgets_what_is_zero() -> None:
    F = Polynomial(("a", "b"), {(0, 0): np.eye(2), (2, 0): np.zeros((2, 2)), (0, 1): np.ones((2, 2))})
    assert pruned(F).degree == {"b": 1}
    assert pruned(Polynomial(("a",), {(1,): np.zeros((2, 2))})).names == ()


def test_parts_are_blocks() -> None:
    free = Unknowns(1, 21)
    V = free.symmetric(6)
    w = np.arange(21.0)
    whole = (V.W @ w).reshape(6, 6)
    np.testing.assert_array_equal(whole, whole.T)
    assert len(np.unique(whole)) == 21
    np.testing.assert_array_equal((part(V, 3, 1, 2).W @ w).reshape(2, 2), whole[2:4, 4:6])
    skew = Unknowns(1, 3).skew(3)
    K = (skew.W @ np.array([1.0, 2.0, 3.0])).reshape(3, 3)
    np.testing.assert_array_equal(K, -K.T)
    np.testing.assert_array_equal((skew.T.W @ np.array([1.0, 2.0, 3.0])).reshape(3, 3), -K)
