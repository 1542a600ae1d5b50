"""Times and named signals with units: what a simulation returns and what a log is read into, no difference."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from luenberger.core.checks import finite_array, nearest
from luenberger.core.errors import BadInput

# Eight hundred megabytes a signal: beyond that a step is a mistake.
_MOST_SAMPLES = 100_000_000


@dataclass(frozen=True, eq=False)
class Signal:
    """One named channel.

    Args:
        name: ASCII name, e.g. "yaw_rate".
        unit: SI unit as text, "" for dimensionless; angles in rad.
        values: samples, shape (nt,); NaN marks a missing sample.
        description: what the channel is and where it comes from.
    """

    name: str
    unit: str
    values: np.ndarray
    description: str = ""

    def __post_init__(self) -> None:
        if isinstance(self.values, str):
            raise BadInput(
                f"Signal `{self.name}` has the unit {self.unit!r} and the values {self.values!r}; give name, unit, values in this order."
            )
        values = np.array(self.values, dtype=np.float64)
        if values.ndim != 1:
            raise BadInput(f"Signal `{self.name}` has shape {values.shape}; a signal needs shape (nt,).")
        values.setflags(write=False)
        object.__setattr__(self, "values", values)


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Strictly increasing times and the signals sampled at them.

    Args:
        time: sample times [s], shape (nt,), strictly increasing and finite.
        signals: the channels, all of length nt.
        name: how the trajectory is called in tables and figures.
        source: where it comes from (file, licence, simulation set-up).

    Raises:
        BadInput: times not finite or not strictly increasing (the first bad pair is named), lengths that differ, a name given twice.
    """

    time: np.ndarray
    signals: Sequence[Signal]
    name: str = "trajectory"
    source: str = ""
    _index: Mapping[str, Signal] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        time = finite_array("time", self.time)
        if time.ndim != 1 or time.size < 2:
            raise BadInput(
                f"`time` of `{self.name}` has shape {time.shape}; at least two samples in shape (nt,) are needed."
            )
        bad = np.flatnonzero(np.diff(time) <= 0)
        if bad.size:
            k = int(bad[0])
            word = "repeats" if time[k + 1] == time[k] else "runs backwards"
            raise BadInput(
                f"`time` of `{self.name}` {word} at sample {k + 1}: {float(time[k])!r} s is followed by {float(time[k + 1])!r} s "
                f"({bad.size} such places); time stamps need to increase strictly. Sort the log or drop the duplicates."
            )
        index: dict[str, Signal] = {}
        for signal in self.signals:
            if signal.values.shape != time.shape:
                raise BadInput(
                    f"Signal `{signal.name}` has {signal.values.size} samples but `{self.name}` has {time.size} time stamps; both need one length."
                )
            if signal.name in index:
                raise BadInput(f"Signal `{signal.name}` is given twice in `{self.name}`; rename one of them.")
            index[signal.name] = signal
        time.setflags(write=False)
        object.__setattr__(self, "time", time)
        object.__setattr__(self, "signals", tuple(self.signals))
        object.__setattr__(self, "_index", index)

    def __len__(self) -> int:
        return self.time.size

    def __iter__(self) -> Iterator[Signal]:
        return iter(self.signals)

    def __contains__(self, name: object) -> bool:
        return name in self._index

    def __getitem__(self, name: str) -> Signal:
        if name not in self._index:
            raise BadInput(f"Trajectory `{self.name}` has no channel `{name}`.{nearest(name, self._index)}")
        return self._index[name]

    @property
    def names(self) -> tuple[str, ...]:
        """The channel names in order."""
        return tuple(self._index)

    @property
    def sample_time(self) -> float:
        """Median distance between time stamps [s]."""
        return float(np.median(np.diff(self.time)))

    def table(self, names: Sequence[str]) -> np.ndarray:
        """Return the named channels side by side, shape (nt, len(names)).

        Args:
            names: channels to stack.

        Raises:
            BadInput: a channel is missing (all missing ones are named).
        """
        missing = [name for name in names if name not in self._index]
        if missing:
            hints = "".join(nearest(name, self._index) for name in missing[:1])
            raise BadInput(
                f"Trajectory `{self.name}` lacks {', '.join(f'`{m}`' for m in missing)}; {len(names)} channels are needed: "
                f"{', '.join(names)}.{hints}"
            )
        if not names:
            return np.zeros((len(self), 0))
        return np.stack([self._index[name].values for name in names], axis=1)

    def with_signals(self, *signals: Signal) -> "Trajectory":
        """Return a copy with channels added; a channel of the same name is replaced."""
        fresh = {s.name: s for s in signals}
        kept = [fresh.pop(s.name, s) for s in self.signals]
        return Trajectory(self.time, [*kept, *fresh.values()], self.name, self.source)

    def between(self, start: float, stop: float) -> "Trajectory":
        """Return the samples with start <= time < stop [s].

        Args:
            start: first time kept [s].
            stop: first time dropped [s].

        Raises:
            BadInput: fewer than two samples remain.
        """
        keep = (self.time >= start) & (self.time < stop)
        if keep.sum() < 2:
            raise BadInput(
                f"`{self.name}` covers {self.time[0]:g} to {self.time[-1]:g} s; the cut {start:g} to {stop:g} s keeps "
                f"{int(keep.sum())} samples and two are needed."
            )
        cut = [Signal(s.name, s.unit, s.values[keep], s.description) for s in self.signals]
        return Trajectory(self.time[keep], cut, self.name, self.source)

    def resample(self, dt: float) -> "Trajectory":
        """Return the trajectory on a uniform grid of step `dt` [s] by linear interpolation.

        Args:
            dt: wanted step [s], positive.

        Raises:
            BadInput: `dt` not positive, longer than the trajectory, or so short that no memory holds the samples.
        """
        if not (np.isfinite(dt) and dt > 0):
            raise BadInput(f"`dt` is {dt}; a positive step in seconds is needed.")
        lasts = float(self.time[-1] - self.time[0])
        if lasts > _MOST_SAMPLES * dt:
            raise BadInput(
                f"`{self.name}` lasts {lasts:g} s, more than {_MOST_SAMPLES} steps of dt = {dt:g} s, which memory does not hold; "
                "take a coarser one, or cut with `between`."
            )
        count = int(np.floor(lasts / dt + 1e-9)) + 1
        if count < 2:
            raise BadInput(f"`{self.name}` lasts {lasts:g} s, less than one step dt = {dt:g} s; take a finer one.")
        grid = np.asarray(self.time[0] + dt * np.arange(count), dtype=np.float64)
        again = [Signal(s.name, s.unit, np.interp(grid, self.time, s.values), s.description) for s in self.signals]
        return Trajectory(grid, again, self.name, self.source)
