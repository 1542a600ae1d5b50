"""A driver who follows a course between cones, and the closed loop of driver and car.

loop = closed_loop(car, PreviewDriver.of(wang_car), course, SpeedKeeper(Constant(80 / 3.6)))
drive = simulate(loop, time=..., x0=loop.start(...))
"""

from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp

from luenberger.core import BadInput
from luenberger.vehicle.manoeuvres import Profile
from luenberger.vehicle.parameters import VehicleParameters
from luenberger.vehicle.tyres import Number

# Below this speed [m/s] the driver predicts as at this speed.
LEAST_SPEED = 2.0
# Points on the path that the driver looks at, evenly spread over the preview time.
LOOKS = 12


def _leaf(value: Any) -> jax.Array:
    return jnp.asarray(value, dtype=float)


def _number() -> Any:
    return eqx.field(converter=_leaf)


class Course(eqx.Module):
    """Lanes between cones, and a smooth path through their middles.

    Between two lanes the path is a polynomial of fifth order, whose slope and curvature vanish at both ends. It begins and ends
    inside the lanes: `ease` of its length lies in each, which uses their free width and lowers the curvature.

    Args:
        name: how the course is called.
        lanes: (first x, last x, right edge y, left edge y) [m] of each lane, in the order they are driven.
        ease: share of the length of a change that lies within a lane, from 0 to less than 1/2.
    """

    name: str = eqx.field(static=True)
    lanes: jax.Array = _number()
    ease: Number = _number()

    def lateral(self, x: Any) -> jax.Array:
        """Return y [m] of the path at x [m], any shape."""
        middle = 0.5 * (self.lanes[:, 2] + self.lanes[:, 3])
        gap = self.lanes[1:, 0] - self.lanes[:-1, 1]
        length = gap / (1 - 2 * self.ease)
        s = jnp.clip((_leaf(x)[..., None] - self.lanes[:-1, 1] + self.ease * length) / length, 0.0, 1.0)
        return middle[0] + jnp.sum(jnp.diff(middle) * s**3 * (10 - 15 * s + 6 * s**2), axis=-1)

    def heading(self, x: Any) -> jax.Array:
        """Return the direction of the path [rad] at x [m], any shape."""
        place = _leaf(x)
        return jnp.arctan(jax.jvp(self.lateral, (place,), (jnp.ones_like(place),))[1])

    @property
    def length(self) -> jax.Array:
        """End of the last lane [m]."""
        return self.lanes[-1, 1]

    def clearance(self, x: Any, y: Any, yaw: Any, *, width: float, front: float, rear: float) -> jax.Array:
        """Return the least distance [m] of the sides of the car from the edges of the lanes; negative where a cone falls.

        Edges count as lines from the first to the last cone of a lane, which is stricter than the cones. Infinite where no part of
        the car is within a lane.

        Args:
            x: place of the centre of gravity [m].
            y: likewise [m].
            yaw: heading of the car [rad].
            width: of the car [m].
            front: from the centre of gravity to the front end [m].
            rear: from the centre of gravity to the rear end [m].
        """
        along = jnp.linspace(-rear, front, 9)[:, None]
        across = jnp.array([-0.5, 0.5]) * width
        place_x = (x + along * jnp.cos(yaw) - across * jnp.sin(yaw))[..., None]
        place_y = (y + along * jnp.sin(yaw) + across * jnp.cos(yaw))[..., None]
        first, last, right, left = self.lanes.T
        free = jnp.minimum(place_y - right, left - place_y)
        return jnp.min(jnp.where((place_x >= first) & (place_x <= last), free, jnp.inf))


def iso_3888_1(car_width: float, *, ease: float = 0.12) -> Course:
    """Return the double lane change: lanes of 15, 25 and 30 m, gaps of 30 and 25 m, offset of 3.5 m to the left.

    Args:
        car_width: width of the car without mirrors [m].
        ease: see `Course`.

    Raises:
        BadInput: a width that is not positive.

    Reference: ISO 3888-1, Test track for a severe lane-change manoeuvre, double lane-change: widths 1.1 w + 0.25, 1.2 w + 0.25,
        1.3 w + 0.25 m. The offset is taken between right edges, as published simulation programs do.
    """
    _positive("car_width", car_width)
    first, second, third = (share * car_width + 0.25 for share in (1.1, 1.2, 1.3))
    lanes = ((0.0, 15.0, 0.0, first), (45.0, 70.0, 3.5, 3.5 + second), (95.0, 125.0, 0.0, third))
    return Course("ISO 3888-1", _leaf(lanes), ease)


