"""The double track as a truth model: four wheels with load transfer, roll, lagging tyres, actuator and a road below."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from luenberger.vehicle.combined_tyres import LoadedTyre, MagicFormulaCombined
from luenberger.vehicle.double_track_parameters import DoubleTrackParameters
from luenberger.vehicle.parameters import GRAVITY
from luenberger.vehicle.road import Road
from luenberger.vehicle.tyres import Number

# Below this speed [m/s] the slip angle is lateral speed over this speed, and brakes fade out: the car can stand still.
LOW_SPEED = 0.5


class Wheels(NamedTuple):
    """What happens at the four wheels, each of shape (4,) in the order front left, front right, rear left, rear right.

    Args:
        slip: slip angle of the wheel now [rad].
        rolling: speed at which the tyre renews its contact [m/s].
        load: vertical load [N].
        longitudinal: force along the wheel [N].
        lateral: force across the wheel, to the left [N].
        forward: force along the car [N].
        sideward: force across the car, to the left [N].
    """

    slip: jax.Array
    rolling: jax.Array
    load: jax.Array
    longitudinal: jax.Array
    lateral: jax.Array
    forward: jax.Array
    sideward: jax.Array


class DoubleTrack(eqx.Module):
    """Four wheels, roll and load transfer; a model that `simulate` takes, and a pytree that vmap varies.

        m (d vx/dt - w r) = sum Fx      m (d w/dt + vx r) = sum Fy      w = vy - h d phi/dt
        Iz d r/dt = sum (x Fy - y Fx)   Ix d2 phi/dt2 = h sum Fy + m g h phi - K phi - D d phi/dt
        s d alpha'/dt = |v| (alpha - alpha')                             for each wheel, forces from alpha'

    (vx, vy) is the velocity of the road point below the centre of gravity; the body above rolls about it and its own lateral
    speed is w. Choose it to try observers against what their plants leave out. Left out here too: aerodynamics, wheel
    speeds (longitudinal force is demanded and held within the friction), pitch motion beyond a lag of the loads, camber,
    compliance and toe, unsprung mass, and tipping over once both wheels of one side have lifted.

    *Assumes* a flat road; the front wheels steer by one angle. Numbers are leaves: `equinox.tree_at` exchanges them.

    Args:
        parameters: the car.
        road: friction and stiffness factor by place; left out: uniform with the friction of the parameters.
        front_tyre: tyre of one front wheel; left out: Magic Formula with half the axle stiffness at static load.
        rear_tyre: tyre of one rear wheel; left out: likewise.

    Reference: R. Rajamani, Vehicle Dynamics and Control (2012), chapters 2, 8 and 13; H. Pacejka, Tire and Vehicle Dynamics
        (2012), sections 1.3 and 7.2 (relaxation length).
    """

    states: ClassVar[tuple[str, ...]] = (
        *("position_x", "position_y", "yaw", "speed", "lateral_speed", "yaw_rate", "roll", "roll_rate"),
        *("steering", "load_acceleration"),
        *("lagged_slip_front_left", "lagged_slip_front_right", "lagged_slip_rear_left", "lagged_slip_rear_right"),
    )
    inputs: ClassVar[tuple[str, ...]] = ("steering_demand", "acceleration_demand")
    outputs: ClassVar[tuple[str, ...]] = (
        *("yaw_rate", "lateral_acceleration", "longitudinal_acceleration", "acceleration", "lateral_accelerometer"),
        *("sideslip", "body_lateral_speed", "front_slip", "rear_slip", "front_slip_exact", "rear_slip_exact"),
        *("front_force", "rear_force", "front_longitudinal_force", "rear_longitudinal_force"),
        *("load_front_left", "load_front_right", "load_rear_left", "load_rear_right"),
    )
    scheduling_names: ClassVar[tuple[str, ...]] = ()
    units: ClassVar[Mapping[str, str]] = MappingProxyType(
        {"position_x": "m", "position_y": "m", "speed": "m/s", "lateral_speed": "m/s", "body_lateral_speed": "m/s"}
        | dict.fromkeys(("yaw", "roll", "steering", "steering_demand", "sideslip", *states[10:], *outputs[7:11]), "rad")
        | dict.fromkeys(("yaw_rate", "roll_rate"), "rad/s")
        | dict.fromkeys(("load_acceleration", "acceleration_demand", *outputs[1:5]), "m/s^2")
        | dict.fromkeys(outputs[11:], "N")
    )
    dt: ClassVar[None] = None

    name: str = eqx.field(static=True)
    road: Road
    front_tyre: LoadedTyre
    rear_tyre: LoadedTyre
    mass: Number
    yaw_inertia: Number
    front_axle_distance: Number
    rear_axle_distance: Number
    centre_height: Number
    front_track: Number
    rear_track: Number
    roll_inertia: Number
    roll_stiffness: Number
    front_roll_share: Number
    roll_damping: Number
    pitch_lag: Number
    front_relaxation: Number
    rear_relaxation: Number
    steering_lag: Number
    steering_rate: Number
    brake_front_share: Number
    drive_front_share: Number
    longitudinal_share: Number

    def __init__(
        self,
        parameters: DoubleTrackParameters,
        road: Road | None = None,
        front_tyre: LoadedTyre | None = None,
        rear_tyre: LoadedTyre | None = None,
    ):
        usual = magic_formula_wheels(parameters)
        self.name = f"double track of {parameters.car.name}"
        self.road = Road.uniform(parameters.friction) if road is None else road
        self.front_tyre = jax.tree.map(jnp.asarray, usual[0] if front_tyre is None else front_tyre)
        self.rear_tyre = jax.tree.map(jnp.asarray, usual[1] if rear_tyre is None else rear_tyre)
        # Arrays, so that a compiled simulation serves every car.
        for name in ("mass", "yaw_inertia", "front_axle_distance", "rear_axle_distance"):
            setattr(self, name, jnp.asarray(getattr(parameters.car, name)))
        for name in _OWN:
            setattr(self, name, jnp.asarray(getattr(parameters, name)))

    def start(self, speed: float) -> jax.Array:
        """Return the state of straight running at a speed [m/s] from the origin along x, shape (14,)."""
        return jnp.zeros(len(self.states)).at[3].set(speed)

    def dynamics(self, t: Any, x: Any, u: Any, r: Any = None) -> jax.Array:
        """Return the time derivative of the state, shape (14,).

        Args:
            t: time [s], not used.
            x: state in the order of `states`.
            u: (road-wheel angle asked for [rad], acceleration asked for [m/s^2]).
            r: no scheduling, not used.
        """
        x, u = jnp.asarray(x), jnp.asarray(u)
        yaw, vx, vy, rate, roll, roll_rate, steer, shifted = (x[k] for k in range(2, 10))
        wheels = self.wheels(x, u)
        forward, sideward = wheels.forward.sum(), wheels.sideward.sum()
        along, across = self._places()
        springs = self.roll_stiffness * roll + self.roll_damping * roll_rate
        leaning = self.centre_height * (sideward + self.mass * GRAVITY * roll) - springs
        roll_acceleration = leaning / self.roll_inertia
        body = vy - self.centre_height * roll_rate
        turning = (along * wheels.sideward - across * wheels.forward).sum() / self.yaw_inertia
        steer_rate = jnp.clip((u[0] - steer) / self.steering_lag, -self.steering_rate, self.steering_rate)
        relaxation = jnp.repeat(jnp.stack([jnp.asarray(self.front_relaxation), jnp.asarray(self.rear_relaxation)]), 2)
        chassis = [
            vx * jnp.cos(yaw) - vy * jnp.sin(yaw),
            vx * jnp.sin(yaw) + vy * jnp.cos(yaw),
            rate,
            forward / self.mass + body * rate,
            sideward / self.mass - vx * rate + self.centre_height * roll_acceleration,
            turning,
            roll_rate,
            roll_acceleration,
            steer_rate,
            (forward / self.mass - shifted) / self.pitch_lag,
        ]
        return jnp.concatenate([jnp.stack(chassis), wheels.rolling / relaxation * (wheels.slip - x[10:14])])

    def output(self, t: Any, x: Any, u: Any, r: Any = None) -> jax.Array:
        """Return the outputs, shape (19,), arguments as in `dynamics`.

        lateral_acceleration and longitudinal_acceleration are those of the centre of gravity in the axes of the road;
        acceleration is d vx/dt; lateral_accelerometer is what a sensor fixed to the rolling body reads, with its share of
        gravity. front_slip and rear_slip are the small-angle definition of the observers, delta - (vy + a r) / vx and
        -(vy - b r) / vx; the exact ones take the arctangent. Neither lags; the lagged slips of the wheels are states.
        front_force and rear_force are sums over the axle across the wheels.
        """
        x, u = jnp.asarray(x), jnp.asarray(u)
        vx, vy, rate, roll, roll_rate, steer = (x[k] for k in range(3, 9))
        wheels = self.wheels(x, u)
        ax, ay = wheels.forward.sum() / self.mass, wheels.sideward.sum() / self.mass
        body = vy - self.centre_height * roll_rate
        rolling = jnp.maximum(vx, LOW_SPEED)
        front = (vy + self.front_axle_distance * rate) / rolling
        rear = (vy - self.rear_axle_distance * rate) / rolling
        accelerations = [ax, ax + body * rate, ay * jnp.cos(roll) + GRAVITY * jnp.sin(roll)]
        slips = [steer - front, -rear, steer - jnp.arctan(front), -jnp.arctan(rear)]
        axles = [force[k : k + 2].sum() for force in (wheels.lateral, wheels.longitudinal) for k in (0, 2)]
        rows = [rate, ay, *accelerations, jnp.arctan2(vy, rolling), body, *slips, *axles]
        return jnp.concatenate([jnp.stack(rows), wheels.load])

    def wheels(self, x: Any, u: Any) -> Wheels:
        """Return slips, loads and forces of the wheels; arguments as in `dynamics`."""
        yaw, vx, vy, rate, steer = x[2], x[3], x[4], x[5], x[8]
        along, across = self._places()
        angle = jnp.stack([steer, steer, jnp.zeros_like(steer), jnp.zeros_like(steer)])
        turn, lean = jnp.cos(angle), jnp.sin(angle)
        wheel_x, wheel_y = vx - rate * across, vy + rate * along
        rolling = jnp.maximum(jnp.abs(wheel_x * turn + wheel_y * lean), LOW_SPEED)
        slip = -jnp.arctan((wheel_y * turn - wheel_x * lean) / rolling)
        place_x = x[0] + jnp.cos(yaw) * along - jnp.sin(yaw) * across
        place_y = x[1] + jnp.sin(yaw) * along + jnp.cos(yaw) * across
        load = self._loads(x)
        friction = self.road.friction(place_x, place_y)
        strained = self.road.stiffness_factor(place_x, place_y) * x[10:14]
        demand = self._demands(u[1], vx)
        pairs = [
            tyre.driven(strained[k], demand[k], load[k], friction[k], self.longitudinal_share)
            for tyre, k in ((self.front_tyre, slice(0, 2)), (self.rear_tyre, slice(2, 4)))
        ]
        longitudinal, lateral = (jnp.concatenate([pair[i] for pair in pairs]) for i in (0, 1))
        forward, sideward = longitudinal * turn - lateral * lean, longitudinal * lean + lateral * turn
        return Wheels(slip, rolling, load, longitudinal, lateral, forward, sideward)

    def _places(self) -> tuple[jax.Array, jax.Array]:
        a, b = jnp.asarray(self.front_axle_distance), jnp.asarray(self.rear_axle_distance)
        front, rear = jnp.asarray(self.front_track) / 2, jnp.asarray(self.rear_track) / 2
        return jnp.stack([a, a, -b, -b]), jnp.stack([front, -front, rear, -rear])

    def _loads(self, x: Any) -> jax.Array:
        """Return the wheel loads; they are never negative and always sum to m g."""
        roll, roll_rate, shifted = x[6], x[7], x[9]
        weight, wheelbase = self.mass * GRAVITY, self.front_axle_distance + self.rear_axle_distance
        shift = self.mass * self.centre_height * shifted / wheelbase
        front = jnp.clip(weight * self.rear_axle_distance / wheelbase - shift, 0.0, weight)
        springs = self.roll_stiffness * roll + self.roll_damping * roll_rate
        share = jnp.asarray(self.front_roll_share)
        loads = []
        for axle, part, track in ((front, share, self.front_track), (weight - front, 1.0 - share, self.rear_track)):
            # A wheel that has lifted cannot give more of its load to the other side.
            transfer = jnp.clip(part * springs / track, -axle / 2, axle / 2)
            loads += [axle / 2 - transfer, axle / 2 + transfer]
        return jnp.stack(loads)

    def _demands(self, acceleration: Any, speed: Any) -> jax.Array:
        """Return the longitudinal force asked of each wheel; a brake opposes the motion and is none at standstill."""
        braking = acceleration < 0
        fade = jnp.where(braking, jnp.clip(speed / LOW_SPEED, -1.0, 1.0), 1.0)
        front = jnp.where(braking, self.brake_front_share, self.drive_front_share)
        half = self.mass * acceleration * fade / 2
        return jnp.stack([front * half, front * half, (1.0 - front) * half, (1.0 - front) * half])


_OWN = (
    *(
        "centre_height",
        "front_track",
        "rear_track",
        "roll_inertia",
        "roll_stiffness",
        "front_roll_share",
        "roll_damping",
    ),
    *("pitch_lag", "front_relaxation", "rear_relaxation", "steering_lag", "steering_rate"),
    *("brake_front_share", "drive_front_share", "longitudinal_share"),
)


def magic_formula_wheels(parameters: DoubleTrackParameters) -> tuple[MagicFormulaCombined, MagicFormulaCombined]:
    """Return one front and one rear wheel whose pairs have the stiffness of the axles at static load.

    Slip stiffness is taken equal to cornering stiffness; the double track itself asks for forces, not for slip ratios.

    Args:
        parameters: the car, the load of the greatest stiffness, shape and curvature.
    """
    car = parameters.car
    weight = car.mass * GRAVITY / (2 * car.wheelbase)
    wheels = []
    for stiffness, load in (
        (car.front_stiffness / 2, weight * car.rear_axle_distance),
        (car.rear_stiffness / 2, weight * car.front_axle_distance),
    ):
        peak_load = parameters.peak_load_ratio * load
        shape = (parameters.tyre_shape, parameters.tyre_curvature)
        wheels.append(MagicFormulaCombined(stiffness, stiffness, load, peak_load, *shape))
    return wheels[0], wheels[1]
