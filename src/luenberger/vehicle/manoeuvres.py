"""Open-loop manoeuvres: road-wheel angle and speed as functions of time, with their exact rates.

    manoeuvre = fishhook(amplitude=0.08, speed=20.0)
    many = eqx.tree_at(lambda m: m.turn.amplitude, manoeuvre, jnp.linspace(0.02, 0.1, 50))     # for vmap

Amplitudes, speeds, rates and times are leaves. Angles are those of the road wheels [rad], positive to the left. The speed is a
plan: a model that has it as scheduling follows exactly, one that is driven by forces needs a pedal (`SpeedKeeper`).
"""

from abc import abstractmethod
from collections.abc import Sequence
from math import isfinite, pi
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from luenberger.core import BadInput
from luenberger.vehicle.tyres import Number

# 4 / sqrt(27): with it the amplitude of a lobe is its peak.
LOBE_PEAK = 0.7698
DEGREE = pi / 180


def _leaf(value: Any) -> jax.Array:
    return jnp.asarray(value, dtype=float)


def _number() -> Any:
    # Arrays, so that a compiled simulation serves every amplitude.
    return eqx.field(converter=_leaf)


class Profile(eqx.Module):
    """A signal over time with its exact derivative."""

    @abstractmethod
    def value(self, t: Any) -> jax.Array:
        """Return the signal at a time [s]."""

    @abstractmethod
    def rate(self, t: Any) -> jax.Array:
        """Return its time derivative at a time [s]; at a corner that of the side to come."""

    @property
    @abstractmethod
    def corners(self) -> jax.Array:
        """Times at which signal, rate or a higher derivative jumps [s], increasing, shape (nj,)."""


class Constant(Profile):
    """A signal that does not change.

    Args:
        level: its value.
    """

    level: Number = _number()

    def value(self, t: Any) -> jax.Array:
        """Return the level."""
        return self.level + 0.0 * _leaf(t)

    def rate(self, t: Any) -> jax.Array:
        """Return zero."""
        return jnp.zeros_like(_leaf(t))

    @property
    def corners(self) -> jax.Array:
        """None."""
        return jnp.zeros(0)


class Ramp(Profile):
    """From zero to the amplitude in a straight line, then held.

    Args:
        amplitude: final value.
        start: when it leaves zero [s].
        rise_time: length of the line [s].
    """

    amplitude: Number = _number()
    start: Number = _number()
    rise_time: Number = _number()

    def value(self, t: Any) -> jax.Array:
        """Return the signal at a time [s]."""
        return self.amplitude * jnp.clip((t - self.start) / self.rise_time, 0.0, 1.0)

    def rate(self, t: Any) -> jax.Array:
        """Return amplitude / rise_time on the line, zero elsewhere."""
        rising = (t >= self.start) & (t < self.start + self.rise_time)
        return jnp.where(rising, self.amplitude / self.rise_time, 0.0)

    @property
    def corners(self) -> jax.Array:
        """Both ends of the line."""
        return jnp.stack([_leaf(self.start), _leaf(self.start + self.rise_time)])


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
        """Return the signal at a time [s]."""
        return self.amplitude * jnp.sin(2 * jnp.pi * self.frequency * self._running(t))

    def rate(self, t: Any) -> jax.Array:
        """Return its derivative [1/s times the unit]; zero in the pause."""
        start, pause, resume, end = self.corners
        moving = ((t >= start) & (t < pause)) | ((t >= resume) & (t < end))
        speed = 2 * jnp.pi * self.frequency
        return jnp.where(moving, self.amplitude * speed * jnp.cos(speed * self._running(t)), 0.0)

    @property
    def corners(self) -> jax.Array:
        """Start, both ends of the pause, end."""
        pause = self.start + (self.cycles - 0.25) / self.frequency
        end = self.start + self.cycles / self.frequency + self.dwell
        return jnp.stack([_leaf(t) for t in (self.start, pause, pause + self.dwell, end)])

    def _running(self, t: Any) -> Any:
        since = t - self.start
        paused = jnp.clip(since - (self.cycles - 0.25) / self.frequency, 0.0, self.dwell)
        return jnp.clip(since - paused, 0.0, self.cycles / self.frequency)


