"""Sideslip without memory from the force at the rear axle: the anchor every observer has to beat."""

import jax
import jax.numpy as jnp
from jax.typing import ArrayLike

from luenberger.vehicle.parameters import VehicleParameters
from luenberger.vehicle.sideslip import sideslip_from_rear_slip
from luenberger.vehicle.tyres import BrushTyre, LinearTyre


def rear_axle_force(
    lateral_acceleration: ArrayLike, car: VehicleParameters, yaw_acceleration: ArrayLike = 0.0
) -> jax.Array:
    """Return the lateral force of the rear axle [N] from the balances of the single track.

    With m ay = Ff + Fr and Iz dr = a Ff - b Fr, eliminating Ff gives (a + b) Fr = m a ay - Iz dr. Without the yaw
    acceleration this is the quasi-steady force.

    Args:
        lateral_acceleration: ay [m/s^2] at the centre of gravity, what an accelerometer on a level road reads.
        car: m, a, b, Iz.
        yaw_acceleration: dr/dt [rad/s^2].
    """
    moment = car.mass * car.front_axle_distance * jnp.asarray(lateral_acceleration)
    return (moment - car.yaw_inertia * jnp.asarray(yaw_acceleration)) / car.wheelbase


def rear_axle_sideslip(
    yaw_rate: ArrayLike,
    speed: ArrayLike,
    lateral_acceleration: ArrayLike,
    car: VehicleParameters,
    yaw_acceleration: ArrayLike = 0.0,
    tyre: LinearTyre | BrushTyre | None = None,
) -> jax.Array:
    """Return beta = atan(b r / vx - alpha_r) [rad] with alpha_r from the force of the rear axle.

    The force Fr = (m a ay - Iz dr) / (a + b) needs the slip angle alpha_r = Fr / Cr (or the inverse of the tyre curve),
    and alpha_r = -(vy - b r) / vx turns it into vy / vx = b r / vx - alpha_r. Exact for the linear single track with the
    right Cr when the yaw acceleration is given, and in steady cornering without it. It needs no dynamics and no gain,
    hears every bias and vibration of the accelerometer, and feels road bank as slip.

    Args:
        yaw_rate: r [rad/s].
        speed: vx [m/s], positive.
        lateral_acceleration: ay [m/s^2] at the centre of gravity.
        car: m, a, b, Iz, Cr.
        yaw_acceleration: dr/dt [rad/s^2]; zero is the quasi-steady form.
        tyre: tyre of the rear axle with an inverse curve; left out: linear with Cr.
    """
    tyre = LinearTyre(car.rear_stiffness) if tyre is None else tyre
    slip = tyre.slip(rear_axle_force(lateral_acceleration, car, yaw_acceleration))
    return sideslip_from_rear_slip(slip, speed, yaw_rate, car)
