"""Open-loop manoeuvres: road-wheel angle and speed as functions of time, with their exact rates.

    manoeuvre = fishhook(amplitude=0.08, speed=20.0)
    many = eqx.tree_at(lambda m: m.turn.amplitude, manoeuvre, jnp.linspace(0.02, 0.1, 50))     # for vmap

Amplitudes, speeds, rates and times are leaves. Angles are those of the road wheels [rad], positive to the left. The speed is a
plan: a model that has it as scheduling follows exactly, one that is driven by forces needs a pedal (`SpeedKeeper`).
"""

from abc import abstractmethod
from math import isfinite, radians
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from luenberger.core import BadInput
from luenberger.vehicle.tyres import Number

# 4 / sqrt(27): with it the amplitude of a lobe is its peak.
LOBE_PEAK = 0.7698


def _leaf(value: Any) -> jax.Array:
    return jnp.asarray(value, dtype=float)


def _held(x: Any, upper: Any) -> jax.Array:
    # Not `clip`, whose derivative at a corner is the mean of both sides; this takes the side to come.
    return jnp.where(x < 0.0, 0.0, jnp.where(x < upper, x, upper))


def _number() -> Any:
    # Arrays, so that a compiled simulation serves every amplitude.
    return eqx.field(converter=_leaf)


class Profile(eqx.Module):
    """A signal over time with its exact derivative."""

    @abstractmethod
    def value(self, t: Any) -> jax.Array:
        """Return the signal at a time [s], any shape."""

    def rate(self, t: Any) -> jax.Array:
        """Return its time derivative by forward differentiation; at a corner that of the side to come."""
        time = _leaf(t)
        return jax.jvp(self.value, (time,), (jnp.ones_like(time),))[1]

    @property
    @abstractmethod
    def corners(self) -> jax.Array:
        """Times at which signal, rate or second derivative jumps [s], increasing, shape (nj,)."""


class Constant(Profile):
    """A signal that does not change.

    Args:
        level: its value.
    """

    level: Number = _number()

    def value(self, t: Any) -> jax.Array:
        """Return the level."""
        return jnp.broadcast_to(_leaf(self.level), jnp.shape(t))

    @property
    def corners(self) -> jax.Array:
        """None."""
        return jnp.zeros(0)


class BrokenLine(Profile):
    """Straight lines between levels that are multiples of an amplitude, zero before, the last level held.

    Each line lasts its own time and, where the rate of the actuator is the limit, a share of |amplitude| / slew more.

    Args:
        amplitude: factor on the levels; negative turns the other way first.
        start: when the first line begins [s].
        levels: level at the end of each line, shape (nl,).
        lengths: fixed part of the time of each line [s], shape (nl,).
        turns: levels each line crosses at the slew rate, 0 where its time is fixed, shape (nl,).
        slew: rate of those lines [1/s times the unit], positive.
    """

    amplitude: Number = _number()
    start: Number = _number()
    levels: Number = _number()
    lengths: Number = _number()
    turns: Number = _number()
    slew: Number = _number()

    def value(self, t: Any) -> jax.Array:
        """Return the signal at a time [s], any shape."""
        steps = self.amplitude * jnp.diff(_leaf(self.levels), prepend=0.0)
        spans = jnp.diff(self.corners)
        gone = _held(_leaf(t)[..., None] - self.corners[:-1], spans)
        # A line of no length has no step either.
        return jnp.sum(steps * gone / jnp.where(spans > 0, spans, 1.0), axis=-1)

    @property
    def corners(self) -> jax.Array:
        """Ends of the lines."""
        lengths = self.lengths + self.turns * jnp.abs(_leaf(self.amplitude)) / self.slew
        return _leaf(self.start) + jnp.concatenate([jnp.zeros(1), jnp.cumsum(_leaf(lengths))])


class DwellingSine(Profile):
    """Whole periods of a sine, with a pause at the last peak; without a pause a plain sine.

        A sin(2 pi f w),   w = t - start less the time spent in the pause, held within [0, cycles / f]

    Args:
        amplitude: A.
        frequency: f [Hz].
        start: when it begins [s].
        cycles: number of periods.
        dwell: length of the pause [s], three quarters into the last period.
    """

    amplitude: Number = _number()
    frequency: Number = _number()
    start: Number = _number()
    cycles: Number = _number()
    dwell: Number = _number()

    def value(self, t: Any) -> jax.Array:
        """Return the signal at a time [s], any shape."""
        since = _leaf(t) - self.start
        paused = _held(since - (self.cycles - 0.25) / self.frequency, self.dwell)
        running = _held(since - paused, self.cycles / self.frequency)
        return _leaf(self.amplitude) * jnp.sin(2 * jnp.pi * self.frequency * running)

    @property
    def corners(self) -> jax.Array:
        """Start, both ends of the pause, end."""
        pause = self.start + (self.cycles - 0.25) / self.frequency
        end = self.start + self.cycles / self.frequency + self.dwell
        return jnp.stack([_leaf(t) for t in (self.start, pause, pause + self.dwell, end)])


