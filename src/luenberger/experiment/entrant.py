"""What enters a comparison: an observer with its channels, and the kinds that can be asked for."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from luenberger.core import Trajectory
from luenberger.design import Design
from luenberger.observers import Estimate, Observer
from luenberger.replay import Channels
from luenberger.report.tables import Table
from luenberger.vehicle import VehicleParameters


@dataclass(frozen=True)
class Setting:
    """What every builder is told.

    Args:
        car: parameter set with the stiffness believed in.
        speed: trusted interval of the speed [m/s].
        acceleration: trusted interval of dvx/dt [m/s^2].
        dt: sample time [s].
        training: part of the log that may be learned from, None where there is none.
    """

    car: VehicleParameters
    speed: tuple[float, float]
    acceleration: tuple[float, float]
    dt: float
    training: Trajectory | None = None


@dataclass(frozen=True)
class Entrant:
    """A built entrant.

    Args:
        observer: what runs.
        channels: what it reads.
        sideslip: takes its states, shape (nt, nx), and the trajectory, returns the sideslip [rad], shape (nt,).
        constants: channels that hold a number of the entrant, so that tuning compiles once.
        design: gain with certificate, None for filters and anchors.
        watch: takes a name, a log and the bounds of the slip angles, returns a table of what was assumed and how long it held.
        notes: what was learned or chosen when the entrant was built, one sentence each.
    """

    observer: Observer
    channels: Channels
    sideslip: Callable[[np.ndarray, Trajectory], np.ndarray]
    constants: Mapping[str, float] = field(default_factory=dict)
    design: Design | None = None
    watch: Callable[[str, Trajectory, Estimate], Table] | None = None
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Kind:
    """One kind of entrant.

    Args:
        build: setting and options -> entrant.
        options: name -> default; all positive numbers.
        knobs: what tuning may change, stiffness first.
        sentence: what it is, for tables.
    """

    build: Callable[[Setting, Mapping[str, float]], Entrant]
    options: Mapping[str, float]
    knobs: tuple[str, ...]
    sentence: str
