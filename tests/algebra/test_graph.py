"""The expression graph: shared subexpressions, and rewriting that holds for all finite reals."""

import math
import operator
from collections.abc import Callable
from typing import Any

import pytest

from luenberger.algebra.arithmetic import BALL, FLOAT
from luenberger.algebra.ball import Ball
from luenberger.algebra.endpoint import OutsideDomain
from luenberger.algebra.graph import Graph, Node, Operation, pruned, run
from luenberger.core import NotAccepted


@pytest.fixture
def graph() -> Graph:
    return Graph()


def value(graph: Graph, element: Any, *inputs: float) -> Any:
    """The element's double for given inputs."""
    node = graph.lift(element)
    return run(graph.operations, inputs, FLOAT)[node.index]


def test_equal_operations_are_stored_once(graph: Graph) -> None:
    x, y = graph.input(), graph.input()
    assert graph.apply("add", x, y) is graph.apply("add", x, y)
    assert graph.apply("mul", x, 2.0) is graph.apply("mul", x, 2.0)
    assert graph.apply("add", x, y) is not graph.apply("add", y, x)
    assert len(graph.operations) == 6


def test_the_sign_of_zero_is_kept(graph: Graph) -> None:
    assert graph.lift(0.0) is not graph.lift(-0.0)
    assert math.copysign(1.0, value(graph, -0.0)) == -1.0


RULES: list[tuple[str, Callable[[Graph, Node], tuple], Callable[[Graph, Node], Any]]] = [
    ("add", lambda g, x: (x, 0.0), lambda g, x: x),
    ("add", lambda g, x: (0.0, x), lambda g, x: x),
    ("sub", lambda g, x: (x, 0.0), lambda g, x: x),
    ("sub", lambda g, x: (x, x), lambda g, x: 0.0),
    ("sub", lambda g, x: (0.0, x), lambda g, x: g.apply("neg", x)),
    ("mul", lambda g, x: (x, 1.0), lambda g, x: x),
    ("mul", lambda g, x: (0.0, x), lambda g, x: 0.0),
    ("mul", lambda g, x: (-1.0, x), lambda g, x: g.apply("neg", x)),
    ("mul", lambda g, x: (x, x), lambda g, x: g.apply("square", x)),
    ("div", lambda g, x: (x, 1.0), lambda g, x: x),
    ("div", lambda g, x: (0.0, x), lambda g, x: 0.0),
    ("max", lambda g, x: (x, x), lambda g, x: x),
    ("max", lambda g, x: (x, -math.inf), lambda g, x: x),
    ("min", lambda g, x: (math.inf, x), lambda g, x: x),
    ("neg", lambda g, x: (2.0,), lambda g, x: -2.0),
    ("select", lambda g, x: (True, x, 2.0), lambda g, x: x),
    ("select", lambda g, x: (g.apply("gt", x, 0.0), x, x), lambda g, x: x),
    ("and", lambda g, x: (True, g.apply("gt", x, 0.0)), lambda g, x: g.apply("gt", x, 0.0)),
    ("and", lambda g, x: (g.apply("gt", x, 0.0), False), lambda g, x: False),
    ("or", lambda g, x: (g.apply("gt", x, 0.0), True), lambda g, x: True),
    ("or", lambda g, x: (False, g.apply("gt", x, 0.0)), lambda g, x: g.apply("gt", x, 0.0)),
    ("xor", lambda g, x: (g.apply("gt", x, 0.0), True), lambda g, x: g.apply("not", g.apply("gt", x, 0.0))),
    ("not", lambda g, x: (True,), lambda g, x: False),
]


@pytest.mark.parametrize("rule", RULES, ids=lambda r: r[0])
def test_rules(graph: Graph, rule: tuple) -> None:
    name, operands, expected = rule
    x = graph.input()
    assert graph.apply(name, *operands(graph, x)) == expected(graph, x)


def test_what_is_no_identity_stays(graph: Graph) -> None:
    x = graph.input()
    assert graph.operations[graph.apply("div", 0.0, 0.0).index].name == "div"
    assert graph.operations[graph.apply("div", x, x).index].name == "div"
    assert graph.operations[graph.apply("add", 0.1, 0.2).index].name == "add"


