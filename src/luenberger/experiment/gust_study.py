"""What a study of a car in side wind leaves: tables, pictures, designs, and the file of its numbers."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from luenberger.design import SwitchedDesign
from luenberger.experiment.gust_runs import Cars, Enclosure
from luenberger.report.figures import Figure
from luenberger.report.tables import Table


@dataclass(frozen=True, eq=False)
class Study:
    """What was found.

    Args:
        summary: what stands where, in plain sentences.
        table: one row an entrant.
        figures: pictures.
        designs: entrant -> design.
        columns: name -> numbers, for the file beside the page.
        tables: further tables.
        assumptions: what was taken as true, one sentence each.
        citations: sources of the methods that have no design.
    """

    summary: str
    table: Table
    figures: Sequence[Figure]
    designs: Mapping[str, SwitchedDesign]
    columns: Mapping[str, np.ndarray]
    tables: Sequence[Table] = ()
    assumptions: Sequence[str] = ()
    citations: Sequence[str] = field(default=())


HEADINGS = ("entrant", "width [m/s]", "runs left", "reach [%]", "RMSE [m/s]", "rests on")
NOTE = (
    "Mean distance of the bounds of the lateral speed; on how many runs a state ever leaves its bounds; how much of the half width an error "
    "takes at most; root mean square error of the middle; what the bounds rest on. "
    "The gust is bounded by a zonotopic filter that is told the largest gust; the Kalman filter's bounds are three standard deviations either way."
)
STATED = "certificate"
INDUCTION = "recursion"
NONE = "nothing"


def scored(name: str, bounds: Enclosure, runs: Cars, guarantee: str) -> list[object]:
    """Return the row of an entrant under `HEADINGS`.

    Args:
        name: of the entrant.
        bounds: along all runs.
        runs: the truth.
        guarantee: `STATED`, `INDUCTION` or `NONE`.
    """
    left, error = int(bounds.left(runs.states).sum()), (bounds.estimate - runs.states)[..., 0]
    middle = 0.5 * (bounds.lower + bounds.upper)[..., 0] - runs.states[..., 0]
    rms = float(np.sqrt(np.mean((error if guarantee == NONE else middle) ** 2)))
    reach = 100 * bounds.reach(runs.states)
    return [name, bounds.width, left, reach, rms, guarantee]
