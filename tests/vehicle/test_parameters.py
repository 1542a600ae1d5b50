"""Numbers of a car keep unit and source, and wrong ones are refused by name."""

from typing import Any

import pytest

from luenberger.core import BadInput
from luenberger.vehicle import Quantity, VehicleParameters, wang_car

NUMBERS: dict[str, Any] = {
    "mass": 1000.0,
    "yaw_inertia": 1500.0,
    "front_axle_distance": 1.0,
    "rear_axle_distance": 1.5,
    "front_stiffness": 60e3,
    "rear_stiffness": 50e3,
}
UNITS = ("kg", "kg m^2", "m", "m", "N/rad", "N/rad")


def car(**changes: Any) -> VehicleParameters:
    return VehicleParameters(name="car", **(NUMBERS | changes))


def test_a_number_stands_beside_unit_and_source() -> None:
    quantities = {k: Quantity(v, u, f"book, {k}") for (k, v), u in zip(NUMBERS.items(), UNITS, strict=True)}
    made = VehicleParameters.stated("car", **quantities)
    assert made.mass == 1000.0
    assert made.unit("yaw_inertia") == "kg m^2"
    assert made.source("rear_stiffness") == "book, rear_stiffness"
    assert made.table()[0] == ("mass", 1000.0, "kg", "mass", "book, mass")
    assert len(made.table()) == 6


def test_whole_numbers_become_floats() -> None:
    assert isinstance(car(mass=900).mass, float)


@pytest.mark.parametrize("value", [0.0, -5.0, float("nan"), float("inf"), True])
@pytest.mark.parametrize("name", ["mass", "rear_stiffness", "friction"])
def test_numbers_are_positive_and_finite(name: str, value: float) -> None:
    with pytest.raises(BadInput, match=f"`{name}` of `car` is .* a positive finite number"):
        car(**{name: value})


def test_a_wrong_unit_is_refused() -> None:
    quantities = {k: Quantity(v, u, "") for (k, v), u in zip(NUMBERS.items(), UNITS, strict=True)}
    quantities["front_stiffness"] = Quantity(60.0, "kN/rad", "")
    with pytest.raises(BadInput, match="`front_stiffness` of `car` is given in `kN/rad`; it needs to be in `N/rad`"):
        VehicleParameters.stated("car", **quantities)


def test_missing_and_unknown_numbers_are_named() -> None:
    with pytest.raises(BadInput, match="`car` lacks `yaw_inertia`, `front_axle_distance`"):
        VehicleParameters.stated("car", mass=Quantity(1.0, "kg", ""))
    with pytest.raises(BadInput, match=r"unknown key `inertia`\. Did you mean `yaw_inertia`"):
        car().with_values(inertia=1.0)
    with pytest.raises(BadInput, match=r"unknown key `mas`\. Did you mean `mass`"):
        car(sources={"mas": "book"})
    with pytest.raises(BadInput, match="unknown key `stiffness`"):
        car().source("stiffness")


def test_changed_numbers_say_so() -> None:
    changed = wang_car.with_values(front_stiffness=70e3, centre_height=0.5)
    assert (changed.front_stiffness, changed.rear_stiffness) == (70e3, wang_car.rear_stiffness)
    assert changed.source("front_stiffness") == "set by hand, instead of 76500 N/rad"
    assert changed.source("centre_height") == "set by hand"
    assert changed.source("mass") == wang_car.source("mass")
    assert wang_car.front_stiffness == 76500.0
    assert wang_car.with_values(source="fit", mass=810.0).source("mass") == "fit"
    assert car().source("mass") == "not stated"


def test_axle_loads_carry_the_weight_unless_given() -> None:
    plain = car()
    # Sum and moment balance of a car at rest; rounding of a few products.
    assert plain.front_axle_load + plain.rear_axle_load == pytest.approx(1000.0 * 9.80665, rel=1e-15)
    assert plain.front_axle_load * 1.0 == pytest.approx(plain.rear_axle_load * 1.5, rel=1e-15)
    assert car(front_load=4000.0).front_axle_load == 4000.0


def test_neutral_steer_is_the_sign_change_of_the_understeer_gradient() -> None:
    # a Cf = b Cr: 1.0 * 60e3 = 1.5 * 40e3.
    neutral = car(rear_stiffness=40e3)
    assert neutral.is_neutral_steer
    assert neutral.understeer_gradient == pytest.approx(0.0, abs=1e-18)
    assert not car().is_neutral_steer
    assert car().understeer_gradient > 0 > car(rear_stiffness=39e3).understeer_gradient


def test_cars_are_equal_by_content_and_hash() -> None:
    assert car() == car()
    assert hash(car()) == hash(car())
    assert car() != car(mass=1001.0)
