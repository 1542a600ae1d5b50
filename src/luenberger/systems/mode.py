"""Modes of a plant that no output shows, found by one subspace recursion, and the report that names them."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from luenberger.systems.system import System


@dataclass(frozen=True, eq=False)
class Mode:
    """One motion of the plant that leaves every output at zero.

    Args:
        eigenvalue: s [1/s] of a continuous plant, factor z a step of a discrete one.
        vector: state direction of unit length, shape (nx,), complex for an oscillation.
        direction: the same in state names, e.g. "0.71*front_slip + 0.71*rear_slip".
        where: parameter values at which the plant was frozen.
        dt: sample time [s] of a discrete plant, else None.
        roundoff: error of the eigenvalue that counts as none, in its unit.
    """

    eigenvalue: complex
    vector: np.ndarray
    direction: str
    where: Mapping[str, float]
    dt: float | None
    roundoff: float = 0.0

    @property
    def decay(self) -> float:
        """Rate at which the motion dies out [1/s]; negative where it grows."""
        if self.dt is None:
            return -float(self.eigenvalue.real)
        size = abs(self.eigenvalue)
        return math.inf if size == 0 else -math.log(size) / self.dt

    def fades(self, decay_rate: float) -> bool:
        """Tell whether the motion dies out strictly faster than a rate; a tie within roundoff does not count.

        Args:
            decay_rate: rate to beat [1/s].
        """
        if self.dt is None:
            return self.eigenvalue.real + self.roundoff < -decay_rate
        return abs(self.eigenvalue) + self.roundoff < math.exp(-decay_rate * self.dt)

    @property
    def text(self) -> str:
        """Eigenvalue with unit, direction and place in words."""
        return f"{self.value} ({self.direction}){place(self.where)}"

    @property
    def value(self) -> str:
        """Eigenvalue with its unit; an oscillation stands for its conjugate pair."""
        z = self.eigenvalue
        real = 0.0 if abs(z.real) <= self.roundoff else z.real
        number = f"{real:.3g}" if z.imag == 0 else f"{real:.3g} +/- {abs(z.imag):.3g}j"
        return f"{number} 1/s" if self.dt is None else f"{number} a step"


@dataclass(frozen=True, eq=False)
class Report:
    """Answer to a structural question about a plant; true in an `if` where the property holds.

    Args:
        question: the property, e.g. "observability".
        holds: whether it was found to hold at every point looked at.
        modes: the hidden motions, the slowest first.
        sentences: the answer in words.
        rank: rank of the observability matrix, or normal rank of the Rosenbrock pencil, at the worst point.
        singular_values: those of that matrix in balanced coordinates, largest first.
        matching: rank(C E) = rank(E) at every point; None where no unknown input was asked about.
    """

    question: str
    holds: bool
    modes: tuple[Mode, ...]
    sentences: tuple[str, ...]
    rank: int
    singular_values: np.ndarray
    matching: bool | None = None

    def __bool__(self) -> bool:
        return self.holds

    def __str__(self) -> str:
        return "\n".join(self.sentences)


def named_modes(
    system: System, where: Mapping[str, float], values: np.ndarray, directions: np.ndarray, roundoff: float
) -> list[Mode]:
    """Return one `Mode` an eigenvalue; of a conjugate pair the one that turns left stands for both.

    Args:
        system: plant that owns the state names.
        where: parameter values.
        values: eigenvalues, (k,).
        directions: state directions, (nx, k).
        roundoff: error of an eigenvalue that counts as none.
    """
    return [
        Mode(complex(s), v, in_words(v, system.states), where, system.dt, roundoff)
        for s, v in zip(values, directions.T, strict=True)
        if s.imag >= 0
    ]


def slowest_first(modes: Sequence[Mode]) -> tuple[Mode, ...]:
    """Return modes in the order of their decay, the one that stands most in the way first.

    Args:
        modes: hidden motions.
    """
    return tuple(sorted(modes, key=lambda mode: mode.decay))


def in_words(vector: np.ndarray, names: Sequence[str]) -> str:
    """Return a direction in state names, e.g. "0.71*a + 0.71*b"; a complex one as the plane it spans.

    Args:
        vector: direction, (nx,).
        names: state names.
    """
    vector = vector / np.linalg.norm(vector)
    turned = vector * np.exp(-1j * np.angle(vector[_leader(vector)]))
    if np.max(abs(turned.imag)) < 1e-6:
        return _sum_in_words(turned.real, names)
    other = turned.imag * np.sign(turned.imag[_leader(turned.imag)])
    return f"plane of {_sum_in_words(turned.real, names)} and {_sum_in_words(other, names)}"


def place(where: Mapping[str, float]) -> str:
    """Return " at vx = 10, mu = 0.9", or nothing for a plant without parameters.

    Args:
        where: parameter name -> value.
    """
    return f" at {', '.join(f'{name} = {value:.6g}' for name, value in where.items())}" if where else ""


def _leader(vector: np.ndarray) -> int:
    # The first of those that tie for the largest, so that roundoff does not choose the sign.
    size = abs(vector)
    return int(np.argmax(size >= size.max() * (1 - 1e-6)))


def _sum_in_words(vector: np.ndarray, names: Sequence[str]) -> str:
    text = ""
    for c, name in zip(vector, names, strict=True):
        if abs(c) >= 0.005:
            number = "" if f"{abs(c):.2f}" == "1.00" else f"{abs(c):.2f}*"
            text += (" + " if c > 0 else " - ") + number + name
    return "-" + text[3:] if text.startswith(" - ") else text[3:]
