"""From a design or an observer to a folder that builds and checks itself."""

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from luenberger.certify import Certificate
from luenberger.core import BadInput, NotAccepted
from luenberger.design import Design, SwitchedDesign
from luenberger.export.build import Build, build, write_c
from luenberger.export.c import CCode, c_code
from luenberger.export.golden import Golden, golden, random_drive
from luenberger.export.guard import Guarded
from luenberger.export.rounding import UNITS
from luenberger.export.sampled import SampledStep, proofs_text, quantised, quantised_plant, sampled_step
from luenberger.observers import Observer
from luenberger.systems import Switched, System

# Samples of the golden vectors.
_RUNS, _SAMPLES = 4, 250
# What a run of C may differ from one of Python by, in units of roundoff and of the largest value met: both round each of some
# hundred operations a step, and a contracting step forgets its roundings.
_UNITS = 1e4


@dataclass(frozen=True, eq=False)
class Exported:
    """What was written.

    Args:
        code: header and source.
        vectors: golden vectors.
        files: paths of all files.
        build: what the compiler and the replay said.
        certificate: claims of the design, checked for the numbers that ship; None for a filter.
        step: claim about the sampled step; None where its guarantee is its own.
        statements: what header and proofs say of the sampled step.
    """

    code: CCode
    vectors: Golden
    files: tuple[Path, ...]
    build: Build
    certificate: Certificate | None
    step: SampledStep | None
    statements: tuple[str, ...]


def export_c(
    source: Design | SwitchedDesign | Observer,
    folder: str | Path,
    *,
    name: str = "observer",
    precision: str = "double",
    dt: float | None = None,
    system: System | Switched | None = None,
    residual_bound: Any = None,
    check: bool = True,
    **options: Any,
) -> Exported:
    """Write an observer as C99 with golden vectors, a replay program, a Makefile, a README and what is proved; then build and check it.

    Choose it when a design leaves for the target. What is written is the observer's own step, read operation by operation; what is
    proved is proved again for the numbers that ship and for the sampled step.

    Args:
        source: a design, or a running observer with its `system`.
        folder: where to write.
        name: prefix of all symbols and files.
        precision: "double" or "float".
        dt: sample time [s] of a continuous design.
        system: plant of a running observer, for names, units and watched assumptions.
        residual_bound: see `Guarded.of`.
        check: compile and replay where a compiler is there.
        options: of the observer, see `Design.observer`.

    Raises:
        BadInput: see `c_code`; an observer without its plant; options beside a running observer.
        NotAccepted: an operation that C99 lacks; an unknown-input design in single precision.
    """
    certificate, step = None, None
    if isinstance(source, Observer):
        if system is None or options:
            raise BadInput("A running observer is exported with its `system` and takes no further options.")
        observer, plant = source, system
    elif isinstance(source, SwitchedDesign):
        if precision != "double":
            raise NotAccepted(
                "In single precision P E is no longer zero, and the unknown input, which nobody bounds, would reach the estimate. Export this "
                'design with precision="double".'
            )
        observer, plant, certificate = source.observer(dt, **options), source.system, source.certificate
    else:
        shipped = quantised(source, precision)
        observer, plant, certificate = shipped.observer(dt, **options), shipped.system, shipped.certificate
        held = shipped if precision != "float" else replace(shipped, system=quantised_plant(plant, precision))
        step = sampled_step(held, held.observer(dt, **options))
    guarded = Guarded.of(observer, plant, certificate=certificate, residual_bound=residual_bound)
    statements: tuple[str, ...] = ()
    if certificate is not None:
        statements = (_step_of_its_own(observer, plant) if step is None else f"Sampled step, {step.sentence}",)
    code = c_code(guarded, name, precision=precision, certificate=certificate, statements=statements)
    kind = np.float32 if precision == "float" else np.float64
    run = golden(guarded, *random_drive(guarded, _SAMPLES, _RUNS), dtype=kind)
    files = write_c(code, run, folder, tolerance=_UNITS * UNITS[precision][0])
    proofs = Path(folder) / f"{name}_proofs.json"
    proofs.write_text(
        json.dumps(proofs_text(certificate, step, precision, statements), indent=1) + "\n", encoding="utf-8"
    )
    built = build(folder, name) if check else Build(False, False, "not asked for")
    return Exported(code, run, (*files, proofs), built, certificate, step, statements)


def _step_of_its_own(observer: Observer, plant: System | Switched) -> str:
    if Switched.of(plant).first.dt is not None:
        return f"Sampled step of {observer.dt!r} s: the certificate above speaks of this map itself."
    return (
        f"Sampled step of {observer.dt!r} s: the certificate above speaks of continuous time, not of this step. What holds step by step, "
        "for signals held over it, are the bounds: the step keeps the order, and what sampling leaves out is enclosed."
    )
