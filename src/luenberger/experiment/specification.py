"""An experiment as a TOML file: read whole, checked whole, before anything is computed."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from luenberger.core import BadInput
from luenberger.core.checks import is_number, is_whole, known_keys, nearest

DATA = Path(__file__).parent / "data"
CHANNELS = ("speed", "lateral_speed", "yaw_rate", "steering", "lateral_acceleration")
_KEYS = {
    "the experiment": ("title", "notes", "log", "vehicle", "domain", "sensors", "score", "fit", "entrants"),
    "[log]": ("path", "drive", "attribution", "time", "sample_time", "start", "stop", "channels"),
    "[vehicle]": (
        "parameters",
        "mass",
        "yaw_inertia",
        "front_axle_distance",
        "rear_axle_distance",
        "front_stiffness",
        "rear_stiffness",
    ),
    "[domain]": ("speed", "acceleration"),
    "[sensors]": ("seed", *CHANNELS),
    "[score]": ("skip",),
    "[fit]": ("share", "evaluations"),
}


@dataclass(frozen=True)
class Specification:
    """What an experiment file says.

    Args:
        title: headline of the page.
        notes: what a reader of the results must know about this log, shown on the page.
        path: the log, absolute; None where a drive is simulated.
        drive: name of the simulated drive, empty where a log is read.
        attribution: where the log comes from, shown on the page.
        time: time column and unit.
        channels: our name -> column, unit, scale for `read_log`.
        sample_time: uniform step [s] the log is brought to.
        cut: (start, stop) [s] of the log, None for its ends.
        vehicle: parameter set and changes.
        speed: interval of the speed [m/s] the designs trust.
        acceleration: interval of dvx/dt [m/s^2] the designs trust.
        noise: standard deviation of white noise added to a measured channel, SI.
        seed: seed of that noise.
        skip: seconds at the start that are not scored, for everybody.
        fit_share: share of the log every entrant is tuned on, None for no tuning; the rest is scored.
        evaluations: how often each entrant may be replayed while tuning.
        entrants: name -> kind and options.
    """

    title: str
    notes: tuple[str, ...]
    path: Path | None
    drive: str
    attribution: str
    time: Mapping[str, Any]
    channels: Mapping[str, Mapping[str, Any]]
    sample_time: float
    cut: tuple[float | None, float | None]
    vehicle: Mapping[str, Any]
    speed: tuple[float, float]
    acceleration: tuple[float, float]
    noise: Mapping[str, float]
    seed: int
    skip: float
    fit_share: float | None
    evaluations: int
    entrants: Mapping[str, Mapping[str, Any]]


def read_specification(path: str | Path) -> Specification:
    """Read and check an experiment file.

    Args:
        path: TOML file; a log path in it is relative to it, or the name of a log that ships with the package.

    Raises:
        BadInput: no such file, not TOML, unknown key (the nearest known one is named), missing part, bad interval.
    """
    path = Path(path)
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as cause:
        raise BadInput(f"`{path}` cannot be read ({cause.strerror}); give the path of an experiment file.") from None
    except tomllib.TOMLDecodeError as cause:
        raise BadInput(f"`{path}` is not TOML: {cause}. Correct that line.") from None
    known_keys(f"`{path.name}`", data, _KEYS["the experiment"])
    for section in ("log", "vehicle", "domain", "sensors", "score", "fit"):
        given = table(data.get(section, {}), f"[{section}]", path)
        known_keys(f"[{section}] of `{path.name}`", given, _KEYS[f"[{section}]"])
    log, domain, fit = _part(data, "log", path), _part(data, "domain", path), data.get("fit")
    drive, channels = str(log.get("drive", "")), _channels(log, path)
    sensors, vehicle = dict(data.get("sensors", {})), _part(data, "vehicle", path)
    entrants = table(_part(data, "entrants", path), "[entrants]", path)
    return Specification(
        title=str(data.get("title", path.stem)),
        notes=notes(data, path),
        path=None if drive else _log_path(str(_part(log, "path", path, "[log]")), path),
        drive=drive,
        attribution=str(log.get("attribution", "")),
        time={} if drive else table(_part(log, "time", path, "[log]"), "[log] time", path),
        channels=channels,
        sample_time=_positive(log.get("sample_time", 0.01), "sample_time", "s"),
        cut=(_instant(log, "start"), _instant(log, "stop")),
        vehicle={k: v if k == "parameters" else _positive(v, f"vehicle.{k}", "SI") for k, v in vehicle.items()},
        speed=_interval(_part(domain, "speed", path, "[domain]"), "speed", "m/s", positive=True),
        acceleration=_interval(_part(domain, "acceleration", path, "[domain]"), "acceleration", "m/s^2"),
        noise={k: _positive(v, f"sensors.{k}", "SI", zero=True) for k, v in sensors.items() if k != "seed"},
        seed=_whole(sensors.get("seed", 0), "sensors.seed", 0),
        skip=_positive(data.get("score", {}).get("skip", 0.0), "skip", "s", zero=True),
        fit_share=None if fit is None else _share(fit.get("share", 0.5)),
        evaluations=0 if fit is None else _whole(fit.get("evaluations", 100), "fit.evaluations", 1),
        entrants={name: table(options, f"[entrants.{name}]", path) for name, options in entrants.items()},
    )


def _channels(log: Mapping[str, Any], path: Path) -> Mapping[str, Mapping[str, Any]]:
    """Channels of a log; a simulated drive has the right ones and takes none of what a log needs."""
    if "drive" in log:
        if spare := [k for k in ("path", "time", "channels") if k in log]:
            raise BadInput(f"[log] of `{path.name}` names a simulated drive and {spare}; leave out one or the other.")
        return {}
    channels = table(_part(log, "channels", path, "[log]"), "[log.channels]", path)
    if missing := [c for c in CHANNELS if c not in channels]:
        raise BadInput(f"[log.channels] of `{path.name}` lacks {missing}; the experiment needs {', '.join(CHANNELS)}.")
    return {name: table(channel, f"[log.channels.{name}]", path) for name, channel in channels.items()}


def table(value: Any, name: str, path: Path) -> Mapping[str, Any]:
    """Return a table of an experiment file.

    Args:
        value: what stands there.
        name: of the table.
        path: the file.

    Raises:
        BadInput: no table.
    """
    if not isinstance(value, Mapping):
        raise BadInput(f"{name} of `{path.name}` is {value!r}; a table of keys and values is needed.")
    return value


def notes(data: Mapping[str, Any], path: Path) -> tuple[str, ...]:
    """Return the notes of an experiment file, none where it has none.

    Args:
        data: the whole file.
        path: the file.

    Raises:
        BadInput: no list of texts.
    """
    found = data.get("notes", [])
    if not isinstance(found, list) or not all(isinstance(note, str) for note in found):
        raise BadInput(f"`notes` of `{path.name}` is {found!r}; a list of texts is needed.")
    return tuple(found)


def _part(data: Mapping[str, Any], key: str, path: Path, where: str = "The file") -> Any:
    if key not in data:
        raise BadInput(f"{where} of `{path.name}` has no `{key}`; add it.{nearest(key, data)}")
    return data[key]


def _log_path(text: str, spec: Path) -> Path:
    candidates = [DATA / text, (spec.parent / text).resolve()]
    found = next((c for c in candidates if c.is_file()), None)
    if found is None:
        shipped = ", ".join(sorted(p.name for p in DATA.glob("*.csv")))
        raise BadInput(
            f"The log `{text}` is neither beside `{spec.name}` nor shipped with the package ({shipped}); correct [log] path."
        )
    return found


def _interval(value: Any, name: str, unit: str, positive: bool = False) -> tuple[float, float]:
    good = isinstance(value, list) and len(value) == 2 and all(map(is_number, value)) and value[0] < value[1]
    if not good or (positive and value[0] <= 0):
        needed = f"two increasing {'positive ' if positive else ''}numbers [lower, upper] in {unit}"
        raise BadInput(f"[domain] {name} is {value!r}; {needed} are needed.")
    return float(value[0]), float(value[1])


def _positive(value: Any, name: str, unit: str, zero: bool = False) -> float:
    if not is_number(value) or not (value > 0 or (zero and value == 0)):
        raise BadInput(f"`{name}` is {value!r}; a {'number >= 0' if zero else 'positive number'} in {unit} is needed.")
    return float(value)


def _share(value: Any) -> float:
    if not is_number(value) or not 0 < value < 1:
        raise BadInput(f"[fit] share is {value!r}; a share of the log between 0 and 1 is needed, the rest is scored.")
    return float(value)


def _whole(value: Any, name: str, least: int) -> int:
    if not is_whole(value) or value < least:
        raise BadInput(f"`{name}` is {value!r}; a whole number >= {least} is needed.")
    return value


def _instant(log: Mapping[str, Any], name: str) -> float | None:
    value = log.get(name)
    if value is not None and not is_number(value):
        raise BadInput(f"[log] {name} is {value!r}; a time in s is needed.")
    return value
