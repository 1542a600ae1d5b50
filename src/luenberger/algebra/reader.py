"""Walks a jaxpr: loops are unrolled, calls entered, what is known computed, the rest written into a graph."""

from collections.abc import Callable, Mapping
from typing import Any

import jax
import numpy as np

from luenberger.algebra.arithmetic import FLOAT
from luenberger.algebra.graph import Graph
from luenberger.algebra.movement import MOVEMENTS, moved
from luenberger.algebra.primitives import ALIASES, WHOLE, chosen, written
from luenberger.core import BadInput

_CALLS = frozenset(("pjit", "jit", "closed_call", "core_call", "remat", "remat2", "checkpoint"))
_HANDMADE = frozenset(("custom_jvp_call", "custom_vjp_call", "custom_vjp_call_jaxpr", "stop_gradient"))
_BODIES = ("jaxpr", "call_jaxpr", "fun_jaxpr")
_SAME = frozenset(
    ("stop_gradient", "reduce_precision", "optimization_barrier", "sharding_constraint", "device_put", "name", "pvary")
)


class Reader:
    """Turns equations into graph operations.

    Args:
        graph: where operations are added.
    """

    def __init__(self, graph: Graph):
        self.graph = graph
        self.handmade: set[str] = set()

    def read(self, jaxpr: Any, constants: Any, arguments: list[Any]) -> list[Any]:
        """Return the outputs of a jaxpr: numeric arrays where known, else object arrays of elements.

        Args:
            jaxpr: open jaxpr.
            constants: values of its constant variables.
            arguments: values of its input variables.

        Raises:
            BadInput: an equation without a meaning for scalars.
        """
        values: dict[Any, Any] = dict(zip(jaxpr.constvars, map(_known, constants), strict=True))
        values.update(zip(jaxpr.invars, arguments, strict=True))

        def value(atom: Any) -> Any:
            return _known(atom.val) if hasattr(atom, "val") else values[atom]

        for equation in jaxpr.eqns:
            found = self._equation(equation, [value(atom) for atom in equation.invars])
            values.update(zip(equation.outvars, found, strict=True))
        return [value(atom) for atom in jaxpr.outvars]

    def _equation(self, equation: Any, operands: list[Any]) -> list[Any]:
        name = equation.primitive.name
        if name in _HANDMADE and any(map(_is_open, operands)):
            self.handmade.add(str(equation.params.get("name", name)))
        if name in _CALLS or (name in _HANDMADE and name not in _SAME):
            return self._body(next(equation.params[key] for key in _BODIES if key in equation.params), operands)
        if name in _CONTROL:
            return _CONTROL[name](self, equation, operands)
        if not any(map(_is_open, operands)):
            return _folded(equation, operands)
        if name in _SAME:
            return operands
        if name in MOVEMENTS and not (name == "select_n" and _is_open(operands[0])):
            found = moved(equation, operands)
        else:
            found = [written(self.graph, equation, operands)]
        return [_settled(x, v.aval.dtype) for x, v in zip(found, equation.outvars, strict=True)]

    def _body(self, body: Any, operands: list[Any]) -> list[Any]:
        return self.read(getattr(body, "jaxpr", body), getattr(body, "consts", ()), operands)

    def scan(self, equation: Any, operands: list[Any]) -> list[Any]:
        """Unroll a loop of known length."""
        p = equation.params
        first, last = p["num_consts"], p["num_consts"] + p["num_carry"]
        constants, carry, slices = operands[:first], operands[first:last], operands[last:]
        layers: dict[int, list[Any]] = {}
        for k in range(p["length"])[:: -1 if p["reverse"] else 1]:
            found = self._body(p["jaxpr"], [*constants, *carry, *(x[k, ...] for x in slices)])
            carry, layers[k] = found[: p["num_carry"]], found[p["num_carry"] :]
        stacked: list[Any] = []
        for place, variable in enumerate(equation.outvars[p["num_carry"] :]):
            out = np.empty(variable.aval.shape, dtype=object)
            for k, layer in layers.items():
                out[k, ...] = layer[place]
            stacked.append(_settled(out, variable.aval.dtype))
        return [*carry, *stacked]

    def while_loop(self, equation: Any, operands: list[Any]) -> list[Any]:
        """Unroll a loop whose condition is known at every pass."""
        p = equation.params
        test, body = p["cond_nconsts"], p["cond_nconsts"] + p["body_nconsts"]
        carry = operands[body:]
        while True:
            again = self._body(p["cond_jaxpr"], [*operands[:test], *carry])[0]
            if _is_open(again):
                raise BadInput(
                    "The function has a `while` loop whose number of passes depends on its arguments; a fixed number is "
                    "needed. Use `lax.fori_loop` or `lax.scan` with a known length."
                )
            if not again:
                return carry
            carry = self._body(p["body_jaxpr"], [*operands[test:body], *carry])

    def cond(self, equation: Any, operands: list[Any]) -> list[Any]:
        """Enter the branch taken where known, else all and choose."""
        which, arguments, branches = operands[0], operands[1:], equation.params["branches"]
        if not _is_open(which):
            return self._body(branches[min(max(int(which), 0), len(branches) - 1)], arguments)
        found = [self._body(branch, arguments) for branch in branches]
        return [
            _settled(
                chosen(self.graph, which, [x.astype(object) for x in cases], ("i", v.aval.dtype.kind)), v.aval.dtype
            )
            for *cases, v in zip(*found, equation.outvars, strict=True)
        ]


_CONTROL: Mapping[str, Callable[[Reader, Any, list[Any]], list[Any]]] = {
    "scan": Reader.scan,
    "while": Reader.while_loop,
    "cond": Reader.cond,
}


def _known(value: Any) -> Any:
    """NumPy form of a value; random keys have none and stay as they are."""
    extended = hasattr(value, "dtype") and jax.numpy.issubdtype(value.dtype, jax.dtypes.extended)
    return value if extended else np.asarray(value)


def _is_open(value: Any) -> bool:
    return value.dtype == object


def _settled(value: np.ndarray, dtype: Any) -> np.ndarray:
    """Turn an object array back into numbers where no element depends on the arguments any more."""
    if _is_open(value) and all(isinstance(e, int | float) for e in value.flat):
        return value.astype(dtype)
    return value


def _folded(equation: Any, operands: list[Any]) -> list[Any]:
    """Compute an equation without arguments; NumPy serves where it means the same, for JAX would compile each shape."""
    given: str = equation.primitive.name
    name, parameters = ALIASES.get(given, given), equation.params
    if all(isinstance(x, np.ndarray) for x in operands):
        if name in MOVEMENTS:
            return [_settled(x, v.aval.dtype) for x, v in zip(moved(equation, operands), equation.outvars, strict=True)]
        if name == "convert_element_type":
            return [operands[0].astype(parameters["new_dtype"])]
        if name == "iota":
            axis, shape = parameters["dimension"], tuple(parameters["shape"])
            return [np.indices(shape)[axis].astype(parameters["dtype"])]
        doubles = all(x.dtype == np.float64 for x in operands) and name in FLOAT.functions and name != "integer_pow"
        if operands and (doubles or name in WHOLE):
            with np.errstate(all="ignore"):
                return [np.asarray(FLOAT.functions[name](*operands)).astype(equation.outvars[0].aval.dtype)]
    found = equation.primitive.bind(*operands, **parameters)
    return [_known(f) for f in (found if equation.primitive.multiple_results else [found])]