def iso_3888_2(car_width: float, *, ease: float = 0.12) -> Course:
    """Return the obstacle avoidance: lanes of 12, 11 and 12 m, gaps of 13.5 and 12.5 m, 1 m between first and second lane.

    Args:
        car_width: width of the car without mirrors [m].
        ease: see `Course`.

    Raises:
        BadInput: a width that is not positive.

    Reference: ISO 3888-2 (2011), Test track for a severe lane-change manoeuvre, obstacle avoidance: widths 1.1 w + 0.25, w + 1,
        3 m; right edges of the outer lanes are taken in line.
    """
    _positive("car_width", car_width)
    first = 1.1 * car_width + 0.25
    lanes = ((0.0, 12.0, 0.0, first), (25.5, 36.5, first + 1.0, first + 2.0 + car_width), (49.0, 61.0, 0.0, 3.0))
    return Course("ISO 3888-2", _leaf(lanes), ease)


class PreviewDriver(eqx.Module):
    """Holds the one steering angle that would bring the car nearest to the path ahead, and thinks again at every instant.

        min over d of the sum of (path(s) - y(s; d))^2 over s in the preview time,   demand = gain d

    y(s; d) is the lateral place of a linear single track that starts from the state of the car and is asked for the constant
    road-wheel angle d. The hands follow the demand with a lag of first order, which stands for reaction and muscles and which
    the driver knows of; a real delay is left out. The shorter the preview, the closer the path and the harder the turns: on
    ISO 3888-1 at 80 km/h 5 m/s^2 with 0.7 s, 8 with 0.5 s and 9 with 0.2 s; saturating tyres want 0.7 to 0.8 s.

    Args:
        mass: m [kg]; this and the next five are the car as the driver knows it.
        yaw_inertia: Iz [kg m^2].
        front_axle_distance: a [m].
        rear_axle_distance: b [m].
        front_stiffness: Cf [N/rad].
        rear_stiffness: Cr [N/rad].
        gain: 1 for the minimum.
        preview: preview time [s].
        lag: time constant of the hands [s].
        limit: greatest road-wheel angle asked for [rad].

    Reference: C. MacAdam, Application of an optimal preview control for simulation of closed-loop automobile driving (1981),
        IEEE Trans. Syst. Man Cybern. 11(6); there with a pure delay in place of the lag.
    """

    mass: Number = _number()
    yaw_inertia: Number = _number()
    front_axle_distance: Number = _number()
    rear_axle_distance: Number = _number()
    front_stiffness: Number = _number()
    rear_stiffness: Number = _number()
    gain: Number = _number()
    preview: Number = _number()
    lag: Number = _number()
    limit: Number = _number()

    @staticmethod
    def of(
        car: VehicleParameters, *, gain: float = 1.0, preview: float = 0.7, lag: float = 0.1, limit: float = 0.5
    ) -> "PreviewDriver":
        """Return a driver who knows the linear single track of a car; other arguments as in the class.

        Raises:
            BadInput: a preview, lag or limit that is not positive.
        """
        for word, value in (("preview", preview), ("lag", lag), ("limit", limit)):
            _positive(word, value)
        lengths, stiffness = (
            (car.front_axle_distance, car.rear_axle_distance),
            (car.front_stiffness, car.rear_stiffness),
        )
        return PreviewDriver(car.mass, car.yaw_inertia, *lengths, *stiffness, gain, preview, lag, limit)

    def steering(self, course: Course, pose: Any, hands: Any = 0.0) -> jax.Array:
        """Return the road-wheel angle [rad] the driver asks for.

        Args:
            course: path to follow.
            pose: (x [m], y [m], yaw [rad], vx [m/s], vy [m/s], yaw rate [rad/s]).
            hands: angle the hands hold now [rad].
        """
        x, y, yaw, vx, vy, rate = (_leaf(pose[k]) for k in range(6))
        ahead = self.preview * jnp.arange(1, LOOKS + 1) / LOOKS
        away = (vx * jnp.cos(yaw) - vy * jnp.sin(yaw)) * ahead
        aside = (course.lateral(x + away) - y) * jnp.cos(yaw) - away * jnp.sin(yaw)
        now = jnp.stack([jnp.zeros(()), jnp.zeros(()), vy, rate, _leaf(hands)])
        coasting, reach = self._predicted(jnp.maximum(vx, LEAST_SPEED), now)
        demand = self.gain * jnp.sum((aside - coasting) * reach) / jnp.sum(reach**2)
        return jnp.clip(demand, -self.limit, self.limit)

    def _predicted(self, speed: Any, now: Any) -> tuple[jax.Array, jax.Array]:
        """Lateral place at each look if nothing is asked for, and what one radian asked for adds."""
        m, Iz, a, b = self.mass, self.yaw_inertia, self.front_axle_distance, self.rear_axle_distance
        Cf, Cr, v = self.front_stiffness, self.rear_stiffness, speed
        turn = (b * Cr - a * Cf) / v
        A = [
            [0.0, v, 1.0, 0.0, 0.0],
            [0.0, 0.0, 0.0, 1.0, 0.0],
            [0.0, 0.0, -(Cf + Cr) / (m * v), turn / m - v, Cf / m],
            [0.0, 0.0, turn / Iz, -(a * a * Cf + b * b * Cr) / (Iz * v), a * Cf / Iz],
            [0.0, 0.0, 0.0, 0.0, -1.0 / self.lag],
        ]
        half = 0.5 * self.preview / LOOKS * jnp.array(A)
        # The trapezoidal rule stays stable where the car is slow and its modes are fast.
        step = jnp.linalg.solve(jnp.eye(5) - half, jnp.eye(5) + half)
        asked = jnp.linalg.solve(jnp.eye(5) - half, jnp.zeros(5).at[4].set(self.preview / LOOKS / self.lag))
        pushes = jnp.stack([jnp.zeros(5), asked], axis=1)

        def advance(states: Any, _: Any) -> tuple[Any, Any]:
            states = step @ states + pushes
            return states, states[0]

        places = jax.lax.scan(advance, jnp.stack([now, jnp.zeros(5)], axis=1), length=LOOKS)[1]
        return places[:, 0], places[:, 1]


