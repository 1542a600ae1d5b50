"""Courses between cones, the preview driver, and the closed loop on a linear single track that knows its place."""

import dataclasses
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from luenberger.core import BadInput, Trajectory
from luenberger.simulate import Model, simulate
from luenberger.vehicle import VehicleParameters, carmaker_car, wang_car
from luenberger.vehicle.driver import (
    ClosedLoop,
    Course,
    PreviewDriver,
    SpeedKeeper,
    closed_loop,
    iso_3888_1,
    iso_3888_2,
)
from luenberger.vehicle.manoeuvres import Constant, HalfCosine

SPEED = 80 / 3.6
BODY = {"width": 1.6, "front": 2.0, "rear": 2.2}


class PlacedTrack(eqx.Module):
    """Linear single track with its place on the road; what is asked is done at once."""

    car: VehicleParameters = eqx.field(static=True)
    states: ClassVar[tuple[str, ...]] = ("position_x", "position_y", "yaw", "speed", "lateral_speed", "yaw_rate")
    inputs: ClassVar[tuple[str, ...]] = ("acceleration_demand", "steering_demand")
    outputs: ClassVar[tuple[str, ...]] = ("lateral_acceleration",)
    units: ClassVar[dict[str, str]] = {"lateral_acceleration": "m/s^2"}
    name: ClassVar[str] = "placed track"

    def forces(self, x: Any, u: Any) -> tuple[Any, Any]:
        a, b, vx = self.car.front_axle_distance, self.car.rear_axle_distance, x[3]
        front, rear = u[1] - (x[4] + a * x[5]) / vx, -(x[4] - b * x[5]) / vx
        return self.car.front_stiffness * front, self.car.rear_stiffness * rear

    def dynamics(self, t: Any, x: Any, u: Any, r: Any) -> jax.Array:
        Ff, Fr = self.forces(x, u)
        sine, cosine, car = jnp.sin(x[2]), jnp.cos(x[2]), self.car
        return jnp.stack(
            [
                *(x[3] * cosine - x[4] * sine, x[3] * sine + x[4] * cosine, x[5], u[0]),
                (Ff + Fr) / car.mass - x[3] * x[5],
                (car.front_axle_distance * Ff - car.rear_axle_distance * Fr) / car.yaw_inertia,
            ]
        )

    def output(self, t: Any, x: Any, u: Any, r: Any) -> jax.Array:
        Ff, Fr = self.forces(x, u)
        return ((Ff + Fr) / self.car.mass)[None]


def loop_of(course: Course | None = None, car: VehicleParameters = wang_car, **driver: float) -> ClosedLoop:
    course = iso_3888_1(BODY["width"]) if course is None else course
    return closed_loop(PlacedTrack(car), PreviewDriver.of(car, **driver), course, SpeedKeeper(Constant(SPEED)))


def drive(loop: ClosedLoop, speed: float = SPEED, seconds: float = 7.5) -> Trajectory:
    start = loop.start([0, 0, 0, speed, 0, 0])
    return simulate(loop, time=np.linspace(0, seconds, 751), x0=start, rtol=1e-8, atol=1e-8)


def margin(drive: Trajectory, course: Course) -> float:
    places = (drive[name].values for name in ("position_x", "position_y", "yaw"))
    return float(jax.vmap(lambda x, y, yaw: course.clearance(x, y, yaw, **BODY))(*places).min())


def test_the_lanes_have_the_printed_sizes() -> None:
    w = 1.8
    lanes = np.asarray(iso_3888_1(w).lanes)
    np.testing.assert_allclose(np.diff(lanes[:, :2].ravel()), [15, 30, 25, 25, 30])
    np.testing.assert_allclose(lanes[:, 3] - lanes[:, 2], [1.1 * w + 0.25, 1.2 * w + 0.25, 1.3 * w + 0.25])
    np.testing.assert_allclose(lanes[:, 2], [0, 3.5, 0])
    avoid = np.asarray(iso_3888_2(w).lanes)
    np.testing.assert_allclose(np.diff(avoid[:, :2].ravel()), [12, 13.5, 11, 12.5, 12])
    assert float(iso_3888_2(w).length) == 61.0
    np.testing.assert_allclose(avoid[:, 3] - avoid[:, 2], [1.1 * w + 0.25, w + 1, 3.0])
    assert avoid[1, 2] - avoid[0, 3] == pytest.approx(1.0)


