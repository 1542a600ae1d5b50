"""Logs of the car in the wind with all that a simulation knows of it, for monitors of what was assumed."""

from dataclasses import replace
from typing import Any

import jax.numpy as jnp
from jax.scipy.linalg import expm

from luenberger.experiment.published.ifqir_drive import Choices, cars, choices, drive
from luenberger.observers.monitor import Drive
from luenberger.vehicle import gust_car, wind_plant
from observers import gust_drive as gust

SAMPLES, STEERING_ERROR = 150, 0.002
STIFFNESS = {"front_stiffness": gust_car.front_stiffness, "rear_stiffness": gust_car.rear_stiffness}


def unknowns(seed: int = 3) -> Choices:
    """One random car and eight at vertices of everything that nobody knows."""
    return choices(SAMPLES, random=1, adversaries=False, seed=seed)


def log(unknown: Choices, car: int = 0, varying: bool = False, **road: Any) -> Drive:
    """All that a simulation knows of one car on the drive."""
    way = replace(drive(SAMPLES), **road)
    found = cars(way, unknown, steering_error=STEERING_ERROR, varying=varying)
    speed = way.speed if varying else way.local
    return Drive(
        way.time,
        r=way.speed[:, None],
        u=found.steering[car],
        y=found.outputs[car],
        x=found.states[car],
        true_r=speed[:, None],
        noise=unknown.noise[:, car] * [0.005, STEERING_ERROR],
        disturbance=way.gust[:, None],
        uncertainty={
            name: middle * (1 + 0.1 * unknown.stiffness[:, car, k])
            for k, (name, middle) in enumerate(STIFFNESS.items())
        },
    )


def euler(x: Any, u: Any, d: Any, r: Any, q: dict[str, Any]) -> Any:
    """The sampled car as the modes have it."""
    plant = gust.car()
    values = {"speed": r[0], "inverse_speed": 1 / r[0]} | q
    A, B, E = (plant.polynomial(letter)(values) for letter in "ABE")
    return A @ x + B @ u + E @ d


def continuous(x: Any, u: Any, d: Any, r: Any, q: dict[str, Any]) -> Any:
    """The car itself, with everything held over the step."""
    plant = wind_plant(gust_car, (6.0, 19.9), gust_arm=gust.ARM, stiffness=((54e3, 66e3), (58.5e3, 71.5e3)))
    values = {"speed": r[0], "inverse_speed": 1 / r[0]} | q
    A, B, E = (plant.polynomial(letter)(values) for letter in "ABE")
    block = jnp.zeros((3, 3)).at[:2, :2].set(A).at[:2, 2].set(B @ u + E @ d)
    return (expm(gust.STEP * block) @ jnp.append(x, 1.0))[:2]
