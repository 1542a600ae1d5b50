"""The shipped cars: every number sourced, and the printed facts about them."""

import pytest

from luenberger.core import BadInput
from luenberger.vehicle import CARS, car_named, carmaker_car, ferrari_250lm, wang_car


@pytest.mark.parametrize("name", CARS)
def test_every_number_has_a_source(name: str) -> None:
    for row in car_named(name).table():
        assert row.source not in ("", "not stated"), row.name


def test_the_printed_car_is_exactly_neutral() -> None:
    # 0.948 m * 76500 N/rad = 1.422 m * 51000 N/rad = 72522 N m/rad.
    assert wang_car.is_neutral_steer
    assert wang_car.front_axle_distance * wang_car.front_stiffness == pytest.approx(72522.0, rel=1e-14)
    assert not carmaker_car.is_neutral_steer
    assert not ferrari_250lm.is_neutral_steer


def test_wheelbases() -> None:
    assert carmaker_car.wheelbase == pytest.approx(2.626)
    assert ferrari_250lm.wheelbase == pytest.approx(2.40)


def test_an_unknown_car_gets_the_nearest() -> None:
    with pytest.raises(BadInput, match=r"no car `carmaker`\. Did you mean `carmaker_car`"):
        car_named("carmaker")