class Reversal(Profile):
    """To the amplitude at a fixed rate, a pause, to its opposite at that rate, held, and slowly back to zero.

    Args:
        amplitude: first peak; negative turns the other way first.
        slew: rate of the turns [1/s times the unit], positive.
        start: when it begins [s].
        dwell: pause at the first peak [s].
        hold: time at the opposite peak [s].
        back: time of the return to zero [s].
    """

    amplitude: Number = _number()
    slew: Number = _number()
    start: Number = _number()
    dwell: Number = _number()
    hold: Number = _number()
    back: Number = _number()

    def value(self, t: Any) -> jax.Array:
        """Return the signal at a time [s]."""
        return jnp.interp(_leaf(t), self.corners, self._levels())

    def rate(self, t: Any) -> jax.Array:
        """Return its derivative, constant between corners."""
        corners, levels = self.corners, self._levels()
        slopes = jnp.diff(levels) / jnp.where(jnp.diff(corners) > 0, jnp.diff(corners), 1.0)
        slopes = jnp.concatenate([jnp.zeros(1), slopes, jnp.zeros(1)])
        return slopes[jnp.searchsorted(corners, _leaf(t), side="right")]

    @property
    def corners(self) -> jax.Array:
        """The six corners of the broken line."""
        turn = jnp.abs(_leaf(self.amplitude)) / self.slew
        lengths = (self.start, turn, self.dwell, 2 * turn, self.hold, self.back)
        return jnp.cumsum(jnp.stack([_leaf(length) for length in lengths]))

    def _levels(self) -> jax.Array:
        return self.amplitude * jnp.array([0.0, 1.0, 1.0, -1.0, -1.0, 0.0])


class Lobes(Profile):
    """Double swings A 0.7698 (sin 2 pi s - sin(4 pi s) / 2), s = (t - t0) / length in [0, 1]; value and slope vanish at the ends.

    Args:
        amplitudes: A of each lobe, its peak, shape (nl,).
        starts: t0 of each lobe [s], shape (nl,).
        length: length of a lobe [s].
    """

    amplitudes: Number = _number()
    starts: Number = _number()
    length: Number = _number()

    def value(self, t: Any) -> jax.Array:
        """Return the signal at a time [s]."""
        phase, inside = self._phase(t)
        shape = jnp.sin(phase) - 0.5 * jnp.sin(2 * phase)
        return LOBE_PEAK * jnp.sum(jnp.where(inside, self.amplitudes * shape, 0.0), axis=-1)

    def rate(self, t: Any) -> jax.Array:
        """Return its derivative."""
        phase, inside = self._phase(t)
        shape = (jnp.cos(phase) - jnp.cos(2 * phase)) * 2 * jnp.pi / self.length
        return LOBE_PEAK * jnp.sum(jnp.where(inside, self.amplitudes * shape, 0.0), axis=-1)

    @property
    def corners(self) -> jax.Array:
        """Both ends of each lobe: there the second derivative jumps."""
        return jnp.sort(jnp.concatenate([_leaf(self.starts), _leaf(self.starts + self.length)]))

    def _phase(self, t: Any) -> tuple[Any, Any]:
        s = (_leaf(t)[..., None] - self.starts) / self.length
        return 2 * jnp.pi * s, (s >= 0) & (s <= 1)


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
        """Return the signal at a time [s]."""
        return self.first + 0.5 * (self.last - self.first) * (1 - jnp.cos(jnp.pi * self._share(t)))

    def rate(self, t: Any) -> jax.Array:
        """Return its derivative."""
        return 0.5 * (self.last - self.first) * jnp.pi / self.length * jnp.sin(jnp.pi * self._share(t))

    @property
    def corners(self) -> jax.Array:
        """Both ends: there the second derivative jumps."""
        return jnp.stack([_leaf(self.start), _leaf(self.start + self.length)])

    def _share(self, t: Any) -> jax.Array:
        return jnp.clip((t - self.start) / self.length, 0.0, 1.0)


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


