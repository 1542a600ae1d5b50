"""The same tuning effort for every entrant: a bounded number of replays, a simplex search over its own knobs."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from luenberger.core import BadInput, LuenbergerError


@dataclass(frozen=True)
class Tuned:
    """What a search found.

    Args:
        knobs: name -> value.
        cost: the cost there.
        evaluations: how many times the cost was computed.
    """

    knobs: Mapping[str, float]
    cost: float
    evaluations: int


def tune(cost: Callable[[Mapping[str, float]], float], start: Mapping[str, float], evaluations: int) -> Tuned:
    """Minimise a cost over positive knobs by a simplex search on their logarithms.

    A knob vector for which no observer exists costs infinity, so that the search walks round it.

    Args:
        cost: takes name -> value, returns a number, or raises a `LuenbergerError` where no observer exists.
        start: first value of each knob, positive.
        evaluations: largest number of cost evaluations.

    Raises:
        BadInput: a start that is not positive, or a cost that is infinite at the start.
    """
    if any(not v > 0 for v in start.values()):
        raise BadInput(f"Tuning starts at {dict(start)}; every knob needs a positive start.")
    names = list(start)
    if not names:
        return Tuned({}, cost({}), 1)
    best: list[tuple[float, Mapping[str, float]]] = []

    def judged(logarithms: np.ndarray) -> float:
        knobs = dict(zip(names, map(float, np.exp(logarithms)), strict=True))
        try:
            value = float(cost(knobs))
        except LuenbergerError:
            value = np.inf
        value = value if np.isfinite(value) else 1e9
        best.append((value, knobs))
        return value

    x0 = np.log(list(start.values()))
    if judged(x0) >= 1e9:
        raise BadInput(f"No observer runs at the start of the tuning, {dict(start)}; start elsewhere.")
    simplex = np.vstack([x0, *(x0 + 0.3 * row for row in np.eye(len(names)))])
    minimize(judged, x0, method="Nelder-Mead", options={"maxfev": max(evaluations - 1, 1), "initial_simplex": simplex})
    value, knobs = min(best, key=lambda pair: pair[0])
    return Tuned(knobs, value, len(best))
