"""Lateral tyre forces of an axle. A positive slip angle gives a positive force (to the left).

    alpha_f = delta - (vy + a r) / vx        alpha_r = -(vy - b r) / vx        F = C alpha for small alpha

Each tyre is a JAX function of the slip angle whose numbers are pytree leaves, so stiffness or peak can be fitted by
gradients and batched with `vmap`.
"""

from abc import abstractmethod
from math import inf, isfinite

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from luenberger.algebra.enclosure import enclose_jacobian
from luenberger.core import BadInput
from luenberger.vehicle.parameters import VehicleParameters

Number = float | jax.Array | np.ndarray


class Tyre(eqx.Module):
    """What every tyre offers: force, stiffness at zero slip, range of slopes, and the remainder beyond the linear part."""

    @abstractmethod
    def __call__(self, slip_angle: ArrayLike) -> jax.Array:
        """Return the lateral force [N].

        Args:
            slip_angle: alpha [rad], any shape.
        """

    @property
    @abstractmethod
    def stiffness(self) -> Number:
        """Cornering stiffness dF/dalpha at zero slip [N/rad]."""

    @abstractmethod
    def slope_range(self, limit: float = inf) -> tuple[float, float]:
        """Return the least and the greatest dF/dalpha [N/rad] for |alpha| <= limit.

        Args:
            limit: largest slip angle trusted [rad].
        """

    def remainder(self, slip_angle: ArrayLike) -> jax.Array:
        """Return F(alpha) - stiffness alpha [N], the nonlinear part of a plant whose A holds the stiffness.

        Args:
            slip_angle: alpha [rad], any shape.
        """
        return self(slip_angle) - self.stiffness * jnp.asarray(slip_angle)


class LinearTyre(Tyre):
    """F = C alpha.

    Choose it below about 0.4 g on a dry road.

    Args:
        cornering: C [N/rad].
    """

    cornering: Number

    def __call__(self, slip_angle: ArrayLike) -> jax.Array:
        """Return C alpha [N]."""
        return jnp.asarray(self.cornering * jnp.asarray(slip_angle))

    @property
    def stiffness(self) -> Number:
        """C [N/rad]."""
        return self.cornering

    def slope_range(self, limit: float = inf) -> tuple[float, float]:
        """Return (C, C); see `Tyre.slope_range`."""
        return float(self.cornering), float(self.cornering)

    def slip(self, force: ArrayLike) -> jax.Array:
        """Return the slip angle [rad] of a force [N]."""
        return jnp.asarray(force) / self.cornering


class BrushTyre(Tyre):
    """Brush model with parabolic pressure: cubic up to |alpha| = 1 / theta, then the peak mu Fz.

        F = mu Fz x (3 - 3 |x| + x^2),   x = theta alpha clipped to [-1, 1],   theta = C / (3 mu Fz)

    Choose it where the tyre saturates: two numbers an axle, and slopes between 0 and C on all slip angles. With
    c1 = 3 mu Fz theta, c2 = -3 mu Fz theta^2, c3 = mu Fz theta^3 this is c1 alpha + c2 alpha |alpha| + c3 alpha^3 below
    saturation; the slope is continuous everywhere.

    Args:
        cornering: C = c1 [N/rad].
        peak: mu Fz [N].

    Reference: Wang 2014, equation 5.63. Equation 5.68 there leaves out the saturated branch; `remainder` keeps it.
    """

    cornering: Number
    peak: Number

    def __call__(self, slip_angle: ArrayLike) -> jax.Array:
        """Return the force [N] at a slip angle [rad]."""
        x = jnp.clip(self.theta * jnp.asarray(slip_angle), -1.0, 1.0)
        return jnp.asarray(self.peak * x * (3.0 - 3.0 * jnp.abs(x) + x * x))

    @property
    def stiffness(self) -> Number:
        """C [N/rad]."""
        return self.cornering

    @property
    def theta(self) -> Number:
        """Inverse of the slip angle where the force saturates [1/rad]."""
        return self.cornering / (3.0 * self.peak)

    def slope_range(self, limit: float = inf) -> tuple[float, float]:
        """Return (C (1 - theta limit)^2, C), the first zero from saturation on; see `Tyre.slope_range`."""
        inside = 1.0 - min(float(self.theta) * limit, 1.0)
        return float(self.cornering) * inside**2, float(self.cornering)

    def slip(self, force: ArrayLike) -> jax.Array:
        """Return the slip angle [rad] of a force [N]; forces beyond the peak give the angle of saturation."""
        share = jnp.clip(jnp.asarray(force) / self.peak, -1.0, 1.0)
        return jnp.sign(share) * (1.0 - jnp.cbrt(1.0 - jnp.abs(share))) / self.theta


class MagicFormulaTyre(Tyre):
    """F = D sin(C atan(B alpha - E (B alpha - atan(B alpha)))).

    Choose it where the coefficients were fitted to measured tyres; beyond the peak the force falls again.

    Args:
        B: stiffness factor [1/rad].
        C: shape factor.
        D: peak force [N].
        E: curvature factor.

    Reference: H. Pacejka, Tire and Vehicle Dynamics (2012), section 4.3, without offsets.
    """

    B: Number
    C: Number
    D: Number
    E: Number

    def __call__(self, slip_angle: ArrayLike) -> jax.Array:
        """Return the force [N] at a slip angle [rad]."""
        x = self.B * jnp.asarray(slip_angle)
        return jnp.asarray(self.D * jnp.sin(self.C * jnp.arctan(x - self.E * (x - jnp.arctan(x)))))

    @property
    def stiffness(self) -> Number:
        """B C D [N/rad]."""
        return self.B * self.C * self.D

    def slope_range(self, limit: float = inf) -> tuple[float, float]:
        """Return bounds of the slope proved in ball arithmetic, at most 0.1 % too wide; `limit` must be finite.

        Raises:
            BadInput: no finite limit.
        """
        if not (isfinite(limit) and limit > 0):
            raise BadInput(
                f"`limit` is {limit} rad; the slope of a Magic Formula is bounded on a finite slip range only."
            )
        found = enclose_jacobian(lambda z: self(z[0]), [-limit], [limit])
        return float(found.lower[0]), float(found.upper[0])


def linear_tyres(car: VehicleParameters) -> tuple[LinearTyre, LinearTyre]:
    """Return the front and the rear axle of a car as linear tyres.

    Args:
        car: the car.
    """
    return LinearTyre(car.front_stiffness), LinearTyre(car.rear_stiffness)


def brush_tyres(car: VehicleParameters) -> tuple[BrushTyre, BrushTyre]:
    """Return the front and the rear axle of a car as brush tyres with peaks mu Fz.

    Args:
        car: a car with a known friction.

    Raises:
        BadInput: the car has no friction.
    """
    if car.friction is None:
        raise BadInput(f"`{car.name}` has no friction; give one with `.with_values(friction=0.9)`.")
    front = BrushTyre(car.front_stiffness, car.friction * car.front_axle_load)
    return front, BrushTyre(car.rear_stiffness, car.friction * car.rear_axle_load)
