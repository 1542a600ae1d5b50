"""From an experiment file to designs, a replay, scores and one page."""

import hashlib
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

import luenberger
from luenberger.core import Signal, Trajectory
from luenberger.design import Design
from luenberger.experiment.entrants import Entrant, Setting, build, kind_of
from luenberger.experiment.specification import Specification, read_specification
from luenberger.experiment.tuning import Tuned, tune
from luenberger.logs import read_log
from luenberger.replay import Channels, replay
from luenberger.report.citations import citations
from luenberger.report.figures import comparison_figures
from luenberger.report.page import Page
from luenberger.report.tables import Table
from luenberger.vehicle import VehicleParameters, car_named, slip_angle_channels

Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class Result:
    """What an experiment leaves behind.

    Args:
        title: headline.
        summary: where our observers stand, in plain sentences.
        table: scores, one row an entrant.
        page: the HTML page.
        files: everything written, the page included.
        entrants: the built entrants.
        sideslip: name -> estimate [rad] over `scored`.
        scored: the part of the log that is scored.
        errors: name -> RMSE of the sideslip [rad].
    """

    title: str
    summary: str
    table: Table
    page: Path
    files: tuple[Path, ...]
    entrants: Mapping[str, Entrant]
    sideslip: Mapping[str, np.ndarray]
    scored: Trajectory
    errors: Mapping[str, float]

    def as_json(self) -> dict[str, Any]:
        """Plain data: title, summary, table and files."""
        return {
            "title": self.title,
            "summary": self.summary,
            "table": self.table.as_json(),
            "files": [str(f) for f in self.files],
        }


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
    knobs: dict[str, Tuned] = {}
    entrants: dict[str, Entrant] = {}
    setting = Setting(car, spec.speed, spec.acceleration, spec.sample_time)
    for k, (name, options) in enumerate(spec.entrants.items()):
        share = (k + 0.5) / (len(spec.entrants) + 1)
        if fitted is not None:
            tell(f"tuning {name}", share)
            knobs[name] = _tuned(spec, setting, options, fitted)
        tell(f"designing {name}", share)
        entrants[name] = build(setting, options, knobs[name].knobs if name in knobs else None)
    tell("replaying", len(entrants) / (len(entrants) + 1))
    sideslip, seconds = _replayed(entrants, scored)
    errors = {name: _rmse(sideslip[name], scored, spec.skip) for name in entrants}
    table = _table(spec, entrants, scored, sideslip, errors, seconds, knobs)
    summary = _summary(spec, errors)
    folder = Path(out) / Path(path).stem
    page, files = _written(spec, car, folder, entrants, scored, sideslip, errors, seconds, table, summary)
    tell("done", 1.0)
    return Result(spec.title, summary, table, page, files, entrants, sideslip, scored, errors)


def _car(spec: Specification) -> VehicleParameters:
    options = dict(spec.vehicle)
    car = car_named(str(options.pop("parameters", "")))
    return (
        car.with_values("set in the experiment file", **{k: float(v) for k, v in options.items()}) if options else car
    )


def _prepared(spec: Specification, car: VehicleParameters) -> Trajectory:
    """Read, cut, bring to a uniform step, disturb the sensors, and add the channels that plants are scheduled by."""
    log = read_log(spec.path, spec.channels, time=spec.time)
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
        entrant = build(setting, options, knobs)
        sideslip, _ = _replayed({"one": entrant}, log, timing=False)
        return _rmse(sideslip["one"], log, spec.skip)

    return tune(cost, {k: defaults[k] for k in kind.knobs}, spec.evaluations)


def _replayed(
    entrants: Mapping[str, Entrant], log: Trajectory, timing: bool = True
) -> tuple[dict[str, np.ndarray], dict[str, float]]:
    """Run all entrants over a log in one scan; return sideslip [rad] and seconds a step by name."""
    channels: dict[str, Channels] = {}
    for name, entrant in entrants.items():
        # Entrants may hold different numbers under one name, so each gets channels of its own for them.
        own = {n: f"{name}: {n}" for n in entrant.constants}
        constants = [
            Signal(own[n], "", np.full(len(log), v), "constant of an entrant") for n, v in entrant.constants.items()
        ]
        log = log.with_signals(*constants)
        read = entrant.channels
        channels[name] = Channels(read.inputs, read.outputs, tuple(own.get(n, n) for n in read.scheduling))
    run = replay({n: e.observer for n, e in entrants.items()}, log, channels, np.zeros(2), timing=timing)
    sideslip = {n: e.sideslip(np.asarray(run.estimates[n].x), log) for n, e in entrants.items()}
    return sideslip, dict(run.seconds_per_step or {})


def _rmse(estimate: np.ndarray, log: Trajectory, skip: float) -> float:
    scored = log.time >= log.time[0] + skip
    return float(np.sqrt(np.mean((estimate - log["sideslip"].values)[scored] ** 2)))


