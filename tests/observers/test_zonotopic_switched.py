"""Zonotopic observers of a car in the wind: the gust is bounded instead of decoupled, over three speeds or all of them."""

from functools import cache
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from luenberger.core import BadInput, NotAccepted
from luenberger.observers.observer import Estimate
from luenberger.observers.zonotopic import (
    ZonotopicFilter,
    ZonotopicKalmanFilter,
    ZonotopicLuenberger,
    ZonotopicObserver,
)
from luenberger.observers.zonotopic_strips import ZonotopicStripFilter
from luenberger.sets import Zonotope
from luenberger.systems import System
from luenberger.systems.discretize import discretize
from luenberger.systems.switched import Switched
from luenberger.vehicle import gust_car, wind_plant

SPEEDS, ENDS = (8.5, 13.55, 18.05), (6.0, 11.0, 16.0, 19.899)
OPTIONS: dict[str, Any] = {"initial_half_width": [0.2, 0.1], "count": 20}
RUNS, STEPS, SETTLED = 18, 200, 20
DRIVES = ("random", "constant", "vertices")


@cache
def scheduled(gust: float, steering_error: float = 0.0, speed_error: float = 0.0) -> System:
    stiffness = ((54e3, 66e3), (58.5e3, 71.5e3))
    plant = wind_plant(
        gust_car, (6.0, 19.9), gust_arm=0.4, stiffness=stiffness, yaw_rate_noise=0.005, steering_error=steering_error,
        speed_error=speed_error, gust_bound=gust,
    )  # fmt: skip
    return discretize(plant, 0.06, "euler")


def three_speeds(gust: float, steering_error: float = 0.0) -> Switched:
    plant = scheduled(gust, steering_error)
    return Switched.of([plant.freeze(speed=v, inverse_speed=1 / v) for v in SPEEDS], "speed", ENDS, unit="m/s")


def driven(plant: System, kind: str, switched: bool) -> tuple[jax.Array, ...]:
    """States, measured inputs, outputs and r of a weaving car whose speed passes through all modes."""
    draw = np.random.default_rng(DRIVES.index(kind)).uniform(-1, 1, (RUNS, STEPS, 6))
    if kind == "constant":
        draw[:] = np.sign(draw[:, :1])
    elif kind == "vertices":
        draw = np.sign(draw)
    time = 0.06 * np.arange(STEPS)
    speed = 13.0 + 6.5 * np.sin(2 * np.pi * time / 12)
    held = np.array(SPEEDS)[np.searchsorted(ENDS[1:-1], speed, side="right")] if switched else speed
    error = plant.parameters[0].error
    polynomials = {k: plant.polynomial(k) for k in "ABCEGN"}
    disturbance, noise = np.array(plant.disturbance_bound), np.array(plant.noise_bound)

    def one(x: jax.Array, now: Any) -> tuple[jax.Array, Any]:
        s, v, t = now
        unknown = {"front_stiffness": 60e3 + 6e3 * s[0], "rear_stiffness": 65e3 + 6.5e3 * s[1]}
        values = {"speed": v, "inverse_speed": 1 / v, **unknown}
        A, B, C, E, G, N = (m({n: values[n] for n in m.names}) for m in polynomials.values())
        true = jnp.array([0.03 * jnp.sin(2 * jnp.pi * 0.3 * t)])
        read = v + error * s[5]
        r = now[1:2] if switched else jnp.array([read, 1 / read])
        return A @ x + B @ true + E @ (s[2:3] * disturbance), (
            x,
            true + N @ (s[3:5] * noise),
            C @ x + G @ (s[3:5] * noise),
            r,
        )

    def whole(s: jax.Array) -> Any:
        return jax.lax.scan(one, jnp.array([0.2, 0.1]) * s[0, :2], (s, held, time))[1]

    return jax.jit(jax.vmap(whole))(draw)


@eqx.filter_jit
def stepped(observer: ZonotopicObserver, start: Any, u: Any, y: Any, r: Any) -> tuple[Zonotope, Estimate]:
    return observer.step(observer.init(start), u, y, r)


@eqx.filter_jit
def run(observer: ZonotopicObserver, u: Any, y: Any, r: Any) -> Estimate:
    def advance(state: Zonotope, now: Any) -> tuple[Zonotope, Estimate]:
        return observer.step(state, *now)

    return jax.lax.scan(advance, observer.init(jnp.zeros(2)), (u, y, r))[1]


def seen(observer: ZonotopicObserver, runs: tuple[jax.Array, ...]) -> tuple[float, float]:
    """How far any run leaves its box, and the mean width of the lateral speed [m/s]."""
    x, u, y, r = runs
    box = eqx.filter_vmap(run, in_axes=(None, 0, 0, 0))(observer, u, y, r)
    low, high = np.asarray(box.lower), np.asarray(box.upper)
    return float(np.maximum(low - x, x - high).max()), float((high - low)[:, SETTLED:, 0].mean())


