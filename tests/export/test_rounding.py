"""The derived bound of finite precision: holds for what happens, and is no wild overestimate."""

import numpy as np
import pytest

from export_plants import running, scheduled
from luenberger.export import Guarded, golden
from luenberger.export.golden import random_drive
from luenberger.export.program import program
from luenberger.export.rounding import UNITS, RoundedArithmetic, run_bound


def test_a_run_in_single_precision_stays_inside_and_uses_a_fair_part() -> None:
    guarded = Guarded.of(running(), scheduled())
    drive = [a.astype(np.float32) for a in random_drive(guarded, 30)]
    single, double = golden(guarded, *drive, dtype=np.float32), golden(guarded, *drive)
    bound = run_bound(program(guarded), "float", *(a[0] for a in drive))
    gap = np.abs(single.estimate[0] - double.estimate[0])
    assert (gap <= bound).all()
    # Roundings of both signs cancel; still a bound a thousand times too large would bound nothing.
    assert gap.max() > 1e-3 * bound.max()
    assert bound.max() < 1e-5


def test_double_precision_is_bounded_by_the_ratio_of_the_roundings() -> None:
    guarded = Guarded.of(running(), scheduled())
    drive = [a[0].astype(np.float32) for a in random_drive(guarded, 5)]
    read = program(guarded)
    ratio = run_bound(read, "float", *drive)[-1] / run_bound(read, "double", *drive)[-1]
    wanted = UNITS["float"][0] / UNITS["double"][0]
    assert (0.1 * wanted < ratio).all()
    assert (ratio < 10 * wanted).all()


@pytest.mark.parametrize("precision", UNITS)
def test_one_operation_is_widened_by_its_unit(precision: str) -> None:
    arithmetic = RoundedArithmetic(precision)
    two, third = (
        arithmetic.constant(2.0),
        arithmetic.functions["div"](arithmetic.constant(1.0), arithmetic.constant(3.0)),
    )
    assert two.is_point
    assert third.contains(float(np.float32(1) / np.float32(3)) if precision == "float" else 1 / 3)
    assert third.width == pytest.approx(2 * UNITS[precision][0] / 3, rel=1e-2)
    assert arithmetic.functions["neg"](two).is_point
