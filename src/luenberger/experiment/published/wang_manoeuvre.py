"""A double lane change under braking, as Wang 2014 shows it in figures 3.7 and 3.8, driven by two truths.

The dissertation prints the speeds at the ends alone. Here the speed falls as a half cosine between one and nine seconds, and
the wheel is turned twice by A 0.77 (sin 2 pi s - sin(4 pi s) / 2), whose value and slope vanish at both ends.
"""

import importlib
from collections.abc import Callable
from functools import cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from luenberger.core import Signal, Trajectory
from luenberger.simulate import TruthModel, simulate
from luenberger.vehicle import braking_lane_changes, slip_angle_channels, slip_angles, wang_car

STEP, SECONDS = 1e-3, 10.0
DRIVE = braking_lane_changes()
# The driver of the drift model holds the speed by adding this rate times its error [1/s].
SPEED_HOLD = 10.0
# Height of the centre of gravity [m] for the drift model; the dissertation has none.
HEIGHT = 0.5
# The package rounds gravity to this; the stiffness of its tyres is -p_ky1 times the load.
PACKAGE_GRAVITY = 9.81
_UNITS = {
    "lateral_speed": "m/s",
    "yaw_rate": "rad/s",
    "steering": "rad",
    "steering_rate": "rad/s",
    "acceleration": "m/s^2",
    "speed": "m/s",
    "front_stiffness": "N/rad",
    "rear_stiffness": "N/rad",
}


def speed(t: Any) -> jax.Array:
    """Return vx [m/s].

    Args:
        t: time [s].
    """
    return DRIVE.speed(t)


def acceleration(t: Any) -> jax.Array:
    """Return d vx/dt [m/s^2].

    Args:
        t: time [s].
    """
    return DRIVE.acceleration(t)


def steering(t: Any, scale: float = 1.0) -> jax.Array:
    """Return the road-wheel angle [rad].

    Args:
        t: time [s].
        scale: factor on both lobes.
    """
    return scale * DRIVE.steering(t)


def steering_rate(t: Any, scale: float = 1.0) -> jax.Array:
    """Return its derivative [rad/s]; arguments as in `steering`.

    Args:
        t: time [s].
        scale: factor on both lobes.
    """
    return scale * DRIVE.steering_rate(t)


def sample_times() -> np.ndarray:
    """Sample times of the manoeuvre [s], shape (nt,)."""
    return np.linspace(0.0, SECONDS, round(SECONDS / STEP) + 1)


@cache
def linear_truth(scale: float = 1.0, stiffness: Callable[[Any], tuple[Any, Any]] | None = None) -> Trajectory:
    """Drive the single track with small angles and return the channels of `slip_angle_channels`.

    Inputs and stiffness are joined by straight lines between the samples, which are one millisecond apart.

    Args:
        scale: factor on the steering.
        stiffness: t -> (Cf, Cr) [N/rad]; left out: the numbers of the car.
    """
    times = sample_times()
    held = (wang_car.front_stiffness, wang_car.rear_stiffness) if stiffness is None else stiffness(times)
    r = np.stack([np.asarray(speed(times)), *(np.broadcast_to(C, times.shape) for C in held)], axis=1)
    u = np.stack([np.asarray(f(times, scale)) for f in (steering, steering_rate)], axis=1)
    model = TruthModel(
        _linear_rate,
        _linear_output,
        states=("lateral_speed", "yaw_rate"),
        inputs=("steering", "steering_rate"),
        outputs=("acceleration",),
        scheduling_names=("speed", "front_stiffness", "rear_stiffness"),
        units=_UNITS,
        name="single track",
    )
    driven = simulate(model, time=times, x0=[0.0, 0.0], u=u, r=r, interpolation="linear", rtol=1e-9, atol=1e-11)
    return slip_angle_channels(driven, wang_car)


