"""Functions as engineers write them, read in floats, in balls, and in an arithmetic that writes source text."""

import math
from collections.abc import Callable, Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from luenberger.algebra.ball import Ball
from luenberger.algebra.endpoint import OutsideDomain
from luenberger.algebra.jaxpr import BALL, FLOAT, evaluate, trace
from luenberger.core import BadInput

A = np.array([[0, 1, 0, 0], [-48.6, -1.25, 48.6, 0], [0, 0, 0, 1], [19.5, 0, -19.5, 0]])
B = np.array([0, 21.6, 0, 0])
X = np.array([0.3, -0.7, 1.2, -2.4])
U = np.array(0.4)


def flexible_joint(x: jax.Array, u: jax.Array) -> jax.Array:
    return A @ x + B * u + jnp.array([0, 0, 0, -3.33]) * jnp.sin(x[2])


def runge_kutta(x: jax.Array, u: jax.Array) -> jax.Array:
    dt = 0.01
    k1 = flexible_joint(x, u)
    k2 = flexible_joint(x + dt / 2 * k1, u)
    k3 = flexible_joint(x + dt / 2 * k2, u)
    k4 = flexible_joint(x + dt * k3, u)
    return x + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def tyre(slip: jax.Array) -> jax.Array:
    b, c, e = 10.0, 1.9, 0.97
    return jnp.sin(c * jnp.arctan(b * slip - e * (b * slip - jnp.arctan(b * slip))))


def single_track(x: jax.Array, u: jax.Array) -> jax.Array:
    vx, vy, r = x[0] + 20, x[1], x[2] / 4
    front, rear = jnp.arctan2(vy + 1.2 * r, vx) - u, jnp.arctan2(vy - 1.6 * r, vx)
    return (
        jnp.stack([-6000 * tyre(front) - 4000 * tyre(rear) - 1500 * vx * r, -7200 * tyre(front) + 6400 * tyre(rear)])
        / 1e4
    )


ENGINEERING: dict[str, Callable] = {
    "flexible joint": flexible_joint,
    "step": runge_kutta,
    "compiled step": jax.jit(runge_kutta),
    "jacobian of the step": lambda x, u: jax.jacfwd(runge_kutta)(x, u),
    "single track": single_track,
    "jacobian of the single track": lambda x, u: jax.jacfwd(single_track)(x, u),
    "sensitivity to the input": lambda x, u: jax.jacfwd(single_track, argnums=1)(x, u),
    "reverse": lambda x, u: jax.jacrev(single_track)(x, u),
    "hessian": lambda x, u: jax.hessian(lambda x: jnp.exp(-x @ x) * jnp.arctan(x[0] * x[1]) / (1 + x[2] ** 2) + u)(x),
    "gradient of a norm": lambda x, u: jax.grad(lambda x: jnp.linalg.norm(x) * x[2])(x) * u,
    "slope of extremes": lambda x, u: jax.jacfwd(lambda x: jnp.max(x) * jnp.maximum(x, u) + jnp.abs(x))(x),
}


@pytest.mark.parametrize("name", ENGINEERING)
def test_plants_and_their_derivatives(name: str, agree: Callable) -> None:
    agree(ENGINEERING[name], X, U)


def test_trees_go_in_and_come_out(agree: Callable) -> None:
    def step(state: dict, u: jax.Array) -> tuple:
        x, (p, count) = state["x"], state["rest"]
        return {"x": x + u, "rest": (p @ p.T, count + 1)}, (x > 0, jnp.ones(2), 3)

    agree(step, {"x": X[:2], "rest": (np.eye(2) + 0.5, np.array(4.0))}, U)


def test_a_trace_is_read_once_and_used_for_many_arguments() -> None:
    calls: list[int] = []

    def function(x: jax.Array) -> jax.Array:
        calls.append(1)
        return jnp.sin(x) * x

    read = trace(function, np.zeros(3))
    read_once = len(calls)
    for seed in range(3):
        x = np.random.default_rng(seed).normal(size=3)
        np.testing.assert_allclose(read(x, arithmetic=FLOAT).astype(float), np.sin(x) * x, rtol=1e-14)
    assert len(calls) == read_once


def test_the_jacobian_of_the_flexible_joint_holds_on_a_box() -> None:
    box = np.array([Ball.hull(-5.0, 5.0)] * 4, dtype=object)
    found = evaluate(lambda x: jax.jacfwd(flexible_joint)(x, 0.0), box, arithmetic=BALL)
    expected = np.array(A)
    for index, ball in np.ndenumerate(found):
        if index == (3, 2):
            # 19.5 and 3.33 as doubles add exactly in 128 bits; cos stays within [-1, 1].
            assert ball.lower_exact == Ball.exact(-19.5).lower_exact - Ball.exact(3.33).lower_exact
            assert ball.upper_exact == Ball.exact(-19.5).lower_exact + Ball.exact(3.33).lower_exact
        else:
            assert ball.is_point
            assert ball.contains(expected[index])