@pytest.mark.parametrize("make", [iso_3888_1, iso_3888_2])
def test_the_path_is_smooth_and_leads_a_car_between_the_cones(make) -> None:
    course = make(BODY["width"])
    x = np.linspace(-30, float(course.length) + 30, 4001)
    y = course.lateral(x)
    slope = (course.lateral(x + 1e-5) - course.lateral(x - 1e-5)) / 2e-5
    # Central differences: 1e-10 / 6 of a third derivative below 1 / m^2, and rounding 1e-15 / 1e-5.
    np.testing.assert_allclose(np.tan(course.heading(x)), slope, atol=1e-9)
    # Bounded second differences: curvature below 0.1 / m is what 15 m/s can bear, a kink would show as 1 / step.
    assert np.abs(np.diff(y, 2)).max() / (x[1] - x[0]) ** 2 < 0.1
    free = jax.vmap(lambda *pose: course.clearance(*pose, **BODY))(x, y, course.heading(x))
    assert float(free.min()) > 0.05


def test_clearance_measures_sides_and_ends_of_the_car() -> None:
    course = iso_3888_1(2.0)
    # First lane 2.45 m wide: a car of 1.6 m in its middle has 0.425 m each side.
    assert float(course.clearance(7.0, 1.225, 0.0, **BODY)) == pytest.approx(0.425)
    assert float(course.clearance(7.0, 0.7, 0.0, **BODY)) == pytest.approx(-0.1)
    # Turned by 0.1 rad the front left corner stands out by 2 sin 0.1 and the rear right one by 2.2 sin 0.1.
    wide = 1.225 - 2.2 * np.sin(0.1) - 0.8 * np.cos(0.1)
    assert float(course.clearance(7.0, 1.225, 0.1, **BODY)) == pytest.approx(wide)
    assert float(course.clearance(30.0, 1.225, 0.0, **BODY)) == np.inf


def test_the_driver_passes_the_double_lane_change_at_80_km_h() -> None:
    loop = loop_of()
    driven = drive(loop)
    assert driven["position_x"].values[-1] > 125 + BODY["rear"]
    # Measured 0.040 m with a solver good to a micrometre; the rest is room for another choice of looks.
    assert margin(driven, loop.course) > 0.03
    # The path error that the loop reports is the distance from the path, and steering is bounded by what the driver may ask.
    wanted = driven["position_y"].values - np.asarray(loop.course.lateral(driven["position_x"].values))
    np.testing.assert_allclose(driven["path_error"].values, wanted, atol=1e-13)
    assert np.abs(driven["hands"].values).max() < 0.1


@pytest.mark.parametrize(
    "driver",
    [{"gain": 0.2}, {"gain": -1.0}, {"preview": 1.2}, {"preview": 2.0}],
    ids=lambda d: ",".join(f"{k}={v}" for k, v in d.items()),
)
def test_a_bad_driver_leaves_the_lanes(driver: dict[str, float]) -> None:
    loop = loop_of(None, wang_car, **driver)
    assert margin(drive(loop), loop.course) < -0.2


class ShortSighted(PreviewDriver):
    """Takes the path beside the car for the path ahead."""

    def steering(self, course: Course, pose: Any, hands: Any = 0.0) -> jax.Array:
        beside = course.lateral(pose[0])
        lane = jnp.array([0.0, 1.0, 0.0, 0.0]) + jnp.array([0.0, 0.0, 1.0, 1.0]) * beside
        flat = Course("beside", jnp.stack([lane, lane + jnp.array([5.0, 5.0, 0.0, 0.0])]), 0.1)
        return super().steering(flat, pose, hands)


def test_a_driver_without_preview_leaves_the_lanes() -> None:
    knows = PreviewDriver.of(wang_car)
    blind = ShortSighted(**{f.name: getattr(knows, f.name) for f in dataclasses.fields(knows)})
    loop = closed_loop(PlacedTrack(wang_car), blind, iso_3888_1(BODY["width"]), SpeedKeeper(Constant(SPEED)))
    assert margin(drive(loop), loop.course) < -0.2


def test_the_driver_passes_the_obstacle_avoidance() -> None:
    loop = loop_of(iso_3888_2(BODY["width"]), preview=0.4)
    loop = eqx.tree_at(lambda k: k.pedals.plan.level, loop, jnp.asarray(50 / 3.6))
    driven = drive(loop, speed=50 / 3.6)
    assert driven["position_x"].values[-1] > 61 + BODY["rear"]
    assert margin(driven, loop.course) > 0.02


def test_the_driver_asks_for_nothing_on_the_path_and_turns_towards_it() -> None:
    course, driver = iso_3888_1(1.8), PreviewDriver.of(carmaker_car)
    middle = float(course.lateral(-40.0))
    ask = lambda y, yaw: float(driver.steering(course, jnp.array([-40.0, y, yaw, SPEED, 0.0, 0.0])))  # noqa: E731
    assert ask(middle, 0.0) == pytest.approx(0.0, abs=1e-14)
    assert ask(middle - 0.5, 0.0) > 0.01
    assert ask(middle + 0.5, 0.0) == pytest.approx(-ask(middle - 0.5, 0.0), rel=1e-9)
    assert ask(middle, 0.05) < -0.01
    assert ask(middle - 1e3, 0.0) == 0.5


