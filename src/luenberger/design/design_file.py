"""Design files: JSON that says what it is, read with errors that name what is wrong."""

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from luenberger.core import BadInput
from luenberger.core.checks import known_keys

T = TypeVar("T")


def read_file(path: str | Path) -> dict[str, Any]:
    """Return the entries of a design file of any kind.

    Args:
        path: file written by `save`.

    Raises:
        BadInput: no such file, not JSON, or no design.
    """
    try:
        data = json.loads(Path(path).read_text(encoding="utf-8"))
    except OSError as cause:
        raise BadInput(f"`{path}` cannot be read ({cause.strerror}); give the path of a design file.") from None
    except ValueError as cause:
        raise BadInput(
            f"`{path}` is not JSON, or is cut off ({cause}); give a whole file as `Design.save` wrote it."
        ) from None
    if not isinstance(data, dict) or "format" not in data:
        raise BadInput(
            f"`{path}` is no design file, it does not say its `format`; give a file written by `Design.save`."
        )
    return data


def built_from(
    path: str | Path, form: str, keys: Sequence[str], build: Callable[[Mapping[str, Any]], T], later: Sequence[str] = ()
) -> T:
    """Read a file of one format and build what it holds.

    Args:
        path: file.
        form: what its `format` has to say.
        keys: entries it has.
        build: takes the entries.
        later: entries that older files lack.

    Raises:
        BadInput: another format, unknown or missing entries, or damaged ones.
    """
    data = read_file(path)
    if data["format"] != form:
        raise BadInput(
            f"`{path}` is no design file of this kind; its `format` is `{data['format']}` and needs to be `{form}`. "
            "`luenberger.design.load_design` reads both kinds."
        )
    known_keys(f"`{path}`", data, [*keys, *later])
    try:
        return build(data)
    except (AttributeError, LookupError, TypeError, ValueError) as cause:
        if isinstance(cause, BadInput):
            raise
        raise BadInput(
            f"`{path}` is damaged ({type(cause).__name__}: {cause}); write it again with `Design.save`."
        ) from None


def write_file(path: str | Path, data: Mapping[str, Any]) -> None:
    """Write the entries of a design file.

    Args:
        path: file to write.
        data: entries, `format` first.

    Raises:
        BadInput: the file cannot be written.
    """
    try:
        Path(path).write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
    except OSError as cause:
        raise BadInput(
            f"`{path}` cannot be written ({cause.strerror}); give another path, in a folder that exists."
        ) from None
