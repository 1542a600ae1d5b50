"""Switched plants: what the modes share, which mode holds, and the order of the scheduling."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from luenberger.core import BadInput
from luenberger.systems import Parameter, Switched, System


def mode(pole: float, **options: Any) -> System:
    return System.linear([[pole]], [[1.0]], **({"dt": 0.1, "name": "pot"} | options))


def scheduled(pole: float) -> System:
    return System.lpv([[pole]], parameters=[Parameter("r", 0.0, 1.0), Parameter("s", 0.0, 1.0)], dt=0.1)


def test_one_plant_is_a_switched_plant_with_one_mode() -> None:
    plant = mode(0.5)
    switched = Switched.of(plant)
    assert switched.modes == (plant,)
    assert switched.first is plant
    assert switched.name == "pot"
    assert switched.transitions == ((0, 0),)
    assert switched.scheduling_names == ()
    assert switched.nr == 0
    assert int(switched.mode(jnp.zeros(0))) == 0


def test_a_switched_plant_is_taken_as_it_is() -> None:
    switched = Switched.of([mode(0.5), mode(0.6)], "gear")
    assert Switched.of(switched) is switched


def test_transitions_hold_all_ordered_pairs() -> None:
    switched = Switched.of([mode(p) for p in (0.4, 0.5, 0.6)], "gear")
    assert set(switched.transitions) == {(i, j) for i in range(3) for j in range(3)}
    assert len(switched.transitions) == 9
    assert switched.name == "pot, 3 modes"


@pytest.mark.parametrize(
    ("speed", "expected"),
    [(5.0, 0), (6.0, 0), (10.999, 0), (11.0, 1), (15.99, 1), (16.0, 2), (19.899, 2), (40.0, 2)],
)
def test_mode_by_limits(speed: float, expected: int) -> None:
    switched = Switched.of([mode(p) for p in (0.4, 0.5, 0.6)], "speed", (6.0, 11.0, 16.0, 19.899), unit="m/s")
    assert int(switched.mode(jnp.array([speed]))) == expected
    assert jnp.issubdtype(switched.mode(jnp.array([speed])).dtype, jnp.integer)
    # Compiled and batched alike.
    assert int(jax.jit(lambda r: switched.mode(r))(jnp.array([speed]))) == expected
    assert jax.vmap(lambda r: switched.mode(r))(jnp.array([[speed], [11.5]])).tolist() == [expected, 1]


@pytest.mark.parametrize("number", [0, 1, 2])
def test_without_limits_the_signal_is_the_number_of_the_mode(number: int) -> None:
    switched = Switched.of([mode(p) for p in (0.4, 0.5, 0.6)])
    assert switched.signal == "mode"
    assert int(switched.mode(jnp.array([float(number)]))) == number


def test_signal_comes_last_unless_it_schedules_the_modes() -> None:
    apart = Switched.of([scheduled(0.4), scheduled(0.5)], "gear", (0.0, 1.0, 2.0))
    assert apart.scheduling_names == ("r", "s", "gear")
    r = jnp.array([0.1, 0.2, 1.5])
    assert int(apart.mode(r)) == 1
    np.testing.assert_array_equal(apart.within(r), [0.1, 0.2])
    among = Switched.of([scheduled(0.4), scheduled(0.5)], "r", (0.0, 0.5, 1.0))
    assert among.scheduling_names == ("r", "s")
    assert int(among.mode(jnp.array([0.7, 0.2]))) == 1
    np.testing.assert_array_equal(among.within(jnp.array([0.7, 0.2])), [0.7, 0.2])


def test_matrices_are_leaves() -> None:
    switched = Switched.of([mode(0.4), mode(0.5)], "gear", dwell=3)
    doubled = jax.tree.map(lambda leaf: 2 * leaf, switched)
    assert float(doubled.modes[1].at("A")[0, 0]) == 1.0
    assert doubled.dwell == 3
    assert doubled.ends == (-0.5, 0.5, 1.5)


@pytest.mark.parametrize(
    ("second", "what"),
    [
        (mode(0.5, dt=0.2), "dt"),
        (mode(0.5, states=("level",)), "states"),
        (mode(0.5, inputs=("tap",)), "inputs"),
        (mode(0.5, outputs=("gauge",)), "outputs"),
        (mode(0.5, E=[[1.0]]), "nd"),
        (mode(0.5, G=[[1.0, 0.5]]), "nv"),
        (mode(0.5, noise_bound=[0.1]), "noise_bound"),
        (scheduled(0.5), "inputs"),
    ],
)
def test_modes_share_signals_and_bounds(second: System, what: str) -> None:
    with pytest.raises(BadInput, match=f"The modes differ in `{what}`"):
        Switched.of([mode(0.4), second])


@pytest.mark.parametrize(
    ("options", "word"),
    [
        ({"ends": (0.0, 1.0)}, "2 modes need 3 rising limits"),
        ({"ends": (0.0, 1.0, 1.0)}, "rising"),
        ({"ends": (0.0, float("nan"), 1.0)}, "ends"),
        ({"dwell": 0}, "`dwell` is 0"),
    ],
)
def test_refusals(options: dict[str, Any], word: str) -> None:
    with pytest.raises(BadInput, match=word):
        Switched.of([mode(0.4), mode(0.5)], "gear", **options)


def test_no_mode_and_a_vector_of_the_wrong_length_are_refused() -> None:
    with pytest.raises(BadInput, match="no modes"):
        Switched.of([])
    with pytest.raises(BadInput, match="give one for each"):
        Switched.of([mode(0.4), mode(0.5)], "gear").mode(jnp.zeros(2))
