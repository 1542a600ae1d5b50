"""From an experiment file to designs, a replay, scores and one page."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from luenberger.core import BadInput, Signal, Trajectory
from luenberger.experiment.drives import simulated_drive
from luenberger.experiment.entrant import Entrant, Setting
from luenberger.experiment.entrants import build, kind_of
from luenberger.experiment.results import Result, replayed, rmse, written
from luenberger.experiment.specification import Specification, read_specification
from luenberger.experiment.tuning import Tuned, tune
from luenberger.logs import read_log
from luenberger.vehicle import VehicleParameters, car_named, slip_angle_channels

Progress = Callable[[str, float], None]


def run_experiment(path: str | Path, out: str | Path = "results", progress: Progress | None = None) -> Result:
    """Run an experiment file and write its page, designs and scores.

    Args:
        path: TOML file, see `read_specification`.
        out: folder for the results; a folder of the experiment's name is made in it.
        progress: called with what is being done and the share done, 0 to 1.

    Raises:
        BadInput: the file, the log or an option cannot be used; nothing has been written then.
        Infeasible, NotCertified: a design of the file does not exist or cannot be proved.
        ReplayFailed: an observer left the finite numbers.
    """
    tell = progress or (lambda text, share: None)
    spec = read_specification(path)
    for options in spec.entrants.values():
        kind_of(options)
    tell("reading the log", 0.0)
    car = _car(spec)
    log = _prepared(spec, car)
    fitted, scored = _split(spec, log)
    if spec.skip >= (lasts := float(scored.time[-1] - scored.time[0])):
        raise BadInput(f"`skip` is {spec.skip:g} s but only {lasts:g} s are scored; leave some of them.")
    knobs: dict[str, Tuned] = {}
    entrants: dict[str, Entrant] = {}
    setting = Setting(car, spec.speed, spec.acceleration, spec.sample_time, fitted)
    for k, (name, options) in enumerate(spec.entrants.items()):
        share = (k + 0.5) / (len(spec.entrants) + 1)
        if fitted is not None:
            tell(f"tuning {name}", share)
            knobs[name] = _tuned(spec, setting, options, fitted)
        tell(f"designing {name}", share)
        entrants[name] = build(setting, options, knobs[name].knobs if name in knobs else None)
    tell("replaying", len(entrants) / (len(entrants) + 1))
    run = replayed(entrants, scored)
    result = written(spec, car, Path(out) / Path(path).stem, entrants, scored, run, knobs)
    tell("done", 1.0)
    return result


def _car(spec: Specification) -> VehicleParameters:
    options = dict(spec.vehicle)
    car = car_named(str(options.pop("parameters", "")))
    return (
        car.with_values("set in the experiment file", **{k: float(v) for k, v in options.items()}) if options else car
    )


def _read(spec: Specification, path: Path) -> Trajectory:
    return read_log(path, spec.channels, time=spec.time)


def _prepared(spec: Specification, car: VehicleParameters) -> Trajectory:
    """Read, cut, bring to a uniform step, disturb the sensors, and add the channels that plants are scheduled by."""
    log = simulated_drive(spec.drive, car, spec.sample_time) if spec.path is None else _read(spec, spec.path)
    start, stop = (
        a if a is not None else b for a, b in zip(spec.cut, (log.time[0], log.time[-1] + spec.sample_time), strict=True)
    )
    log = log.between(float(start), float(stop)).resample(spec.sample_time)
    clean_channels = slip_angle_channels(log, car)
    truth = [clean_channels[name] for name in ("front_slip", "rear_slip", "sideslip")]
    noise = np.random.default_rng(spec.seed)
    for name, deviation in spec.noise.items():
        clean = log[name]
        values = clean.values + deviation * noise.standard_normal(len(log))
        log = log.with_signals(
            Signal(name, clean.unit, values, f"{clean.description} with noise of {deviation} {clean.unit}")
        )
    return slip_angle_channels(log, car).with_signals(*truth)


def _split(spec: Specification, log: Trajectory) -> tuple[Trajectory | None, Trajectory]:
    if spec.fit_share is None:
        return None, log
    middle = log.time[0] + spec.fit_share * (log.time[-1] - log.time[0])
    return log.between(log.time[0], middle), log.between(middle, log.time[-1] + spec.sample_time)


def _tuned(spec: Specification, setting: Setting, options: Mapping[str, Any], log: Trajectory) -> Tuned:
    kind = kind_of(options)
    defaults = {**kind.options, **{k: float(v) for k, v in options.items() if k != "kind"}}
    defaults |= {k: getattr(setting.car, k) for k in ("front_stiffness", "rear_stiffness")}

    def cost(knobs: Mapping[str, float]) -> float:
        run = replayed({"one": build(setting, options, knobs)}, log, timing=False)
        return rmse(run.sideslip["one"], log, spec.skip)

    return tune(cost, {k: defaults[k] for k in kind.knobs}, spec.evaluations)
