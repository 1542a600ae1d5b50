"""From states to sideslip and back, JAX functions that work on samples and on whole channels.

Sideslip beta = atan(vy / vx) of the centre of gravity, positive where the car drifts to the left.
"""

import jax
import jax.numpy as jnp
from jax.typing import ArrayLike

from luenberger.vehicle.parameters import VehicleParameters


def sideslip_from_lateral_speed(lateral_speed: ArrayLike, speed: ArrayLike) -> jax.Array:
    """Return beta = atan(vy / vx) [rad].

    Args:
        lateral_speed: vy at the centre of gravity [m/s].
        speed: vx [m/s], positive.
    """
    return jnp.arctan(jnp.asarray(lateral_speed) / jnp.asarray(speed))


def lateral_speed_from_rear_slip(
    rear_slip: ArrayLike, speed: ArrayLike, yaw_rate: ArrayLike, car: VehicleParameters
) -> jax.Array:
    """Return vy = b r - alpha_r vx [m/s], from alpha_r = -(vy - b r) / vx.

    Args:
        rear_slip: alpha_r [rad].
        speed: vx [m/s].
        yaw_rate: r [rad/s].
        car: gives b.
    """
    return car.rear_axle_distance * jnp.asarray(yaw_rate) - jnp.asarray(rear_slip) * jnp.asarray(speed)


def lateral_speed_from_front_slip(
    front_slip: ArrayLike, speed: ArrayLike, yaw_rate: ArrayLike, steering: ArrayLike, car: VehicleParameters
) -> jax.Array:
    """Return vy = (delta - alpha_f) vx - a r [m/s], from alpha_f = delta - (vy + a r) / vx.

    Args:
        front_slip: alpha_f [rad].
        speed: vx [m/s].
        yaw_rate: r [rad/s].
        steering: delta, road-wheel angle [rad].
        car: gives a.
    """
    slope = jnp.asarray(steering) - jnp.asarray(front_slip)
    return slope * jnp.asarray(speed) - car.front_axle_distance * jnp.asarray(yaw_rate)


def sideslip_from_rear_slip(
    rear_slip: ArrayLike, speed: ArrayLike, yaw_rate: ArrayLike, car: VehicleParameters
) -> jax.Array:
    """Return beta = atan(b r / vx - alpha_r) [rad]; arguments as in `lateral_speed_from_rear_slip`."""
    return sideslip_from_lateral_speed(lateral_speed_from_rear_slip(rear_slip, speed, yaw_rate, car), speed)


def slip_angles(
    lateral_speed: ArrayLike, yaw_rate: ArrayLike, speed: ArrayLike, steering: ArrayLike, car: VehicleParameters
) -> tuple[jax.Array, jax.Array]:
    """Return (alpha_f, alpha_r) = (delta - (vy + a r) / vx, -(vy - b r) / vx) [rad], for small angles.

    Args:
        lateral_speed: vy at the centre of gravity [m/s].
        yaw_rate: r [rad/s].
        speed: vx [m/s].
        steering: delta, road-wheel angle [rad].
        car: gives a and b.
    """
    vy, r, vx = jnp.asarray(lateral_speed), jnp.asarray(yaw_rate), jnp.asarray(speed)
    front = jnp.asarray(steering) - (vy + car.front_axle_distance * r) / vx
    return front, -(vy - car.rear_axle_distance * r) / vx
