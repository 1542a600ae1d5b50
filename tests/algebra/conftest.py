"""What several files of this room check: a function read anew gives JAX's doubles, and balls around them."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from luenberger.algebra.ball import Ball
from luenberger.algebra.jaxpr import BALL, FLOAT, trace

Agree = Callable[..., None]


def _leaves(tree: Any) -> list[np.ndarray]:
    return [np.asarray(leaf) for leaf in jax.tree_util.tree_leaves(tree)]


@pytest.fixture
def agree() -> Agree:
    """Check a function at doubles: read in floats and in balls, against JAX.

    Values of the functions used are below 1e3; both sides round every operation, in another order for sums: 1e-14
    relative is some fifty roundings. Balls hold the real value, from which JAX's double may be as far.
    """

    def check(function: Callable, *arguments: Any, balls: bool = True, tolerance: float = 1e-14) -> None:
        expected = function(*jax.tree_util.tree_map(jnp.asarray, arguments))
        read = trace(function, *arguments)
        found = read(*arguments, arithmetic=FLOAT)
        assert jax.tree_util.tree_structure(found) == jax.tree_util.tree_structure(expected)
        for got, want in zip(_leaves(found), _leaves(expected), strict=True):
            assert got.dtype == object
            np.testing.assert_allclose(
                got.astype(float), want.astype(float), rtol=tolerance, atol=tolerance, strict=True
            )
        if not balls:
            return
        points = jax.tree_util.tree_map(lambda a: np.vectorize(Ball.exact, otypes=[object])(a), arguments)
        for got, want in zip(_leaves(read(*points, arithmetic=BALL)), _leaves(expected), strict=True):
            for ball, double in zip(got.flat, want.flat, strict=True):
                if isinstance(ball, bool):
                    assert ball == double
                else:
                    slack = tolerance * (1 + abs(float(double)))
                    assert ball.lower - slack <= double <= ball.upper + slack
                    assert ball.width <= slack

    return check