class Lobes(Profile):
    """Double swings A 0.7698 (sin 2 pi s - sin(4 pi s) / 2), s = (t - t0) / length in [0, 1]; smooth at both ends.

    Args:
        amplitudes: A of each lobe, its peak, shape (nl,).
        starts: t0 of each lobe [s], shape (nl,).
        length: length of a lobe [s].
    """

    amplitudes: Number = _number()
    starts: Number = _number()
    length: Number = _number()

    def value(self, t: Any) -> jax.Array:
        """Return the signal at a time [s], any shape."""
        phase = 2 * jnp.pi * _held((_leaf(t)[..., None] - self.starts) / self.length, 1.0)
        return LOBE_PEAK * jnp.sum(self.amplitudes * (jnp.sin(phase) - 0.5 * jnp.sin(2 * phase)), axis=-1)

    @property
    def corners(self) -> jax.Array:
        """Both ends of each lobe: there the second derivative jumps."""
        return jnp.sort(jnp.concatenate([_leaf(self.starts), _leaf(self.starts + self.length)]))


class HalfCosine(Profile):
    """From one level to another as half a period of a cosine; the rate has no jump.

    Args:
        first: level before.
        last: level after.
        start: when it leaves the first level [s].
        length: time of the change [s].
    """

    first: Number = _number()
    last: Number = _number()
    start: Number = _number()
    length: Number = _number()

    def value(self, t: Any) -> jax.Array:
        """Return the signal at a time [s], any shape."""
        share = _held((_leaf(t) - self.start) / self.length, 1.0)
        return _leaf(self.first) + 0.5 * (self.last - self.first) * (1 - jnp.cos(jnp.pi * share))

    @property
    def corners(self) -> jax.Array:
        """Both ends: there the second derivative jumps."""
        return jnp.stack([_leaf(self.start), _leaf(self.start + self.length)])


class Manoeuvre(eqx.Module):
    """Steering and speed over time; a pytree whose numbers vmap varies.

    Args:
        turn: profile of the road-wheel angle [rad].
        pace: profile of the speed vx [m/s].
        duration: how long it takes, with the time to settle [s].
        name: how it is called.
    """

    turn: Profile
    pace: Profile
    duration: float = eqx.field(static=True)
    name: str = eqx.field(static=True)

    def steering(self, t: Any) -> jax.Array:
        """Return the road-wheel angle [rad] at a time [s]."""
        return self.turn.value(t)

    def steering_rate(self, t: Any) -> jax.Array:
        """Return d delta/dt [rad/s] at a time [s]."""
        return self.turn.rate(t)

    def speed(self, t: Any) -> jax.Array:
        """Return vx [m/s] at a time [s]."""
        return self.pace.value(t)

    def acceleration(self, t: Any) -> jax.Array:
        """Return d vx/dt [m/s^2] at a time [s]; not what an accelerometer reads in a bend."""
        return self.pace.rate(t)

    @property
    def jump_times(self) -> jax.Array:
        """Times at which an input or one of its derivatives jumps [s], increasing; the argument of that name of `simulate`."""
        return jnp.sort(jnp.concatenate([self.turn.corners, self.pace.corners]))


def step_steer(amplitude: Any, speed: Any, *, start: float = 1.0, rise: float = 0.1, settle: float = 4.0) -> Manoeuvre:
    """Return a step of the steering with a steep flank, for the transient of yaw and slip.

    Args:
        amplitude: road-wheel angle [rad]; a number or a traced array, as the speed.
        speed: vx [m/s], kept even where a standard lets the car coast.
        start: when the wheel moves [s].
        rise: time of the flank [s]; zero would ask for an infinite steering rate and is refused.
        settle: time after the wheel has stopped [s].

    Raises:
        BadInput: a time that is not positive.

    Reference: ISO 7401, Road vehicles: Lateral transient response test methods, step input.
    """
    _positive(start=start, rise=rise, settle=settle)
    return Manoeuvre(_ramp(amplitude, start, rise), Constant(speed), start + rise + settle, "step steer")


def ramp_steer(slope: Any, speed: Any, *, start: float = 1.0, rise: float = 20.0, settle: float = 2.0) -> Manoeuvre:
    """Return slowly increasing steering, which takes the tyres to their peak almost in steady state.

    Args:
        slope: rate of the road wheel [rad/s]; customary are 13.5 deg/s at the steering wheel and 80 km/h. Other arguments as in
            `step_steer`, with the same refusals.

    Reference: FMVSS 126 (49 CFR 571.126), S7.6, slowly increasing steer test.
    """
    _positive(start=start, rise=rise, settle=settle)
    turn = _ramp(_leaf(slope) * rise, start, rise)
    return Manoeuvre(turn, Constant(speed), start + rise + settle, "ramp steer")