def test_the_prediction_is_that_of_the_linear_car() -> None:
    driver, track = PreviewDriver.of(wang_car, preview=0.6, lag=0.15), PlacedTrack(wang_car)
    vy, rate, hands = 0.3, -0.2, 0.02

    def ahead(asked: float) -> np.ndarray:
        def rate_of(t: Any, x: Any, u: Any, r: Any) -> jax.Array:
            dx = track.dynamics(t, x[:6], jnp.stack([0.0 * t, x[6]]), r)
            # Small angles: lateral place in the first direction of the car.
            dx = dx.at[1].set(x[3] * x[2] + x[4])
            return jnp.append(dx, (asked - x[6]) / 0.15)

        from_here = np.array([0.0, 0.0, 0.0, SPEED, vy, rate, hands])
        rows, steps = [from_here], 1200
        h = 0.6 / steps
        f = jax.jit(lambda x: rate_of(0.0, x, None, None))
        for _ in range(steps):
            x = rows[-1]
            rows.append(x + h * np.asarray(f(x + h / 2 * np.asarray(f(x)))))
        return np.array(rows)[steps // 12 :: steps // 12, 1]

    coasting, reach = driver._predicted(SPEED, jnp.array([0.0, 0.0, vy, rate, hands]))
    # Twelve steps of 0.05 s by the trapezoidal rule against modes of 7 1/s: one part in a hundred of the reach.
    np.testing.assert_allclose(coasting, ahead(0.0), atol=2e-3)
    np.testing.assert_allclose(reach, ahead(1.0) - ahead(0.0), atol=0.01 * float(reach[-1]))


def test_pedals_follow_a_plan_within_their_limits() -> None:
    pedals = SpeedKeeper(HalfCosine(20.0, 10.0, 1.0, 4.0), gain=2.0, braking=6.0, driving=2.0)
    assert float(pedals.acceleration(3.0, pedals.plan.value(3.0))) == pytest.approx(-np.pi * 10 / 8)
    assert float(pedals.acceleration(0.0, 19.5)) == pytest.approx(1.0)
    assert float(pedals.acceleration(0.0, 30.0)) == -6.0
    assert float(pedals.acceleration(0.0, 10.0)) == 2.0
    loop = eqx.tree_at(lambda k: k.pedals, loop_of(), SpeedKeeper(HalfCosine(SPEED, 15.0, 1.0, 4.0)))
    driven = drive(loop)
    wanted = jax.vmap(loop.pedals.plan.value)(driven.time)
    # The car does at once what it is asked, so the feedback has nothing to do beyond the tolerance of the solver.
    np.testing.assert_allclose(driven["speed"].values, wanted, atol=1e-6)


def test_the_loop_is_a_model_and_a_batch_of_drivers_a_vmap() -> None:
    loop = loop_of()
    assert isinstance(loop, Model)
    assert loop.units["hands"] == "rad"
    assert loop.name == "placed track on ISO 3888-1"
    x = loop.start([0, 0, 0, SPEED, 0, 0], before=-20.0)
    gains = jnp.array([0.5, 1.0])
    rates = jax.jit(
        jax.vmap(lambda gain: eqx.tree_at(lambda k: k.driver.gain, loop, gain).dynamics(0.0, x.at[1].add(-0.1)))
    )(gains)
    assert rates.shape == (2, 7)
    assert float(rates[1, 6]) == pytest.approx(2 * float(rates[0, 6]), rel=1e-12)


def test_a_car_without_a_place_is_refused() -> None:
    class Lost(PlacedTrack):
        states: ClassVar[tuple[str, ...]] = ("speed", "lateral_speed", "yaw_rate")

    class Stiff(PlacedTrack):
        inputs: ClassVar[tuple[str, ...]] = ("steering_demand",)

    others = PreviewDriver.of(wang_car), iso_3888_1(1.6), SpeedKeeper(Constant(SPEED))
    with pytest.raises(BadInput, match="has no state position_x, position_y, yaw"):
        closed_loop(Lost(wang_car), *others)
    with pytest.raises(BadInput, match="are needed"):
        closed_loop(Stiff(wang_car), *others)


def test_impossible_numbers_are_refused() -> None:
    for wrong in (lambda: iso_3888_1(0.0), lambda: iso_3888_2(-1.0), lambda: PreviewDriver.of(wang_car, preview=0.0)):
        with pytest.raises(BadInput, match="is needed"):
            wrong()
