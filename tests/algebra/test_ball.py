"""Laws of balls: every member's image is inside, ends are as tight as stated, doubles are exact."""

import math
from collections.abc import Callable
from fractions import Fraction

import numpy as np
import pytest
from flint import arb, ctx, fmpq
from hypothesis import given, settings
from hypothesis import strategies as st

from luenberger.algebra.ball import Ball
from luenberger.algebra.endpoint import OutsideDomain
from luenberger.core import BadInput

pytestmark = pytest.mark.filterwarnings("ignore:Do not use the `random` module")
law = settings(deadline=None, max_examples=80, derandomize=True)

reals = st.floats(-50.0, 50.0, allow_subnormal=False)
shares = st.fractions(0, 1, max_denominator=64)


@st.composite
def balls(draw: st.DrawFn, lower: float = -50.0, upper: float = 50.0) -> Ball:
    a, b = sorted((draw(st.floats(lower, upper)), draw(st.floats(lower, upper))))
    return Ball.hull(a, b)


def member(ball: Ball, share: Fraction) -> fmpq:
    return ball.lower_exact + (ball.upper_exact - ball.lower_exact) * fmpq(share.numerator, share.denominator)


def holds(ball: Ball, value: arb) -> bool:
    """True where a value known to 300 bits lies inside, or cannot be told from an end."""
    return bool(ball.low <= value.upper()) and bool(value.lower() <= ball.high)


def precisely(function: Callable[[arb], arb], value: fmpq) -> arb:
    with ctx.workprec(300):
        return function(arb(value))


OPERATIONS: dict[str, Callable] = {
    "add": lambda a, b: a + b,
    "sub": lambda a, b: a - b,
    "mul": lambda a, b: a * b,
    "div": lambda a, b: a / b,
}


@pytest.mark.parametrize("name", OPERATIONS)
@law
@given(a=balls(), b=balls(), s=shares, t=shares)
def test_arithmetic_holds_every_pair_of_members(name: str, a: Ball, b: Ball, s: Fraction, t: Fraction) -> None:
    operation = OPERATIONS[name]
    if name == "div" and b.contains(0):
        with pytest.raises(OutsideDomain, match="contains zero"):
            operation(a, b)
        return
    assert operation(a, b).contains(operation(member(a, s), member(b, t)))


@pytest.mark.parametrize("name", OPERATIONS)
@law
@given(a=balls(), b=balls(0.5, 9.0), flip=st.booleans())
def test_ends_of_arithmetic_are_the_extremes_at_the_corners(name: str, a: Ball, b: Ball, flip: bool) -> None:
    b = -b if flip else b
    corners = [OPERATIONS[name](x, y) for x in (a.lower_exact, a.upper_exact) for y in (b.lower_exact, b.upper_exact)]
    found = OPERATIONS[name](a, b)
    # Quotients are rounded once at 128 bits; doubles of this size add and multiply exactly there, up to 2100 bits apart.
    slack = fmpq(1, 2**110) * max(1, *(abs(c) for c in corners))
    assert min(corners) - slack <= found.lower_exact <= min(corners)
    assert max(corners) <= found.upper_exact <= max(corners) + slack


