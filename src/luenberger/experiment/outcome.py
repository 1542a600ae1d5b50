"""The report that every kind of experiment ends in."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from luenberger.report.tables import Table


@dataclass(frozen=True, kw_only=True)
class Report:
    """What every experiment leaves behind.

    Args:
        title: headline.
        summary: what stands where, in plain sentences.
        table: scores, one row an entrant.
        page: the HTML page.
        files: everything written, the page included.
        watched: further tables, e.g. how the bounds did, what was assumed and how long it held.
    """

    title: str
    summary: str
    table: Table
    page: Path
    files: tuple[Path, ...]
    watched: Sequence[Table] = ()

    def as_json(self) -> dict[str, Any]:
        """Plain data: title, summary, table and files."""
        return {
            "title": self.title,
            "summary": self.summary,
            "table": self.table.as_json(),
            "assumptions": [table.as_json() for table in self.watched],
            "files": [str(f) for f in self.files],
        }
