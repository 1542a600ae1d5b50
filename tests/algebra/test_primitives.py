"""Every arithmetic primitive gives JAX's doubles when read in floats, and balls around them."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax

from luenberger.algebra.jaxpr import FLOAT, trace
from luenberger.core import BadInput

X = np.array([0.3, -0.7, 1.2, -2.4])
M = np.array([[0.5, -1.0, 2.0], [0.25, 3.0, -0.75]])

ELEMENTARY: dict[str, Callable] = {
    "arithmetic": lambda x: (x + 2 * x[::-1]) * (x - 1) / (3 + x) - -x,
    "sin cos tan": lambda x: jnp.sin(x) + jnp.cos(x) * jnp.tan(x / 2),
    "inverse": lambda x: jnp.arcsin(x / 9) + jnp.arccos(x / 9) + jnp.arctan(x),
    "atan2": lambda x: jnp.arctan2(x, 2 + x[::-1]),
    "hyperbolic": lambda x: jnp.sinh(x) + jnp.cosh(x) + jnp.tanh(x),
    "inverse hyperbolic": lambda x: jnp.arcsinh(x) + jnp.arccosh(x * x + 2) + jnp.arctanh(x / 9),
    "exponential": lambda x: jnp.exp(x) + jnp.expm1(x) + jnp.exp2(x),
    "logarithm": lambda x: jnp.log(x * x + 1) + jnp.log1p(x * x),
    "roots": lambda x: jnp.sqrt(x * x + 1) + lax.rsqrt(x * x + 1),
    "logistic": lambda x: jax.nn.sigmoid(x) + lax.erf(x),
    "powers": lambda x: x**3 + x**2 + x**-2 + x**0 + x**1 + jnp.abs(x) ** 2.5 + jnp.abs(x) ** (0 * x + 3),
    "variable power": lambda x: jnp.abs(x) ** x,
    "extremes": lambda x: jnp.maximum(x, 0.1) + jnp.minimum(x, x[::-1]) + jnp.abs(x) + jnp.sign(x),
    "clamp": lambda x: jnp.clip(x, -0.5, 0.6) + lax.clamp(-0.1, x, 1.1),
    "steps": lambda x: jnp.floor(x) + jnp.ceil(x) + lax.rem(x, 0.5),
    "angle wrap": lambda x: jnp.mod(3 * x + jnp.pi, 2 * jnp.pi) - jnp.pi,
    "hypot": lambda x: jnp.hypot(x, 1.0),
    "where": lambda x: jnp.where(x > 0, jnp.sqrt(jnp.where(x > 0, x, 1.0)), x**2),
    "predicates": lambda x: jnp.where((x > 0) & (x <= 1) | ~(x > -2) ^ (x == 3) | (x != x), x, 0.0),
    "not finite": lambda x: jnp.where(jnp.isnan(x) | jnp.isinf(x) | ~jnp.isfinite(x), 0.0, x),
    "many cases": lambda x: lax.select_n((x > 0) * 1 + (x > 1), x, 2 * x, 3 * x),
    "counting": lambda x: (x > 0).astype(float) * 2 + jnp.sum(x > 0) + (x > 0).any() + (x > 3).all(),
    "equal predicates": lambda x: jnp.where((x > 0) == (x > 1), 1.0, 2.0) + jnp.where((x > 0) != (x > 1), x, 0.0),
    "chosen predicates": lambda x: jnp.where(jnp.where(x > 0, x > 1, x < -1), x, 0.0),
    "truth": lambda x: x.astype(bool) * x,
    "single precision": lambda x: lax.convert_element_type(x * 0 + 0.5, jnp.float32).astype(float) + x,
}

REDUCING: dict[str, Callable] = {
    "sums": lambda m: m.sum() + m.sum(0) + m.mean(1)[:, None],
    "products": lambda m: m.prod() + m.prod(0),
    "extremes": lambda m: m.max(0) + m.min() + m.max(),
    "deviation": lambda m: jnp.std(m, axis=1) + jnp.linalg.norm(m),
    "running": lambda m: jnp.cumsum(m, 1) + jnp.cumprod(m, 0) + lax.cummax(m, 1) + lax.cummin(m, 0),
    "running back": lambda m: lax.cumsum(m, 0, reverse=True),
    "empty": lambda m: m[:, :0].sum(1) + m.sum(),
    "matrix products": lambda m: m @ m.T @ (m @ jnp.ones(3)),
    "einsum": lambda m: jnp.einsum("ij,kj->ik", m, m) + jnp.einsum("ij,ij->", m, m) + jnp.einsum("ij,ij->i", m, m),
    "batched": lambda m: jnp.matmul(jnp.stack([m, 2 * m]), jnp.stack([m.T, m.T])),
    "outer": lambda m: jnp.outer(m[0], m[1]) + jnp.kron(m[0], m[1]).sum() + jnp.trace(m[:, :2]),
    "cross": lambda m: jnp.cross(m[0], m[1]) + jnp.tril(jnp.outer(m[0], m[0])),
    "added": lambda m: m.at[0, jnp.array([0, 0, 2])].add(m[1]),
}


@pytest.mark.parametrize("name", ELEMENTARY)
def test_elementary(name: str, agree: Callable) -> None:
    agree(ELEMENTARY[name], X)


@pytest.mark.parametrize("name", REDUCING)
def test_reducing(name: str, agree: Callable) -> None:
    agree(REDUCING[name], M)


def test_cube_roots_are_read_in_floats(agree: Callable) -> None:
    agree(jnp.cbrt, X, balls=False)


def test_a_variable_times_itself_is_a_square() -> None:
    for function in (lambda x: x * x, lambda x: x**2, lambda x: jnp.square(x), lambda x: jnp.dot(x, x)):
        names = [o.name for o in trace(function, X[:1]).operations]
        assert names == ["input", "square"]


@pytest.mark.parametrize(
    ("function", "message"),
    [
        (lambda x: jnp.sort(x), "JAX primitive `sort`"),
        (lambda x: jnp.linalg.inv(jnp.outer(x, x) + jnp.eye(4)), "elimination in Python loops"),
        (lambda x: x[x.astype(int)], "converts values that depend on its arguments to int64"),
        (lambda x: jnp.arange(4.0)[jnp.sum(x > 0)], "index that depends on its arguments"),
        (lambda x: jnp.sum(x > 0) // 2, "has no meaning|on whole numbers|`div`|`sign`|`rem`"),
        (lambda x: x + 1j * x, "complex128|converts"),
    ],
)
def test_what_has_no_meaning_for_scalars_is_named(function: Callable, message: str) -> None:
    with pytest.raises(BadInput, match=message):
        trace(function, X)


def test_counting_is_exact_beyond_the_first_sum() -> None:
    found = trace(lambda x: jnp.sum((x > 0).astype(int)) + 3, X)(X, arithmetic=FLOAT)
    assert found[()] == 5
