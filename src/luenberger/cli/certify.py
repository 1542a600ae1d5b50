"""`luenberger certify`: prove a saved design again, without a solver."""

from pathlib import Path
from typing import Annotated

import typer

from luenberger.cli.output import out, print_json, progress_bar, sentence
from luenberger.core import Outcome
from luenberger.design import load_design
from luenberger.report.tables import certificate_table

_COLOURS = {"proved": "green", "refuted": "red", "undecided": "yellow"}


def command(
    design: Annotated[Path, typer.Argument(help="Design file written by `Design.save` or `luenberger run`.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON on standard output.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="No progress bar.")] = False,
) -> None:
    """Prove every claim of a design file again from its plant, gain and witnesses; no solver is used.

    Exit code 0: all proved, 1: a claim refuted or undecided, 2: the file cannot be used.

    Example: luenberger certify results/slip_angle_slalom/lpv_observer.json
    """
    loaded = load_design(design)
    with progress_bar(quiet) as progress:
        certificate = loaded.certify(progress)
    seconds = [proof.seconds for proof in certificate.proofs]
    if as_json:
        parts = certificate.as_text()
        parts["proofs"] = [{**p, "seconds": s} for p, s in zip(parts["proofs"], seconds, strict=True)]
        print_json({"outcome": certificate.outcome.value, "seconds": certificate.seconds, **parts})
    else:
        table = certificate_table(certificate, seconds=seconds)
        out.print(table.as_rich(_COLOURS))
        sentence("This rests on:")
        for line in certificate.assumptions:
            sentence(f"- {line}")
        sentence(
            f"{certificate.outcome.value}: {certificate.outcome.sentence}"
            if certificate.proofs
            else "The file claims nothing."
        )
    if certificate.outcome is not Outcome.PROVED:
        raise typer.Exit(1)
