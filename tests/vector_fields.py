"""What observers integrate, written from their definition, for laws that must not use the observers themselves."""

from collections.abc import Callable

import jax
import jax.numpy as jnp

from luenberger.design import Design


def copy_slope(design: Design, r: jax.Array) -> Callable[[jax.Array, jax.Array, jax.Array, jax.Array], jax.Array]:
    """Return (t, xhat, u, x) -> dxhat of a correction observer, with or without argument gain, at frozen scheduling."""
    system, f = design.system, design.system.nonlinearity
    values = dict(zip(system.scheduling_names, r, strict=True))
    L, C = jnp.asarray(design.gain(values)), jnp.asarray(system.at("C", r))

    def slope(t: jax.Array, xhat: jax.Array, u: jax.Array, x: jax.Array) -> jax.Array:
        seen = C @ (x - xhat)
        dxhat = system.dynamics(t, xhat, u, r) + L @ seen
        if design.argument_gain is None or f is None:
            return dxhat
        zeta = xhat + jnp.asarray(design.argument_gain(values)) @ seen
        return dxhat + jnp.asarray(system.at("F", r)) @ (f(zeta, u) - f(xhat, u))

    return slope
