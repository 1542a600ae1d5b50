"""Endpoints: exact numbers, precision left as found, turning points of waves never missed."""

from fractions import Fraction

import numpy as np
import pytest
from flint import arb, ctx, fmpq

from luenberger.algebra.endpoint import (
    PI,
    PRECISION,
    OutsideDomain,
    at_working_precision,
    may_hold,
    number,
    rational,
    wave,
)
from luenberger.core import BadInput


def test_precision_is_raised_inside_and_restored_after_an_error() -> None:
    @at_working_precision
    def fail() -> None:
        assert ctx.prec == PRECISION
        raise ValueError

    before = ctx.prec
    with pytest.raises(ValueError):
        fail()
    assert ctx.prec == before != PRECISION


@pytest.mark.parametrize("value", [0.1, np.float64(0.1), -3, np.int64(7), Fraction(3, 8), fmpq(-5, 4), np.float32(0.1)])
def test_dyadic_numbers_are_exact(value: object) -> None:
    found = number(value)
    assert found.is_exact()
    assert found.fmpq() == rational(value)
    assert rational(value) == value or float(value) == value  # type: ignore[arg-type]


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -float("inf")])
def test_numbers_that_are_not_finite_are_outside(value: float) -> None:
    with pytest.raises(OutsideDomain, match="finite"):
        number(value)


@pytest.mark.parametrize("value", ["1.0", None, 1j])
def test_what_is_no_number_is_refused(value: object) -> None:
    with pytest.raises(BadInput, match="not a real number"):
        number(value)


@pytest.mark.parametrize(
    ("lower", "upper", "holds"), [(-0.1, 0.1, True), (0.1, 6.2, False), (0.1, 6.3, True), (-6.3, -6.2, True)]
)
def test_multiples_of_two_pi_are_found(lower: float, upper: float, holds: bool) -> None:
    assert may_hold(arb(lower), arb(upper), fmpq(0), 2) is holds


@pytest.mark.parametrize("shift", [0, 1, -1, 1000, -(10**9)])
def test_wave_turns_exactly_between_neighbouring_doubles_of_pi(shift: int) -> None:
    # The double below pi and the one above enclose a trough of cos, neither reaches it.
    low, high = np.pi, np.nextafter(np.pi, 4.0)
    turn = at_working_precision(lambda: 2 * shift * PI)()
    inside = at_working_precision(lambda: ((arb(low) + turn).lower(), (arb(high) + turn).upper()))()
    outside = at_working_precision(lambda: ((arb(high) + turn).lower(), (arb(high) + turn).upper()))()
    assert at_working_precision(wave)(*inside, arb.cos, fmpq(0))[0] == -1
    assert at_working_precision(wave)(*outside, arb.cos, fmpq(0))[0] > -1
