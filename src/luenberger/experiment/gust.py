"""From an experiment file with a [gust] part to designs, many runs in side wind, tables, pictures and one page."""

import re
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pandas as pd

import luenberger
from luenberger.core import BadInput
from luenberger.core.checks import nearest
from luenberger.experiment.gust_crossover import crossover_study
from luenberger.experiment.gust_double_track import double_track_study
from luenberger.experiment.gust_specification import GustSpecification, read_gust
from luenberger.experiment.gust_study import Study
from luenberger.experiment.gust_switched import switched_study
from luenberger.experiment.outcome import Report
from luenberger.report.citations import citations
from luenberger.report.page import Page

Progress = Callable[[str, float], None]
STUDIES: Mapping[str, Callable[[GustSpecification, Progress], Study]] = {
    "switched": switched_study,
    "crossover": crossover_study,
    "double_track": double_track_study,
}


def run_gust(path: str | Path, out: str | Path = "results", progress: Progress | None = None) -> Report:
    """Run a study of a car in side wind and write its page, designs and numbers.

    Args:
        path: TOML file with a [gust] part, see `GustSpecification`.
        out: folder for the results; a folder of the experiment's name is made in it.
        progress: called with what is being done and the share done, 0 to 1.

    Raises:
        BadInput: the file cannot be used; nothing has been written then.
        Infeasible, NotCertified: a design does not exist or cannot be proved.
    """
    tell = progress or (lambda text, share: None)
    spec = read_gust(path)
    if spec is None:
        raise BadInput(f"`{path}` has no [gust] part; give the path of a study in side wind.")
    if spec.study not in STUDIES:
        raise BadInput(f"[gust] study is `{spec.study}`.{nearest(spec.study, STUDIES)}")
    study = STUDIES[spec.study](spec, tell)
    report = _written(spec, study, Path(out) / Path(path).stem)
    tell("done", 1.0)
    return report


def _written(spec: GustSpecification, study: Study, folder: Path) -> Report:
    folder.mkdir(parents=True, exist_ok=True)
    files = []
    for name, design in study.designs.items():
        files.append(folder / f"{re.sub(r'[^a-z0-9]+', '_', name.lower())}.json")
        design.save(files[-1])
    files.append(folder / "numbers.csv")
    pd.DataFrame({n: np.asarray(v) for n, v in study.columns.items()}).to_csv(
        files[-1], index=False, float_format="%.9g"
    )
    car = spec.vehicle
    numbers = "; ".join(f"{row.name} {row.value:g} {row.unit} ({row.source})" for row in car.table())
    page = Page(
        title=spec.title,
        summary=study.summary,
        assumptions=[*spec.notes, *study.assumptions, *_stated(spec), f"The car is {car.name}: {numbers}."],
        designs=study.designs,
        scores=study.table,
        tables=study.tables,
        figures=study.figures,
        citations=citations(study.designs.values(), study.citations),
        provenance={"luenberger": luenberger.__version__, "study": spec.study, "seed": str(spec.seed)},
    )
    files.append(page.write(folder / "report.html"))
    return Report(
        title=spec.title,
        summary=study.summary,
        table=study.table,
        page=files[-1],
        files=tuple(files),
        watched=study.tables,
    )


def _stated(spec: GustSpecification) -> list[str]:
    bound = f" It never leaves ±({', '.join(f'{b:g}' for b in spec.state_bound)})." if spec.state_bound else ""
    return [
        f"Both cornering stiffnesses lie within {100 * spec.stiffness_share:g} %, the gyro errs by {spec.yaw_rate_noise:g} rad/s and the steering "
        f"angle by {spec.steering_error:g} rad at most; the state starts within {spec.initial_half_width:g} of zero.{bound}",
        f"The gust acts {spec.arm:g} m ahead of the centre of gravity and reaches {spec.force:g} N on the drive.",
    ]