def step_steer(
    amplitude: Any, speed: Any, *, start: float = 1.0, rise_time: float = 0.1, duration: float = 5.0
) -> Manoeuvre:
    """Return a step of the steering with a steep flank, for the transient of yaw and slip.

    Args:
        amplitude: road-wheel angle [rad].
        speed: constant vx [m/s].
        start: when the wheel moves [s].
        rise_time: time of the flank [s]; zero would ask for an infinite steering rate and is refused.
        duration: end of the manoeuvre [s].

    Raises:
        BadInput: a time that is not positive or an end before the flank is over.

    Reference: ISO 7401, Road vehicles: Lateral transient response test methods, step input.
    """
    _times(start=start, rise_time=rise_time, duration=duration)
    _ends("step steer", start + rise_time, duration)
    return Manoeuvre(Ramp(amplitude, start, rise_time), Constant(speed), duration, "step steer")


def ramp_steer(
    slope: Any, speed: Any, *, start: float = 1.0, rise_time: float = 20.0, duration: float = 23.0
) -> Manoeuvre:
    """Return slowly increasing steering, which sweeps the tyres up to their peak almost in steady state.

    Args:
        slope: rate of the road wheel [rad/s]; 13.5 deg/s at the steering wheel over the steering ratio is customary.
        speed: constant vx [m/s]; 80 km/h is customary.
        start: when the wheel moves [s].
        rise_time: how long it moves [s].
        duration: end of the manoeuvre [s].

    Raises:
        BadInput: a time that is not positive or an end before the ramp is over.

    Reference: FMVSS 126 (49 CFR 571.126), S7.6 slowly increasing steer test.
    """
    _times(start=start, rise_time=rise_time, duration=duration)
    _ends("ramp steer", start + rise_time, duration)
    turn = Ramp(_leaf(slope) * rise_time, start, rise_time)
    return Manoeuvre(turn, Constant(speed), duration, "ramp steer")


