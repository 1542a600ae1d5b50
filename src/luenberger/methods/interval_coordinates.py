"""Coordinates z = T x in which an interval observer may keep order: sign changes and constant matrices."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from luenberger.core import BadInput
from luenberger.core.checks import known_keys, matrix
from luenberger.systems import System

# More states than this have more sign changes than a design should try; name the coordinates then.
MOST_STATES = 6


@dataclass(frozen=True, eq=False)
class Choice:
    """Coordinates in which a design was found.

    Args:
        transform: T.
        level: its optimum.
        comparable: a level that can be compared between coordinates.
        posed: the posed problem, for the steps that follow.
    """

    transform: np.ndarray
    level: float
    comparable: float
    posed: Any


def candidates(
    asked: Any, system: System, attempt: Callable[[np.ndarray], Choice | None]
) -> tuple[Choice | None, list[np.ndarray]]:
    """Try coordinates and return the best design found, or None, and all that was tried.

    Args:
        asked: "states", "signs", "search" or a matrix T.
        system: plant.
        attempt: designs in given coordinates; None where that fails.

    Raises:
        BadInput: unknown word, T of the wrong shape, too many states for all signs.
    """
    tried: list[np.ndarray] = []
    best: Choice | None = None
    for T in _asked(asked, system):
        tried.append(T)
        found = attempt(T)
        # Signs come first; a matrix has to beat them clearly, since bounds of mixed states are harder to read.
        if found is not None and (best is None or found.comparable < best.comparable * (1 - 1e-6)):
            best = found
    return best, tried


def sign_changes(nx: int) -> Iterator[np.ndarray]:
    """Yield diag(+-1) of all sign patterns, the first state positive, since turning all signs changes nothing.

    Args:
        nx: number of states.

    Raises:
        BadInput: too many states.
    """
    if nx > MOST_STATES:
        raise BadInput(
            f'{nx} states have {2 ** (nx - 1)} sign changes; name `coordinates` as one matrix T, or use "states".'
        )
    for signs in product((1.0, -1.0), repeat=nx - 1):
        yield np.diag([1.0, *signs])


def _asked(asked: Any, system: System) -> Iterator[np.ndarray]:
    nx = system.nx
    if not isinstance(asked, str):
        yield matrix("coordinates", asked, nx, nx, f"the system has {nx} states")
        return
    known_keys("`coordinates`", [asked], ["states", "signs", "search"])
    if asked == "states":
        yield np.eye(nx)
        return
    yield from sign_changes(nx)