FUNCTIONS: dict[str, tuple[Callable[[Ball], Ball], Callable[[arb], arb], float, float]] = {
    "sin": (Ball.sin, arb.sin, -50, 50),
    "cos": (Ball.cos, arb.cos, -50, 50),
    "tan": (Ball.tan, arb.tan, -1.5, 1.5),
    "exp": (Ball.exp, arb.exp, -50, 50),
    "expm1": (Ball.expm1, arb.expm1, -50, 50),
    "log": (Ball.log, arb.log, 1e-3, 50),
    "log1p": (Ball.log1p, arb.log1p, -0.99, 50),
    "sqrt": (Ball.sqrt, arb.sqrt, 0, 50),
    "sinh": (Ball.sinh, arb.sinh, -20, 20),
    "cosh": (Ball.cosh, arb.cosh, -20, 20),
    "tanh": (Ball.tanh, arb.tanh, -50, 50),
    "atan": (Ball.atan, arb.atan, -50, 50),
    "asin": (Ball.asin, arb.asin, -1, 1),
    "acos": (Ball.acos, arb.acos, -1, 1),
    "asinh": (Ball.asinh, arb.asinh, -50, 50),
    "acosh": (Ball.acosh, arb.acosh, 1, 50),
    "atanh": (Ball.atanh, arb.atanh, -0.99, 0.99),
    "erf": (Ball.erf, arb.erf, -5, 5),
    "logistic": (Ball.logistic, lambda x: 1 / (1 + (-x).exp()), -50, 50),
    "square": (Ball.square, lambda x: x * x, -50, 50),
    "cube": (lambda b: b.integer_pow(3), lambda x: x * x * x, -50, 50),
    "fourth": (lambda b: b.integer_pow(4), lambda x: x * x * x * x, -50, 50),
    "abs": (abs, abs, -50, 50),
    "sign": (Ball.sign, arb.sgn, -50, 50),
    "floor": (Ball.floor, arb.floor, -50, 50),
    "ceil": (Ball.ceil, arb.ceil, -50, 50),
}


@pytest.mark.parametrize("name", FUNCTIONS)
@law
@given(data=st.data(), share=shares)
def test_functions_hold_every_member_and_no_more(name: str, data: st.DataObject, share: Fraction) -> None:
    function, truth, lower, upper = FUNCTIONS[name]
    ball = data.draw(balls(lower, upper))
    found = function(ball)
    assert holds(found, precisely(truth, member(ball, share)))
    # Each end must be attained: at an end of the argument, or at a turning point (0 for even functions, +-1 for waves).
    ends = [precisely(truth, e) for e in (ball.lower_exact, ball.upper_exact)]
    if name in ("sin", "cos"):
        ends += [arb(1), arb(-1)]
    elif ball.contains(0):
        ends.append(truth(arb(0))) if name not in ("log", "acosh") else None
    for end in (found.low, found.high):
        # 128 bits, after one or two roundings; sizes reach exp(50) ~ 2**73 for cosh and exp.
        assert any(bool(abs(end - e) <= arb(2) ** -110 * max(1, abs(e).upper())) for e in ends)


@law
@given(ball=balls(-20, 20), count=st.integers(5, 200))
def test_waves_are_bounded_by_one_only_where_they_turn(ball: Ball, count: int) -> None:
    lower, upper = float(ball.lower), float(ball.upper)
    for found, crest in ((ball.sin(), np.pi / 2), (ball.cos(), 0.0)):
        turn = math.ceil((lower - crest) / (2 * np.pi) + 1e-9)
        reaches = crest + 2 * np.pi * turn < upper - 1e-9
        grid = np.linspace(lower, upper, count)
        values = np.sin(grid) if crest else np.cos(grid)
        # Doubles of sin and cos are within an ulp of the truth.
        assert found.lower <= values.min() + 1e-15
        assert values.max() - 1e-15 <= found.upper
        assert not reaches or found.upper == 1.0


def test_the_slope_of_the_flexible_joint_is_bounded_exactly() -> None:
    slope = 3.33 * Ball.hull(-5.0, 5.0).cos()
    assert slope.upper_exact == fmpq(*(3.33).as_integer_ratio())
    assert slope.lower_exact == -slope.upper_exact
    assert (slope.lower, slope.upper) == (-3.33, 3.33)
    assert not Ball.hull(-3.3299999, 3.33).contains(slope)


def test_square_knows_that_both_factors_are_one() -> None:
    ball = Ball.hull(-5.0, 5.0)
    assert (ball.square().lower, ball.square().upper) == (0.0, 25.0)
    assert ((ball * ball).lower, (ball * ball).upper) == (-25.0, 25.0)


def test_wide_intervals_keep_their_ends() -> None:
    ball = Ball.hull(-1e300, 1e-300) + Ball.hull(1.0, 1.0)
    assert ball.contains(1)
    assert ball.upper > 1.0
    assert ball.lower == -1e300
    assert Ball.hull(0.1, 0.7).lower_exact == fmpq(*(0.1).as_integer_ratio())


