"""Which column of a log is which of our channels, and how its numbers become SI."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from luenberger.core import BadInput
from luenberger.core.checks import known_keys
from luenberger.logs.units import unit_named

_KEYS = ("column", "unit", "scale", "offset", "sign", "description")


@dataclass(frozen=True)
class Channel:
    """Where one signal comes from: value in `unit` = sign * (scale * column + offset), then SI.

    Args:
        columns: column names of the log; several are averaged (left and right wheel, say).
        unit: unit of the scaled number; "" is dimensionless.
        scale: factor, e.g. 1 / steering ratio for a hand-wheel angle.
        offset: added after the scale, in `unit`; e.g. minus the sensor bias.
        sign: 1, or -1 where the log counts the other way round.
        description: free text for tables.

    Raises:
        BadInput: no column, unknown unit, scale zero or not finite, sign other than 1 and -1.
    """

    columns: tuple[str, ...]
    unit: str
    scale: float = 1.0
    offset: float = 0.0
    sign: int = 1
    description: str = ""

    def __post_init__(self) -> None:
        where = f"The channel of column {', '.join(f'`{c}`' for c in self.columns) or '(none)'}"
        if not self.columns or not all(self.columns):
            raise BadInput(f"{where} names no column; give `column` the name in the header of the log.")
        unit_named(self.unit)
        if not (isfinite(self.scale) and self.scale != 0 and isfinite(self.offset)):
            raise BadInput(f"{where} has scale {self.scale} and offset {self.offset}; finite numbers, scale not zero.")
        if self.sign not in (1, -1):
            raise BadInput(f"{where} has sign {self.sign}; it needs to be 1 or -1, factors go into `scale`.")

    @property
    def si_unit(self) -> str:
        """The SI unit of the signal."""
        return unit_named(self.unit).si

    def to_si(self, raw: np.ndarray) -> np.ndarray:
        """Return the logged numbers in SI.

        Args:
            raw: numbers as logged, shape (nt,).
        """
        return unit_named(self.unit).to_si(self.sign * (self.scale * raw + self.offset))


@dataclass(frozen=True)
class ChannelMap:
    """The time column and the channels of a family of logs.

    Args:
        time: the clock.
        channels: our name -> channel.
    """

    time: Channel
    channels: Mapping[str, Channel]


def channel(name: str, given: Any) -> Channel:
    """Read one channel from a TOML table or dictionary.

    Args:
        name: our name of the signal, for messages.
        given: a `Channel`, or a mapping with keys column (text or list of texts to average), unit, and where needed
            scale, offset, sign, description.

    Raises:
        BadInput: unknown or missing key, value of the wrong kind, or what `Channel` refuses.
    """
    if isinstance(given, Channel):
        return given
    where = f"Channel `{name}`"
    if not isinstance(given, Mapping):
        raise BadInput(f'{where} is {given!r}; a table such as {{ column = "vx", unit = "m/s" }} is needed.')
    known_keys(where, given, _KEYS)
    if lacking := [key for key in ("column", "unit") if key not in given]:
        raise BadInput(
            f"{where} lacks {' and '.join(f'`{k}`' for k in lacking)}; a column and its unit are needed, "
            'unit = "" for a dimensionless one.'
        )
    column = given["column"]
    columns = (column,) if isinstance(column, str) else tuple(column) if isinstance(column, list | tuple) else ()
    if not columns or not all(isinstance(c, str) for c in columns):
        raise BadInput(f"{where} has column = {column!r}; a column name or a list of names is needed.")
    for key in ("scale", "offset", "sign"):
        value = given.get(key, 1)
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise BadInput(f"{where} has {key} = {value!r}; a number is needed.")
    for key in ("unit", "description"):
        if not isinstance(given.get(key, ""), str):
            raise BadInput(f"{where} has {key} = {given[key]!r}; a text is needed.")
    sign = given.get("sign", 1)
    try:
        return Channel(
            columns,
            given["unit"],
            float(given.get("scale", 1.0)),
            float(given.get("offset", 0.0)),
            int(sign) if float(sign).is_integer() else 0,
            given.get("description", ""),
        )
    except (BadInput, OverflowError) as cause:
        raise BadInput(f"{where}: {cause}") from None


def channel_map(given: Mapping[str, Any]) -> dict[str, Channel]:
    """Read our name -> channel from TOML tables or dictionaries.

    Args:
        given: our name -> table, see `channel`.

    Raises:
        BadInput: no channel at all, a name that is no ASCII word, or a channel that cannot be read.
    """
    if not given:
        raise BadInput(
            'The channel map is empty; give at least one channel, e.g. speed = { column = "vx", unit = "m/s" }.'
        )
    for name in given:
        if not (name.isascii() and name.isidentifier()):
            raise BadInput(f"Channel `{name}` is no ASCII word; name it with letters, digits and `_`, e.g. yaw_rate.")
    return {name: channel(name, table) for name, table in given.items()}


def read_channel_map(path: str | Path) -> ChannelMap:
    """Read a channel map from a TOML file with a [time] table and a [channels] table.

    Choose a file of its own where many logs share their columns.

    Args:
        path: TOML file.

    Raises:
        BadInput: no such file, not TOML, unknown or missing part.
    """
    path = Path(path)
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as cause:
        raise BadInput(f"`{path}` cannot be read ({cause.strerror}); give the path of a channel map.") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as cause:
        raise BadInput(f"`{path}` is not TOML: {cause}. Correct that line.") from None
    known_keys(f"`{path.name}`", data, ("time", "channels"))
    if lacking := [part for part in ("time", "channels") if part not in data]:
        raise BadInput(f"`{path.name}` lacks [{'] and ['.join(lacking)}]; a channel map needs [time] and [channels].")
    return ChannelMap(channel("time", data["time"]), channel_map(data["channels"]))
