"""`luenberger list`: what there is."""

from typing import Annotated

import typer

from luenberger import observers
from luenberger.cli.output import out, print_json, sentence
from luenberger.experiment.drives import DRIVES
from luenberger.experiment.entrants import KINDS
from luenberger.experiment.published import SOURCES
from luenberger.experiment.specification import DATA
from luenberger.methods import METHODS
from luenberger.report.tables import Table
from luenberger.vehicle import CARS


def command(
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON on standard output.")] = False,
) -> None:
    """List methods, observers, cars, kinds of entrants, logs, simulated drives and papers.

    Example: luenberger list --json
    """
    running = [
        n for n in observers.__all__ if n[0].isupper() and hasattr(getattr(observers, n), "step") and n != "Observer"
    ]
    groups = {
        "method": {name: _first(method) for name, method in METHODS.items()},
        "observer": {name: _first(getattr(observers, name)) for name in running},
        "entrant": {name: kind.sentence for name, kind in KINDS.items()},
        "car": {key: car.name for key, car in CARS.items()},
        "log": {path.name: "ships with the package" for path in sorted(DATA.glob("*.csv"))},
        "drive": {name: drive.sentence for name, drive in DRIVES.items()},
        "paper": {name: f"luenberger reproduce {name}" for name in SOURCES},
    }
    if as_json:
        print_json({**groups, "references": {name: list(method.references) for name, method in METHODS.items()}})
        return
    rows = [[group, name, text] for group, members in groups.items() for name, text in members.items()]
    out.print(Table(["what", "name", "is"], rows, [], "luenberger").as_rich())
    for name, method in METHODS.items():
        for reference in method.references:
            sentence(f"{name}: {reference}")


def _first(thing: object) -> str:
    return (thing.__doc__ or "").strip().split("\n", maxsplit=1)[0]
