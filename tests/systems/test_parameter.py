"""An interval that cannot be trusted is refused where it is stated."""

import math

import pytest

from luenberger.core import BadInput
from luenberger.systems import Parameter
from luenberger.systems.parameter import box


@pytest.mark.parametrize(
    ("lower", "upper"), [(2.0, 1.0), (math.nan, 1.0), (0.0, math.nan), (0.0, math.inf), (-math.inf, 0.0)]
)
def test_ends_need_to_be_finite_and_ordered(lower: float, upper: float) -> None:
    with pytest.raises(BadInput, match=r"Parameter `vx` has the interval .* m/s"):
        Parameter("vx", lower, upper, "m/s")


@pytest.mark.parametrize("bounds", [{"rate": -1.0}, {"rate": math.nan}, {"error": -0.1}, {"error": math.nan}])
def test_rate_and_error_are_not_negative(bounds: dict[str, float]) -> None:
    with pytest.raises(BadInput, match="both need to be >= 0"):
        Parameter("vx", 1.0, 2.0, **bounds)


def test_a_point_is_an_interval() -> None:
    point = Parameter("vx", 3.0, 3.0)
    assert point.middle == 3.0
    assert point.interval == (3.0, 3.0)


def test_middle_and_box() -> None:
    speed, friction = Parameter("vx", 5.0, 35.0, "m/s"), Parameter("mu", 0.3, 1.0, measured=False)
    assert speed.middle == 20.0
    assert box([speed, friction]) == {"vx": (5.0, 35.0), "mu": (0.3, 1.0)}


def test_no_rate_means_no_bound_is_trusted() -> None:
    assert Parameter("vx", 1.0, 2.0).rate is None