@cache
def drift_truth(scale: float = 1.0) -> Trajectory | None:
    """Drive the single-track drift model of CommonRoad with mass, inertia and axle distances of the car of the dissertation.

    The tyres follow the Magic Formula with combined slip, with their stiffness set to the sum of the printed ones; wheels
    turn, loads shift under braking. Speed is held to the planned one by feedback.

    Args:
        scale: factor on the steering.

    Returns:
        channels of `slip_angle_channels`, or None where the package `vehiclemodels` is absent.

    Reference: M. Althoff, G. Wuersching, CommonRoad: Vehicle Models (2020), section 7.
    """
    model = _drift_model()
    if model is None:
        return None
    parameters, dynamics, start = model
    times = sample_times()
    # Stages of Runge-Kutta stand at the ends and the middle of a step.
    half = np.linspace(0.0, SECONDS, 2 * (times.size - 1) + 1)
    wanted, feed, turn = (np.asarray(f(half)) for f in (speed, acceleration, lambda t: steering_rate(t, scale)))

    def rate(k: int, x: np.ndarray) -> np.ndarray:
        pedal = feed[k] + SPEED_HOLD * (wanted[k] - x[3])
        return np.array(dynamics(x.tolist(), [float(turn[k]), float(pedal)], parameters))

    states = np.zeros((times.size, len(start)))
    states[0] = start
    for k in range(times.size - 1):
        x = states[k]
        k1 = rate(2 * k, x)
        k2 = rate(2 * k + 1, x + STEP / 2 * k1)
        k3 = rate(2 * k + 1, x + STEP / 2 * k2)
        k4 = rate(2 * k + 2, x + STEP * k3)
        states[k + 1] = x + STEP / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    vx, vy = states[:, 3] * np.cos(states[:, 6]), states[:, 3] * np.sin(states[:, 6])
    signals = [
        Signal("speed", "m/s", vx),
        Signal("lateral_speed", "m/s", vy),
        Signal("yaw_rate", "rad/s", states[:, 5]),
        Signal("steering", "rad", states[:, 2]),
        Signal("steering_rate", "rad/s", np.asarray(steering_rate(times, scale))),
        Signal("acceleration", "m/s^2", np.gradient(vx, times), "d speed/dt by central differences"),
    ]
    return slip_angle_channels(Trajectory(times, signals, "drift model", "CommonRoad single-track drift"), wang_car)


def _linear_rate(t: Any, x: Any, u: Any, r: Any) -> jax.Array:
    front, rear = slip_angles(x[0], x[1], r[0], u[0], wang_car)
    force = jnp.stack([r[1] * front, r[2] * rear])
    arms = jnp.array([wang_car.front_axle_distance, -wang_car.rear_axle_distance])
    return jnp.stack([jnp.sum(force) / wang_car.mass - r[0] * x[1], jnp.sum(arms * force) / wang_car.yaw_inertia])


def _linear_output(t: Any, x: Any, u: Any, r: Any) -> jax.Array:
    return acceleration(t)[None]


def _drift_model() -> tuple[Any, Callable[..., Any], list[float]] | None:
    """Parameters, right-hand side and start of the drift model."""
    try:
        cars, drift, first = (
            importlib.import_module(f"vehiclemodels.{name}")
            for name in ("parameters_vehicle2", "vehicle_dynamics_std", "init_std")
        )
    except ImportError:
        return None
    p = cars.parameters_vehicle2()
    p.m, p.I_z, p.h_s = wang_car.mass, wang_car.yaw_inertia, HEIGHT
    p.a, p.b = wang_car.front_axle_distance, wang_car.rear_axle_distance
    p.tire.p_ky1 = -(wang_car.front_stiffness + wang_car.rear_stiffness) / (wang_car.mass * PACKAGE_GRAVITY)
    return p, drift.vehicle_dynamics_std, first.init_std([0.0, 0.0, 0.0, float(speed(0.0)), 0.0, 0.0, 0.0], p)
