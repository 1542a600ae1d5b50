"""The walk over a jaxpr: loops, calls, branches, and what is computed beforehand."""

from collections.abc import Callable
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax

from luenberger.algebra.ball import Ball
from luenberger.algebra.jaxpr import BALL, FLOAT, trace
from luenberger.core import BadInput

X = np.array([0.3, -0.7, 1.2])


@jax.custom_vjp
def doubled(x: jax.Array) -> jax.Array:
    return 2 * x


doubled.defvjp(lambda x: (2 * x, None), lambda _, g: (3 * g,))


@jax.custom_jvp
def halved(x: jax.Array) -> jax.Array:
    return x / 2


halved.defjvp(lambda primals, tangents: (halved(primals[0]), 7 * tangents[0]))

CASES: dict[str, Callable] = {
    "jit in jit": jax.jit(lambda x: jax.jit(jnp.sin)(x) + 1),
    "checkpoint": jax.checkpoint(lambda x: jnp.sin(jnp.cos(x))),
    "custom": lambda x: doubled(x) + halved(x) + jax.nn.relu(x) + jax.nn.softplus(x),
    "stop gradient": lambda x: lax.stop_gradient(x) * x + jax.nn.logsumexp(x),
    "scan": lambda x: lax.scan(lambda c, t: (0.9 * c + t * jnp.sin(c), (c[0] + t, t)), x, jnp.arange(5.0)),
    "scan over arguments": lambda x: lax.scan(lambda c, t: (c + t, c * t), 0.0, x, reverse=True),
    "scan of rows": lambda x: lax.scan(lambda c, t: (c @ t, t * c[0]), x, jnp.ones((2, 3, 3)) / 3),
    "scan without output": lambda x: lax.scan(lambda c, _: (c * x, None), x, length=3)[0],
    "scan of known output": lambda x: lax.scan(lambda c, t: (c + t, t * 2), x, jnp.arange(3.0)),
    "fori": lambda x: lax.fori_loop(0, 3, lambda i, c: c + x[i] * i, 0.0),
    "while": lambda x: lax.while_loop(lambda c: c[0] < 3, lambda c: (c[0] + 1, c[1] * x), (0, x))[1],
    "cond": lambda x: lax.cond(x[0] > 0, lambda y: y * 2, lambda y: jnp.ones(3), x),
    "cond known": lambda x: lax.cond(jnp.array(3) > 0, lambda y: y * 2, lambda y: -y, x),
    "switch known": lambda x: lax.switch(7, [lambda y: y * 2, lambda y: -y, lambda y: y + 1], x),
    "switch": lambda x: lax.switch(jnp.sum(x > 0), [lambda y: y * 2, lambda y: -y, lambda y: y + 1], x),
    "switch beyond": lambda x: lax.switch(jnp.sum(x > 0) - 5, [lambda y: y > 1, lambda y: y > 0], x),
    "vmapped switch": lambda x: jax.vmap(lambda r: lax.switch((r > 0) + 0, [jnp.sin, jnp.cos], r))(x),
    "vmap": lambda x: jax.vmap(lambda r: jnp.tanh(r).sum() * r)(jnp.outer(x, x)),
    "vmapped cond": lambda x: jax.vmap(lambda r: lax.cond(r > 0, jnp.sin, jnp.cos, r))(x),
    "partial": partial(lambda a, x: a * x, 3.0),
    "known linear algebra": lambda x: jnp.linalg.inv(2 * jnp.eye(3) + 0.1) @ x,
    "known everything": lambda x: (jnp.arange(3) // 2 + jnp.sort(jnp.array([3, 1, 2])), jnp.log(-jnp.ones(2)) * 0 == 1),
    "random": lambda x: x + jax.random.uniform(jax.random.key(3), (3,)),
    "indices from a table": lambda x: lax.fori_loop(0, 3, lambda i, c: c + x[jnp.array([2, 0, 1])[i]] * i, 0.0),
    "known movement": lambda x: x[jnp.pad(jnp.array([1, 2])[jnp.array([1, 0])], 1).at[0].set(2)],
    "indices by arithmetic": lambda x: x[(jnp.arange(3) * 2 + 1) % 3] + jnp.roll(x, 1),
}


@pytest.mark.parametrize("name", CASES)
def test_structures_are_entered(name: str, agree: Callable) -> None:
    agree(CASES[name], X)


def test_a_loop_of_unknown_length_is_named() -> None:
    with pytest.raises(BadInput, match="`while` loop whose number of passes depends on its arguments"):
        trace(lambda x: lax.while_loop(lambda c: c < x[0], lambda c: c + 1, 0.0), X)


def test_both_sides_of_an_undecided_cond_are_held() -> None:
    read = trace(lambda x: lax.cond(x > 0, lambda y: y + 10, lambda y: y - 10, x), 0.0)
    found = read(np.asarray(Ball.hull(-1, 1), dtype=object), arithmetic=BALL)[()]
    assert (found.lower, found.upper) == (-11.0, 11.0)


def test_derivative_rules_by_hand_are_noted() -> None:
    assert trace(CASES["custom"], X).handmade
    assert trace(CASES["stop gradient"], X).handmade == {"stop_gradient"}
    assert not trace(CASES["known linear algebra"], X).handmade
    assert not trace(CASES["scan"], X).handmade


def test_what_does_not_depend_on_arguments_costs_nothing() -> None:
    matrix = jnp.arange(9.0).reshape(3, 3)
    read = trace(lambda x: jnp.sum(jnp.sin(matrix) @ matrix) * x[0], X)
    assert [o.name for o in read.operations if o.name != "input"] == ["constant", "mul"]
    expected = float(jnp.sum(jnp.sin(matrix) @ matrix))
    np.testing.assert_allclose(read(X, arithmetic=FLOAT)[()], expected * X[0], rtol=1e-14)


def test_zeros_of_a_jacobian_vanish() -> None:
    read = trace(jax.jacfwd(lambda x: jnp.stack([x[0] * x[1], jnp.sin(x[2]), x[0]])), X)
    # d/dx: x1, x0, cos(x2), and the constants 0 and 1.
    assert sorted(o.name for o in read.operations) == ["constant", "constant", "cos", "input", "input", "input"]