def slalom(
    amplitude: Any, speed: float, *, spacing: float = 18.0, cones: int = 10, start: float = 1.0, settle: float = 1.0
) -> Manoeuvre:
    """Return sinusoidal steering as round evenly spaced cones, one period each two cones: f = vx / (2 spacing).

    Args:
        amplitude: road-wheel angle [rad].
        speed: constant vx [m/s]; fixes the frequency and the duration, so it is a plain number here.
        spacing: distance of the cones [m]; 18 m is customary on proving grounds, no standard fixes it.
        cones: number of half periods, even.
        start: when the wheel moves [s].
        settle: time of straight running at the end [s].

    Raises:
        BadInput: a number that is not positive, or an odd number of cones.
    """
    _times(speed=speed, spacing=spacing, cones=cones, start=start, settle=settle)
    if cones % 2:
        raise BadInput(f"`cones` is {cones}; an even number of half periods is needed to end straight.")
    frequency = speed / (2 * spacing)
    turn = DwellingSine(amplitude, frequency, start, cones // 2, 0.0)
    return Manoeuvre(turn, Constant(speed), start + cones / 2 / frequency + settle, "slalom")


def sine_with_dwell(
    amplitude: Any, speed: Any = 80 / 3.6, *, start: float = 1.0, frequency: float = 0.7, dwell: float = 0.5
) -> Manoeuvre:
    """Return the test of stability control: one period of a sine that pauses at its second peak.

    Four seconds follow the end of steering, in which the standard watches the yaw rate die down.

    Args:
        amplitude: road-wheel angle [rad]; the standard raises it from 1.5 times the angle for 0.3 g on.
        speed: vx [m/s]; the standard enters with 80 km/h and lets the car coast, here the speed is kept.
        start: when the wheel moves [s].
        frequency: [Hz].
        dwell: pause [s].

    Raises:
        BadInput: a time or frequency that is not positive.

    Reference: FMVSS 126 (49 CFR 571.126), S7.9 and figure 2.
    """
    _times(start=start, frequency=frequency, dwell=dwell)
    turn = DwellingSine(amplitude, frequency, start, 1.0, dwell)
    return Manoeuvre(turn, Constant(speed), start + 1 / frequency + dwell + 4.0, "sine with dwell")


def fishhook(
    amplitude: Any,
    speed: Any = 50 * 0.44704,
    *,
    steering_ratio: float = 16.0,
    start: float = 1.0,
    dwell: float = 0.25,
    duration: float = 8.0,
) -> Manoeuvre:
    """Return the rollover test: a turn and its reverse at 720 deg/s of the steering wheel, held 3 s, back within 2 s.

    The pause before the reverse has a fixed length here; the agency's test waits until the roll rate has died down.

    Args:
        amplitude: road-wheel angle [rad]; the agency takes 6.5 times the angle for 0.3 g.
        speed: vx [m/s]; the agency enters with 35 to 50 mile/h and lets the car coast, here the speed is kept.
        steering_ratio: angle of the steering wheel over that of the road wheels.
        start: when the wheel moves [s].
        dwell: pause at the first peak [s].
        duration: end of the manoeuvre [s]; enough for 0.3 rad at the other defaults.

    Raises:
        BadInput: a time or ratio that is not positive.

    Reference: G. Forkenbrock et al., NHTSA DOT HS 809 513 (2002), fixed timing and roll rate feedback fishhooks.
    """
    _times(steering_ratio=steering_ratio, start=start, dwell=dwell, duration=duration)
    turn = Reversal(amplitude, 720 * DEGREE / steering_ratio, start, dwell, 3.0, 2.0)
    return Manoeuvre(turn, Constant(speed), duration, "fishhook")


def braking_lane_changes(
    amplitudes: Sequence[float] = (0.022, -0.045),
    starts: Sequence[float] = (0.5, 4.0),
    *,
    lobe: float = 2.5,
    speeds: tuple[float, float] = (78 / 3.6, 23 / 3.6),
    braking: tuple[float, float] = (1.0, 9.0),
    duration: float = 10.0,
) -> Manoeuvre:
    """Return two lane changes while the car brakes, so that speed and slip angles sweep their ranges together.

    Args:
        amplitudes: peak of each lobe of the road-wheel angle [rad].
        starts: when each lobe begins [s].
        lobe: length of a lobe [s].
        speeds: vx before and after [m/s].
        braking: first and last instant of braking [s].
        duration: end of the manoeuvre [s].

    Raises:
        BadInput: lobes and starts that do not pair, or times in the wrong order.

    Reference: Wang 2014, figures 3.7 and 3.8, whose speeds these are; the dissertation prints neither steering nor times, so
        both are chosen here.
    """
    _times(lobe=lobe, duration=duration, first_speed=speeds[0], last_speed=speeds[1])
    if len(amplitudes) != len(starts) or not len(starts):
        raise BadInput(
            f"{len(amplitudes)} `amplitudes` and {len(starts)} `starts` are given; one start a lobe is needed."
        )
    if not braking[0] < braking[1]:
        raise BadInput(f"`braking` is {braking} s; its first instant needs to come before its last.")
    _ends("last lobe", max(starts) + lobe, duration)
    pace = HalfCosine(*speeds, braking[0], braking[1] - braking[0])
    return Manoeuvre(Lobes(amplitudes, starts, lobe), pace, duration, "lane changes while braking")


def _times(**numbers: float) -> None:
    for name, value in numbers.items():
        if not (isfinite(value) and value > 0):
            raise BadInput(f"`{name}` is {value}; a positive finite number is needed.")


def _ends(what: str, end: float, duration: float) -> None:
    if end > duration:
        raise BadInput(f"The {what} ends at {end:g} s but `duration` is {duration:g} s; lengthen it.")
