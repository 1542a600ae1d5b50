"""What an experiment leaves behind: estimates, scores, designs, one page."""

import hashlib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd

import luenberger
from luenberger.core import Signal, Trajectory
from luenberger.design import Design
from luenberger.experiment.entrant import Entrant
from luenberger.experiment.entrants import kind_of
from luenberger.experiment.outcome import Report
from luenberger.experiment.specification import Specification
from luenberger.experiment.tuning import Tuned
from luenberger.export import sampled_step
from luenberger.observers import Estimate
from luenberger.replay import Channels, replay
from luenberger.report.citations import citations
from luenberger.report.figures import comparison_figures
from luenberger.report.page import Page
from luenberger.report.tables import Table
from luenberger.systems.jacobian_box import error_box
from luenberger.vehicle import VehicleParameters

Bounds = Mapping[str, tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True, kw_only=True)
class Result(Report):
    """What an experiment on a log or a simulated drive leaves behind, beside its report.

    Args:
        entrants: the built entrants.
        sideslip: name -> estimate [rad] over `scored`.
        scored: the part of the log that is scored.
        errors: name -> RMSE of the sideslip [rad].
        bounds: name -> guaranteed (lower, upper) sideslip [rad] over `scored`, for entrants that give them.
    """

    entrants: Mapping[str, Entrant]
    sideslip: Mapping[str, np.ndarray]
    scored: Trajectory
    errors: Mapping[str, float]
    bounds: Bounds = field(default_factory=dict)


@dataclass(frozen=True)
class Run:
    """What all entrants made of one log.

    Args:
        sideslip: name -> estimate [rad], shape (nt,).
        bounds: name -> guaranteed (lower, upper) sideslip [rad], for entrants that give them.
        seconds: name -> computing time of a step [s]; empty where it was not measured.
        estimates: name -> what the observer said, arrays with a leading axis of samples.
    """

    sideslip: Mapping[str, np.ndarray]
    bounds: Bounds = field(default_factory=dict)
    seconds: Mapping[str, float] = field(default_factory=dict)
    estimates: Mapping[str, Estimate] = field(default_factory=dict)


def replayed(entrants: Mapping[str, Entrant], log: Trajectory, timing: bool = True) -> Run:
    """Run all entrants over a log in one scan.

    Args:
        entrants: name -> entrant.
        log: what is replayed.
        timing: measure the computing time of a step too.
    """
    channels: dict[str, Channels] = {}
    for name, entrant in entrants.items():
        # Entrants may hold different numbers under one name, so each gets channels of its own for them.
        own = {n: f"{name}: {n}" for n in entrant.constants}
        constants = [
            Signal(own[n], "", np.full(len(log), v), "constant of an entrant") for n, v in entrant.constants.items()
        ]
        log = log.with_signals(*constants)
        read = entrant.channels
        outputs, scheduling = (tuple(own.get(n, n) for n in names) for names in (read.outputs, read.scheduling))
        channels[name] = Channels(read.inputs, outputs, scheduling)
    run = replay({n: e.observer for n, e in entrants.items()}, log, channels, np.zeros(2), timing=timing)
    sideslip = {n: e.sideslip(np.asarray(run.estimates[n].x), log) for n, e in entrants.items()}
    bounds: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    for name, entrant in entrants.items():
        estimate = run.estimates[name]
        if estimate.lower is not None and estimate.upper is not None:
            # The sideslip falls or rises with the state that carries it; the smaller end is the lower bound either way.
            ends = [entrant.sideslip(np.asarray(x), log) for x in (estimate.lower, estimate.upper)]
            bounds[name] = (np.minimum(*ends), np.maximum(*ends))
    return Run(sideslip, bounds, dict(run.seconds_per_step or {}), run.estimates)


def rmse(estimate: np.ndarray, log: Trajectory, skip: float) -> float:
    """Return the root mean square error of a sideslip estimate [rad].

    Args:
        estimate: shape (nt,).
        log: holds the truth.
        skip: seconds at the start that are not scored.
    """
    scored = log.time >= log.time[0] + skip
    return float(np.sqrt(np.mean((estimate - log["sideslip"].values)[scored] ** 2)))


