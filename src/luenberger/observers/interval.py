"""Two copies of the plant that hold the state between them, whatever the unmeasured parameters, noise and errors do."""

import math
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer

from luenberger.algebra import Polynomial
from luenberger.core import BadInput, NotAccepted
from luenberger.core.checks import finite_array
from luenberger.observers.correction import LARGEST_STEP, MOST_SUBSTEPS, checked_gain
from luenberger.observers.enclosed_plant import Enclosed
from luenberger.observers.interval_drift import ORDER, Bounds
from luenberger.observers.observer import Estimate, Observer
from luenberger.observers.plant import Fixed, sample_time
from luenberger.systems.system import System


class IntervalObserver(Observer):
    """Upper and lower bound of the state, each driven by the output error.

    With z = T x, hidden parameters q, true scheduling r anywhere its measured value m allows, row by row:

        zu' = max over (q, r) of [T A(r,q) T^-1 zu + T B(r,q) u - L_z(m) (C(r) T^-1 zu + D(r) u - y)] + slack
        zl' = min over (q, r) of [the same with zl] - slack
        slack = |T B N + L_z (G - D N)| noise_bound + |T E| disturbance_bound,      L_z = T L

    Choose it where a bound is wanted that holds for every tyre, load or road inside the declared intervals, and not a most
    likely value. The estimate is the midpoint. The bounds are of one sample ahead: at sample k they have used y up to t_(k-1).

    Assumes: a continuous plant, linear in the state, whose matrices are multi-affine in q and in the scheduling that is read
    with error; T (A(r,q) - L(m) C(r)) T^-1 with no negative entry off its diagonal for all that can happen (the claim
    "containment" proves both for a design; here any gain runs); and the start inside its bounds.

    Guarantees under these assumptions, with u, r, q, d and v held between sub-steps: lower <= x <= upper at every sample, up to
    rounding. Three things make it so after sampling. The step is a sum with positive weights of chained Euler steps, which keep
    the order as long as the sub-step times the largest diagonal entry is at most one (checked when built). What the series
    leaves out is bounded and added. The output is read at the sample while C x moves on between samples: its motion is
    enclosed by a further pair of bounds, set to zero at every sample, instead of being taken as zero. Inputs that move between
    samples are errors of the input: bound them in `noise_bound`. Parameters that move inside a sub-step add a term of
    second order in the sub-step; raise `substeps` where they are that fast.

    Args:
        system: plant with its bounds; parameters that are not measured are q.
        gain: L(r), shape (nx, ny): nested numbers or `Polynomial` in the scheduling parameters.
        dt: sample time [s].
        transform: T, shape (nx, nx); None for the states themselves.
        initial_half_width: (nx,) what `init` puts around a guess; not needed where `init` is given both bounds.
        substeps: parts of the step; None takes as many as the fastest closed loop over the box needs.
        clip_scheduling: clip r into the box of what can be read before use.
        with_noise: keep the noise in the slack; False shows what the bounds are worth without.
        with_offset: keep the disturbance in the slack.
        with_scheduling_error: let the true scheduling differ from the measured one.

    Raises:
        BadInput: wrong shapes, a singular T, unknown parameters, or a closed loop too fast for this sample time.
        NotAccepted: a discrete or nonlinear plant, matrices as functions, powers of what is not measured, a scheduling error
            declared as a map, a noise or disturbance without bound.

    Reference: J. Gouze, A. Rapaport, M. Hadj-Sadok 2000 (interval observers); Wang 2014, equations 4.4 to 4.14, with noise, force
        offset and scheduling error added; S. Gottlieb, C. Shu, E. Tadmor 2001, section 4 (linear order-preserving steps).
    """

    gain: Polynomial
    remainder: jax.Array | np.ndarray
    dt: float = eqx.field(static=True)
    plant: Fixed[Enclosed] = eqx.field(static=True)
    initial_half_width: tuple[float, ...] | None = eqx.field(static=True)
    substeps: int = eqx.field(static=True)
    clip_scheduling: bool = eqx.field(static=True)

    def __init__(
        self,
        system: System,
        gain: Any,
        dt: float | None = None,
        *,
        transform: Any = None,
        initial_half_width: Any = None,
        substeps: int | None = None,
        clip_scheduling: bool = False,
        with_noise: bool = True,
        with_offset: bool = True,
        with_scheduling_error: bool = True,
    ):
        if system.dt is not None or system.nonlinearity is not None:
            what = "is discrete" if system.dt is not None else "has a nonlinearity"
            raise NotAccepted(
                f"`{system.name}` {what}; an interval observer is written for continuous plants that are linear in the state."
            )
        self.dt = sample_time(system, dt)
        self.gain = checked_gain(system, gain)
        self.clip_scheduling = clip_scheduling
        self.initial_half_width = _half_width(system, initial_half_width)
        switches = {"noise": with_noise, "offset": with_offset, "scheduling_error": with_scheduling_error}
        enclosed = Enclosed.of(system, transform, any(np.any(c) for _, c in self.gain), switches)
        self.plant = Fixed(enclosed)
        largest_entries = enclosed.largest_entries(self.gain)
        self.substeps = _substeps(largest_entries, self.dt, substeps)
        self.remainder = _remainder(largest_entries * (self.dt / self.substeps))

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the estimated states."""
        return self.plant.value.system.states

    @property
    def reads(self) -> System:
        """The plant whose signals it reads."""
        return self.plant.value.system

    def init(self, x0: Any) -> jax.Array:
        """Return the start state, the bounds of z in shape (2, nx), lower first.

        Args:
            x0: a guess (nx,), taken with `initial_half_width` on both sides, or the bounds (lower, upper), shape (2, nx);
                float32 here makes the whole run float32.

        Raises:
            BadInput: wrong shape, a guess without `initial_half_width`, or a lower bound above the upper one.
        """
        nx = self.plant.value.system.nx
        x = jnp.asarray(x0)
        x = x if jnp.issubdtype(x.dtype, jnp.floating) else x.astype(float)
        if x.shape == (nx,):
            if self.initial_half_width is None:
                raise BadInput(
                    "The observer starts from a guess but has no `initial_half_width`; give one, or start it from (lower, upper)."
                )
            half = jnp.asarray(self.initial_half_width, x.dtype)
            x = jnp.stack([x - half, x + half])
        if x.shape != (2, nx):
            raise BadInput(
                f"`x0` has shape {x.shape}; a guess ({nx},) or the bounds (2, {nx}), lower first, are needed."
            )
        if not isinstance(x, Tracer) and bool(jnp.any(x[0] > x[1])):
            raise BadInput(f"`x0` has the lower bound {x[0]} above the upper bound {x[1]}; give the lower one first.")
        return jnp.stack(_turned(self.plant.value.transform, x[0], x[1]))

    def step(self, state: Any, u: Any, y: Any, r: Any) -> tuple[jax.Array, Estimate]:
        """Advance by one sample; see `Observer.step`."""
        enclosed, dtype = self.plant.value, state.dtype
        u, y, r = (jnp.asarray(signal, dtype) for signal in (u, y, r))
        if self.clip_scheduling and enclosed.system.nr:
            r = jnp.clip(r, *np.array(enclosed.readable, dtype).T)
        L = self.gain.map(lambda c: jnp.asarray(c, dtype))(dict(zip(enclosed.system.scheduling_names, r, strict=True)))
        drift = enclosed.drift(L, u, y, r)
        h = self.dt / self.substeps
        still = [jnp.zeros((), dtype)] * drift.ny
        bounds = Bounds([*state[0], *still], [*state[1], *still])

        def part(carry: Any, _: None) -> tuple[Any, None]:
            after = drift.advance(Bounds(*carry), h, self.remainder)
            return (after.lower, after.upper), None

        # Loops keep the compiler from writing the same sub-expressions out again for every stage that uses them.
        if self.substeps == 1:
            bounds = drift.advance(bounds, h, self.remainder)
        else:
            bounds = Bounds(*jax.lax.scan(part, (bounds.lower, bounds.upper), None, length=self.substeps)[0])
        nx = enclosed.system.nx
        after = jnp.stack([jnp.stack(bounds.lower[:nx]), jnp.stack(bounds.upper[:nx])])
        lower, upper = _turned(enclosed.inverse, state[0], state[1])
        return after, Estimate(0.5 * (lower + upper), lower=lower, upper=upper)


def _turned(T: np.ndarray, lower: Any, upper: Any) -> tuple[jax.Array, jax.Array]:
    """Bounds of T x from bounds of x."""
    rows = [[float(a) for a in row] for row in T]
    ends: tuple[list[Any], list[Any]] = ([], [])
    for row in rows:
        for out, (one, other) in zip(ends, ((lower, upper), (upper, lower)), strict=True):
            out.append(sum(a * (one if a > 0 else other)[k] for k, a in enumerate(row) if a))
    return jnp.stack(ends[0]), jnp.stack(ends[1])


def _half_width(system: System, given: Any) -> tuple[float, ...] | None:
    if given is None:
        return None
    half = finite_array("initial_half_width", given)
    if half.shape != (system.nx,) or (half < 0).any():
        raise BadInput(
            f"`initial_half_width` is {half.tolist()}; {system.nx} numbers >= 0 are needed, one for each of {list(system.states)}."
        )
    return tuple(map(float, half))


def _substeps(entries: np.ndarray, dt: float, given: int | None) -> int:
    """Parts of the step: sub-steps must keep order, and be short against the fastest motion."""
    if given is not None:
        h, fastest = dt / max(given, 1), float(np.diag(entries).max())
        if given < 1 or h * fastest > 1:
            raise BadInput(
                f"`substeps` is {given}; with a diagonal entry of {fastest:.3g} 1/s and dt = {dt:g} s at least "
                f"{max(1, math.ceil(dt * fastest))} are needed to keep the order."
            )
        return given
    fastest = float(np.abs(np.linalg.eigvals(entries)).max())
    count = max(1, math.ceil(dt * fastest / LARGEST_STEP * (1 - 1e-12)))
    if count > MOST_SUBSTEPS:
        raise BadInput(
            f"The closed loop, up to {fastest:.3g} 1/s, needs {count} sub-steps in dt = {dt:g} s; at most {MOST_SUBSTEPS} are "
            "taken. Use a smaller `dt` or a slower gain, or set `substeps` yourself."
        )
    return count


def _remainder(scaled: np.ndarray) -> np.ndarray:
    """Return sum over j > ORDER of X^(j-1) / j!, what the Taylor polynomial leaves out per unit of h slope, for |h M| <= X."""
    total, power, j = np.zeros_like(scaled), np.linalg.matrix_power(scaled, ORDER), ORDER + 1
    while power.max(initial=0.0) / math.factorial(j) > 1e-3 * np.finfo(float).eps * total.max(initial=0.0):
        total, power, j = total + power / math.factorial(j), power @ scaled, j + 1
    return total
