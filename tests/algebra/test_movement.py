"""Data movement: the short way by NumPy and the long way by JAX's own primitive must agree."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax

from luenberger.algebra import movement
from luenberger.algebra.movement import MOVEMENTS, additions, moved, replayed
from luenberger.core import BadInput

X = np.arange(12.0).reshape(3, 4) + 0.5

CASES: dict[str, Callable] = {
    "broadcast_in_dim": lambda x: jnp.broadcast_to(x[:, None, :], (3, 2, 4)),
    "reshape": lambda x: x.reshape(2, 6),
    "transpose": lambda x: x.T,
    "slice": lambda x: lax.slice(x, (0, 1), (3, 4), (2, 2)),
    "squeeze": lambda x: lax.squeeze(x[:1], (0,)),
    "expand_dims": lambda x: lax.expand_dims(x, (0, 2)),
    "concatenate": lambda x: jnp.concatenate([x, 2 * x, jnp.ones((3, 1))], axis=1),
    "stack": lambda x: jnp.stack([x, x, jnp.zeros((3, 4))], axis=1),
    "rev": lambda x: x[::-1, ::-1],
    "split": lambda x: jnp.split(x, [1, 3], axis=1),
    "select_n": lambda x: jnp.where(np.arange(4) % 2 == 0, x, -1.0),
    "pad": lambda x: lax.pad(x, 7.0, [(1, 0, 1), (-1, 2, 0)]),
    "gather": lambda x: x[np.array([2, 0, 2]), np.array([1, 1, 3])],
    "dynamic_slice": lambda x: lax.dynamic_slice(x, (1, 9), (2, 2)),
    "dynamic_update_slice": lambda x: lax.dynamic_update_slice(x, x[:1, :2], (2, 1)),
    "scatter": lambda x: x.at[np.array([0, 2])].set(x[1]),
    "gather filled": lambda x: x.at[np.array([0, 7])].get(mode="fill", fill_value=3.0),
    "gather nan": lambda x: x.at[np.array([0, 7])].get(mode="fill"),
    "scatter dropped": lambda x: x.at[np.array([1, 7])].set(x[:2], mode="drop"),
}


def equations(function: Callable) -> list[tuple]:
    """Every data-movement equation met while the function runs on X, with the doubles of its operands and results."""
    found: list[tuple] = []

    def walk(jaxpr: object, constants: list, arguments: list) -> list:
        values = dict(zip(jaxpr.constvars, constants)) | dict(zip(jaxpr.invars, arguments))  # type: ignore[attr-defined] # noqa: B905
        for equation in jaxpr.eqns:  # type: ignore[attr-defined]
            operands = [np.asarray(a.val if hasattr(a, "val") else values[a]) for a in equation.invars]
            name = equation.primitive.name
            if "jaxpr" in equation.params:
                results = walk(equation.params["jaxpr"].jaxpr, equation.params["jaxpr"].consts, operands)
            else:
                results = equation.primitive.bind(*operands, **equation.params)
                results = list(results) if equation.primitive.multiple_results else [results]
            if name in MOVEMENTS:
                found.append((equation, operands, [np.asarray(r) for r in results]))
            values.update(zip(equation.outvars, results, strict=True))
        return [a.val if hasattr(a, "val") else values[a] for a in jaxpr.outvars]  # type: ignore[attr-defined]

    closed = jax.make_jaxpr(function)(X)
    walk(closed.jaxpr, closed.consts, [X])
    return found


@pytest.mark.parametrize("name", CASES)
def test_elements_go_where_jax_puts_the_doubles(name: str) -> None:
    met = equations(CASES[name])
    assert name.split()[0] in {e[0].primitive.name for e in met} or name in ("stack", "expand_dims", "squeeze", "rev")
    for equation, operands, expected in met:
        addresses = range(len(operands))[MOVEMENTS[equation.primitive.name]]
        objects = [x if k in addresses else x.astype(object) for k, x in enumerate(operands)]
        for way in (moved, replayed):
            results = way(equation, objects)
            assert len(results) == len(expected)
            for result, truth in zip(results, expected, strict=True):
                assert result.dtype == object
                np.testing.assert_array_equal(result.astype(float), truth.astype(float), strict=True)


def test_parameters_under_another_name_take_the_long_way(monkeypatch: pytest.MonkeyPatch) -> None:
    def renamed(parameters: dict, x: np.ndarray) -> np.ndarray:
        return x.transpose(parameters["a name this JAX does not have"])

    monkeypatch.setitem(movement._SHORTCUTS, "transpose", renamed)
    equation, (operand,), (expected,) = equations(CASES["transpose"])[0]
    np.testing.assert_array_equal(moved(equation, [operand.astype(object)])[0].astype(float), expected)


def test_an_address_that_depends_on_the_arguments_is_refused() -> None:
    equation = next(e for e, _, _ in equations(CASES["gather"]) if e.primitive.name == "gather")
    unknown = np.full((3, 2), None, dtype=object)
    with pytest.raises(BadInput, match="`gather` with an index that depends on its arguments"):
        moved(equation, [X.astype(object), unknown])


def test_updates_are_added_where_they_land() -> None:
    indices = np.array([0, 0, 2, 9])
    closed = jax.make_jaxpr(lambda t, u: t.at[indices].add(u, mode="drop"))(np.zeros(3), np.zeros(4))
    equation = next(e for e in closed.jaxpr.eqns if e.primitive.name.startswith("scatter"))
    index_array = np.array([[0], [0], [2], [9]], dtype=np.int32)
    found = additions(equation, [np.zeros(3), index_array, np.zeros(4)])
    np.testing.assert_array_equal(found, [[1, 0, 0], [1, 0, 0], [0, 0, 1], [0, 0, 0]])
    with pytest.raises(BadInput, match="index that depends"):
        additions(equation, [np.zeros(3), index_array.astype(object), np.zeros(4)])
