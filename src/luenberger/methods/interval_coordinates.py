"""Coordinates z = T x in which an interval observer may keep order: sign changes and constant matrices."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import combinations, product
from typing import Any

import numpy as np
from scipy.linalg import matrix_balance

from luenberger.core import BadInput
from luenberger.core.checks import known_keys, matrix
from luenberger.systems import System
from luenberger.systems.enclosure_system import EnclosureSystem

# More states than this have more sign changes than a design should try; name the coordinates then.
MOST_STATES = 6
# Directions of the rows of T on a half circle, for two states; random matrices for more.
_DIRECTIONS = 12
_RANDOM = 100
_SEED = 20140401


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


Attempt = Callable[[np.ndarray], Choice | None]


def candidates(asked: Any, system: System, attempt: Attempt) -> tuple[list[Choice], list[np.ndarray]]:
    """Try coordinates and return the designs found, the best first, and all that was tried.

    Args:
        asked: "states", "signs", "search" or a matrix T.
        system: plant.
        attempt: designs in given coordinates; None where that fails.

    Raises:
        BadInput: unknown word, T of the wrong shape, too many states for all signs.
    """
    tried: list[np.ndarray] = []
    found: list[Choice] = []

    def visit(T: np.ndarray) -> None:
        tried.append(T)
        choice = attempt(T)
        if choice is not None:
            found.append(choice)

    for T in _asked(asked, system):
        visit(T)
    if isinstance(asked, str) and asked == "search" and found and system.nx == 2:
        scale = _scale(system)
        for step in (0.5, 0.25):
            for T in list(_turned(min(found, key=_worth).transform * scale, step * np.pi / _DIRECTIONS)):
                visit(T / scale)
    return sorted(found, key=_worth), tried


def _worth(choice: Choice) -> float:
    """A matrix has to beat sign changes clearly, since bounds of mixed states are harder to read."""
    return choice.comparable * (1.0 if np.count_nonzero(choice.transform) == len(choice.transform) else 1.001)


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


def mixtures(system: System) -> Iterator[np.ndarray]:
    """Yield constant matrices T of mixed states: a grid of directions for two states, seeded random ones for more.

    States are counted in units in which the coupling of the plant is even.

    Args:
        system: plant.
    """
    scale = _scale(system)
    if system.nx == 2:
        angles = np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS
        for one, other in combinations(angles, 2):
            for turn in (0.0, np.pi):
                if not (one == 0.0 and np.isclose(other, np.pi / 2)):  # those are the states themselves
                    yield _rows(one, other + turn) / scale
        return
    generator = np.random.default_rng(_SEED)
    for _ in range(_RANDOM if system.nx > 2 else 0):
        rows = generator.normal(size=(system.nx, system.nx))
        yield rows / np.linalg.norm(rows, axis=1, keepdims=True) / scale


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
    if asked == "search":
        yield from mixtures(system)


def _scale(system: System) -> np.ndarray:
    """Units of the states that balance the largest entries of A over the box."""
    here = EnclosureSystem.of(system)
    largest = np.max([np.abs(c) for c in here.A.bernstein(here.box).values()], axis=0)
    _, (scale, _) = matrix_balance(largest, permute=False, separate=True)
    return np.asarray(scale)


def _turned(rows: np.ndarray, step: float) -> Iterator[np.ndarray]:
    """Both rows turned by a step either way or not at all."""
    one, other = (float(np.arctan2(row[1], row[0])) for row in rows)
    for i, j in product((-1, 0, 1), repeat=2):
        if i or j:
            yield _rows(one + i * step, other + j * step)


def _rows(one: float, other: float) -> np.ndarray:
    return np.array([[np.cos(one), np.sin(one)], [np.cos(other), np.sin(other)]])
