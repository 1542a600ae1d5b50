"""What can be claimed of an error system, each claim with the witness that lets anybody check it."""

import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from luenberger.core import BadInput
from luenberger.core.checks import finite_array, matrix

Kind = Literal["decay", "l2_gain", "gain_bound"]


@dataclass(frozen=True, eq=False)
class Claim:
    """One statement about the closed-loop error over the whole parameter box and Jacobian set.

    * decay: V = e' P e falls at least like exp(-2 level t) (a step of a discrete plant: V falls by level^2).
    * l2_gain: |weight e|_2 <= level |w|_2 from zero initial error, w the disturbance, the noise, or both.
    * gain_bound: |L(r)|_2 <= level.

    Args:
        kind: which statement.
        level: decay rate [1/s], factor a step, L2 gain, or norm bound.
        storage: the witness P, shape (nx, nx); None for a gain bound.
        multiplier: witness of the norm-bounded channel where the plant has one.
        weight: performance output of an L2 claim, shape (nz, nx).
        inputs: "disturbance", "noise" or "both" for an L2 claim.

    Raises:
        BadInput: negative or non-finite level, missing witness.
    """

    kind: Kind
    level: float
    storage: np.ndarray | None = None
    multiplier: float | None = None
    weight: np.ndarray | None = None
    inputs: str = ""

    def __post_init__(self) -> None:
        if not (math.isfinite(self.level) and self.level >= 0):
            raise BadInput(f"The claim `{self.kind}` has level {self.level}; a finite level >= 0 is needed.")
        if self.kind == "gain_bound":
            return
        if self.storage is None:
            raise BadInput(f"The claim `{self.kind}` has no storage matrix; nothing could check it.")
        P = finite_array("storage", self.storage)
        object.__setattr__(self, "storage", matrix("storage", P, P.shape[0], P.shape[0], "a storage matrix is square"))
        if not np.array_equal(P, P.T):
            raise BadInput("The storage matrix is not symmetric; store (P + P.T) / 2.")
        if self.kind == "l2_gain" and (self.weight is None or self.inputs not in ("disturbance", "noise", "both")):
            raise BadInput("An L2 gain claim needs `weight` and `inputs` ('disturbance', 'noise' or 'both').")

    def sentence(self, discrete: bool = False) -> str:
        """The claim in words."""
        if self.kind == "gain_bound":
            return f"The gain norm |L(r)| stays below {self.level:.6g} on the whole scheduling box."
        if self.kind == "l2_gain":
            return f"From zero initial error, |W e|_2 <= {self.level:.6g} |w|_2 for every {_inputs[self.inputs]} w of finite energy."
        P = np.asarray(self.storage)
        values = np.linalg.eigvalsh(P)
        bound = math.sqrt(max(values[-1], 0.0) / values[0]) if values[0] > 0 else math.inf
        if not discrete and self.level == 0:
            return f"Without disturbance and noise, |e| <= {bound:.4g} |e0| at all times and e goes to zero, inside the stated sets."
        law = f"{self.level:.6g}^k" if discrete else f"exp(-{self.level:.6g} t)"
        return f"Without disturbance and noise, |e| <= {bound:.4g} |e0| {law} for every error inside the stated sets."

    def as_text(self) -> dict[str, Any]:
        """Plain data for JSON; every number that the proof uses is a rational as a string."""
        return {
            "kind": self.kind,
            "level": to_text(self.level),
            "storage": None if self.storage is None else matrix_text(self.storage),
            "multiplier": None if self.multiplier is None else to_text(self.multiplier),
            "weight": None if self.weight is None else matrix_text(self.weight),
            "inputs": self.inputs,
        }

    @staticmethod
    def from_text(data: dict[str, Any]) -> "Claim":
        """Read what `as_text` wrote."""
        return Claim(
            kind=data["kind"],
            level=from_text(data["level"]),
            storage=None if data["storage"] is None else matrix_from_text(data["storage"]),
            multiplier=None if data["multiplier"] is None else from_text(data["multiplier"]),
            weight=None if data["weight"] is None else matrix_from_text(data["weight"]),
            inputs=data["inputs"],
        )


_inputs = {"disturbance": "disturbance", "noise": "noise", "both": "disturbance and noise"}


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
    return np.array([[from_text(x) for x in row] for row in rows], dtype=np.float64).reshape(len(rows), -1)
