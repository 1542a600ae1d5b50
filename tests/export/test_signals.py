"""Names that C can hold, with the units of the plant."""

import pytest

from luenberger.core import BadInput
from luenberger.export import Signals
from luenberger.export.signals import distinct
from luenberger.systems import Parameter, Switched, System


@pytest.mark.parametrize("name", ["", "9lives", "yaw rate", "x-y", "v[0]", "größe", "float", "a\n", "static"])
@pytest.mark.parametrize("place", ["states", "inputs", "outputs", "scheduling"])
def test_names_that_c_cannot_hold_are_refused_wherever_they_stand(name: str, place: str) -> None:
    with pytest.raises(BadInput, match="is no C identifier; rename it"):
        Signals(**{"states": ("x",), place: (name,)})


def test_names_and_units_are_those_of_the_plant() -> None:
    plant = System.lpv(
        [[0.9]],
        C=[[1.0]],
        dt=0.1,
        parameters=[Parameter("speed", 1.0, 2.0, "m/s")],
        states=["slip"],
        outputs=["yaw_rate"],
        units={"slip": "rad", "yaw_rate": "rad/s"},
    )
    found = Signals.of(plant)
    assert (found.states, found.inputs, found.outputs, found.scheduling) == (("slip",), (), ("yaw_rate",), ("speed",))
    assert found.units["slip"] == "rad"
    assert found.units["yaw_rate"] == "rad/s"


def test_the_signal_that_selects_the_mode_is_read_too() -> None:
    modes = [System.linear([[a]], C=[[1.0]], dt=0.1, noise_bound=[0.1]) for a in (0.9, 0.8)]
    found = Signals.of(Switched.of(modes, "speed", (0.0, 10.0, 20.0), unit="m/s"))
    assert found.scheduling == ("speed",)
    assert found.units["speed"] == "m/s"


def test_who_comes_first_keeps_the_name() -> None:
    assert distinct(["k", "L", "k", "k", "k_2"]) == ["k", "L", "k_2", "k_3", "k_2_2"]
