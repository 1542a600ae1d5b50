"""What the unknown-input observer reads of its plant, and what it refuses."""

from collections.abc import Callable
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

from luenberger.algebra import Polynomial
from luenberger.core import BadInput, NotAccepted
from luenberger.observers.unknown_input import UnknownInputObserver
from luenberger.observers.unknown_input_plant import OpenMode, mode_at, one_each
from luenberger.systems import Parameter, System
from luenberger.vehicle.cars import gust_car
from luenberger.vehicle.wind import wind_plant
from observers import gust_drive as gust


def plant(**changes: Any) -> System:
    options: dict[str, Any] = {
        "C": [[0.0, 1.0]], "E": [[0.3], [1.0]], "dt": 0.1, "noise_bound": [0.01], "parameters": [Parameter("p", 0.5, 1.0)],
    }  # fmt: skip
    return System.build([[0.8, 0.1], [0.0, 0.5]], [[1.0], [0.0]], **(options | changes))


def built(system: Any, H: Any = ((-0.3,), (-1.0,))) -> UnknownInputObserver:
    return UnknownInputObserver(system, np.zeros((2, 1)), H, initial_half_width=[0.1, 0.1])


def test_the_mode_that_the_speed_selects() -> None:
    # The second mode knows its stiffness, so it has fewer factors and is filled up.
    known = gust.three_modes().modes[1].freeze(front_stiffness=60e3, rear_stiffness=65e3)
    modes = [gust.three_modes().modes[0], known]
    open_modes = tuple(OpenMode.of(m) for m in modes)
    assert [m.directions.shape[1] for m in open_modes] == [2, 0]
    switched = gust.Switched.of(modes, "speed", (6.0, 11.0, 16.0))
    found = [gust.decoupled(m) for m in modes]
    for k, speed in enumerate((10.99, 11.0)):
        K, H = (tuple(part) for part in zip(*found, strict=True))
        m = mode_at(switched, open_modes, K, H, jnp.asarray([speed]))
        np.testing.assert_allclose(m.A, modes[k].at("A"))
        np.testing.assert_allclose(m.K, found[k][0]({}))
        assert m.rows.shape == (2, 4)
        assert bool(np.any(m.rows)) == (k == 0)


def test_a_scheduled_mode_is_formed_at_its_speed() -> None:
    car = gust.car()
    K, H = gust.decoupled(car)
    r = jnp.asarray([12.5, 1 / 12.5])
    m = mode_at(gust.Switched.of(car), (OpenMode.of(car),), (K,), (H,), r)
    frozen = car.freeze(speed=12.5, inverse_speed=1 / 12.5)
    np.testing.assert_allclose(m.A, frozen.at("A"), rtol=1e-14)
    np.testing.assert_allclose(m.K, gust.decoupled(frozen)[0]({}), rtol=1e-13)


def test_one_matrix_serves_all_modes() -> None:
    three = gust.three_modes()
    K, H = gust.decoupled(three.modes[0])
    for given in (K, H, H.tolist(), [K] * 3, (H,) * 3, [H.tolist()] * 3):
        assert len(one_each("gains", given, three)) == 3
    with pytest.raises(BadInput, match="needs 3"):
        one_each("gains", [H, H], three)


@pytest.mark.parametrize(
    ("system", "error", "match"),
    [
        (lambda: wind_plant(gust_car, (6.0, 19.9), gust_arm=0.4, yaw_rate_noise=0.005), NotAccepted, "continuous"),
        (lambda: plant(D=[[0.1]]), NotAccepted, "feedthrough"),
        (lambda: plant(noise_bound=None), BadInput, "noise_bound"),
        (lambda: plant(C=Polynomial.affine(np.array([[0.0, 1.0]]), p=np.array([[1.0, 0.0]]))), NotAccepted, "constant"),
        (lambda: plant(E=Polynomial.affine(np.zeros((2, 1)), p=np.ones((2, 1)))), NotAccepted, "disturbance_bound"),
        (lambda: [plant(), plant(C=[[0.0, 2.0]])], NotAccepted, "differs between the modes"),
    ],
)
def test_plants_without_a_guarantee_are_refused(system: Callable[[], Any], error: Any, match: str) -> None:
    with pytest.raises(error, match=match):
        built(system())


def test_decoupling_matrices_that_do_not_decouple_are_refused() -> None:
    built(plant())
    with pytest.raises(BadInput, match="not zero"):
        built(plant(), [[-0.3], [-0.9]])
    built(plant(disturbance_bound=[1.0]), [[-0.3], [-0.9]])
    with pytest.raises(NotAccepted, match="constant"):
        built(plant(), Polynomial.affine(np.array([[-0.3], [-1.0]]), p=np.ones((2, 1))))
    with pytest.raises(BadInput, match=r"needs shape \(2, 1\)"):
        built(plant(), [[-0.3, -1.0]])
