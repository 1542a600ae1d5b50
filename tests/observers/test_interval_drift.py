"""Maxima of multi-affine scalars against all vertices, and the weights that keep the order."""

import math
from itertools import combinations, product
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

from luenberger.observers.interval_drift import ORDER, WEIGHTS, largest, plus, times

NAMES = ("p", "q", "r", "s")
ENDS = {"p": (-1.0, 2.0), "q": (0.5, 3.0), "r": (-2.0, -1.0), "s": (jnp.array(0.0), jnp.array(1.0))}


def value(terms: dict[Any, float], point: dict[str, float]) -> float:
    return sum(c * math.prod(point[n] for n in key) for key, c in terms.items())


@pytest.mark.parametrize("seed", range(12))
def test_largest_is_at_a_vertex(seed: int) -> None:
    rng = np.random.default_rng(seed)
    keys = [frozenset(c) for n in range(4) for c in combinations(NAMES, n)]
    chosen = rng.choice(len(keys), rng.integers(1, len(keys)), replace=False)
    terms = {keys[k]: float(rng.normal()) for k in chosen}
    corners = [
        dict(zip(NAMES, (float(x) for x in corner), strict=True)) for corner in product(*(ENDS[n] for n in NAMES))
    ]
    assert float(largest(terms, ENDS)) == pytest.approx(max(value(terms, c) for c in corners), rel=1e-12)
    assert float(-largest(times(terms, -1.0), ENDS)) == pytest.approx(min(value(terms, c) for c in corners), rel=1e-12)


def test_unknowns_that_share_no_monomial_are_maximised_apart() -> None:
    terms = {frozenset({n}): 1.0 for n in NAMES}
    assert float(largest(plus(terms, {frozenset(): 10.0}), ENDS)) == pytest.approx(10 + 2 + 3 - 1 + 1)
    assert largest({}, ENDS) == 0.0


def test_weights_make_the_taylor_polynomial_and_none_is_negative() -> None:
    assert min(WEIGHTS) >= 0
    assert sum(WEIGHTS) == pytest.approx(1.0, rel=1e-14)
    for z in (-0.7, 0.3, 1.0):
        chained = sum(w * (1 + z) ** k for k, w in enumerate(WEIGHTS))
        assert chained == pytest.approx(sum(z**j / math.factorial(j) for j in range(ORDER + 1)), rel=1e-14)
