"""What is read beside what is true: maps built from parameters, rates, and refusals."""

import numpy as np
import pytest

from luenberger.algebra import Polynomial
from luenberger.core import BadInput, NotAccepted
from luenberger.systems import Parameter, SchedulingError, System
from luenberger.systems.jacobian_box import error_box
from luenberger.systems.scheduling_error import scheduling_rates

ONE = Polynomial(("p",), {(1,): np.ones((1, 1))})


def test_exact_parameters_need_no_map() -> None:
    assert SchedulingError.of([Parameter("a", 0.0, 1.0)]) is None


def test_factor_and_offset_become_free_parameters() -> None:
    error = SchedulingError.of([Parameter("a", 1.0, 2.0, error=0.1, factor=(0.9, 1.1)), Parameter("b", 0.0, 1.0)])
    assert error is not None
    assert error.box == {"a": (1.0, 2.0), "a_factor": (0.9, 1.1), "a_offset": (-0.1, 0.1), "b": (0.0, 1.0)}
    measured = error.measured["a"]
    at = {"a": 1.5, "a_factor": 0.95, "a_offset": 0.04}
    assert float(measured({n: at[n] for n in measured.names})[0, 0]) == pytest.approx(1.5 * 0.95 + 0.04, rel=1e-15)
    assert error.measured["b"].names == ("b",)


def test_declared_map_replaces_the_parameters_in_the_box() -> None:
    plant = System.lpv(
        Polynomial.affine(-np.eye(1), a=np.ones((1, 1))),
        C=[[1.0]],
        parameters=[Parameter("a", 0.0, 0.5, factor=(0.9, 1.1))],
        scheduling_error=SchedulingError({"a": ONE}, {"a": ONE}, {"p": (0.0, 0.5)}),
    )
    assert error_box(plant) == {"p": (0.0, 0.5)}
    assert plant.freeze(a=0.1).measured_scheduling is None


@pytest.mark.parametrize(
    ("true", "measured", "box", "message"),
    [
        ({"a": ONE}, {"b": ONE}, {"p": (0.0, 1.0)}, "give both for each"),
        ({"a": ONE}, {"a": ONE}, {}, "which the box leaves out"),
        ({"a": Polynomial.constant(np.eye(2))}, {"a": ONE}, {"p": (0.0, 1.0)}, "a scalar polynomial"),
    ],
)
def test_maps_that_cannot_be_meant(true: dict, measured: dict, box: dict, message: str) -> None:
    with pytest.raises(BadInput, match=message):
        SchedulingError(true, measured, box)


def test_map_of_another_plant_is_refused() -> None:
    with pytest.raises(BadInput, match="is scheduled by"):
        System.linear([[-1.0]], C=[[1.0]], scheduling_error=SchedulingError({"a": ONE}, {"a": ONE}, {"p": (0.0, 1.0)}))


def test_rates_by_law_and_by_bound() -> None:
    law = ((-1.0, (("s", 2), ("a", 1))),)
    rates, box = scheduling_rates([Parameter("s", 0.1, 0.2, rate_law=law), Parameter("a", -1.0, 1.0, rate=10.0)])
    assert float(rates["s"]({"s": 0.2, "a": 3.0})[0, 0]) == pytest.approx(-0.12, rel=1e-15)
    assert rates["a"].names == ("a_rate",)
    assert box == {"a_rate": (-10.0, 10.0)}
    with pytest.raises(NotAccepted, match="rate law"):
        scheduling_rates([Parameter("s", 0.1, 0.2, rate_law=law)])


@pytest.mark.parametrize("factor", [(1.1, 1.2), (0.0, 1.0), (0.5, 0.9), (0.9, float("inf"))])
def test_a_factor_surrounds_one(factor: tuple[float, float]) -> None:
    with pytest.raises(BadInput, match="0 < lower <= 1 <= upper"):
        Parameter("a", 0.0, 1.0, factor=factor)
