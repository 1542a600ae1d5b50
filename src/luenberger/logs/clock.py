"""Is the clock of a log fit for use: order, duplicates, gaps, jitter."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from luenberger.core import BadInput
from luenberger.core.checks import finite_array


@dataclass(frozen=True)
class Gap:
    """A stretch without samples.

    Args:
        index: number of the last sample before the gap, from 0.
        start: its time [s].
        stop: time of the next sample [s].
        missing: samples that the median step would have put between them.
    """

    index: int
    start: float
    stop: float
    missing: int

    @property
    def length(self) -> float:
        """Duration [s]."""
        return self.stop - self.start


@dataclass(frozen=True)
class ClockReport:
    """What `inspect_clock` found.

    Args:
        samples: number of time stamps.
        start: first time stamp [s].
        stop: last time stamp [s].
        step: median of the steps that advance [s].
        shortest: shortest step that advances [s].
        longest: longest step [s].
        jitter: root mean square distance of the steps from their median, gaps left out [s].
        gaps: stretches longer than `gap_factor` median steps.
        duplicates: numbers of the samples that repeat the time before them.
        reversals: numbers of the samples that lie before the sample before them.
        gap_factor: how many median steps make a gap.
    """

    samples: int
    start: float
    stop: float
    step: float
    shortest: float
    longest: float
    jitter: float
    gaps: tuple[Gap, ...]
    duplicates: tuple[int, ...]
    reversals: tuple[int, ...]
    gap_factor: float

    @property
    def is_increasing(self) -> bool:
        """True where every time stamp lies after the one before it, which `Trajectory` needs."""
        return not self.duplicates and not self.reversals

    def is_uniform(self, tolerance: float = 1e-6) -> bool:
        """True where every step is the median step, which a replay needs.

        Args:
            tolerance: largest relative difference.
        """
        spread = max(self.longest - self.step, self.step - self.shortest)
        return self.is_increasing and spread <= tolerance * self.step

    def sentences(self) -> tuple[str, ...]:
        """Return the findings as sentences, the summary first, then each fault with the way out."""
        rate = 1.0 / self.step
        lines = [
            f"{self.samples} samples from {self.start:g} to {self.stop:g} s, median step {self.step:g} s ({rate:g} Hz), "
            f"steps {self.shortest:g} to {self.longest:g} s, jitter {self.jitter:.3g} s rms."
        ]
        if self.reversals:
            lines.append(f"Time runs backwards at {_places(self.reversals)}; sort the log or drop these samples.")
        if self.duplicates:
            lines.append(f"Time stands still at {_places(self.duplicates)}; drop the repeated samples.")
        if self.gaps:
            worst = max(self.gaps, key=lambda gap: gap.length)
            lost = sum(gap.missing for gap in self.gaps)
            lines.append(
                f"{len(self.gaps)} gap{'s' * (len(self.gaps) > 1)} longer than {self.gap_factor:g} median steps, about {lost} samples lost; the longest "
                f"lasts {worst.length:g} s after t = {worst.start:g} s. Cut the log there or interpolate with `.resample(dt)`."
            )
        if self.is_increasing and not self.is_uniform():
            lines.append(
                f"The steps differ; bring the log to a uniform step with `.resample({self.step:.6g})` before a replay."
            )
        return tuple(lines)


def inspect_clock(time: Sequence[float] | np.ndarray, gap_factor: float = 1.5) -> ClockReport:
    """Look at the time stamps of a log before anything is computed from it.

    Args:
        time: time stamps [s], shape (nt,), in any order.
        gap_factor: a step longer than this many median steps is a gap; 1.5 reports every single lost sample.

    Raises:
        BadInput: fewer than two samples, NaN or Inf, no step that advances, or `gap_factor` not above 1.
    """
    time = finite_array("time", time)
    if time.ndim != 1 or time.size < 2:
        raise BadInput(f"`time` has shape {time.shape}; at least two time stamps in shape (nt,) are needed.")
    if not gap_factor > 1:
        raise BadInput(f"`gap_factor` is {gap_factor}; a number above 1 is needed, the median step itself is no gap.")
    steps = np.diff(time)
    forward = steps[steps > 0]
    if forward.size == 0:
        raise BadInput(
            f"None of the {time.size} time stamps lies after the one before it ({time[0]:g} to {time[-1]:g} s); "
            "name the right column as time."
        )
    step = float(np.median(forward))
    long = np.flatnonzero(steps > gap_factor * step)
    even = forward[forward <= gap_factor * step]
    gaps = [Gap(int(k), float(time[k]), float(time[k + 1]), max(round(steps[k] / step) - 1, 0)) for k in long]
    return ClockReport(
        samples=time.size,
        start=float(time[0]),
        stop=float(time[-1]),
        step=step,
        shortest=float(forward.min()),
        longest=float(forward.max()),
        jitter=float(np.sqrt(np.mean((even - step) ** 2))),
        gaps=tuple(gaps),
        duplicates=tuple(int(k) + 1 for k in np.flatnonzero(steps == 0)),
        reversals=tuple(int(k) + 1 for k in np.flatnonzero(steps < 0)),
        gap_factor=gap_factor,
    )


def _places(samples: tuple[int, ...]) -> str:
    shown = ", ".join(map(str, samples[:3]))
    more = f" and {len(samples) - 3} more" if len(samples) > 3 else ""
    return f"sample{'s' * (len(samples) > 1)} {shown}{more}"
