"""Drives of the double track that stand where a log would: the truth of an experiment that nobody tuned to the observers."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import radians
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from luenberger.core import BadInput, Signal, Trajectory
from luenberger.core.checks import nearest
from luenberger.simulate import TruthModel, simulate
from luenberger.vehicle import VehicleParameters
from luenberger.vehicle.double_track import DoubleTrack
from luenberger.vehicle.double_track_parameters import DoubleTrackParameters
from luenberger.vehicle.driver import PreviewDriver, SpeedKeeper, closed_loop, iso_3888_1
from luenberger.vehicle.manoeuvres import (
    BrokenLine,
    Constant,
    HalfCosine,
    Manoeuvre,
    braking_lane_changes,
    fishhook,
    sine_with_dwell,
    slalom,
    step_steer,
)
from luenberger.vehicle.parameters import GRAVITY
from luenberger.vehicle.road import Road

# Rate at which the driver closes a gap to the wanted speed [1/s].
SPEED_HOLD = 2.0
# The second lane lies to the left; with these factors the stiffness of the dissertation's car spans the box of (4.45).
LANE_EDGE, STIFF, SOFT = 1.75, 1.1, 0.9
# The tyre curve of the dissertation is for loads that exceed the weight of its car; on this road the double track, whose wheels
# carry the weight, has the printed peaks 0.85 times 6000 N and 4000 N.
GRIPPY = 0.85 * 10_000.0 / (800.0 * GRAVITY)
# Its car is neutral; with less of the load transfer in front, the rear lets go first and the car spins.
UNDERSTEERING = {"front_roll_share": 0.9, "brake_front_share": 0.75}
# Angle of the steering wheel over that of the road wheels in the fishhook of the agency.
STEERING_RATIO = 16.0
# Speeds between which it brakes [m/s], and the road-wheel angle [rad] that takes both axles beyond 0.1 rad.
FISHHOOK_SPEED, FISHHOOK_ANGLE = (78 / 3.6, 23 / 3.6), 0.085


@dataclass(frozen=True)
class Drive:
    """One simulated drive.

    Args:
        run: car and sample time [s] -> the channels an experiment reads.
        sentence: what it is, for tables.
    """

    run: Callable[[VehicleParameters, float], Trajectory]
    sentence: str


def simulated_drive(name: str, car: VehicleParameters, sample_time: float) -> Trajectory:
    """Simulate a drive of the double track and return the channels an experiment reads.

    Args:
        name: key of `DRIVES`.
        car: gives mass, inertia, axle distances and the stiffness of the tyres at their static load.
        sample_time: step of the samples [s].

    Returns:
        speed, lateral_speed, yaw_rate, steering, lateral_acceleration, and the axle forces front_force, rear_force; what else
        the drive knows.

    Raises:
        BadInput: unknown drive; the nearest known one is named.
    """
    if name not in DRIVES:
        raise BadInput(f"There is no drive `{name}`.{nearest(name, DRIVES)}")
    return DRIVES[name].run(car, sample_time)


def open_loop(
    car: VehicleParameters,
    sample_time: float,
    manoeuvre: Manoeuvre,
    road: Road | None = None,
    chassis: Mapping[str, float] | None = None,
) -> Trajectory:
    """Drive a manoeuvre, its speed held, and return the channels of a drive.

    Args:
        car: as in `simulated_drive`.
        sample_time: step of the samples [s].
        manoeuvre: steering and speed over time.
        road: what lies under the wheels; left out: dry and even.
        chassis: numbers of `DoubleTrackParameters` in place of the assumed ones.
    """
    model = DoubleTrack(
        DoubleTrackParameters.of(car, "set by the drive", **(chassis or {})), _dry() if road is None else road
    )
    start = model.start(float(manoeuvre.speed(0.0)))
    time = np.arange(0.0, manoeuvre.duration + 0.5 * sample_time, sample_time)
    run = simulate(
        speed_held(model),
        time=time,
        x0=np.asarray(start),
        u=lambda t: jnp.stack([manoeuvre.steering(t), manoeuvre.acceleration(t), manoeuvre.speed(t)]),
        jump_times=np.unique(np.asarray(manoeuvre.jump_times)),
        rtol=1e-8,
        atol=1e-10,
    )
    return _channels(run, manoeuvre.name)


def lane_change(
    car: VehicleParameters, sample_time: float, speed: float = 80 / 3.6, preview: float = 0.7, width: float = 1.8
) -> Trajectory:
    """Drive the double lane change of ISO 3888-1 with a driver who looks ahead, and return the channels of a drive.

    The channel `path_error` [m] tells how far the car was from the middle of its lane, to the left.

    Args:
        car: as in `simulated_drive`.
        sample_time: step of the samples [s].
        speed: vx that the driver holds [m/s].
        preview: preview time of the driver [s].
        width: width of the car [m], which fixes the lanes.
    """
    course = iso_3888_1(width)
    model = DoubleTrack(DoubleTrackParameters.of(car), _dry())
    loop = closed_loop(model, PreviewDriver.of(car, preview=preview), course, SpeedKeeper(Constant(speed)))
    start = loop.start(model.start(speed))
    seconds = (float(course.length) + 2 * 20.0) / speed
    time = np.arange(0.0, seconds, sample_time)
    run = simulate(loop, time=time, x0=np.asarray(start), rtol=1e-8, atol=1e-10)
    return _channels(run, course.name, ("path_error",))


def braking_fishhook(amplitude: float = FISHHOOK_ANGLE) -> Manoeuvre:
    """Return a fishhook to the left while the speed falls from 78 to 23 km/h, as Wang 2014 shows it in figures 5.6 and 5.7.

    The dissertation prints the two speeds; the angle, the times and the half cosine between the speeds are ours.

    Args:
        amplitude: road-wheel angle [rad].
    """
    first, last = FISHHOOK_SPEED
    turn = fishhook(amplitude, steering_ratio=STEERING_RATIO, start=0.5, duration=10.0).turn
    return Manoeuvre(turn, HalfCosine(first, last, 0.5, 8.0), 10.0, "fishhook while braking")


def two_fishhooks(first: float = 0.095, second: float = 0.09) -> Manoeuvre:
    """Return a braking fishhook to the left and, once the car is fast again, another to the right: one to tune, one to score.

    Args:
        first: road-wheel angle of the one to the left [rad].
        second: of the one to the right [rad].
    """
    b, rate = second / first, radians(720) / STEERING_RATIO
    levels = [1, 1, -1, -1, 0, 0, -b, -b, b, b, 0]
    lengths = [0, 0.25, 0, 3, 2, 5.0, 0, 0.25, 0, 3, 2]
    turns = [1, 0, 2, 0, 0, 0, b, 0, 2 * b, 0, 0]
    turn = BrokenLine(first, 0.5, jnp.array(levels), jnp.array(lengths), jnp.array(turns), rate)
    fast, slow = FISHHOOK_SPEED
    pace = BrokenLine(
        fast,
        -1.0,
        jnp.array([1.0, 1.0, slow / fast, 1.0, 1.0, slow / fast]),
        jnp.array([0.5, 1.0, 5.5, 4.5, 0.5, 5.5]),
        jnp.zeros(6),
        1.0,
    )
    return Manoeuvre(turn, pace, 18.0, "two fishhooks while braking")


def braked_fishhook(
    car: VehicleParameters, sample_time: float, manoeuvre: Manoeuvre | None = None, friction: float = GRIPPY
) -> Trajectory:
    """Drive a braking fishhook with an understeering chassis and return the channels of a drive.

    Args:
        car: as in `simulated_drive`.
        sample_time: step of the samples [s].
        manoeuvre: left out: `braking_fishhook`.
        friction: of the road.
    """
    driven = braking_fishhook() if manoeuvre is None else manoeuvre
    return open_loop(car, sample_time, driven, Road.uniform(friction), UNDERSTEERING)


def _channels(run: Trajectory, name: str, more: tuple[str, ...] = ()) -> Trajectory:
    names = ("speed", "lateral_speed", "yaw_rate", "steering", "lateral_acceleration", "front_force", "rear_force")
    signals = [Signal(c, run[c].unit, run[c].values, f"double track, {run[c].description}") for c in (*names, *more)]
    return Trajectory(run.time, signals, name, f"simulation of {run.name}")


def _dry() -> Road:
    return Road.uniform(0.85)


def speed_held(model: DoubleTrack) -> TruthModel:
    """Return the car with a driver who adds what the wanted speed lacks to the acceleration asked for.

    Args:
        model: takes the steering angle and the acceleration asked for; the result takes the wanted speed as a third input.
    """

    def demands(x: Any, u: Any) -> jax.Array:
        return jnp.stack([u[0], u[1] + SPEED_HOLD * (u[2] - x[model.states.index("speed")])])

    return TruthModel(
        lambda t, x, u, r: model.dynamics(t, x, demands(x, u), r),
        lambda t, x, u, r: model.output(t, x, demands(x, u), r),
        states=model.states,
        inputs=("steering_demand", "acceleration_demand", "wanted_speed"),
        outputs=model.outputs,
        units={**model.units, "wanted_speed": "m/s"},
        name=model.name,
    )


def _two_lanes() -> Road:
    return Road.lanes([LANE_EDGE], [0.85, 0.85], [STIFF, SOFT])


DRIVES: Mapping[str, Drive] = {
    "lane_changes": Drive(
        lambda car, dt: open_loop(car, dt, braking_lane_changes()), "two lane changes, 78 to 23 km/h, even road"
    ),
    "two_lanes": Drive(
        lambda car, dt: open_loop(car, dt, braking_lane_changes(), _two_lanes()),
        "two lane changes, 78 to 23 km/h, between a lane of stiff and one of soft tyres",
    ),
    "iso_3888_1": Drive(lane_change, "double lane change of ISO 3888-1 with a driver, 80 km/h"),
    "slalom": Drive(lambda car, dt: open_loop(car, dt, slalom(0.03, 20.0)), "slalom at 72 km/h"),
    "step_steer": Drive(lambda car, dt: open_loop(car, dt, step_steer(0.04, 25.0)), "step steer at 90 km/h"),
    "fishhook": Drive(braked_fishhook, "fishhook, 78 to 23 km/h, slip angles beyond 0.1 rad"),
    "two_fishhooks": Drive(
        lambda car, dt: braked_fishhook(car, dt, two_fishhooks()),
        "a fishhook to the left and one to the right, braking",
    ),
    "sine_with_dwell": Drive(
        lambda car, dt: open_loop(car, dt, sine_with_dwell(0.05, 80 / 3.6)), "sine with dwell at 80 km/h"
    ),
}
