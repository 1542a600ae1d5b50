"""An expression graph with shared subexpressions: what a JAX function becomes before it meets an arithmetic.

An element is a `Node`, or a Python number or truth value that is known beforehand. Rewriting is limited to what holds
for all finite reals, so that zeros of a Jacobian vanish and a product of a node with itself is a square.
"""

# pyright: reportUnknownLambdaType=false, reportUnknownArgumentType=false, reportUnknownMemberType=false
import math
import operator
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from luenberger.algebra.arithmetic import Arithmetic
from luenberger.algebra.endpoint import OutsideDomain
from luenberger.core import NotAccepted


class Node:
    """Place of one scalar in a graph."""

    __slots__ = ("index",)

    def __init__(self, index: int):
        self.index = index


Element = Any


class Operation(NamedTuple):
    """One scalar operation.

    Args:
        name: "input", "constant", "select", or a name of `Arithmetic.functions`.
        operands: indices of earlier operations.
        static: further arguments, e.g. the exponent of integer_pow or the value of a constant.
    """

    name: str
    operands: tuple[int, ...] = ()
    static: tuple[Any, ...] = ()


class Graph:
    """Operations in an order in which they can be carried out; equal ones are stored once."""

    def __init__(self) -> None:
        self.operations: list[Operation] = []
        self._nodes: list[Node] = []
        self._known: dict[Operation, Node] = {}

    def input(self) -> Node:
        """Add the next input."""
        return self._node(Operation("input", (), (len(self.operations),)))

    def lift(self, element: Element) -> Node:
        """Return the node of an element; a known number becomes a constant."""
        if isinstance(element, Node):
            return element
        # The sign keeps 0.0 and -0.0 apart, which compare equal.
        return self._node(Operation("constant", (), (float(element), math.copysign(1.0, element))))

    def apply(self, name: str, *elements: Element, static: tuple[Any, ...] = ()) -> Element:
        """Return the element for an operation on elements, simplified where a rule applies."""
        rule = _RULES.get(name)
        if rule is not None:
            found = rule(self, *elements)
            if found is not None:
                return found
        return self._node(Operation(name, tuple(self.lift(e).index for e in elements), static))

    def compare(self, name: str, left: Element, right: Element) -> Element:
        """Return the predicate for eq, ne, lt, le, gt or ge."""
        if not isinstance(left, Node) and not isinstance(right, Node):
            return bool(_COMPARISONS[name][0](left, right))
        if left is right:
            # A number differs from itself only where it is NaN.
            missing = self.apply("is_nan", left)
            return self.apply("not", missing) if name in ("eq", "le", "ge") else missing if name == "ne" else False
        if _infinite(left):
            return self.compare(_COMPARISONS[name][1], right, left)
        if not isinstance(right, Node) and math.isinf(right):
            same, side = (name, "gt") if right > 0 else (_COMPARISONS[name][1], "lt")
            return self._against_infinity(same, left, side)
        if name in ("eq", "ne"):
            for x, extreme in ((left, right), (right, left)):
                found = self._is_extreme(x, extreme)
                if found is not None:
                    return found if name == "eq" else self.apply("not", found)
        return self._node(Operation(name, (self.lift(left).index, self.lift(right).index)))

    def _against_infinity(self, name: str, x: Node, side: str) -> Element:
        """Compare with the infinity on one side of zero (`side`), in words that need no infinite constant."""
        beyond = self.apply("and", self.apply("not", self.apply("is_finite", x)), self.compare(side, x, 0.0))
        missing = self.apply("is_nan", x)
        match name:
            case "eq" | "ge":
                return beyond
            case "ne":
                return self.apply("not", beyond)
            case "lt":
                return self.apply("not", self.apply("or", beyond, missing))
            case _:
                return self.apply("not", missing) if name == "le" else False

    def _is_extreme(self, x: Element, extreme: Element) -> Element | None:
        """Write x == max(x, y) as x >= y: the derivative of max asks this, and balls can decide only the latter."""
        if not isinstance(x, Node) or not isinstance(extreme, Node):
            return None
        operation = self.operations[extreme.index]
        name = {"max": "ge", "min": "le"}.get(operation.name)
        if name is None:
            return None
        first, last = (self._nodes[k] for k in operation.operands)
        if x is last:
            return self.compare(name, x, first)
        inner = self.compare(name, first, last)
        if x is first:
            return inner
        found = self._is_extreme(x, first) if self.operations[first.index].name == operation.name else None
        return None if found is None else self.apply("and", found, inner)

    def _node(self, operation: Operation) -> Node:
        node = self._known.get(operation)
        if node is None:
            node = self._known[operation] = Node(len(self.operations))
            self._nodes.append(node)
            self.operations.append(operation)
        return node


def pruned(operations: Sequence[Operation], wanted: Sequence[int]) -> tuple[list[Operation], list[int]]:
    """Drop operations that nothing wanted depends on; inputs stay.

    Args:
        operations: a graph's operations.
        wanted: indices of results.

    Returns:
        the remaining operations, renumbered, and the new indices of `wanted`.
    """
    needed = [operation.name == "input" for operation in operations]
    for k in wanted:
        needed[k] = True
    for k in range(len(operations) - 1, -1, -1):
        if needed[k]:
            for operand in operations[k].operands:
                needed[operand] = True
    place: dict[int, int] = {}
    kept: list[Operation] = []
    for k, operation in enumerate(operations):
        if needed[k]:
            place[k] = len(kept)
            kept.append(operation._replace(operands=tuple(place[j] for j in operation.operands)))
    return kept, [place[k] for k in wanted]


