"""Arithmetics: three-valued logic, hulls of branches, and the record of steps."""

from itertools import product

import numpy as np
import pytest

from luenberger.algebra.arithmetic import BALL, FLOAT, Arithmetic, BallArithmetic
from luenberger.algebra.ball import Ball
from luenberger.algebra.endpoint import OutsideDomain

VALUES = {True: {True}, False: {False}, None: {True, False}}


def test_both_arithmetics_fulfil_the_protocol() -> None:
    assert isinstance(FLOAT, Arithmetic)
    assert isinstance(BALL, Arithmetic)
    # Cube roots are the one elementary function without balls.
    assert set(FLOAT.functions) - set(BALL.functions) == {"cbrt"}


@pytest.mark.parametrize("name", ["and", "or", "xor", "not"])
def test_three_valued_logic_is_what_all_members_agree_on(name: str) -> None:
    for operands in product(VALUES, repeat=1 if name == "not" else 2):
        outcomes = {bool(FLOAT.functions[name](*choice)) for choice in product(*(VALUES[o] for o in operands))}
        expected = outcomes.pop() if len(outcomes) == 1 else None
        assert BALL.functions[name](*operands) is expected


def test_an_undecided_branch_gives_the_hull_and_is_noted() -> None:
    arithmetic = BallArithmetic()
    low, high = Ball.hull(0, 1), Ball.hull(3, 4)
    assert arithmetic.select(True, low, high) is low
    assert arithmetic.select(False, low, high) is high
    assert not arithmetic.steps
    hull = arithmetic.select(None, low, high)
    assert (hull.lower, hull.upper) == (0.0, 4.0)
    assert arithmetic.steps == {"a branch"}


def test_a_branch_between_equal_numbers_is_no_step() -> None:
    arithmetic = BallArithmetic()
    assert arithmetic.select(None, Ball.exact(2), Ball.exact(2)).is_point
    assert not arithmetic.steps


def test_an_undefined_side_matters_only_where_it_may_be_taken() -> None:
    low, undefined = Ball.hull(0, 1), OutsideDomain("no root")
    assert BALL.select(True, low, undefined) is low
    with pytest.raises(OutsideDomain, match="no root"):
        BALL.select(None, low, undefined)


@pytest.mark.parametrize(
    ("name", "operands", "steps"),
    [
        ("sign", (Ball.hull(-1, 1),), True),
        ("sign", (Ball.hull(0.5, 1),), False),
        ("floor", (Ball.hull(0.5, 1),), True),
        ("ceil", (Ball.hull(0.5, 1),), False),
        ("rem", (Ball.hull(0, 6), Ball.exact(5)), True),
        ("rem", (Ball.hull(-1, 4), Ball.exact(5)), False),
        ("abs", (Ball.hull(-1, 1),), False),
        ("max", (Ball.hull(-1, 1), Ball.exact(0)), False),
    ],
)
def test_operations_that_jump_are_noted(name: str, operands: tuple[Ball, ...], steps: bool) -> None:
    arithmetic = BallArithmetic()
    arithmetic.functions[name](*operands)
    assert arithmetic.steps == ({name} if steps else set())


def test_floats_may_be_arrays_side_by_side() -> None:
    x = np.array([-1.0, 0.0, 2.0])
    chosen = FLOAT.select(FLOAT.functions["gt"](x, 0.0), x, FLOAT.constant(7.0))
    np.testing.assert_array_equal(chosen, [7.0, 7.0, 2.0])
    assert isinstance(FLOAT.select(True, 1.0, 2.0), float)