def _table(
    spec: Specification,
    entrants: Mapping[str, Entrant],
    log: Trajectory,
    run: Run,
    errors: Mapping[str, float],
    knobs: Mapping[str, Tuned],
) -> Table:
    truth = np.rad2deg(log["sideslip"].values)
    kept = log.time >= log.time[0] + spec.skip
    tuned_any = any(tuned.knobs for tuned in knobs.values())
    rows = []
    for name, entrant in sorted(entrants.items(), key=lambda pair: errors[pair[0]]):
        error = (np.rad2deg(run.sideslip[name]) - truth)[kept]
        proved = "" if entrant.design is None else entrant.design.certificate.outcome.value
        before = [] if not tuned_any else [float(np.rad2deg(knobs[name].cost))]
        rows.append(
            [
                name,
                *before,
                float(np.rad2deg(errors[name])),
                float(np.abs(error).max()),
                float(error.mean()),
                1e6 * run.seconds[name],
                proved,
            ]
        )
    first = ["tuning [deg]"] if tuned_any else []
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
    notes += [_sampled(name, entrant) for name, entrant in entrants.items() if entrant.design is not None]
    if tuned_any:
        counts = ", ".join(f"{name} {len(t.knobs)} knobs {t.evaluations} replays" for name, t in knobs.items())
        notes.append(f"Tuned on the first {spec.fit_share:.0%} of the log alone, scored on the rest. Effort: {counts}.")
        for name, tuned in knobs.items():
            if tuned.knobs:
                notes.append(f"{name} was tuned to {', '.join(f'{k} {v:.4g}' for k, v in tuned.knobs.items())}.")
    return Table(columns, rows, notes, "Sideslip")


def _sampled(name: str, entrant: Entrant) -> str:
    """What is proved of the step that was replayed; a claim about continuous time does not stand alone."""
    design = entrant.design
    assert design is not None
    # Four stages with a Jacobian of their own each: with several varying entries the proof takes longer than the whole run.
    if len(set(error_box(design.system)) - set(design.system.scheduling_names)) > 1:
        return f"{name}: its claims are about continuous time; `luenberger export` proves the sampled step."
    step = sampled_step(design, entrant.observer)
    if step is None:
        return f"{name}: its bounds hold for the sampled step by the way it is carried out, see the observer."
    return f"{name}, {step.sentence}"


def _bounds_table(spec: Specification, log: Trajectory, bounds: Bounds) -> Table:
    """Containment, mean width and the largest escape of every guaranteed envelope."""
    kept = log.time >= log.time[0] + spec.skip
    truth = np.rad2deg(log["sideslip"].values)[kept]
    rows = []
    for name, ends in bounds.items():
        lower, upper = (np.rad2deg(end)[kept] for end in ends)
        escape = np.maximum(np.maximum(lower - truth, truth - upper), 0.0)
        inside, width = 100 * float((escape == 0).mean()), float((upper - lower).mean())
        rows.append([name, inside, width, float(escape.max())])
    notes = [
        "Share of samples with the truth inside the bounds, mean distance of the bounds, and how far the truth got out."
    ]
    return Table(["entrant", "inside [%]", "width [deg]", "escape [deg]"], rows, notes, "Guaranteed bounds")


def _summary(spec: Specification, errors: Mapping[str, float], enclosed: Sequence[Table]) -> str:
    """Say where our observers stand, best first, whoever wins, and how the guaranteed bounds did."""
    degrees = {n: float(np.rad2deg(e)) for n, e in sorted(errors.items(), key=lambda pair: pair[1])}
    best = next(iter(degrees))
    ours = [n for n in degrees if str(spec.entrants[n]["kind"]).startswith(("lpv", "interval"))]
    others = [n for n in degrees if n not in ours]
    lines = [f"Best of all: {best} with {degrees[best]:.3f} deg RMSE."]
    if ours and others:
        one, other = ours[0], others[0]
        gap = degrees[one] / degrees[other] - 1
        verdict = f"{abs(gap):.0%} {'better' if gap < 0 else 'worse'} than" if abs(gap) >= 0.01 else "level with"
        lines.append(
            f"Our best certified observer, {one}, reaches {degrees[one]:.3f} deg, {verdict} the best of the others, {other}."
        )
    for table in enclosed:
        for name, inside, width, _ in table.rows:
            lines.append(
                f"The envelope of {name} holds the truth for {inside:.2f} % of the samples, {width:.2f} deg wide on average."
            )
    return " ".join(lines)


