"""JAX's arithmetic primitives written into an expression graph, one function each."""

# pyright: reportUnknownLambdaType=false, reportUnknownArgumentType=false
from collections.abc import Callable, Mapping
from functools import reduce
from itertools import pairwise
from typing import Any

import numpy as np

from luenberger.algebra.arithmetic import FLOAT
from luenberger.algebra.graph import Element, Graph
from luenberger.algebra.movement import additions
from luenberger.core import BadInput

Writer = Callable[[Graph, Any, list[np.ndarray]], np.ndarray]

ALIASES = {"add_any": "add", "lt_to": "lt", "le_to": "le"}
# These mean the same on whole numbers and truth values as on reals; division and the like do not.
WHOLE = frozenset(("add", "sub", "mul", "neg", "max", "min", "abs", "eq", "ne", "lt", "le", "gt", "ge"))
_LOGIC = ("and", "or", "xor", "not")
_REDUCTIONS: Mapping[str, tuple[str, Any]] = {
    "reduce_sum": ("add", 0.0),
    "reduce_prod": ("mul", 1.0),
    "reduce_max": ("max", -np.inf),
    "reduce_min": ("min", np.inf),
    "reduce_and": ("and", True),
    "reduce_or": ("or", False),
}
_CUMULATIVE = {"cumsum": "add", "cumprod": "mul", "cummax": "max", "cummin": "min"}


def written(graph: Graph, equation: Any, operands: list[np.ndarray]) -> np.ndarray:
    """Return the output of an arithmetic equation as an object array of elements.

    Args:
        graph: where operations are added.
        equation: of a jaxpr, with one output.
        operands: numeric arrays where known, else object arrays of elements.

    Raises:
        BadInput: the primitive has no meaning for scalars.
    """
    if equation.primitive.name in ("scatter-add", "scatter_add"):
        return _scatter_add(graph, equation, operands)
    elements = [x.astype(object) for x in operands]
    return _WRITERS.get(equation.primitive.name, _elementwise)(graph, equation, elements)


def each(graph: Graph, name: str, *operands: Any, static: tuple[Any, ...] = ()) -> np.ndarray:
    """Apply an operation element by element, with broadcasting.

    Args:
        graph: where operations are added.
        name: of the operation.
        operands: object arrays of elements, or single known numbers.
        static: further arguments of the operation.
    """
    function = np.frompyfunc(lambda *elements: graph.apply(name, *elements, static=static), len(operands), 1)
    return np.asarray(function(*operands), dtype=object)


def _elementwise(graph: Graph, equation: Any, operands: list[np.ndarray]) -> np.ndarray:
    given: str = equation.primitive.name
    name = ALIASES.get(given, given)
    kind = equation.invars[0].aval.dtype.kind
    if kind == "b" and name in ("eq", "ne"):
        differ = each(graph, "xor", *operands)
        return differ if name == "ne" else each(graph, "not", differ)
    allowed = name in _LOGIC if kind == "b" else name in WHOLE or (kind == "f" and name not in _LOGIC)
    if name not in FLOAT.functions or not allowed:
        raise BadInput(
            f"The function uses the JAX primitive `{given}` on {equation.invars[0].aval}, which has no "
            "meaning for other scalars; write that step with arithmetic and elementary functions (small linear systems "
            "by an elimination in Python loops), or bound it by hand."
        )
    return each(graph, name, *operands)


def _integer_power(graph: Graph, equation: Any, operands: list[np.ndarray]) -> np.ndarray:
    exponent = equation.params["y"]
    return np.asarray(np.frompyfunc(lambda x: _whole_power(graph, x, exponent), 1, 1)(operands[0]), dtype=object)


def _power(graph: Graph, equation: Any, operands: list[np.ndarray]) -> np.ndarray:
    def one(x: Element, y: Element) -> Element:
        whole = isinstance(y, int | float) and float(y).is_integer()
        return _whole_power(graph, x, int(y)) if whole else graph.apply("pow", x, y)

    return np.asarray(np.frompyfunc(one, 2, 1)(*operands), dtype=object)


def _whole_power(graph: Graph, x: Element, exponent: int) -> Element:
    match exponent:
        case 0:
            return 1.0
        case 1:
            return x
        case 2:
            return graph.apply("square", x)
        case _:
            return graph.apply("integer_pow", x, static=(exponent,))


def chosen(graph: Graph, which: np.ndarray, cases: list[np.ndarray], kinds: tuple[str, str]) -> np.ndarray:
    """Return the case that a truth value (False: the first of two) or a whole number picks, element by element.

    Args:
        graph: where operations are added.
        which: elements that decide.
        cases: object arrays of elements.
        kinds: NumPy's letters for the types of `which` and of the cases.
    """
    found = cases[-1]
    for k in range(len(cases) - 2, -1, -1):
        is_later = which if kinds[0] == "b" else each(graph, "gt", which, k)
        if kinds[1] == "b":
            here = each(graph, "and", each(graph, "not", is_later), cases[k])
            found = each(graph, "or", each(graph, "and", is_later, found), here)
        else:
            found = each(graph, "select", is_later, found, cases[k])
    return found


