"""Argument checks that speak the house's error language: given, needed, what to do."""

import difflib
import sys
from collections.abc import Iterable, Sequence
from typing import Any, get_args

import numpy as np

from luenberger.core.errors import BadInput


def finite_array(name: str, value: object) -> np.ndarray:
    """Return `value` as a float64 array, refusing anything that is not finite numbers.

    Args:
        name: how the argument is called in the message.
        value: numbers in any nesting that NumPy reads.

    Raises:
        BadInput: not numeric, or NaN/Inf inside (the first bad entry is named).
    """
    try:
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError) as cause:
        raise BadInput(
            f"`{name}` cannot be read as an array of numbers ({cause}); give nested lists of floats."
        ) from None
    bad = np.argwhere(~np.isfinite(array))
    if bad.size:
        where = tuple(int(i) for i in bad[0])
        raise BadInput(
            f"`{name}` holds {array[where]} at index {where}; every entry of `{name}` needs to be a finite number."
        )
    return array


def matrix(
    name: str, value: object, rows: int | None = None, columns: int | None = None, because: str = ""
) -> np.ndarray:
    """Return `value` as a finite 2-D float64 array of the wanted shape; None leaves a side free.

    Args:
        name: how the argument is called in the message.
        value: nested numbers.
        rows: wanted number of rows.
        columns: wanted number of columns.
        because: half sentence that says where the wanted shape comes from, e.g. "the system has 4 states".

    Raises:
        BadInput: wrong number of axes or wrong shape.
    """
    array = finite_array(name, value)
    if array.ndim == 0:
        array = array.reshape(1, 1)
    wanted = f"({'any' if rows is None else rows}, {'any' if columns is None else columns})"
    if (
        array.ndim != 2
        or (rows is not None and array.shape[0] != rows)
        or (columns is not None and array.shape[1] != columns)
    ):
        reason = f" but {because}" if because else ""
        raise BadInput(f"`{name}` has shape {array.shape}{reason}; `{name}` needs shape {wanted}.")
    return array


def nearest(word: str, known: Iterable[str]) -> str:
    """Return a hint ` Did you mean `x`?` for the known word closest to `word`, or the list of known words."""
    words = sorted(known)
    match = difflib.get_close_matches(word, words, n=1, cutoff=0.5)
    if not words:
        return " There are none to choose from."
    return f" Did you mean `{match[0]}`?" if match else f" Known: {', '.join(f'`{w}`' for w in words)}."


def known_keys(where: str, given: Iterable[str], known: Sequence[str]) -> None:
    """Refuse any key that is not in `known`, naming the nearest known key.

    Args:
        where: what the keys belong to, for the message.
        given: the keys found.
        known: the keys understood.

    Raises:
        BadInput: an unknown key.
    """
    for key in given:
        if key not in known:
            raise BadInput(f"{where} has the unknown key `{key}`.{nearest(key, known)}")


def is_number(value: object) -> bool:
    """Tell whether `value` is a number that a double holds; infinities, NaN and truth values are not.

    Args:
        value: what users or files give.
    """
    # By comparison, since `isfinite` of an integer of hundreds of digits raises, and a file may hold one.
    return isinstance(value, int | float) and not isinstance(value, bool) and bool(abs(value) <= sys.float_info.max)


def is_whole(value: object) -> bool:
    """Tell whether `value` is an integer; truth values are not.

    Args:
        value: what users or files give.
    """
    return isinstance(value, int) and not isinstance(value, bool)


def symmetric_matrix(name: str, value: object) -> np.ndarray:
    """Return `value` as a finite symmetric float64 matrix, shape (n, n).

    Args:
        name: how the argument is called in the message.
        value: nested numbers.

    Raises:
        BadInput: not square, or not symmetric to the last digit.
    """
    given = matrix(name, value)
    square = matrix(name, given, len(given), len(given), "a symmetric matrix is square")
    if not np.array_equal(square, square.T):
        raise BadInput(f"`{name}` is not symmetric; give (S + S.T) / 2 in its place.")
    return square


def known_words(owner: object, **words: Any) -> None:
    """Refuse an attribute that is none of the words of its type.

    Args:
        owner: what has the attributes.
        words: attribute -> `Literal` type.

    Raises:
        BadInput: another word, or no word.
    """
    for name, known in words.items():
        given, choices = getattr(owner, name), get_args(known)
        if given not in choices:
            raise BadInput(
                f"`{name}` of a `{type(owner).__name__}` is {given!r}; one of {', '.join(map(repr, choices))} is needed."
            )
