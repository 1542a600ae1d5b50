"""`luenberger certify`: prove a saved design again, without a solver."""

from pathlib import Path
from typing import Annotated

import typer

from luenberger.cli.output import out, print_json
from luenberger.core import Outcome
from luenberger.design import Design
from luenberger.report.tables import certificate_table


def command(
    design: Annotated[Path, typer.Argument(help="Design file written by `Design.save` or `luenberger run`.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON on standard output.")] = False,
) -> None:
    """Prove every claim of a design file again from its plant, gain and witnesses; no solver is used.

    Exit code 0: all proved, 1: a claim refuted or undecided, 2: the file cannot be used.

    Example: luenberger certify results/slip_angle_slalom/lpv_observer.json
    """
    loaded = Design.load(design)
    certificate = loaded.certify()
    if as_json:
        print_json({"outcome": certificate.outcome.value, "seconds": certificate.seconds, **certificate.as_text()})
    else:
        out.print(certificate_table(certificate, discrete=loaded.system.dt is not None).as_rich())
        out.print("This rests on:")
        for line in certificate.assumptions:
            out.print(f"  - {line}")
        out.print(f"{certificate.outcome.value} in {1e3 * certificate.seconds:.1f} ms: {certificate.outcome.sentence}")
    if certificate.outcome is not Outcome.PROVED:
        raise typer.Exit(1)
