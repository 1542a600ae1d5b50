"""`luenberger export`: a design as code for the target."""

import importlib
from pathlib import Path
from typing import Annotated, Any

import typer

from luenberger.cli.output import out, print_json, progress_bar, sentence
from luenberger.core import BadInput, Outcome
from luenberger.core.checks import nearest
from luenberger.design import Design, SwitchedDesign, load_design
from luenberger.export import Axis, Exported, export_c, look_up_table, table_header
from luenberger.report.tables import Table

TARGETS = ("c", "table")


def command(
    design: Annotated[Path, typer.Argument(help="Design file written by `Design.save` or `luenberger run`.")],
    folder: Annotated[Path, typer.Argument(help="Folder to write; made where absent.")],
    to: Annotated[str, typer.Option("--to", help="c: the observer as C99; table: its gain over a grid.")] = "c",
    name: Annotated[str, typer.Option("--name", help="Prefix of files and symbols.")] = "observer",
    precision: Annotated[str, typer.Option("--precision", help="double or float.")] = "double",
    dt: Annotated[float | None, typer.Option("--dt", help="Sample time in s of a continuous design.")] = None,
    half_width: Annotated[
        str,
        typer.Option("--half-width", help="Initial half widths of a set, e.g. 0.1,0.2; observers with sets need them."),
    ] = "",
    axis: Annotated[
        list[str] | None,
        typer.Option("--axis", help="Grid of a table: PARAMETER:1,2,3 or SIGNAL=1/PARAMETER:5,10,20; once for each."),
    ] = None,
    decay: Annotated[
        float | None,
        typer.Option("--decay", help="Decay that a table has to keep where it may be less than the design's."),
    ] = None,
    function: Annotated[
        str, typer.Option("--function", help="MODULE:NAME of the nonlinear function, which no design file holds.")
    ] = "",
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON on standard output.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="No progress bar.")] = False,
) -> None:
    """Write a design as C99 with golden vectors, Makefile and what is proved, then build and check it where a compiler is there.

    Exit code 0: written and agreeing, 1: something disagrees or is not proved for the numbers that ship, 2: input that cannot be used.

    Example: luenberger export results/slip_angle_slalom/lpv_observer.json build/observer --dt 0.01

    A set around the estimate: luenberger export wind.json build/wind --half-width 0.01,0.01

    A gain table: luenberger export lpv.json build/table --to table --axis speed:5,10,20,40 --axis acceleration:-5,0,5
    """
    if to not in TARGETS:
        raise BadInput(f"`--to {to}` is no target.{nearest(to, TARGETS)}")
    loaded = load_design(design, _imported(function))
    with progress_bar(quiet) as progress:
        if to == "table":
            _table(loaded, folder, name, precision, axis or [], decay, as_json, progress)
            return
        progress("reading, writing, building", 0.3)
        options: dict[str, Any] = {} if not half_width else {"initial_half_width": _numbers(half_width)}
        made = export_c(loaded, folder, name=name, precision=precision, dt=dt, **options)
    _shown(made, as_json)


def _shown(made: Exported, as_json: bool) -> None:
    proved = made.certificate is None or made.certificate.outcome is Outcome.PROVED
    stepped = made.step is None or made.step.outcome is Outcome.PROVED
    facts = {
        "operations a step": made.code.operations,
        "bytes of locals": made.code.stack,
        "library calls": ", ".join(made.code.calls) or "none",
        "precision": made.code.precision,
        "design with these numbers": "nothing claimed" if made.certificate is None else made.certificate.outcome.value,
        "sampled step": "see below" if made.step is None else made.step.outcome.value,
        "replay": "not built" if not made.build.ran else "agrees" if made.build.agrees else "disagrees",
    }
    if as_json:
        print_json({**facts, "files": [str(f) for f in made.files], "says": made.build.says.strip()})
    else:
        out.print(Table(["what", "is"], [[k, str(v)] for k, v in facts.items()], []).as_rich())
        for statement in made.statements:
            sentence(statement)
        sentence(made.build.says.strip())
        for file in made.files:
            sentence(str(file))
    if not (proved and stepped) or (made.build.ran and not made.build.agrees):
        raise typer.Exit(1)


def _table(
    design: Design | SwitchedDesign,
    folder: Path,
    name: str,
    precision: str,
    axes: list[str],
    decay: float | None,
    as_json: bool,
    progress: Any,
) -> None:
    if not isinstance(design, Design):
        raise BadInput("The gains of a switched design belong to its modes; it has no table.")
    levels = {} if decay is None else {"decay": decay}
    table = look_up_table(design, [_axis(a) for a in axes], precision=precision, levels=levels, progress=progress)
    folder.mkdir(parents=True, exist_ok=True)
    files = [folder / f"{name}.csv", folder / f"{name}.h"]
    table.save_csv(files[0])
    files[1].write_text(table_header(table, name), encoding="utf-8")
    facts = {"points": table.values.shape[:-2], "error": table.error, "outcome": table.certificate.outcome.value}
    if as_json:
        print_json({**facts, "files": [str(f) for f in files]})
        return
    out.print(Table(["what", "is"], [[k, str(v)] for k, v in facts.items()], []).as_rich())
    for file in files:
        sentence(str(file))


def _axis(text: str) -> Axis:
    head, _, points = text.partition(":")
    signal, _, parameter = head.rpartition("=")
    if signal and not parameter.startswith("1/"):
        raise BadInput(f"`--axis {text}` is not understood; write PARAMETER:1,2,3 or SIGNAL=1/PARAMETER:5,10,20.")
    return Axis(parameter.removeprefix("1/"), _numbers(points), signal)


def _numbers(text: str) -> tuple[float, ...]:
    try:
        return tuple(float(word) for word in text.split(","))
    except ValueError:
        raise BadInput(f"`{text}` is no list of numbers; write e.g. 0.1,0.2.") from None


def _imported(text: str) -> Any:
    if not text:
        return None
    module, _, name = text.partition(":")
    try:
        return getattr(importlib.import_module(module), name)
    except (ImportError, AttributeError, ValueError) as cause:
        raise BadInput(
            f"`--function {text}` cannot be imported ({cause}); write MODULE:NAME of a JAX function."
        ) from None
