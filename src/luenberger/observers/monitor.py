"""What an interval observer was promised, watched at run time: which assumption held when, and which break lost the state.

Every monitor is an excess: a number for every sample that is positive where the assumption is broken, in the unit of what is
watched. The functions are plain JAX, for one sample inside a scan as for a whole log. Some need what only a simulation or a
reference sensor knows; they say so.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from luenberger.core import BadInput
from luenberger.core.checks import finite_array, known_keys
from luenberger.observers.enclosed_plant import Enclosed
from luenberger.observers.observer import Estimate
from luenberger.systems.parameter import Parameter
from luenberger.systems.system import System

# Excess below this, relative to the size of the bound, is rounding.
_ROUNDING = 1e-12


@dataclass(frozen=True, eq=False)
class Assumption:
    """One assumption over a drive.

    Args:
        name: what is assumed.
        time: sample times [s], shape (nt,).
        excess: by how much it is broken at every sample, positive where it is [unit], shape (nt,).
        unit: unit of the excess.
        needs_truth: True where a running observer could not have known it.
    """

    name: str
    time: np.ndarray
    excess: np.ndarray
    unit: str = ""
    needs_truth: bool = False

    @property
    def held(self) -> Bool[np.ndarray, "nt"]:
        """True at the samples where the assumption holds."""
        return self.excess <= 0

    @property
    def share(self) -> float:
        """Share of the samples at which it holds."""
        return float(self.held.mean())

    @property
    def first_break_time(self) -> float | None:
        """First time at which it is broken [s], None where it always holds."""
        return None if self.held.all() else float(self.time[int((~self.held).argmax())])

    @property
    def worst(self) -> float:
        """Largest excess [unit]; not above zero where it always holds."""
        return float(self.excess.max())

    @property
    def sentence(self) -> str:
        """The assumption in words."""
        how = " (judged with the truth)" if self.needs_truth else ""
        if self.first_break_time is None:
            return f"`{self.name}` held at every sample{how}."
        return (
            f"`{self.name}` held at {100 * self.share:.1f} % of the samples, first broken at t = {self.first_break_time:g} s, "
            f"by at most {self.worst:.3g} {self.unit}".rstrip()
            + f"{how}."
        )


@dataclass(frozen=True, eq=False)
class Sector:
    """|value - slope argument| <= offset with a slope in an interval, e.g. axle force, slip angle and secant stiffness.

    Args:
        name: what is called, e.g. "front axle".
        argument: e.g. slip angle [rad], shape (nt,); the truth.
        value: e.g. axle force [N], shape (nt,); the truth.
        slope: interval of the slope, e.g. of the secant stiffness [N/rad].
        offset: bound of what is left [unit of the value].
        unit: unit of the value.
    """

    name: str
    argument: np.ndarray
    value: np.ndarray
    slope: tuple[float, float]
    offset: float = 0.0
    unit: str = "N"


@dataclass(frozen=True, eq=False)
class Drive:
    """What is known of a drive; what is left out is not watched.

    Args:
        time: sample times [s], shape (nt,).
        r: measured scheduling, shape (nt, nr).
        u: measured input, shape (nt, nu).
        y: measured output, shape (nt, ny).
        estimate: bounds, arrays of shape (nt, nx).
        x: true state, shape (nt, nx).
        true_r: true scheduling, shape (nt, nr).
        noise: true noise v, shape (nt, nv).
        disturbance: true disturbance d, shape (nt, nd).
        uncertainty: name of an unmeasured parameter -> its true values, shape (nt,).
        sectors: relations between true signals.
    """

    time: np.ndarray
    r: np.ndarray | None = None
    u: np.ndarray | None = None
    y: np.ndarray | None = None
    estimate: Estimate | None = None
    x: np.ndarray | None = None
    true_r: np.ndarray | None = None
    noise: np.ndarray | None = None
    disturbance: np.ndarray | None = None
    uncertainty: Mapping[str, np.ndarray] = field(default_factory=dict)
    sectors: Sequence[Sector] = ()


@dataclass(frozen=True)
class Violation:
    """A stretch of samples at which the state lay outside its bounds.

    Args:
        start: first time [s].
        stop: last time [s].
        worst: largest distance from the bounds.
        causes: assumptions that were broken then or within the memory before its first sample.
    """

    start: float
    stop: float
    worst: float
    causes: tuple[str, ...]


def box_excess(value: Any, lower: Any, upper: Any) -> jax.Array:
    """Return how far a value lies outside an interval, negative inside.

    Args:
        value: any shape.
        lower: lower end.
        upper: upper end.
    """
    return jnp.maximum(jnp.asarray(lower) - value, value - jnp.asarray(upper))


def rate_excess(before: Any, value: Any, dt: float, bound: Any) -> jax.Array:
    """Return by how much a signal moves faster than its bound from one sample to the next.

    Args:
        before: the sample before.
        value: this sample.
        dt: time between them [s].
        bound: largest |rate|.
    """
    return jnp.abs(jnp.asarray(value) - before) / dt - bound


def sector_excess(argument: Any, value: Any, slope: tuple[float, float], offset: Any = 0.0) -> jax.Array:
    """Return by how much a value leaves {slope argument + offset}, as of an axle force and its slip angle; needs the truth.

    Args:
        argument: e.g. slip angle [rad].
        value: e.g. axle force [N].
        slope: interval of the slope.
        offset: bound of the rest.
    """
    ends = [end * jnp.asarray(argument) for end in slope]
    return box_excess(value, jnp.minimum(*ends), jnp.maximum(*ends)) - offset


def crossing(lower: Any, upper: Any) -> jax.Array:
    """Return by how much a lower bound lies above its upper bound, the largest over the states; shapes (..., nx)."""
    return jnp.max(jnp.asarray(lower) - jnp.asarray(upper), axis=-1)


def containment_excess(x: Any, lower: Any, upper: Any) -> jax.Array:
    """Return how far a true state x lies outside [lower, upper], the largest over the states; shapes (..., nx)."""
    return jnp.max(box_excess(jnp.asarray(x), lower, upper), axis=-1)


def output_excess(enclosed: Enclosed, lower: Any, upper: Any, u: Any, y: Any, r: Any) -> jax.Array:
    """Return by how much one sample of the outputs contradicts the bounds of the state and of the noise.

    Choose it on the road, where no truth is at hand: what the bounds, the noise and the scheduling error together cannot
    explain proves that one of them is wrong. The reverse proves nothing.

    Args:
        enclosed: the plant, `IntervalObserver.plant.value`.
        lower: lower bound of x, shape (nx,).
        upper: upper bound of x, shape (nx,).
        u: measured input, shape (nu,).
        y: measured output, shape (ny,).
        r: measured scheduling, shape (nr,).
    """
    low, high = enclosed.outputs(lower, upper, u, r)
    return jnp.max(box_excess(jnp.asarray(y), low, high))


def monitor(system: System, drive: Drive) -> tuple[Assumption, ...]:
    """Watch every assumption about a plant that a drive says something of.

    Args:
        system: the plant with the bounds that were trusted.
        drive: measured and, where known, true signals.

    Returns:
        one `Assumption` a bound: range, rate and error of the scheduling, range of the uncertainties, noise, disturbance,
        sectors, consistency of the outputs, order of the bounds and inclusion at the start.

    Raises:
        BadInput: signals of the wrong shape, not finite, or of unknown parameters.
    """
    time = finite_array("time", drive.time)
    found: list[Assumption] = []

    def add(name: str, excess: Any, unit: str = "", scale: float = 0.0, needs_truth: bool = False) -> None:
        found.append(Assumption(name, time, np.asarray(excess, float) - _ROUNDING * abs(scale), unit, needs_truth))

    _watch_scheduling(system, drive, add)
    known_keys("`uncertainty` of the drive", drive.uncertainty, list(system.uncertainty))
    for p in (p for p in system.parameters if p.name in drive.uncertainty):
        values = _signal(p.name, drive.uncertainty[p.name], (time.size,))
        add(f"range of {p.name}", box_excess(values, p.lower, p.upper), p.unit, p.upper, True)
    for word, bound, count in (
        ("noise", system.noise_bound, system.nv),
        ("disturbance", system.disturbance_bound, system.nd),
    ):
        given = getattr(drive, word)
        if given is None or bound is None:
            continue
        values = _signal(word, given, (time.size, count))
        for k, limit in enumerate(bound):
            add(f"{word} {k + 1}", np.abs(values[:, k]) - limit, "", limit, True)
    for sector in drive.sectors:
        argument, value = (_signal(sector.name, v, (time.size,)) for v in (sector.argument, sector.value))
        excess = sector_excess(argument, value, sector.slope, sector.offset)
        add(f"sector of {sector.name}", excess, sector.unit, float(np.abs(value).max()), True)
    _watch_bounds(system, drive, add)
    return tuple(found)


def explain(
    time: Float[np.ndarray, "nt"], violation: Float[np.ndarray, "nt"], assumptions: Sequence[Assumption], memory: float
) -> tuple[Violation, ...]:
    """Say for every stretch outside the bounds which assumption was broken at the time or shortly before.

    Args:
        time: sample times [s].
        violation: distance outside the bounds at every sample, positive outside; `containment_excess`.
        assumptions: from `monitor`.
        memory: time for which a break is remembered [s], a few time constants of the closed loop; a broken inclusion at the
            start is remembered alike.

    Raises:
        BadInput: a negative memory.
    """
    if not memory >= 0:
        raise BadInput(f"`memory` is {memory} s; a time >= 0 is needed.")
    outside = np.flatnonzero(violation > 0)
    if not outside.size:
        return ()
    runs = np.split(outside, np.flatnonzero(np.diff(outside) > 1) + 1)
    found = []
    for run in runs:
        window = (time >= time[run[0]] - memory) & (time <= time[run[-1]])
        causes = tuple(a.name for a in assumptions if not a.held[window].all())
        found.append(Violation(float(time[run[0]]), float(time[run[-1]]), float(violation[run].max()), causes))
    return tuple(found)


def _watch_scheduling(system: System, drive: Drive, add: Any) -> None:
    count = np.size(drive.time)
    read = None if drive.r is None else _signal("r", drive.r, (count, system.nr))
    true = None if drive.true_r is None else _signal("true_r", drive.true_r, (count, system.nr))
    for k, p in enumerate(p for p in system.parameters if p.measured):
        for values, needs_truth in ((read, False), (true, True)):
            if values is None:
                continue
            word = f"true {p.name}" if needs_truth else p.name
            lower, upper = p.interval
            if not needs_truth:
                ends = _readable(p, np.array(p.interval))
                lower, upper = float(ends[0].min()), float(ends[1].max())
            scale = max(abs(lower), abs(upper))
            add(f"range of {word}", box_excess(values[:, k], lower, upper), p.unit, scale, needs_truth)
            # What is read may jump with its noise; the rate is promised of the true scheduling, or of an exact reading.
            if p.rate is not None and count > 1 and (needs_truth or p.is_exact):
                steps = np.diff(np.asarray(drive.time))
                excess = np.abs(np.diff(values[:, k])) / steps - p.rate
                add(f"rate of {word}", np.concatenate([excess[:1], excess]), f"{p.unit}/s", p.rate, needs_truth)
        if read is not None and true is not None:
            lower, upper = _readable(p, true[:, k])
            add(f"error of {p.name}", box_excess(read[:, k], lower, upper), p.unit, float(np.abs(upper).max()), True)


def _watch_bounds(system: System, drive: Drive, add: Any) -> None:
    estimate, count = drive.estimate, np.size(drive.time)
    if estimate is None or estimate.lower is None or estimate.upper is None:
        return
    lower, upper = (_signal(n, getattr(estimate, n), (count, system.nx)) for n in ("lower", "upper"))
    add("lower bound below the upper", crossing(lower, upper))
    if drive.x is not None:
        excess = np.zeros(count)
        excess[0] = float(containment_excess(_signal("x", drive.x, (count, system.nx))[0], lower[0], upper[0]))
        add("state inside at the start", excess, needs_truth=True)
    if drive.y is None:
        return
    every = {"noise": True, "offset": False, "scheduling_error": system.scheduling_error is None}
    enclosed = Enclosed.of(system, None, False, every)
    u = np.zeros((count, 0)) if drive.u is None else drive.u
    r = np.zeros((count, 0)) if drive.r is None else drive.r
    u, y, r = (
        _signal(*s)
        for s in (("u", u, (count, system.nu)), ("y", drive.y, (count, system.ny)), ("r", r, (count, system.nr)))
    )
    excess = jax.jit(jax.vmap(lambda *sample: output_excess(enclosed, *sample)))(lower, upper, u, y, r)
    add("outputs agree with the bounds", excess, "", float(np.abs(y).max()))


def _readable(p: Parameter, true: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Interval of what may be read of true values, one by one."""
    values = np.stack([factor * true + error for factor in p.factor for error in (-p.error, p.error)])
    return values.min(axis=0), values.max(axis=0)


def _signal(name: str, given: Any, shape: tuple[int, ...]) -> np.ndarray:
    values = finite_array(name, given)
    if values.shape != shape:
        raise BadInput(f"`{name}` of the drive has shape {values.shape}; {shape} is needed.")
    return values
