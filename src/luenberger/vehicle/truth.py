"""The nonlinear single track as a truth model: what a simulation calls the real car."""

from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp

from luenberger.vehicle.parameters import VehicleParameters
from luenberger.vehicle.tyres import Tyre, linear_tyres


class SingleTrack(eqx.Module):
    """Single track in (vy, r) with any tyre; a JAX function (t, x, u, r) -> dx.

        m (d vy/dt + vx r) = Ff + Fr      Iz d r/dt = a Ff - b Fr      F = tyre(alpha)

    Choose it to try observers against saturating tyres. Load transfer, roll, and the coupling of drive and brake forces
    are left out; take a double track where these matter.

    Args:
        car: mass, inertia, axle distances.
        front: tyre of the front axle; left out: linear with Cf.
        rear: tyre of the rear axle; left out: linear with Cr.
        small_angles: True uses the small-angle slip of the design plants; False the arctangent and the cosine of delta.
    """

    states: ClassVar[tuple[str, ...]] = ("lateral_speed", "yaw_rate")
    inputs: ClassVar[tuple[str, ...]] = ("steering",)
    outputs: ClassVar[tuple[str, ...]] = ("yaw_rate", "lateral_acceleration")
    scheduling_names: ClassVar[tuple[str, ...]] = ("speed",)

    car: VehicleParameters = eqx.field(static=True)
    front: Tyre
    rear: Tyre
    small_angles: bool = eqx.field(static=True)

    def __init__(
        self,
        car: VehicleParameters,
        front: Tyre | None = None,
        rear: Tyre | None = None,
        small_angles: bool = True,
    ):
        linear = linear_tyres(car)
        self.car = car
        self.front = linear[0] if front is None else front
        self.rear = linear[1] if rear is None else rear
        self.small_angles = small_angles

    def slip_angles(self, x: Any, u: Any, r: Any) -> tuple[jax.Array, jax.Array]:
        """Return (alpha_f, alpha_r) [rad]; arguments as in `__call__`."""
        front = (x[0] + self.car.front_axle_distance * x[1]) / r[0]
        rear = (x[0] - self.car.rear_axle_distance * x[1]) / r[0]
        if not self.small_angles:
            front, rear = jnp.arctan(front), jnp.arctan(rear)
        return jnp.asarray(u[0] - front), jnp.asarray(-rear)

    def forces(self, x: Any, u: Any, r: Any) -> tuple[jax.Array, jax.Array]:
        """Return the lateral forces of the axles in the axes of the car (Ff, Fr) [N]; arguments as in `__call__`."""
        front, rear = self.slip_angles(x, u, r)
        turn = 1.0 if self.small_angles else jnp.cos(u[0])
        return self.front(front) * turn, self.rear(rear)

    def __call__(self, t: Any, x: Any, u: Any, r: Any) -> jax.Array:
        """Return the time derivative of the state, shape (2,).

        Args:
            t: time [s], not used.
            x: (vy [m/s], r [rad/s]).
            u: (delta [rad],).
            r: (vx [m/s],), positive.
        """
        front, rear = self.forces(x, u, r)
        car = self.car
        moment = car.front_axle_distance * front - car.rear_axle_distance * rear
        return jnp.stack([(front + rear) / car.mass - r[0] * x[1], moment / car.yaw_inertia])

    def output(self, t: Any, x: Any, u: Any, r: Any) -> jax.Array:
        """Return (yaw rate [rad/s], lateral acceleration [m/s^2]), what gyro and accelerometer read; as `__call__`."""
        front, rear = self.forces(x, u, r)
        return jnp.stack([jnp.asarray(x[1]), (front + rear) / self.car.mass])
