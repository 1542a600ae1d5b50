"""Forces of one wheel from slip angle, slip ratio, vertical load and friction, never beyond the friction circle.

A positive slip angle gives a positive lateral force (to the left), a positive slip ratio a positive longitudinal force
(driving). Stiffness is that of one wheel; the cars of `VehicleParameters` state whole axles.
"""

from abc import abstractmethod

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.typing import ArrayLike

from luenberger.core import BadInput
from luenberger.vehicle.tyres import Number


class LoadedTyre(eqx.Module):
    """What every loaded tyre offers: forces from slip, forces under a longitudinal demand, and stiffness by load.

    Args:
        cornering: dFy/dalpha at zero slip and nominal load [N/rad].
        slip_stiffness: dFx/dkappa at zero slip and nominal load [N].
        nominal_load: vertical load at which the two stiffnesses hold [N].
        peak_load: vertical load of the greatest stiffness [N], `math.inf` for stiffness proportional to load.
    """

    cornering: Number
    slip_stiffness: Number
    nominal_load: Number
    peak_load: Number

    @abstractmethod
    def __call__(
        self, slip_angle: ArrayLike, slip_ratio: ArrayLike, load: ArrayLike, friction: ArrayLike
    ) -> tuple[jax.Array, jax.Array]:
        """Return (Fx, Fy) [N] in the axes of the wheel; all arguments share one shape.

        Args:
            slip_angle: alpha [rad].
            slip_ratio: kappa = (wheel speed - road speed) / road speed, not below -1.
            load: Fz [N], not negative.
            friction: mu.
        """

    def cornering_at(self, load: ArrayLike) -> jax.Array:
        """Return the cornering stiffness at a vertical load [N/rad], degressive: doubling the load does not double it.

        Args:
            load: Fz [N].
        """
        return jnp.asarray(self.cornering * self._stiffness_per_load(load) * load)

    def _stiffness_per_load(self, load: ArrayLike) -> jax.Array:
        """Return stiffness over load, relative to nominal stiffness [1/N]; sin(2 atan z) = 2 z / (1 + z^2)."""
        nominal, peak = jnp.asarray(self.nominal_load), jnp.asarray(self.peak_load)
        return (1.0 + (nominal / peak) ** 2) / (nominal * (1.0 + (load / peak) ** 2))

    def driven(
        self,
        slip_angle: ArrayLike,
        demand: ArrayLike,
        load: ArrayLike,
        friction: ArrayLike,
        share: ArrayLike = 0.95,
    ) -> tuple[jax.Array, jax.Array]:
        """Return (Fx, Fy) [N] of a wheel that brakes or drives with a wanted force, for models without wheel speeds.

            Fx = demand held within +- share mu Fz      Fy = Fy(alpha, 0) sqrt(1 - (Fx / (mu Fz))^2)

        The share stands for a slip controller; below one it leaves some lateral force under full braking.

        Args:
            slip_angle: alpha [rad].
            demand: wanted longitudinal force [N].
            load: Fz [N].
            friction: mu.
            share: part of mu Fz that braking and driving may take, from 0 to below 1.
        """
        peak = jnp.asarray(friction) * jnp.asarray(load)
        used = jnp.clip(jnp.asarray(demand) / jnp.where(peak > 0, peak, 1.0), -jnp.asarray(share), share)
        lateral = self(slip_angle, jnp.zeros_like(peak), load, friction)[1]
        return used * peak, lateral * jnp.sqrt(1.0 - used**2)