def run(operations: Sequence[Operation], inputs: Sequence[Any], arithmetic: Arithmetic) -> list[Any]:
    """Carry out operations in an arithmetic and return all results.

    An operation outside its domain gives the error as its result, and so does all that depends on it, except for a
    branch that is not taken.

    Args:
        operations: in order.
        inputs: one scalar for each input operation, in order.
        arithmetic: meaning of constants and operations.

    Raises:
        NotAccepted: the arithmetic lacks an operation.
    """
    # NaN and infinity may arise silently, as they do in JAX.
    with np.errstate(all="ignore"):
        return _carried_out(operations, iter(inputs), arithmetic)


def _carried_out(operations: Sequence[Operation], given: Iterator[Any], arithmetic: Arithmetic) -> list[Any]:
    functions = arithmetic.functions
    values: list[Any] = []
    lost = False
    for name, operands, static in operations:
        scalars = [values[k] for k in operands]
        try:
            if lost:
                _need_defined(scalars[:1] if name == "select" else scalars)
            if name in functions:
                value = functions[name](*scalars, *static)
            elif name == "constant":
                value = arithmetic.constant(static[0])
            elif name == "input":
                value = next(given)
            elif name == "select":
                value = arithmetic.select(*scalars)
            else:
                raise NotAccepted(
                    f"The function uses `{name}`, which {type(arithmetic).__name__} does not have; write it with "
                    f"{', '.join(sorted(functions))}."
                )
        except OutsideDomain as outside:
            value, lost = outside, True
        values.append(value)
    return values


def _need_defined(scalars: Sequence[Any]) -> None:
    for scalar in scalars:
        if isinstance(scalar, OutsideDomain):
            raise scalar


def _infinite(element: Element) -> bool:
    return not isinstance(element, Node) and math.isinf(element)


def _is(element: Element, number: float) -> bool:
    return not isinstance(element, Node) and element == number


def _add(graph: Graph, a: Element, b: Element) -> Element | None:
    return b if _is(a, 0) else a if _is(b, 0) else None


def _sub(graph: Graph, a: Element, b: Element) -> Element | None:
    if _is(b, 0):
        return a
    if isinstance(a, Node) and a is b:
        return 0.0
    return graph.apply("neg", b) if _is(a, 0) else None


def _mul(graph: Graph, a: Element, b: Element) -> Element | None:
    if _is(a, 0) or _is(b, 0):
        return 0.0
    for one, other in ((a, b), (b, a)):
        if _is(one, 1):
            return other
        if _is(one, -1):
            return graph.apply("neg", other)
    return graph.apply("square", a) if a is b else None


def _div(graph: Graph, a: Element, b: Element) -> Element | None:
    return a if _is(b, 1) else 0.0 if _is(a, 0) and isinstance(b, Node) else None


def _extreme(neutral: float) -> Callable[..., Element | None]:
    def rule(graph: Graph, a: Element, b: Element) -> Element | None:
        return a if a is b or _is(b, neutral) else b if _is(a, neutral) else None

    return rule


def _select(graph: Graph, predicate: Element, when_true: Element, when_false: Element) -> Element | None:
    if not isinstance(predicate, Node):
        return when_true if predicate else when_false
    known = not isinstance(when_true, Node) and not isinstance(when_false, Node)
    return when_true if when_true is when_false or (known and when_true == when_false) else None


def _and(graph: Graph, a: Element, b: Element) -> Element | None:
    for one, other in ((a, b), (b, a)):
        if not isinstance(one, Node):
            return other if one else False
    return a if a is b else None


def _or(graph: Graph, a: Element, b: Element) -> Element | None:
    for one, other in ((a, b), (b, a)):
        if not isinstance(one, Node):
            return True if one else other
    return a if a is b else None


def _xor(graph: Graph, a: Element, b: Element) -> Element | None:
    for one, other in ((a, b), (b, a)):
        if not isinstance(one, Node):
            return graph.apply("not", other) if one else other
    return None


_COMPARISONS: dict[str, tuple[Callable[[Any, Any], bool], str]] = {
    "eq": (operator.eq, "eq"),
    "ne": (operator.ne, "ne"),
    "lt": (operator.lt, "gt"),
    "le": (operator.le, "ge"),
    "gt": (operator.gt, "lt"),
    "ge": (operator.ge, "le"),
}

_RULES: dict[str, Callable[..., Element | None]] = {
    "add": _add,
    "sub": _sub,
    "mul": _mul,
    "div": _div,
    "neg": lambda graph, a: None if isinstance(a, Node) else -a,
    "max": _extreme(-math.inf),
    "min": _extreme(math.inf),
    "select": _select,
    "and": _and,
    "or": _or,
    "xor": _xor,
    "not": lambda graph, a: None if isinstance(a, Node) else not a,
    "is_finite": lambda graph, a: None if isinstance(a, Node) else math.isfinite(a),
    "is_nan": lambda graph, a: None if isinstance(a, Node) else math.isnan(a),
    **{name: (lambda graph, a, b, name=name: graph.compare(name, a, b)) for name in _COMPARISONS},
}
