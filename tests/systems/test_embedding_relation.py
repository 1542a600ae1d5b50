"""Relations between scalars are exact, and found through products, squares and branches."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from flint import fmpq

from luenberger.algebra.jaxpr import trace
from luenberger.systems.embedding_relation import independent, polynomial_forms


def relations(function: Any, n: int) -> tuple[list[int], dict[int, list[fmpq]]]:
    read = trace(function, np.zeros(n))
    forms = polynomial_forms(read.operations)
    return independent([forms[k] for k in read.outputs[0]])


@pytest.mark.parametrize(
    ("function", "weights"),
    [
        (lambda x: [jnp.sin(x[0]), 2.0 * jnp.sin(x[0]) - 3.0], [fmpq(2), fmpq(-3)]),
        (lambda x: [(x[0] + x[1]) ** 2, x[0] ** 2 + 2 * x[0] * x[1] + x[1] ** 2], [fmpq(1), fmpq(0)]),
        (lambda x: [jnp.where(x[0] > 0, x[1], -x[1]), jnp.where(x[0] > 0, 4 * x[1], -4 * x[1])], [fmpq(4), fmpq(0)]),
        (
            lambda x: [x[0] * 0.1, x[0] * 0.3],
            [fmpq(*(0.3).as_integer_ratio()) / fmpq(*(0.1).as_integer_ratio()), fmpq(0)],
        ),
    ],
)
def test_a_follower_is_found_with_its_weights(function: Any, weights: list[fmpq]) -> None:
    chosen, followers = relations(lambda x: jnp.stack(function(x)), 2)
    assert chosen == [0]
    assert followers == {1: weights}


def test_what_cancels_is_a_constant() -> None:
    chosen, followers = relations(lambda x: jnp.stack([(x[0] + 1) ** 2 - x[0] ** 2 - 2 * x[0], x[0]]), 1)
    assert chosen == [1]
    assert followers[0] == [fmpq(0), fmpq(1)]


def test_nothing_is_invented() -> None:
    chosen, followers = relations(
        lambda x: jnp.stack([jnp.sin(x[0]), jnp.sin(x[1]), jnp.cos(x[0]), x[0] * x[1], jnp.where(x[0] > 0, 1.0, 2.0)]),
        2,
    )
    assert chosen == [0, 1, 2, 3, 4]
    assert followers == {}


def test_a_third_row_may_follow_from_two() -> None:
    chosen, followers = relations(lambda x: jnp.stack([x[0] * x[1], jnp.exp(x[1]), 2 * jnp.exp(x[1]) - x[1] * x[0]]), 2)
    assert chosen == [0, 1]
    assert followers == {2: [fmpq(-1), fmpq(2), fmpq(0)]}


def test_slopes_of_a_clipped_cubic_along_two_states_are_proportional() -> None:
    def force(x: Any) -> jax.Array:
        s = jnp.clip(5.0 * (x[0] + 0.5 * x[1]), -1.0, 1.0)
        return s * (3.0 - 3.0 * jnp.abs(s) + s * s)

    chosen, followers = relations(jax.grad(force), 2)
    assert chosen == [0]
    assert followers[1][0] == fmpq(1, 2)
