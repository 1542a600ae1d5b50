"""`luenberger run`: an experiment file becomes designs, a replay, scores and one page."""

from pathlib import Path
from typing import Annotated

import typer

from luenberger.cli.output import out, print_json, progress_bar, sentence
from luenberger.experiment import read_gust, run_experiment, run_gust


def command(
    experiment: Annotated[Path, typer.Argument(help="Experiment file (TOML).")],
    folder: Annotated[Path, typer.Option("--out", help="Folder for the results.")] = Path("results"),
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON on standard output.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="No progress bar.")] = False,
) -> None:
    """Design, certify, replay and score the entrants of an experiment file; write one page.

    Example: luenberger run experiments/slip_angle_slalom.toml --out results
    """
    with progress_bar(quiet) as progress:
        runner = run_experiment if read_gust(experiment) is None else run_gust
        result = runner(experiment, folder, progress)
    if as_json:
        print_json(result.as_json())
        return
    for table in (result.table, *result.watched):
        out.print(table.as_rich())
    sentence(result.summary)
    # A path broken in two lines can be neither clicked nor copied.
    out.print(f"Page: {result.page}", soft_wrap=True, markup=False, highlight=False)
