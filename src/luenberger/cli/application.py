"""The `luenberger` command: commands are loaded by name when they are called.

`luenberger certify` must run where no solver is installed, and help must be quick, so the file of a command is imported
only when that command is called; the page of all commands needs their names and sentences alone.
"""

import importlib
from collections.abc import Mapping, Sequence
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.panel import Panel
from rich.text import Text
from typer.core import TyperCommand, TyperGroup

import luenberger
from luenberger.core import BadInput, LuenbergerError, MissingExtra
from luenberger.core.checks import nearest

# Command -> file in this room, and its line on the help page.
COMMANDS: Mapping[str, tuple[str, str]] = {
    "run": ("run", "Design, certify, replay and score the entrants of an experiment file; write one page."),
    "certify": ("certify", "Prove every claim of a design file again, without a solver."),
    "export": ("export", "Write a design as C99 with golden vectors, or its gain as a table; build and check it."),
    "reproduce": ("reproduce", "Recompute a published paper row by row: printed, ours, verdict."),
    "list": ("catalogue", "List methods, observers, cars, kinds of entrants, logs and papers."),
}
BAD_INPUT = 2


class Lazy(TyperGroup):
    """A command group whose commands live in files of their own."""

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the command names in the order of the help page."""
        return list(COMMANDS)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Return name and sentence of one command, or None for an unknown name; nothing is imported."""
        return TyperCommand(cmd_name, help=COMMANDS[cmd_name][1]) if cmd_name in COMMANDS else None

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Import and return the command that is called, with its name and the words left for it.

        Raises:
            BadInput: no command of that name (the nearest one is named).
            MissingExtra: a package that this command needs is not installed.
        """
        if args and not args[0].startswith("-") and args[0] not in COMMANDS:
            raise BadInput(f"`luenberger` has no command `{args[0]}`.{nearest(args[0], COMMANDS)}")
        name, found, rest = super().resolve_command(ctx, args)
        return name, None if found is None else _loaded(str(found.name)), rest

    def invoke(self, ctx: Any) -> Any:
        """Run the command; an error of this library becomes one readable panel and exit code 2."""
        try:
            return super().invoke(ctx)
        except LuenbergerError as error:
            if ctx.params.get("debug"):
                raise
            panel = Panel(Text(str(error)), title=type(error).__name__, title_align="left", border_style="red")
            Console(stderr=True).print(panel)
            raise typer.Exit(BAD_INPUT) from None


app = typer.Typer(
    cls=Lazy,
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)


def _loaded(name: str) -> Any:
    try:
        module = importlib.import_module(f"luenberger.cli.{COMMANDS[name][0]}")
    except ModuleNotFoundError as cause:
        package = (cause.name or "").split(".")[0]
        if package in ("", "luenberger"):
            raise
        raise MissingExtra(
            f"`luenberger {name}` needs the package `{package}`, which is not installed; run `pip install {package}`."
        ) from cause
    single = typer.Typer(add_completion=False)
    single.command(name=name)(module.command)
    return typer.main.get_command(single)


def _print_version(wanted: bool) -> bool:
    if wanted:
        typer.echo(f"luenberger {luenberger.__version__}")
        raise typer.Exit
    return wanted


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version and stop.", is_eager=True, callback=_print_version)
    ] = False,
    debug: Annotated[
        bool, typer.Option("--debug", envvar="LUENBERGER_DEBUG", help="Show the traceback of an error.")
    ] = False,
) -> None:
    """State observers: designed by convex optimisation, proved on the continuum, replayed on real logs.

    Example: luenberger run experiments/slip_angle_slalom.toml
    """


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and leave the process with its exit code: 0 fine, 1 not proved, 2 input that cannot be used.

    Args:
        arguments: words after `luenberger`; default: those of the process.
    """
    app(args=None if arguments is None else list(arguments), prog_name="luenberger")
