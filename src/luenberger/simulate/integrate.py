"""The pure core of simulation: states at given times from right-hand side, start and inputs, ready for vmap."""

from collections.abc import Callable
from typing import Any

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

Dynamics = Callable[[Any, Any, Any, Any], Any]
Signal = Callable[[Any], Any]


class Integration(eqx.Module):
    """States at the wanted times, and whether the solver came through.

    Args:
        x: states, shape (nt, nx); not finite after the place where the solver gave up.
        succeeded: True where every wanted time was reached.
        steps: number of solver steps.
    """

    x: Float[Array, "nt nx"]
    succeeded: Bool[Array, ""]
    steps: Int[Array, ""]


def integrate(
    dynamics: Dynamics,
    time: Float[Array | np.ndarray, "nt"],
    x0: Float[Array | np.ndarray, "nx"],
    u: Signal,
    r: Signal,
    *,
    jump_times: Float[Array | np.ndarray, "nj"] | None = None,
    rtol: float = 1e-10,
    atol: float = 1e-12,
    solver: Any = None,
    max_steps: int = 1_000_000,
) -> Integration:
    """Integrate x' = dynamics(t, x, u(t), r(t)) with adaptive steps that meet every wanted time.

    Nothing is checked and nothing is raised, so the function can stand under jit and vmap; `simulate` does both.

    Args:
        dynamics: JAX function (t, x, u, r) -> dx, shape (nx,).
        time: wanted times [s], increasing; the first is the start.
        x0: state at time[0].
        u: JAX function of time, input.
        r: JAX function of time, scheduling.
        jump_times: increasing times at which u or r jumps; the solver starts afresh there.
        rtol: relative tolerance a step.
        atol: absolute tolerance a step, in the units of the states.
        solver: a diffrax solver; default `diffrax.Dopri8()`. Take `diffrax.Kvaerno5()` for stiff models.
        max_steps: solver steps after which it gives up.

    Reference: P. Kidger, On Neural Differential Equations (2021), chapter 5 (diffrax); E. Hairer, S. Norsett and
        G. Wanner, Solving Ordinary Differential Equations I (1993), section II.5 (Dormand-Prince 8(5,3)).
    """
    time = jnp.asarray(time)
    jump_times = None if jump_times is None or jump_times.shape[0] == 0 else jnp.asarray(jump_times)
    # Interpolation between steps is less accurate than the steps themselves, so the wanted times are stepped to.
    controller = diffrax.ClipStepSizeController(
        diffrax.PIDController(rtol=rtol, atol=atol), step_ts=time, jump_ts=jump_times
    )
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(lambda t, x, _: jnp.asarray(dynamics(t, x, u(t), r(t)))),
        diffrax.Dopri8() if solver is None else solver,
        t0=time[0],
        t1=time[-1],
        dt0=None,
        y0=jnp.asarray(x0),
        saveat=diffrax.SaveAt(ts=time),
        stepsize_controller=controller,
        max_steps=max_steps,
        throw=False,
    )
    x: Any = solution.ys
    succeeded = jnp.asarray(solution.result == diffrax.RESULTS.successful) & jnp.all(jnp.isfinite(x))
    return Integration(x, succeeded, jnp.asarray(solution.stats["num_steps"]))


def iterate(
    dynamics: Dynamics,
    time: Float[Array | np.ndarray, "nt"],
    x0: Float[Array | np.ndarray, "nx"],
    u: Signal,
    r: Signal,
) -> Float[Array, "nt nx"]:
    """Run the discrete plant x+ = dynamics(t, x, u(t), r(t)) over the given times; pure, as `integrate`.

    Args:
        dynamics: JAX function (t, x, u, r) -> next x, shape (nx,).
        time: sample times [s].
        x0: state at time[0].
        u: JAX function of time, input.
        r: JAX function of time, scheduling.
    """

    def advance(x: Any, t: Any) -> tuple[Any, Any]:
        return jnp.asarray(dynamics(t, x, u(t), r(t)), x.dtype), x

    return jax.lax.scan(advance, jnp.asarray(x0), jnp.asarray(time))[1]