def test_a_rational_that_128_bits_do_not_hold_is_enclosed() -> None:
    third = Ball.exact(Fraction(1, 3))
    assert third.contains(fmpq(1, 3))
    assert not third.is_point
    assert third.lower < third.upper == np.nextafter(third.lower, 1.0)
    assert third.width <= 2.0**-128


@law
@given(value=st.floats(allow_nan=False, allow_infinity=False))
def test_doubles_survive_the_round_trip(value: float) -> None:
    ball = Ball.exact(value)
    assert ball.lower == ball.upper == value
    assert ball.is_point
    assert ball.contains(value)
    assert not ball.contains(math.nextafter(value, math.inf))
    assert not ball.contains(math.nextafter(value, -math.inf))


def test_float_ends_round_outward_also_beyond_the_doubles() -> None:
    tiny, huge = Ball.exact(2.0**-1000) * 2.0**-1000, Ball.exact(2.0**1000) * 2.0**1000
    assert (tiny.lower, tiny.upper) == (0.0, 5e-324)
    assert (huge.lower, huge.upper) == (np.finfo(float).max, math.inf)
    assert ((-huge).lower, (-huge).upper) == (-math.inf, -np.finfo(float).max)
    assert not huge.contains(math.inf)


def test_no_bound_reads_minus_zero() -> None:
    zero = Ball.exact(0) * Ball.hull(-1, 1)
    assert math.copysign(1, zero.lower) == math.copysign(1, zero.upper) == 1.0


def test_comparisons_have_three_answers() -> None:
    low, high, both = Ball.hull(0, 1), Ball.hull(2, 3), Ball.hull(0, 3)
    assert (low < high) is True
    assert (high < low) is False
    assert (low < both) is None
    assert (low <= 1) is True
    assert (low < 1) is None
    assert (low > 1) is False
    assert (low >= 0) is True
    assert (low >= 0.5) is None
    assert (low < 1.5) is True
    assert (high >= 2.5) is None
    assert low.equals(high) is False
    assert low.equals(low) is None
    assert Ball.exact(2).equals(2) is True


def test_numbers_stand_on_either_side_also_in_arrays() -> None:
    ball = Ball.hull(1, 2)
    for found in (2 - ball, 2.0 - ball, fmpq(2) - ball, Fraction(2) - ball, np.float64(2.0) - ball, np.int64(2) - ball):
        assert isinstance(found, Ball)
        assert (found.lower, found.upper) == (0.0, 1.0)
    found = 6 / ball
    assert (found.lower, found.upper) == (3.0, 6.0)
    matrix = np.array([[ball, Ball.exact(0)], [Ball.exact(0), ball]])
    for product in (np.array([[1.0, -1.0], [0.0, 2.0]]) @ matrix, np.eye(2) @ matrix + 0.5, matrix.T @ matrix):
        assert all(isinstance(entry, Ball) for entry in product.flat)
    assert (np.array([[1.0, -1.0], [0.0, 2.0]]) @ matrix)[0, 1].lower == -2.0
    assert np.sin(matrix)[0, 0].upper == 1.0
    assert matrix.sum().upper == 4.0


def test_powers() -> None:
    ball = Ball.hull(-1, 2)
    assert (ball**3).lower == -1.0
    assert (ball**3).upper == 8.0
    assert (ball**4).lower == 0.0
    assert (ball**4).upper == 16.0
    assert (ball**0).lower == (ball**0).upper == 1.0
    assert (Ball.hull(1, 2) ** -2).lower == 0.25
    assert (Ball.hull(-2, -1) ** -1).upper == -0.5
    root = Ball.hull(0, 4) ** 0.5
    assert root.lower == 0.0
    assert root.contains(2)
    assert root.width < 2.0 + 1e-15
    assert (Ball.hull(0, 0) ** 0.5).is_point
    with pytest.raises(OutsideDomain):
        ball**0.5


