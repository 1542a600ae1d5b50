"""Law: a certified L2 gain is never exceeded by a simulated disturbance, started from zero error."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from luenberger.design import Design
from luenberger.systems.discretize import runge_kutta
from vector_fields import copy_slope

STEP = 1e-3


@pytest.mark.parametrize("frequency", [0.3, 1.0, 3.0])
def test_disturbance_to_error(design: Design, frequency: float) -> None:
    claims = [c for c in design.certificate.claims if c.kind == "l2_gain" and c.inputs == "disturbance"]
    if not claims:
        return
    system, nx = design.system, design.system.nx
    r = np.array([np.mean(i) for i in system.scheduling_box.values()])
    copy, E = copy_slope(design, jnp.asarray(r)), np.asarray(system.at("E", r))
    weight = np.asarray(claims[0].weight)
    direction = np.linalg.svd(E)[2][0]
    rest = jnp.zeros(system.nu)

    def advance(z: jax.Array, t: jax.Array) -> tuple[jax.Array, None]:
        d = jnp.sin(2 * jnp.pi * frequency * t) * jnp.exp(-0.2 * t) * direction

        def slope(z: jax.Array) -> jax.Array:
            x, xhat = z[:nx], z[nx : 2 * nx]
            dx = system.dynamics(t, x, rest, r) + E @ d
            return jnp.concatenate(
                [dx, copy(t, xhat, rest, x), jnp.array([jnp.sum((weight @ (x - xhat)) ** 2), d @ d])]
            )

        return runge_kutta(slope, z, STEP), None

    end, _ = jax.jit(lambda z: jax.lax.scan(advance, z, STEP * jnp.arange(20_000)))(jnp.zeros(2 * nx + 2))
    # The disturbance is held over a step on both sides of the comparison; rounding is the only slack.
    assert end[-2] <= claims[0].level ** 2 * end[-1] * (1 + 1e-6)
