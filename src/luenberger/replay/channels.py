"""Which channels of a trajectory an observer reads, and the checks before anything is compiled."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import jax
import numpy as np

from luenberger.core import BadInput, Trajectory
from luenberger.core.checks import known_keys
from luenberger.observers import Observer
from luenberger.systems import Switched

# Steps may differ from dt by this share, beyond the rounding of the time stamps themselves.
STEP_TOLERANCE = 1e-6

# u, y, r side by side, each (nt, nc); traced arrays inside a compiled scan.
Samples = tuple[np.ndarray | jax.Array, np.ndarray | jax.Array, np.ndarray | jax.Array]


@dataclass(frozen=True)
class Channels:
    """Names of the trajectory channels that an observer reads, in the order of its vectors.

    Args:
        inputs: channels of u.
        outputs: channels of y.
        scheduling: channels of r.
    """

    inputs: Sequence[str] = ()
    outputs: Sequence[str] = ()
    scheduling: Sequence[str] = ()

    def __post_init__(self) -> None:
        for group in ("inputs", "outputs", "scheduling"):
            names = getattr(self, group)
            if isinstance(names, str):
                raise BadInput(f"`{group}` is the text `{names}`; a sequence of names is needed, e.g. ({names!r},).")
            object.__setattr__(self, group, tuple(names))


def channels_of(observers: Mapping[str, Observer], channels: Channels | Mapping[str, Channels]) -> dict[str, Channels]:
    """Return the channels of each observer by name.

    Args:
        observers: name -> observer.
        channels: one for all, or name -> channels.

    Raises:
        BadInput: a name without observer, or an observer without channels.
    """
    if isinstance(channels, Channels):
        return dict.fromkeys(observers, channels)
    return by_name("channels", observers, channels)


def by_name(what: str, observers: Mapping[str, Observer], given: Mapping[str, Any]) -> dict[str, Any]:
    """Return one entry for each observer, refusing names that are missing or unknown.

    Args:
        what: the argument, for the message.
        observers: name -> observer.
        given: name -> entry.

    Raises:
        BadInput: a name without observer, or an observer without entry.
    """
    known_keys(f"`{what}`", given, list(observers))
    if missing := [name for name in observers if name not in given]:
        raise BadInput(f"`{what}` has no entry for {missing}; one for each of {list(observers)} is needed.")
    return {name: given[name] for name in observers}


def samples_of(
    name: str, observer: Observer, trajectory: Trajectory, channels: Channels, missing_outputs: bool
) -> Samples:
    """Return the checked samples (u, y, r) of one observer, each (nt, nc).

    Args:
        name: of the observer, for messages.
        observer: gives the sample time.
        trajectory: signals.
        channels: the ones to read.
        missing_outputs: let NaN in output channels pass, for observers that skip missing entries.

    Raises:
        BadInput: more or fewer channels than the observer reads, one that is missing or holds NaN/Inf, or a time step that is not
            the observer's.
    """
    uniform(name, observer.dt, trajectory)
    u, y, r = (trajectory.table(group) for group in (channels.inputs, channels.outputs, channels.scheduling))
    _complete(name, observer, channels)
    _finite(trajectory, channels.inputs, u, "")
    _finite(trajectory, channels.scheduling, r, "")
    hint = " If the observer skips missing outputs (Kalman filters do), pass `missing_outputs=True`."
    _finite(trajectory, channels.outputs, np.where(np.isnan(y), 0.0, y) if missing_outputs else y, hint)
    return u, y, r


def _complete(name: str, observer: Observer, channels: Channels) -> None:
    """Refuse channels of another number than the plant has: a vector of another length may still broadcast, to nonsense."""
    if observer.reads is None:
        return
    plant = Switched.of(observer.reads)
    needed = {"inputs": plant.first.inputs, "outputs": plant.first.outputs, "scheduling": plant.scheduling_names}
    for group, names in needed.items():
        given = getattr(channels, group)
        if len(given) != len(names):
            raise BadInput(
                f"`{name}` reads the {group} {list(names)}, {len(names)} in all, but its channels name {len(given)}: {list(given)}. Give one "
                "channel for each, in this order."
            )


def uniform(name: str, dt: float, trajectory: Trajectory) -> None:
    """Refuse a trajectory whose steps are not dt.

    Args:
        name: of the observer, for the message.
        dt: its sample time [s].
        trajectory: times to check.

    Raises:
        BadInput: a step that differs.
    """
    steps = np.diff(trajectory.time)
    worst = int(np.abs(steps - dt).argmax())
    rounding = 4.0 * float(np.spacing(np.abs(trajectory.time).max()))
    if abs(steps[worst] - dt) > STEP_TOLERANCE * dt + rounding:
        raise BadInput(
            f"`{name}` runs at dt = {dt:g} s but `{trajectory.name}` steps by {steps[worst]:.9g} s after sample {worst} "
            f"(t = {trajectory.time[worst]:g} s; median step {trajectory.sample_time:.9g} s). Use `.resample({dt:g})` on the trajectory, "
            "or build the observer for its step."
        )


def _finite(trajectory: Trajectory, names: Sequence[str], values: np.ndarray, hint: str) -> None:
    bad = np.argwhere(~np.isfinite(values))
    if bad.size:
        k, channel = (int(i) for i in bad[0])
        count = int((~np.isfinite(values[:, channel])).sum())
        raise BadInput(
            f"Channel `{names[channel]}` of `{trajectory.name}` is {values[k, channel]} at sample {k} (t = {trajectory.time[k]:g} s), "
            f"{count} such samples; observers need finite samples. Cut the trajectory or fill the gap first.{hint}"
        )