def written(
    spec: Specification,
    car: VehicleParameters,
    folder: Path,
    entrants: Mapping[str, Entrant],
    log: Trajectory,
    run: Run,
    knobs: Mapping[str, Tuned],
) -> Result:
    """Score a run and write its designs, estimates and page.

    Args:
        spec: what the experiment file says.
        car: the car as stated there.
        folder: where to write.
        entrants: name -> entrant.
        log: the scored part of the log.
        run: what the entrants made of it.
        knobs: name -> what tuning found.
    """
    errors = {name: rmse(run.sideslip[name], log, spec.skip) for name in entrants}
    enclosed = [_bounds_table(spec, log, run.bounds)] if run.bounds else []
    table, summary = _table(spec, entrants, log, run, errors, knobs), _summary(spec, errors, enclosed)
    folder.mkdir(parents=True, exist_ok=True)
    designs = {name: e.design for name, e in entrants.items() if e.design is not None}
    files = []
    for name, design in designs.items():
        files.append(folder / f"{re.sub(r'[^a-z0-9]+', '_', name.lower())}.json")
        design.save(files[-1])
    ends = {f"{n} {end}": b[k] for n, b in run.bounds.items() for k, end in enumerate(("lower", "upper"))}
    columns = {"time": log.time, "truth": log["sideslip"].values, **run.sideslip, **ends}
    files.append(folder / "sideslip.csv")
    pd.DataFrame(columns).to_csv(files[-1], index=False, float_format="%.9g")
    watched = enclosed + [e.watch(n, log, run.estimates[n]) for n, e in entrants.items() if e.watch is not None]
    page = Page(
        title=spec.title,
        summary=summary,
        assumptions=_assumptions(spec, car, entrants, log),
        designs=designs,
        scores=table,
        tables=watched,
        figures=comparison_figures(
            log.time,
            log["sideslip"].values,
            run.sideslip,
            name="sideslip",
            unit="rad",
            truth_name="log",
            errors=errors,
            seconds=run.seconds,
            bounds=run.bounds,
        ),
        citations=citations(designs.values(), [spec.attribution] if spec.attribution else []),
        provenance={
            "luenberger": luenberger.__version__,
            **_origin(spec),
        },
    )
    files.append(folder / "report.html")
    page.write(files[-1])
    return Result(
        title=spec.title,
        summary=summary,
        table=table,
        page=files[-1],
        files=tuple(files),
        watched=watched,
        entrants=entrants,
        sideslip=run.sideslip,
        scored=log,
        errors=errors,
        bounds=run.bounds,
    )


def _origin(spec: Specification) -> dict[str, str]:
    if spec.path is None:
        return {"simulated drive": spec.drive}
    return {"log": spec.path.name, "sha256 of the log": hashlib.sha256(spec.path.read_bytes()).hexdigest()}


def _assumptions(
    spec: Specification, car: VehicleParameters, entrants: Mapping[str, Entrant], log: Trajectory
) -> list[str]:
    noise = ", ".join(f"{n} {v:g}" for n, v in spec.noise.items())
    numbers = "; ".join(f"{row.name} {row.value:g} {row.unit} ({row.source})" for row in car.table())
    return [
        *spec.notes,
        *(f"{name}: {line}" for name, entrant in entrants.items() for line in entrant.notes),
        *(f"{n}: {line}" for n, e in entrants.items() if e.design is not None for line in _broken(e.design, log)),
        f"White noise was added to the log: {noise} (standard deviations, SI)." if noise else "No noise was added.",
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