def _table(
    spec: Specification,
    entrants: Mapping[str, Entrant],
    log: Trajectory,
    sideslip: Mapping[str, np.ndarray],
    errors: Mapping[str, float],
    seconds: Mapping[str, float],
    knobs: Mapping[str, Tuned],
) -> Table:
    kept = log.time >= log.time[0] + spec.skip
    rows = []
    for name, entrant in sorted(entrants.items(), key=lambda pair: errors[pair[0]]):
        error = np.rad2deg((sideslip[name] - log["sideslip"].values)[kept])
        proved = "" if entrant.design is None else entrant.design.certificate.outcome.value
        before = [] if not knobs else [float(np.rad2deg(knobs[name].cost))]
        rows.append(
            [
                name,
                *before,
                float(np.rad2deg(errors[name])),
                float(np.abs(error).max()),
                float(error.mean()),
                1e6 * seconds[name],
                proved,
            ]
        )
    first = ["tuning [deg]"] if knobs else []
    columns = [
        "entrant",
        *first,
        "RMSE [deg]",
        "max [deg]",
        "bias [deg]",
        "step [us]",
        "certificate",
    ]
    notes = [
        "RMSE, largest error and mean error (bias) of the sideslip over the scored samples; computing time of one step."
    ]
    notes += [f"{name}: {kind_of(options).sentence}." for name, options in spec.entrants.items()]
    if knobs:
        counts = ", ".join(f"{name} {len(t.knobs)} knobs {t.evaluations} replays" for name, t in knobs.items())
        notes.append(f"Tuned on the first {spec.fit_share:.0%} of the log alone, scored on the rest. Effort: {counts}.")
        for name, tuned in knobs.items():
            if tuned.knobs:
                notes.append(f"{name} was tuned to {', '.join(f'{k} {v:.4g}' for k, v in tuned.knobs.items())}.")
    return Table(columns, rows, notes, "Sideslip")


def _summary(spec: Specification, errors: Mapping[str, float]) -> str:
    """Say where our observers stand, best first, whoever wins."""
    degrees = {n: float(np.rad2deg(e)) for n, e in sorted(errors.items(), key=lambda pair: pair[1])}
    best = next(iter(degrees))
    ours = [n for n in degrees if str(spec.entrants[n]["kind"]).startswith("lpv")]
    others = [n for n in degrees if n not in ours]
    lines = [f"Best of all: {best} with {degrees[best]:.3f} deg RMSE."]
    if ours and others:
        one, other = ours[0], others[0]
        gap = degrees[one] / degrees[other] - 1
        verdict = f"{abs(gap):.0%} {'better' if gap < 0 else 'worse'} than" if abs(gap) >= 0.01 else "level with"
        lines.append(
            f"Our best certified observer, {one}, reaches {degrees[one]:.3f} deg, {verdict} the best of the others, {other}."
        )
    return " ".join(lines)


def _written(
    spec: Specification,
    car: VehicleParameters,
    folder: Path,
    entrants: Mapping[str, Entrant],
    log: Trajectory,
    sideslip: Mapping[str, np.ndarray],
    errors: Mapping[str, float],
    seconds: Mapping[str, float],
    table: Table,
    summary: str,
) -> tuple[Path, tuple[Path, ...]]:
    folder.mkdir(parents=True, exist_ok=True)
    designs = {name: e.design for name, e in entrants.items() if e.design is not None}
    files = []
    for name, design in designs.items():
        files.append(folder / f"{re.sub(r'[^a-z0-9]+', '_', name.lower())}.json")
        design.save(files[-1])
    columns = {"time": log.time, "truth": log["sideslip"].values, **sideslip}
    files.append(folder / "sideslip.csv")
    pd.DataFrame(columns).to_csv(files[-1], index=False, float_format="%.9g")
    page = Page(
        title=spec.title,
        summary=summary,
        assumptions=_assumptions(spec, car, designs, log),
        designs=designs,
        scores=table,
        figures=comparison_figures(
            log.time,
            log["sideslip"].values,
            sideslip,
            name="sideslip",
            unit="rad",
            truth_name="log",
            errors=errors,
            seconds=seconds,
        ),
        citations=citations(designs.values(), [spec.attribution] if spec.attribution else []),
        provenance={
            "luenberger": luenberger.__version__,
            "log": spec.path.name,
            "sha256 of the log": hashlib.sha256(spec.path.read_bytes()).hexdigest(),
        },
    )
    files.append(folder / "report.html")
    page.write(files[-1])
    return files[-1], tuple(files)


def _assumptions(
    spec: Specification, car: VehicleParameters, designs: Mapping[str, Design], log: Trajectory
) -> list[str]:
    noise = ", ".join(f"{n} {v:g}" for n, v in spec.noise.items())
    numbers = "; ".join(f"{row.name} {row.value:g} {row.unit} ({row.source})" for row in car.table())
    return [
        *spec.notes,
        *(f"{name}: {line}" for name, design in designs.items() for line in _broken(design, log)),
        f"White noise was added to the log: {noise} (standard deviations, SI)."
        if noise
        else "The log was replayed as it is.",
        f"The car is {car.name}: {numbers}.",
    ]


def _broken(design: Design, log: Trajectory) -> list[str]:
    """Say how much of the log lay inside the box the certificate is about; a proof says nothing outside it."""
    inside = np.ones(len(log), dtype=bool)
    for name, (lower, upper) in design.system.scheduling_box.items():
        inside &= (log[name].values >= lower) & (log[name].values <= upper)
    box = ", ".join(design.system.scheduling_box)
    lines = [
        f"The log lay inside the trusted box of {box} for {inside.mean():.1%} of the samples; scheduling was clipped to it outside."
    ]
    f = design.system.nonlinearity
    known = [(k, name) for k, name in enumerate(design.system.states) if name in log]
    if f is not None and f.domain is not None and known:
        truth = log.table([name for _, name in known])
        lower, upper = (np.array([end[k] for k, _ in known]) for end in f.domain)
        share = ((truth >= lower) & (truth <= upper)).all(axis=1).mean()
        lines.append(
            f"The true state lay inside the box where the bound on the nonlinearity holds for {share:.1%} of the samples."
        )
    return lines
