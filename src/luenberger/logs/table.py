"""A recorded log becomes a `Trajectory`: named channels, SI, increasing time, no silent holes."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np

from luenberger.core import BadInput, Signal, Trajectory
from luenberger.logs.channel_map import Channel, channel, channel_map
from luenberger.logs.clock import inspect_clock
from luenberger.logs.columns import read_columns

Missing = Literal["refuse", "interpolate", "keep"]
Clock = Literal["refuse", "drop"]


def read_log(
    path: str | Path,
    channels: Mapping[str, Channel | Mapping[str, Any]],
    *,
    time: str | Channel | Mapping[str, Any],
    missing: Missing = "refuse",
    clock: Clock = "refuse",
    from_zero: bool = False,
    name: str | None = None,
    source: str | None = None,
    **layout: Any,
) -> Trajectory:
    """Read the named channels of a CSV, gzipped CSV or Parquet log.

    Units, signs and sensor offsets are dealt with here and nowhere later. Gaps in the clock are kept; ask
    `inspect_clock(trajectory.time)` for them.

    Args:
        path: the log.
        channels: our name -> {column, unit, scale, offset, sign, description}; see `Channel`.
        time: time column, a name (seconds) or a table with column and unit.
        missing: empty cells are refused, filled by straight lines in time (held at the ends), or kept as NaN.
        clock: samples that do not advance in time are refused, or dropped.
        from_zero: count time from the first sample, for stamps since 1970.
        name: how the trajectory is called; left out: the file name.
        source: where it comes from; left out: the file name.
        layout: `separator`, `decimal`, `skip_lines` of a text file, see `read_columns`.

    Returns:
        A trajectory with one signal a channel, in SI.

    Raises:
        BadInput: file, column, unit, cell, clock or hole that cannot be used; the message names it.
        MissingExtra: a Parquet file without pyarrow.

    Example::

        speed = {"column": "v", "unit": "km/h"}
        log = read_log("drive.csv", {"speed": speed}, time="t")
    """
    path = Path(path)
    if missing not in ("refuse", "interpolate", "keep"):
        raise BadInput(f"`missing` is {missing!r}; it needs to be refuse, interpolate or keep.")
    if clock not in ("refuse", "drop"):
        raise BadInput(f"`clock` is {clock!r}; it needs to be refuse or drop.")
    wanted = channel_map(channels)
    stamp = channel("time", {"column": time, "unit": "s"} if isinstance(time, str) else time)
    if stamp.si_unit != "s":
        raise BadInput(f"The time column has unit `{stamp.unit}`; a unit of time such as s, ms or ns is needed.")
    columns = [c for one in (stamp, *wanted.values()) for c in one.columns]
    raw = read_columns(path, list(dict.fromkeys(columns)), **layout)
    seconds, kept = _clock(path, stamp, raw, clock, from_zero)
    signals = []
    for label, one in wanted.items():
        values = one.to_si(_mean(one, raw)[kept])
        values = _whole(path, label, one, seconds, values, missing)
        signals.append(Signal(label, one.si_unit, values, one.description or f"column {', '.join(one.columns)}"))
    return Trajectory(seconds, signals, name or path.name, path.name if source is None else source)


def _mean(one: Channel, raw: Mapping[str, np.ndarray]) -> np.ndarray:
    return raw[one.columns[0]] if len(one.columns) == 1 else np.mean([raw[c] for c in one.columns], axis=0)


def _clock(
    path: Path, stamp: Channel, raw: Mapping[str, np.ndarray], clock: Clock, from_zero: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Return increasing times [s] and the numbers of the samples they belong to."""
    ticks = _mean(stamp, raw)
    if (bad := np.flatnonzero(~np.isfinite(ticks))).size:
        raise BadInput(
            f"The time column of `{path.name}` holds {ticks[bad[0]]} in sample {bad[0]} ({bad.size} such samples); every sample needs a time."
        )
    # The first stamp goes before the unit is applied: 1e18 ns keeps more digits as a difference.
    time = stamp.to_si(ticks - ticks[0] if from_zero else ticks)
    if time.size < 2:
        raise BadInput(f"`{path.name}` holds {time.size} sample; at least two are needed.")
    report = inspect_clock(time)
    if report.is_increasing:
        return time, np.arange(time.size)
    if clock == "refuse":
        raise BadInput(
            f"The clock of `{path.name}` cannot be used: {' '.join(report.sentences()[1:])} "
            'Or read it with clock="drop", which leaves out every sample that does not advance.'
        )
    latest = np.maximum.accumulate(time)
    kept = np.concatenate([[0], np.flatnonzero(np.diff(latest) > 0) + 1])
    return time[kept], kept


def _whole(path: Path, label: str, one: Channel, time: np.ndarray, values: np.ndarray, missing: Missing) -> np.ndarray:
    good = np.isfinite(values)
    holes = values.size - int(good.sum())
    if holes == 0:
        return values
    if missing == "keep":
        return np.where(good, values, np.nan)
    columns = ", ".join(f"`{c}`" for c in one.columns)
    if missing == "refuse" or holes == values.size:
        first = int(np.argmin(good))
        way_out = (
            "the column is empty, name another one."
            if holes == values.size
            else 'fill them with missing="interpolate", or keep them as NaN with missing="keep".'
        )
        raise BadInput(
            f"Channel `{label}` (column {columns}) of `{path.name}` has no value at sample {first}, t = {time[first]:g} s, "
            f"and {holes} of {values.size} values are missing; {way_out}"
        )
    return np.interp(time, time[good], values[good])
