"""The `luenberger` command: commands are loaded by name when they are called.

`luenberger certify` must run where no solver is installed, and `--help` must be quick, so the file of a command is
imported only when that command is asked for.
"""

import importlib
import os
import sys
from collections.abc import Sequence
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.panel import Panel
from rich.text import Text
from typer.core import TyperGroup

import luenberger
from luenberger.core import LuenbergerError

COMMANDS = ("run", "certify", "reproduce", "list")
BAD_INPUT = 2


class Lazy(TyperGroup):
    """A command group whose commands live in files of their own."""

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the command names in the order of the help page."""
        return list(COMMANDS)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Import and return one command, or None for an unknown name."""
        if cmd_name not in COMMANDS:
            return None
        module = importlib.import_module(f"luenberger.cli.{'catalogue' if cmd_name == 'list' else cmd_name}")
        single = typer.Typer(add_completion=False)
        single.command(name=cmd_name)(module.command)
        return typer.main.get_command(single)


app = typer.Typer(
    cls=Lazy,
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)


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
) -> None:
    """State observers: designed by convex optimisation, proved on the continuum, replayed on real logs."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line; an error of this library becomes one readable panel and exit code 2.

    Args:
        arguments: words after `luenberger`; default: those of the process. With LUENBERGER_DEBUG set, tracebacks are shown.
    """
    try:
        app(args=arguments)
    except LuenbergerError as error:
        if os.environ.get("LUENBERGER_DEBUG"):
            raise
        panel = Panel(Text(str(error)), title=type(error).__name__, title_align="left", border_style="red")
        Console(stderr=True).print(panel)
        sys.exit(BAD_INPUT)