def test_floats_side_by_side() -> None:
    read = trace(flexible_joint, X, U)
    grid = np.random.default_rng(0).normal(size=(4, 7))
    values = read.run([*grid, np.full(7, 0.4)], FLOAT)
    for row, k in enumerate(read.outputs[0]):
        expected = [np.asarray(flexible_joint(jnp.asarray(x), U))[row] for x in grid.T]
        np.testing.assert_allclose(np.broadcast_to(values[k], 7), expected, rtol=1e-13, atol=1e-13)


class Text:
    """Writes one line of source for every operation; a scalar is the name of a variable."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        infix = {"add": "+", "sub": "-", "mul": "*", "div": "/", "gt": ">", "ge": ">="}
        self.functions: Mapping[str, Callable[..., str]] = {
            **{name: lambda a, b, sign=sign: self.line(f"{a} {sign} {b}") for name, sign in infix.items()},
            **{name: lambda a, name=name: self.line(f"{name}({a})") for name in ("sin", "atan", "sqrt", "exp", "cos")},
            "neg": lambda a: self.line(f"-{a}"),
            "square": lambda a: self.line(f"{a} * {a}"),
            "atan2": lambda a, b: self.line(f"atan2({a}, {b})"),
            "integer_pow": lambda a, n: self.line(f"{a} ** {n}"),
        }

    def line(self, expression: str) -> str:
        self.lines.append(f"v{len(self.lines)} = {expression}")
        return f"v{len(self.lines) - 1}"

    def constant(self, value: float) -> str:
        return f"({value!r})"

    def select(self, predicate: Any, when_true: Any, when_false: Any) -> str:
        return self.line(f"{when_true} if {predicate} else {when_false}")


@pytest.mark.parametrize("function", [runge_kutta, single_track, lambda x, u: jnp.where(x > u, x**3, -x)])
def test_source_text_computes_the_same(function: Callable) -> None:
    text = Text()
    names = np.array([f"x{k}" for k in range(4)], dtype=object)
    results = evaluate(function, names, np.array("u", dtype=object), arithmetic=text)
    values: dict[str, Any] = {**vars(math), **{f"x{k}": float(X[k]) for k in range(4)}, "u": float(U)}
    exec("\n".join(text.lines), values)
    # The same operations in the same order; sums inside a matrix product may be taken in another order by JAX.
    found = [eval(name, values) for name in results]
    np.testing.assert_allclose(found, np.asarray(function(jnp.asarray(X), U)), rtol=1e-14, atol=1e-14)
    assert len(set(text.lines)) == len(text.lines)


def test_a_step_stays_short() -> None:
    # Four evaluations of four rows, known zeros left out: far below the 4 * 4 * 8 products and sums of dense code.
    operations = [o for o in trace(runge_kutta, X, U).operations if o.name not in ("input", "constant")]
    assert len(operations) < 150


def test_undefined_results_are_told_and_unused_ones_are_not() -> None:
    ball = np.asarray(Ball.hull(-1, 1), dtype=object)
    with pytest.raises(OutsideDomain, match="sqrt"):
        evaluate(lambda x: jnp.sqrt(x) + 1, ball, arithmetic=BALL)
    found = evaluate(lambda x: jnp.where(x > 5, jnp.sqrt(x - 5), x), ball, arithmetic=BALL)[()]
    assert (found.lower, found.upper) == (-1.0, 1.0)


def test_arguments_of_another_shape_are_refused() -> None:
    read = trace(lambda x: x * 2, np.zeros(3))
    with pytest.raises(BadInput, match=r"leaf shapes \[\(2,\)\], but the function was traced for \[\(3,\)\]"):
        read(np.zeros(2), arithmetic=FLOAT)
    with pytest.raises(BadInput, match="same structure"):
        read(np.zeros(3), np.zeros(3), arithmetic=FLOAT)


@pytest.mark.parametrize(
    "function",
    [
        lambda x: x if x[0] > 0 else -x,
        lambda x: np.sin(np.asarray(x)),
        lambda x: x * float(x[0]),
        lambda x: x[int(x[0])],
    ],
)
def test_python_on_values_is_refused(function: Callable) -> None:
    with pytest.raises(BadInput, match=r"pure JAX: use `jnp.where`"):
        trace(function, X)