class SpeedKeeper(eqx.Module):
    """Pedals that hold a planned speed: acceleration = planned rate + gain (planned speed - vx), within the limits.

    Args:
        plan: profile of vx [m/s].
        gain: [1/s].
        braking: greatest deceleration asked for [m/s^2], positive.
        driving: greatest acceleration asked for [m/s^2], positive.
    """

    plan: Profile
    gain: Number = eqx.field(converter=_leaf, default=2.0)
    braking: Number = eqx.field(converter=_leaf, default=8.0)
    driving: Number = eqx.field(converter=_leaf, default=3.0)

    def acceleration(self, t: Any, speed: Any) -> jax.Array:
        """Return the acceleration asked for [m/s^2] at a time [s] and a speed [m/s]."""
        wanted = self.plan.rate(t) + self.gain * (self.plan.value(t) - speed)
        return jnp.clip(wanted, -self.braking, self.driving)


class ClosedLoop(eqx.Module):
    """Driver and car as one model without inputs, which `simulate` takes; made by `closed_loop`.

    Its states are those of the car and `hands`, the road-wheel angle that the driver asks for after the lag; to the outputs of the
    car it adds what the driver asked and how far the car is from the path, to the left.

    Args:
        car: the model that is driven.
        driver: turns the wheel.
        course: path to follow.
        pedals: hold the speed.
    """

    POSE: ClassVar[tuple[str, ...]] = ("position_x", "position_y", "yaw", "speed", "lateral_speed", "yaw_rate")
    DEMANDS: ClassVar[tuple[str, ...]] = ("steering_demand", "acceleration_demand")

    car: Any
    driver: PreviewDriver
    course: Course
    pedals: SpeedKeeper
    inputs: tuple[str, ...] = eqx.field(static=True, default=(), init=False)
    scheduling_names: tuple[str, ...] = eqx.field(static=True, default=(), init=False)
    dt: float | None = eqx.field(static=True, default=None, init=False)

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states."""
        return (*self.car.states, "hands")

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs."""
        return (*self.car.outputs, *self.DEMANDS, "path_error")

    @property
    def units(self) -> dict[str, str]:
        """Units of states and outputs."""
        own = {"hands": "rad", "steering_demand": "rad", "acceleration_demand": "m/s^2", "path_error": "m"}
        return {**self.car.units, **own}

    @property
    def name(self) -> str:
        """Name of the loop."""
        return f"{self.car.name} on {self.course.name}"

    def dynamics(self, t: Any, x: Any, u: Any = None, r: Any = None) -> jax.Array:
        """Return the time derivative of the state; t [s], u and r are not used."""
        rate = self.car.dynamics(t, x[:-1], self._asked(t, x), jnp.zeros(0))
        hands = (self.driver.steering(self.course, self._pose(x), x[-1]) - x[-1]) / self.driver.lag
        return jnp.concatenate([jnp.asarray(rate), hands[None]])

    def output(self, t: Any, x: Any, u: Any = None, r: Any = None) -> jax.Array:
        """Return the outputs; arguments as in `dynamics`."""
        asked, pose = self._asked(t, x), self._pose(x)
        seen = self.car.output(t, x[:-1], asked, jnp.zeros(0))
        return jnp.concatenate([jnp.asarray(seen), asked, (pose[1] - self.course.lateral(pose[0]))[None]])

    def start(self, car_state: Any, before: float = 20.0) -> jax.Array:
        """Return the state with the car on the path, heading along it, some way before the first lane.

        Args:
            car_state: state of the car; its position and yaw are replaced, shape (nx,).
            before: distance of the first lane [m].
        """
        place = self.course.lanes[0, 0] - before
        pose = jnp.stack([place, self.course.lateral(place), self.course.heading(place)])
        index = jnp.array([self.car.states.index(name) for name in self.POSE[:3]])
        return jnp.append(_leaf(car_state).at[index].set(pose), 0.0)

    def _pose(self, x: Any) -> jax.Array:
        return jnp.stack([x[self.car.states.index(name)] for name in self.POSE])

    def _asked(self, t: Any, x: Any) -> jax.Array:
        acceleration = self.pedals.acceleration(t, x[self.car.states.index("speed")])
        asked = {"steering_demand": x[-1], "acceleration_demand": acceleration}
        return jnp.stack([asked[name] for name in self.car.inputs])


