"""A switched plant whose claims can be worked out by hand: the output is the state that the unknown input drives.

x1+ = a x1 + b x2,   x2+ = d,   y = x2 + v:   H = [0, -1]', P = diag(1, 0), and K = [b, 0]' leaves e+ = diag(a, 0) e + w.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from luenberger.algebra import Polynomial
from luenberger.systems import Switched, System

COUPLING, NOISE = 0.2, 0.1
H = np.array([[0.0], [-1.0]])
K = np.array([[COUPLING], [0.0]])


def plant(*speeds: float, dwell: int = 1, **options: Any) -> Switched:
    """One mode for each a."""
    given = {"noise_bound": [NOISE], **options}
    return Switched.of([mode(a, **given) for a in speeds], dwell=dwell)


def mode(a: float, **options: Any) -> System:
    """x1+ = a x1 + b x2, x2+ = d."""
    return System.linear([[a, COUPLING], [0.0, 0.0]], C=[[0.0, 1.0]], E=[[0.0], [1.0]], dt=0.1, name="hand", **options)


def constant(matrices: Sequence[np.ndarray]) -> tuple[Polynomial, ...]:
    """Gains as polynomials."""
    return tuple(Polynomial.constant(m) for m in matrices)
