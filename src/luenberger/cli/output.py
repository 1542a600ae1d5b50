"""What commands share: a progress bar on standard error, pure JSON or tables on standard output."""

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

out = Console()


@contextmanager
def progress_bar(quiet: bool = False) -> Iterator[Callable[[str, float], None]]:
    """Give a function (text, share done 0 to 1) that moves a bar on standard error.

    Args:
        quiet: True shows nothing.
    """
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True, disable=quiet) as bar:
        task = bar.add_task("starting", total=1.0)
        yield lambda text, share: bar.update(task, description=text, completed=share)


def sentence(text: str) -> None:
    """Print a sentence as it stands: brackets in it are no markup and numbers get no colour.

    Args:
        text: what to print.
    """
    out.print(text, markup=False, highlight=False)


def print_json(data: Any) -> None:
    """Print data as JSON, nothing else.

    Args:
        data: plain data.
    """
    print(json.dumps(data, indent=1, ensure_ascii=False))
