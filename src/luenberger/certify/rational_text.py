"""Numbers of a certificate as text: every double is written as the rational it is exactly."""

import math
import operator
from typing import Any

import numpy as np

from luenberger.algebra import Polynomial
from luenberger.core import BadInput


def to_text(number: float) -> str:
    """Return the exact value of a double as a rational, e.g. "5/4".

    Args:
        number: any finite double.
    """
    p, q = float(number).as_integer_ratio()
    return str(p) if q == 1 else f"{p}/{q}"


def from_text(text: str) -> float:
    """Return the double that `to_text` wrote.

    Raises:
        BadInput: not a rational that a double holds exactly.
    """
    try:
        p, _, q = str(text).partition("/")
        value = int(p) / int(q or 1)
        held = value.as_integer_ratio() == (
            (int(p) // math.gcd(int(p), int(q or 1))),
            int(q or 1) // math.gcd(int(p), int(q or 1)),
        )
    except (ValueError, ZeroDivisionError, OverflowError):
        raise BadInput(f'`{text}` is not a rational; numbers in a certificate need the form "p/q".') from None
    if not held:
        raise BadInput(f"`{text}` is not exactly a double; the certificate was altered or written by something else.")
    return value


def matrix_text(array: np.ndarray) -> list[list[str]]:
    """Return a matrix as nested rational strings.

    Args:
        array: matrix of doubles.
    """
    return [[to_text(x) for x in row] for row in np.atleast_2d(array)]


def matrix_from_text(rows: list[list[str]]) -> np.ndarray:
    """Return the float matrix that `matrix_text` wrote.

    Args:
        rows: nested rational strings.
    """
    found = np.array([[from_text(x) for x in row] for row in rows], dtype=np.float64)
    return found.reshape(len(rows), -1) if rows else np.zeros((0, 0))


def polynomial_as_text(polynomial: Polynomial) -> dict[str, Any]:
    """Return names, shape and terms of a matrix polynomial."""
    terms = [{"exponents": list(e), "coefficient": matrix_text(np.asarray(c))} for e, c in polynomial]
    return {"names": list(polynomial.names), "shape": list(polynomial.shape), "terms": terms}


def polynomial_from_text(data: dict[str, Any]) -> Polynomial:
    """Read what `polynomial_as_text` wrote.

    Args:
        data: names, shape and terms.

    Raises:
        BadInput: coefficients that are not written as rationals.
        TypeError: exponents that are no whole numbers.
    """
    shape = tuple(data["shape"])
    return Polynomial(
        data["names"],
        {
            tuple(map(operator.index, t["exponents"])): matrix_from_text(t["coefficient"]).reshape(shape)
            for t in data["terms"]
        },
    )