def closed_loop(car: Any, driver: PreviewDriver, course: Course, pedals: SpeedKeeper) -> ClosedLoop:
    """Return driver and car as one model; its `dynamics(t, x, u, r)` is pure and its numbers can be batched with vmap.

    Args:
        car: model such as `DoubleTrack`: functions `dynamics` and `output` of (t, x, u, r), names `states`, `inputs` and `outputs`,
            `units` and `name`; with the states of `ClosedLoop.POSE` and the inputs of `ClosedLoop.DEMANDS`.
        driver: turns the wheel.
        course: path to follow.
        pedals: hold the speed.

    Raises:
        BadInput: the car lacks a state that the driver sees, or has not just these two inputs.
    """
    lacking = [name for name in ClosedLoop.POSE if name not in car.states]
    if lacking:
        raise BadInput(f"`{car.name}` has no state {', '.join(lacking)}; a driver sees {', '.join(ClosedLoop.POSE)}.")
    if sorted(car.inputs) != sorted(ClosedLoop.DEMANDS):
        raise BadInput(f"`{car.name}` has the inputs {list(car.inputs)}; {list(ClosedLoop.DEMANDS)} are needed.")
    return ClosedLoop(car, driver, course, pedals)


def _positive(word: str, value: float) -> None:
    if not 0 < value < float("inf"):
        raise BadInput(f"`{word}` is {value}; a positive finite number is needed.")