# Mean widths of the lateral speed that a zonotopic Kalman filter with the current output is known to reach on this car.
WIDTHS = {50.0: 0.065, 200.0: 0.092, 500.0: 0.131, 1000.0: 0.175}


@pytest.mark.parametrize("gust", WIDTHS)
def test_the_width_follows_the_bound_of_the_gust(gust: float) -> None:
    plant = scheduled(gust)
    apart, width = seen(ZonotopicFilter(plant, **OPTIONS), driven(plant, "random", switched=False))
    assert apart <= 1e-12
    # The drive behind those numbers is not known to the last detail, and the factors follow the drive.
    assert width == pytest.approx(WIDTHS[gust], rel=0.05)


@pytest.mark.parametrize("kind", DRIVES)
def test_the_state_never_leaves_its_box(kind: str) -> None:
    # 18 runs a kind, each with three speeds, all speeds, and a speed that is measured with error.
    for switched, speed_error in ((True, 0.0), (False, 0.0), (False, 0.2)):
        plant = scheduled(500.0, 0.01, speed_error)
        given = three_speeds(500.0, 0.01) if switched else plant
        runs = driven(plant, kind, switched)
        for make in (ZonotopicKalmanFilter, ZonotopicFilter):
            assert seen(make(given, **OPTIONS), runs)[0] <= 1e-12


def test_one_speed_in_place_of_all_is_broken() -> None:
    # The containment above would see the wrong mode: here the modes are in reverse order.
    plants = three_speeds(500.0, 0.01)
    wrong = Switched.of(plants.modes[::-1], "speed", ENDS, unit="m/s")
    assert seen(ZonotopicFilter(wrong, **OPTIONS), driven(scheduled(500.0, 0.01), "constant", switched=True))[0] > 1e-3


@pytest.mark.parametrize(("mode", "speed"), [(0, 6.5), (1, 11.0), (2, 19.0), (2, 25.0)])
def test_a_step_is_that_of_the_mode_that_holds(mode: int, speed: float) -> None:
    plant = three_speeds(200.0, 0.01)
    gains = [[[0.1 * k], [0.5]] for k in (1.0, 2.0, 3.0)]
    start = Zonotope.of([0.1, -0.2], np.diag([0.3, 0.1]))
    u, y = np.array([0.02]), np.array([-0.1])
    pairs = [
        (ZonotopicLuenberger(plant, gains, **OPTIONS), ZonotopicLuenberger(plant.modes[mode], gains[mode], **OPTIONS)),
        (
            ZonotopicStripFilter(plant, gains, **OPTIONS),
            ZonotopicStripFilter(plant.modes[mode], gains[mode], **OPTIONS),
        ),
        (ZonotopicFilter(plant, **OPTIONS), ZonotopicFilter(plant.modes[mode], **OPTIONS)),
    ]
    for whole, single in pairs:
        ours = stepped(whole, start, u, y, np.array([speed]))
        theirs = stepped(single, start, u, y, np.zeros(0))
        for a, b in zip(jax.tree.leaves(ours), jax.tree.leaves(theirs), strict=True):
            np.testing.assert_allclose(a, b, rtol=1e-13, atol=1e-15)


def test_modes_may_differ_in_what_is_unknown() -> None:
    plant = scheduled(200.0)
    frozen = [plant.freeze(speed=v, inverse_speed=1 / v) for v in SPEEDS]
    modes = [
        frozen[0],
        frozen[1].freeze(front_stiffness=60e3),
        frozen[2].freeze(front_stiffness=60e3, rear_stiffness=65e3),
    ]
    observer = ZonotopicFilter(Switched.of(modes, "speed", ENDS, unit="m/s"), **OPTIONS)
    start = Zonotope.of([0.1, -0.2], np.diag([0.3, 0.1]))
    for k, v in enumerate(SPEEDS):
        single = ZonotopicFilter(modes[k], **OPTIONS)
        ours = stepped(observer, start, np.zeros(1), np.zeros(1), np.array([v]))[0]
        theirs = stepped(single, start, np.zeros(1), np.zeros(1), np.zeros(0))[0]
        np.testing.assert_allclose(ours.interval().upper, theirs.interval().upper, rtol=1e-13)


def test_plants_and_gains_that_do_not_fit_are_refused() -> None:
    plant = three_speeds(200.0)
    with pytest.raises(BadInput, match="2 gains but"):
        ZonotopicLuenberger(plant, [[[0.1], [0.5]]] * 2, **OPTIONS)
    with pytest.raises(BadInput, match="a guarantee needs bounds"):
        ZonotopicFilter([m.replace(disturbance_bound=None) for m in plant.modes], **OPTIONS)
    with pytest.raises(BadInput, match="noise in every output"):
        ZonotopicFilter([plant.modes[0], plant.modes[1].replace(G=[[0.0, 0.0]])], **OPTIONS)
    with pytest.raises(NotAccepted, match="continuous"):
        ZonotopicFilter([m.replace(dt=None) for m in plant.modes], **OPTIONS)