def slalom(amplitude: Any, speed: float, *, spacing: float = 18.0, cones: int = 10, start: float = 1.0) -> Manoeuvre:
    """Return sinusoidal steering as round evenly spaced cones, f = vx / (2 spacing), and a second straight on.

    Args:
        speed: vx [m/s]; fixes frequency and duration, so it is a plain number here. Other arguments as in `step_steer`.
        spacing: distance of the cones [m]; 18 m is customary on proving grounds, no standard fixes it.
        cones: number of half periods, even.

    Raises:
        BadInput: a number that is not positive, or an odd number of cones.
    """
    _positive(speed=speed, spacing=spacing, cones=cones, start=start)
    if cones % 2:
        raise BadInput(f"`cones` is {cones}; an even number of half periods is needed to end straight.")
    frequency = speed / (2 * spacing)
    turn = DwellingSine(amplitude, frequency, start, cones // 2, 0.0)
    return Manoeuvre(turn, Constant(speed), start + cones / 2 / frequency + 1.0, "slalom")


def sine_with_dwell(amplitude: Any, speed: Any = 80 / 3.6, *, start: float = 1.0) -> Manoeuvre:
    """Return the test of stability control: one period of a sine that pauses at its second peak.

    Its frequency is 0.7 Hz and its pause 0.5 s; four seconds straight follow.

    Args:
        amplitude: road-wheel angle [rad]; the standard raises it from 1.5 times the angle for 0.3 g on. Other arguments as in
            `step_steer`, with the same refusals.

    Reference: FMVSS 126 (49 CFR 571.126), S7.9 and figure 2.
    """
    _positive(start=start)
    turn = DwellingSine(amplitude, 0.7, start, 1.0, 0.5)
    return Manoeuvre(turn, Constant(speed), start + 1 / 0.7 + 0.5 + 4.0, "sine with dwell")


def fishhook(
    amplitude: Any,
    speed: Any = 50 * 0.44704,
    *,
    steering_ratio: float = 16.0,
    start: float = 1.0,
    duration: float = 8.0,
) -> Manoeuvre:
    """Return the rollover test: a turn and its reverse at 720 deg/s of the steering wheel, held 3 s, back within 2 s.

    The pause before the reverse lasts 0.25 s; the agency also has a test in which it waits for the roll rate.

    Args:
        amplitude: road-wheel angle [rad]; the agency takes 6.5 times the angle for 0.3 g. Other arguments as in `step_steer`,
            with the same refusals.
        speed: vx [m/s]; the agency enters with 35 to 50 mile/h.
        steering_ratio: angle of the steering wheel over that of the road wheels.
        duration: end of the manoeuvre [s]; enough for 0.3 rad at the other defaults.

    Reference: G. Forkenbrock et al., NHTSA DOT HS 809 513 (2002), fixed timing fishhook.
    """
    _positive(steering_ratio=steering_ratio, start=start, duration=duration)
    levels, lengths, turns = _leaf([[1, 1, -1, -1, 0], [0, 0.25, 0, 3, 2], [1, 0, 2, 0, 0]])
    turn = BrokenLine(amplitude, start, levels, lengths, turns, radians(720) / steering_ratio)
    return Manoeuvre(turn, Constant(speed), duration, "fishhook")


def braking_lane_changes(scale: Any = 1.0) -> Manoeuvre:
    """Return two lane changes while braking from 78 to 23 km/h, so that speed and slip angles sweep their ranges together.

    Args:
        scale: factor on the steering, whose peaks are 0.022 and -0.045 rad.

    Reference: Wang 2014, figures 3.7 and 3.8, whose speeds these are; the dissertation prints neither steering nor times, so
        both are chosen here.
    """
    turn = Lobes(_leaf(scale) * jnp.array([0.022, -0.045]), _leaf([0.5, 4.0]), 2.5)
    return Manoeuvre(turn, HalfCosine(78 / 3.6, 23 / 3.6, 1.0, 8.0), 10.0, "lane changes while braking")


def _ramp(amplitude: Any, start: float, rise: float) -> BrokenLine:
    return BrokenLine(amplitude, start, _leaf([1.0]), _leaf([rise]), _leaf([0.0]), 1.0)


def _positive(**numbers: float) -> None:
    for name, value in numbers.items():
        if not (isfinite(value) and value > 0):
            raise BadInput(f"`{name}` is {value}; a positive finite number is needed.")
