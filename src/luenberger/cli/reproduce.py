"""`luenberger reproduce`: every number of a published paper beside ours."""

from collections import Counter
from pathlib import Path
from typing import Annotated

import typer

from luenberger.cli.output import out, print_json, progress_bar, sentence
from luenberger.core import BadInput
from luenberger.core.checks import nearest
from luenberger.experiment.published import PAGES, SOURCES, Row
from luenberger.report.tables import Table

_COLOURS = {"reproduced": "green", "bettered": "green", "corrected": "yellow", "not reproducible": "red"}


def command(
    source: Annotated[str, typer.Argument(help="Paper, e.g. song-hedrick; left out: list them.")] = "",
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON on standard output.")] = False,
    page: Annotated[
        Path | None, typer.Option("--page", help="Write the figures of the paper, drawn again, here.")
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", help="No progress bar.")] = False,
) -> None:
    """Recompute a paper row by row: printed, ours, verdict.

    Example: luenberger reproduce wang-interval --page figures.html
    """
    if not source:
        print_json(list(SOURCES)) if as_json else out.print("\n".join(SOURCES))
        return
    if source not in SOURCES:
        raise BadInput(f"No paper is called `{source}`.{nearest(source, SOURCES)}")
    if page is not None and source not in PAGES:
        raise BadInput(f"`{source}` has no page of figures; leave out `--page`, or take one of {', '.join(PAGES)}.")
    with progress_bar(quiet) as progress:
        done: list[Row] = []

        def told(row: Row) -> None:
            done.append(row)
            # The number of rows is not known beforehand; the bar approaches its end.
            progress(row.item[:60], 1 - 1 / (1 + len(done) / 10))

        rows = SOURCES[source](told)
        if page is not None:
            progress("drawing the figures", 0.99)
            PAGES[source](page)
    counts = Counter(row.verdict.value for row in rows)
    if as_json:
        keys = ("item", "equation", "printed", "ours", "reason", "deviation")
        listed = [{k: getattr(row, k) for k in keys} | {"verdict": row.verdict.value} for row in rows]
        print_json({"source": source, "rows": listed, "counts": dict(counts)})
        return
    cells = [
        [str(k), f"{r.item}, {r.equation}", r.printed, r.ours, r.verdict.value] for k, r in enumerate(rows, start=1)
    ]
    out.print(Table(["", "item", "printed", "ours", "verdict"], cells, [], source).as_rich(_COLOURS))
    # Reasons are sentences; in a column of a terminal nobody could read them.
    for k, row in enumerate(rows, start=1):
        sentence(f"{k:3d}  {row.reason}")
    sentence(", ".join(f"{n} {word}" for word, n in counts.items()))