COMPARISONS = {
    "eq": operator.eq,
    "ne": operator.ne,
    "lt": operator.lt,
    "le": operator.le,
    "gt": operator.gt,
    "ge": operator.ge,
}


@pytest.mark.parametrize("name", COMPARISONS)
@pytest.mark.parametrize("x", [-2.0, 0.0, 3.0, math.inf, -math.inf, math.nan])
@pytest.mark.parametrize("bound", [math.inf, -math.inf])
def test_comparison_with_infinity_is_rewritten_without_change(name: str, x: float, bound: float) -> None:
    for order in (1, -1):
        graph = Graph()
        node = graph.input()
        found = graph.apply(name, *((node, bound)[::order]))
        assert bool(value(graph, found, x)) == COMPARISONS[name](*((x, bound)[::order]))
        assert not any(o.name == "constant" and math.isinf(o.static[0]) for o in graph.operations)


@pytest.mark.parametrize("name", COMPARISONS)
@pytest.mark.parametrize("x", [1.0, math.nan])
def test_comparison_with_itself_asks_for_nan(graph: Graph, name: str, x: float) -> None:
    node = graph.input()
    assert bool(value(graph, graph.apply(name, node, node), x)) == COMPARISONS[name](x, x)


@pytest.mark.parametrize("extreme", ["max", "min"])
@pytest.mark.parametrize("place", [0, 1, 2])
@pytest.mark.parametrize(
    "numbers", [(1.0, 2.0, 3.0), (3.0, 2.0, 1.0), (1.0, 3.0, 2.0), (2.0, 2.0, 2.0), (2.0, 2.0, 1.0)]
)
def test_being_the_extreme_becomes_comparisons_of_the_parts(extreme: str, place: int, numbers: tuple) -> None:
    graph = Graph()
    parts = [graph.input() for _ in numbers]
    top = graph.apply(extreme, graph.apply(extreme, *parts[:2]), parts[2])
    found = graph.apply("eq", parts[place], top)
    expected = numbers[place] == (max if extreme == "max" else min)(numbers)
    assert bool(value(graph, found, *numbers)) == expected
    assert bool(value(graph, graph.apply("ne", top, parts[place]), *numbers)) != expected
    # Balls that do not overlap decide, which they could not by comparing with the extreme itself.
    balls = [Ball.hull(3 * x, 3 * x + 1) for x in (1, 2, 3)]
    assert run(graph.operations, balls, BALL)[found.index] is ((place == 2) == (extreme == "max") and place != 1)


def test_an_error_travels_until_a_branch_drops_it(graph: Graph) -> None:
    x = graph.input()
    root = graph.apply("sqrt", x)
    taken = graph.apply("select", graph.apply("ge", x, 0.0), graph.apply("add", root, 1.0), x)
    for interval, is_lost in ((Ball.hull(-2, -1), False), (Ball.hull(1, 4), False), (Ball.hull(-1, 1), True)):
        values = run(graph.operations, [interval], BALL)
        assert isinstance(values[taken.index], OutsideDomain) is is_lost
    assert isinstance(run(graph.operations, [Ball.hull(-2, -1)], BALL)[root.index], OutsideDomain)


def test_an_arithmetic_without_an_operation_is_named(graph: Graph) -> None:
    graph.apply("cbrt", graph.input())
    with pytest.raises(NotAccepted, match="`cbrt`, which BallArithmetic does not have"):
        run(graph.operations, [Ball.exact(1)], BALL)


def test_pruning_keeps_inputs_and_what_is_wanted(graph: Graph) -> None:
    x, y = graph.input(), graph.input()
    graph.apply("sin", y)
    wanted = graph.apply("mul", graph.apply("cos", x), 3.0)
    kept, places = pruned(graph.operations, [wanted.index])
    assert [o.name for o in kept] == ["input", "input", "cos", "constant", "mul"]
    assert kept[places[0]] == Operation("mul", (2, 3))
    assert run(kept, [0.0, 5.0], FLOAT)[places[0]] == 3.0