class MagicFormulaCombined(LoadedTyre):
    """Magic Formula of one curve for all slip directions (similarity); the force falls again beyond the peak.

        |F| = mu Fz sin(C atan(rho / C - E (rho / C - atan(rho / C)))),   rho = |(Ck kappa, Ca alpha)| / (mu Fz)

    The force points along the stiffness-weighted slip (Ck kappa, Ca alpha). Choose it as the truth behind observers whose
    tyres are linear, brush or Magic Formula of the axle. Force directions of real tyres turn towards the sliding velocity
    at full slip; this is left out.

    Args:
        shape: C, from 1 to below 2.
        curvature: E, at most 1.

    Reference: H. Pacejka, Tire and Vehicle Dynamics (2012), sections 4.2 (similarity) and 4.3 (stiffness by load).
    """

    shape: Number = 1.35
    curvature: Number = 0.0

    def __call__(
        self, slip_angle: ArrayLike, slip_ratio: ArrayLike, load: ArrayLike, friction: ArrayLike
    ) -> tuple[jax.Array, jax.Array]:
        """Return (Fx, Fy) [N]; see `LoadedTyre.__call__`."""
        load, friction = jnp.asarray(load), jnp.asarray(friction)
        per_friction = self._stiffness_per_load(load) / friction
        x = self.slip_stiffness * per_friction * slip_ratio
        y = self.cornering * per_friction * slip_angle
        square = x**2 + y**2
        # The quotient g(rho) / rho tends to one; dividing at zero would spoil gradients there.
        moving = square > 1e-24
        rho = jnp.sqrt(jnp.where(moving, square, 1.0))
        z = rho / self.shape
        curve = jnp.sin(self.shape * jnp.arctan(z - self.curvature * (z - jnp.arctan(z))))
        force = friction * load * jnp.where(moving, curve / rho, 1.0)
        return force * x, force * y


class DugoffTyre(LoadedTyre):
    """Dugoff tyre: linear until half of the friction is used, then bending towards mu Fz without ever falling.

    Choose it as a second truth with a different bend, or where only stiffness and friction are known. The fall of friction
    with sliding speed is left out, so that the bound mu Fz is reached only in the limit.

    Reference: H. Dugoff, P. Fancher, L. Segel, SAE 700377 (1970), with constant friction. With S = |(Ck kappa, Ca tan alpha)|
        and 2 lambda = mu Fz (1 + kappa) / S, their force is S / (1 + kappa) below and mu Fz (1 - lambda / 2) from half the friction on.
    """

    def __call__(
        self, slip_angle: ArrayLike, slip_ratio: ArrayLike, load: ArrayLike, friction: ArrayLike
    ) -> tuple[jax.Array, jax.Array]:
        """Return (Fx, Fy) [N]; see `LoadedTyre.__call__`."""
        load, friction, slip_ratio = jnp.asarray(load), jnp.asarray(friction), jnp.asarray(slip_ratio)
        per_friction = self._stiffness_per_load(load) / friction
        x = self.slip_stiffness * per_friction * slip_ratio
        y = self.cornering * per_friction * jnp.tan(jnp.asarray(slip_angle))
        square = x**2 + y**2
        moving = square > 1e-24
        pull = jnp.sqrt(jnp.where(moving, square, 1.0))
        rolling = jnp.maximum(1.0 + slip_ratio, 0.0)
        sliding = 2.0 * pull > rolling
        safe = jnp.where(rolling > 0, rolling, 1.0)
        used = jnp.where(sliding, 1.0 - rolling / (4.0 * pull), pull / safe)
        force = friction * load * jnp.where(moving, used / pull, 1.0)
        return force * x, force * y


def secant_stiffness(force: ArrayLike, slip_angle: ArrayLike, least_slip: float = 1e-3) -> jax.Array:
    """Return F / alpha [N/rad], NaN where |alpha| is below `least_slip` and the quotient would be noise.

    Choose it to hold a truth against the stiffness box that an interval or robust observer was designed for.

    Args:
        force: lateral force [N].
        slip_angle: alpha [rad], the definition that the observer uses.
        least_slip: smallest slip angle that is divided by [rad], positive.

    Raises:
        BadInput: `least_slip` is not positive.
    """
    if not least_slip > 0:
        raise BadInput(
            f"`least_slip` is {least_slip} rad; a positive angle is needed, below which F / alpha is no number."
        )
    slip = jnp.asarray(slip_angle)
    known = jnp.abs(slip) >= least_slip
    return jnp.where(known, jnp.asarray(force) / jnp.where(known, slip, 1.0), jnp.nan)
