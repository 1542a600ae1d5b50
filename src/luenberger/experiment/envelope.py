"""Entrants that draw a guaranteed envelope of the sideslip, and the watch over what the guarantee assumes."""

from collections.abc import Callable, Mapping

import numpy as np

from luenberger.core import BadInput, Trajectory
from luenberger.experiment.entrant import Entrant, Setting
from luenberger.methods.method import Method
from luenberger.observers import Drive, Estimate, Sector, explain, monitor
from luenberger.observers.monitor import containment_excess
from luenberger.replay import Channels
from luenberger.report.tables import Table
from luenberger.synthesize import synthesize
from luenberger.systems import System
from luenberger.vehicle import VehicleParameters, sideslip_from_rear_slip, slip_angle_plant
from luenberger.vehicle.stiffness_box import StiffnessBox, axle_forces, stiffness_box

# Time [s] for which a broken assumption may still show in the bounds: several time constants of the slowest width.
MEMORY = 1.0
_BOX = ("front_lower", "front_upper", "rear_lower", "rear_upper")
OPTIONS: Mapping[str, float] = {
    **dict.fromkeys(_BOX, 0.0),
    "force_offset": 0.0,
    "share": 0.99,
    "tail": 0.01,
    "slip_floor": 0.0175,
    "steering_noise": 0.0,
    "steering_rate_noise": 0.0,
    "yaw_rate_noise": 0.0,
    "initial_half_width": 0.1,
    "slip_limit": 0.06,
}


def envelope(method: Callable[[Mapping[str, float]], Method]) -> Callable[[Setting, Mapping[str, float]], Entrant]:
    """Return the builder of an interval observer entrant.

    The stiffness box is what the options say; where they say nothing it is identified on the part of the log that may be
    learned from, with the share of samples that its force offset has to cover.

    Args:
        method: options -> design method.
    """

    def built(setting: Setting, options: Mapping[str, float]) -> Entrant:
        box, how = _box(setting, options)
        noise = tuple(options[f"{n}_noise"] for n in ("steering", "steering_rate", "yaw_rate"))
        plant = slip_angle_plant(
            setting.car,
            setting.speed,
            setting.acceleration,
            stiffness=(box.front, box.rear),
            force_offset=box.offset,
            noise=(noise[0], noise[1], noise[2]),
        )
        design = synthesize(plant, method(options))
        half = np.full(2, options["initial_half_width"])
        observer = design.observer(setting.dt, clip_scheduling=True, initial_half_width=half)
        channels = Channels(
            ("steering", "steering_rate", "yaw_rate"), ("slip_difference",), ("inverse_speed", "acceleration")
        )

        def sideslip(x: np.ndarray, trajectory: Trajectory) -> np.ndarray:
            speed, yaw_rate = trajectory["speed"].values, trajectory["yaw_rate"].values
            return np.asarray(sideslip_from_rear_slip(x[:, 1], speed, yaw_rate, setting.car))

        def watch(name: str, log: Trajectory, estimate: Estimate) -> Table:
            return watched(name, log, estimate, setting.car, box, plant)

        return Entrant(observer, channels, sideslip, design=design, watch=watch, notes=(how,))

    return built


def _box(setting: Setting, options: Mapping[str, float]) -> tuple[StiffnessBox, str]:
    given = [n for n in _BOX if options[n] > 0]
    if len(given) == len(_BOX):
        ends = [options[n] for n in _BOX]
        offset = options["force_offset"]
        box = StiffnessBox((ends[0], ends[1]), (ends[2], ends[3]), (offset, offset), (1.0, 1.0))
        how = "The stiffness box was stated in the experiment file"
    elif given:
        raise BadInput(f"The envelope states {given} of its stiffness box; state all of {list(_BOX)} or none.")
    elif setting.training is None:
        raise BadInput(
            f"The envelope has no stiffness box; state {list(_BOX)} and `force_offset`, or let the experiment learn it from a part "
            "of the log with [fit]."
        )
    else:
        learned = ("share", "tail", "slip_floor")
        box = stiffness_box(setting.training, setting.car, **{n: options[n] for n in learned})
        how = f"The stiffness box was identified on the first {setting.training.time[-1] - setting.training.time[0]:.0f} s"
    front, rear = (f"[{1e-3 * lower:.1f}, {1e-3 * upper:.1f}] kN/rad" for lower, upper in (box.front, box.rear))
    offset = f"{box.offset[0]:.0f} N and {box.offset[1]:.0f} N"
    return box, f"{how}: front {front}, rear {rear}, force beyond it up to {offset}."


def watched(
    name: str, log: Trajectory, estimate: Estimate, car: VehicleParameters, box: StiffnessBox, system: System
) -> Table:
    """Return how long each assumption of the guarantee held on a log, and which ones were broken where the truth got out.

    Args:
        name: of the entrant.
        log: scored log with the true slip angles.
        estimate: bounds of the slip angles, each (nt, 2).
        car: mass, inertia, axle distances.
        box: stiffness box and force offset that were believed.
        system: the plant with its bounds.
    """
    slip, force = log.table(["front_slip", "rear_slip"]), axle_forces(log, car)
    axles = zip(("front", "rear"), (box.front, box.rear), box.offset, strict=True)
    drive = Drive(
        time=log.time,
        r=log.table(system.scheduling_names),
        u=log.table(system.inputs),
        y=log.table(system.outputs),
        estimate=estimate,
        x=slip,
        sectors=[
            Sector(f"{axle} axle force", slip[:, k], force[:, k], interval, offset)
            for k, (axle, interval, offset) in enumerate(axles)
        ],
    )
    assumptions = monitor(system, drive)
    lower, upper = np.asarray(estimate.lower), np.asarray(estimate.upper)
    excess = np.maximum(np.asarray(containment_excess(slip, lower, upper)), 0.0)
    stretches = explain(log.time, excess, assumptions, MEMORY)
    rows = []
    for a in assumptions:
        blamed = 100 * float(np.mean([a.name in v.causes for v in stretches])) if stretches else None
        rows.append([a.name.replace("_", " "), 100 * a.share, a.first_break_time, blamed])
    clear = sum(not v.causes for v in stretches)
    notes = [
        f"A slip angle was outside the envelope for {100 * float((excess > 0).mean()):.2f} % of the samples, in "
        f"{len(stretches)} stretches, by {np.rad2deg(excess.max()):.2f} deg at most; {len(stretches) - clear} of them had a "
        f"broken assumption at the time or in the {MEMORY:g} s before.",
        "The last column is the share of those stretches. The axle forces are those that make the slip-angle equations exact on "
        "the log; they need the truth and look ahead. Noise cannot be seen in a log and is not watched.",
    ]
    columns = ["assumption", "held [%]", "first broken [s]", "of violations [%]"]
    return Table(columns, rows, notes, f"What the envelope of {name} assumes")