def test_angles_go_by_the_corners_and_stop_at_the_cut() -> None:
    found = Ball.hull(-1, 1).atan2(Ball.hull(1, 2))
    assert found.lower <= -math.pi / 4 <= found.lower + 1e-15
    assert found.upper >= math.pi / 4 >= found.upper - 1e-15
    behind = Ball.hull(0, 1).atan2(Ball.hull(-2, -1))
    # The corners (-1, 1) and (-2, 0); the double nearest to pi lies below pi.
    assert behind.lower <= 3 * math.pi / 4
    assert behind.upper > math.pi
    for y, x in (
        (Ball.hull(-1, 1), Ball.hull(-2, -1)),
        (Ball.hull(0, 1), Ball.hull(0, 1)),
        (Ball.exact(0), Ball.exact(0)),
    ):
        with pytest.raises(OutsideDomain, match="cut"):
            y.atan2(x)


@law
@given(ball=balls(), divisor=st.floats(0.5, 7.0), share=shares)
def test_remainders_hold_every_member(ball: Ball, divisor: float, share: Fraction) -> None:
    value, c = member(ball, share), fmpq(*divisor.as_integer_ratio())
    quotient = value / c
    turns = quotient.floor() if quotient >= 0 else quotient.ceil()
    found = ball.rem(Ball.exact(divisor))
    assert found.contains(value - c * turns)
    assert abs(found).upper <= divisor


def test_remainder_is_sharp_within_one_turn() -> None:
    found = Ball.hull(6.0, 8.0).rem(Ball.exact(5.0))
    assert (found.lower, found.upper) == (1.0, 3.0)
    found = Ball.hull(-3.0, 4.0).rem(Ball.exact(5.0))
    assert (found.lower, found.upper) == (-3.0, 4.0)


@pytest.mark.parametrize(
    ("function", "ball"),
    [
        (Ball.sqrt, Ball.hull(-1, 1)),
        (Ball.log, Ball.hull(0, 1)),
        (Ball.asin, Ball.hull(0, 2)),
        (Ball.acosh, Ball.hull(0, 2)),
        (Ball.atanh, Ball.hull(0, 1)),
        (Ball.tan, Ball.hull(1, 2)),
        (Ball.exp, Ball.exact(1e300)),
    ],
)
def test_what_is_undefined_inside_is_refused(function: Callable[[Ball], Ball], ball: Ball) -> None:
    with pytest.raises(OutsideDomain):
        function(ball)


def test_bad_intervals_are_refused() -> None:
    with pytest.raises(BadInput, match="inverted"):
        Ball.hull(2.0, 1.0)
    with pytest.raises(OutsideDomain, match="nan"):
        Ball.hull(float("nan"), 1.0)
    with pytest.raises(BadInput, match="not a real number"):
        Ball.exact("1")
    with pytest.raises(TypeError):
        Ball.exact(1) + "1"


def test_precision_of_the_caller_is_neither_used_nor_changed() -> None:
    with ctx.workprec(20):
        found = Ball.exact(0.1) * Ball.exact(0.1)
        assert ctx.prec == 20
    assert found.lower_exact == fmpq(*(0.1).as_integer_ratio()) ** 2 == found.upper_exact


@pytest.mark.parametrize("precision", [20, 53, 400])
def test_ends_stay_exact_at_any_precision_of_the_caller(precision: int) -> None:
    third, wide = Ball.exact(Fraction(1, 3)), Ball.hull(Fraction(-1, 3), Fraction(2, 3))
    with ctx.workprec(precision):
        for found in (
            -third,
            abs(-third),
            third - wide,
            wide.square(),
            wide.trunc(),
            wide.rem(Ball.exact(1)),
            1 / third,
        ):
            assert found.low.is_exact()
            assert found.high.is_exact()
        assert (-third).contains(fmpq(-1, 3))
        assert (third.lower, third.upper) == (1 / 3, math.nextafter(1 / 3, 1.0))


def test_union_extremes_and_flint_form() -> None:
    a, b = Ball.hull(-1, 1), Ball.hull(0, 3)
    assert (a.union(b).lower, a.union(b).upper) == (-1.0, 3.0)
    assert (a.maximum(b).lower, a.maximum(b).upper) == (0.0, 3.0)
    assert (a.minimum(b).lower, a.minimum(b).upper) == (-1.0, 1.0)
    assert a.as_arb().contains(arb(1))
    assert a.as_arb().contains(arb(-1))
    assert repr(a) == "[-1.0, 1.0]"
    assert abs(+a).lower == 0.0