def _select(graph: Graph, equation: Any, operands: list[np.ndarray]) -> np.ndarray:
    kinds = (equation.invars[0].aval.dtype.kind, equation.outvars[0].aval.dtype.kind)
    return chosen(graph, operands[0], operands[1:], kinds)


def _clamp(graph: Graph, equation: Any, operands: list[np.ndarray]) -> np.ndarray:
    lower, x, upper = operands
    return each(graph, "min", each(graph, "max", x, lower), upper)


def _convert(graph: Graph, equation: Any, operands: list[np.ndarray]) -> np.ndarray:
    source, target = equation.invars[0].aval.dtype.kind, np.dtype(equation.params["new_dtype"]).kind
    if source == "b" and target in "fiu":
        return each(graph, "select", operands[0], *((1.0, 0.0) if target == "f" else (1, 0)))
    if target == "b":
        return each(graph, "ne", operands[0], 0.0)
    if target == "c" or (source == "f" and target != "f"):
        raise BadInput(
            f"The function converts values that depend on its arguments to {equation.params['new_dtype']}; only real "
            "numbers can be read. Use `jnp.floor`, or an index that is known beforehand."
        )
    return operands[0]


def _reduction(graph: Graph, equation: Any, operands: list[np.ndarray]) -> np.ndarray:
    name, start = _REDUCTIONS[equation.primitive.name]
    axes = tuple(int(a) for a in equation.params["axes"])
    front = np.moveaxis(operands[0], axes, tuple(range(len(axes))))
    shape = front.shape[len(axes) :]
    layers = front.reshape((int(np.prod(front.shape[: len(axes)], dtype=int)), *shape))
    if not len(layers):
        return np.full(shape, start, dtype=object)
    return np.asarray(reduce(lambda a, b: each(graph, name, a, b), layers), dtype=object)


def _cumulative(graph: Graph, equation: Any, operands: list[np.ndarray]) -> np.ndarray:
    name, axis = _CUMULATIVE[equation.primitive.name], equation.params["axis"]
    out = np.moveaxis(operands[0].copy(), axis, 0)
    order = range(len(out))[:: -1 if equation.params["reverse"] else 1]
    for before, k in pairwise(order):
        out[k] = each(graph, name, out[before], out[k])[()]
    return np.moveaxis(out, 0, axis)


def _product(graph: Graph, equation: Any, operands: list[np.ndarray]) -> np.ndarray:
    """dot_general: both sides are brought to (batch, free, summed)."""
    (left_sum, right_sum), (left_batch, right_batch) = equation.params["dimension_numbers"]

    def size(shape: tuple[int, ...]) -> int:
        return int(np.prod(shape, dtype=int))

    def arranged(x: np.ndarray, summed: Any, batch: Any) -> tuple[np.ndarray, tuple[int, ...], tuple[int, ...]]:
        free = [k for k in range(x.ndim) if k not in summed and k not in batch]
        outer, kept, inner = (tuple(x.shape[k] for k in axes) for axes in (batch, free, summed))
        return x.transpose((*batch, *free, *summed)).reshape((size(outer), size(kept), size(inner))), outer, kept

    left, outer, rows = arranged(operands[0], tuple(left_sum), tuple(left_batch))
    right, _, columns = arranged(operands[1], tuple(right_sum), tuple(right_batch))
    total = np.full((*left.shape[:2], right.shape[1]), 0.0, dtype=object)
    for k in range(left.shape[2]):
        total = each(graph, "add", total, each(graph, "mul", left[:, :, None, k], right[:, None, :, k]))
    return total.reshape(outer + rows + columns)


def _scatter_add(graph: Graph, equation: Any, operands: list[np.ndarray]) -> np.ndarray:
    out = operands[0].astype(object).ravel()
    for update, landed in zip(operands[2].flat, additions(equation, operands), strict=True):
        for k in np.flatnonzero(landed):
            out[k] = graph.apply("add", out[k], update)
    return out.reshape(operands[0].shape)


_WRITERS: Mapping[str, Writer] = {
    "integer_pow": _integer_power,
    "pow": _power,
    "select_n": _select,
    "clamp": _clamp,
    "convert_element_type": _convert,
    "dot_general": _product,
    **dict.fromkeys(_REDUCTIONS, _reduction),
    **dict.fromkeys(_CUMULATIVE, _cumulative),
}
