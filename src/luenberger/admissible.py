"""How far a bound of a plant may grow until a method no longer finds an observer that can be proved."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from luenberger.core import BadInput, Infeasible, NotCertified
from luenberger.design import Design
from luenberger.methods.method import Method
from luenberger.synthesize import synthesize
from luenberger.systems import System


@dataclass(frozen=True)
class Admissible:
    """Where proved designs end.

    Args:
        proved: the largest scale with a proved design.
        refused: the smallest scale above it that was tried and refused; None where even the largest one was proved.
        design: the design at `proved`.
        reason: why `refused` was refused; empty where nothing was.
    """

    proved: float
    refused: float | None
    design: Design
    reason: str = ""


def largest_admissible(
    plant: Callable[[float], System], method: Method, low: float, high: float, tolerance: float = 1e-3
) -> Admissible:
    """Bisect for the largest scale of a plant at which a method gives a proved design.

    Choose it to compare methods by the Jacobian set, the slip range or the uncertainty they can still serve. Every scale
    that counts is a full design with its certificate, so the result is a lower bound that holds; `refused` says only that
    the method found nothing there.

    Assumes: what is proved at one scale can be proved at every smaller one.

    Args:
        plant: scale -> plant, its bounds growing with the scale.
        method: the method with its options.
        low: scale at which the method succeeds.
        high: scale up to which is looked.
        tolerance: largest distance of the two ends that are returned, in the unit of the scale, > 0.

    Returns:
        the two ends, and the design at the proved one.

    Raises:
        BadInput: interval or tolerance that is empty or not finite.
        LuenbergerError: the method refuses the plant at `low` already, for the reason in the message.
    """
    if not (np.isfinite(low) and np.isfinite(high) and low < high):
        raise BadInput(f"The scales are [{low:g}, {high:g}]; two finite numbers, low < high, are needed.")
    if not (np.isfinite(tolerance) and tolerance > 0):
        raise BadInput(f"`tolerance` is {tolerance:g}; a finite number above zero is needed.")
    good, design = float(low), synthesize(plant(low), method)
    bad, scale, reason = None, float(high), ""
    while bad is None or bad - good > tolerance:
        tried = _tried(plant(scale), method)
        if isinstance(tried, Design):
            good, design = scale, tried
            if bad is None:
                break
        else:
            bad, reason = scale, tried
        scale = 0.5 * (good + bad)
    return Admissible(good, bad, design, reason)


def _tried(system: System, method: Method) -> Design | str:
    """The design, or why there is none; an undetectable pair counts as one more reason."""
    try:
        return synthesize(system, method)
    except (Infeasible, NotCertified, BadInput) as refusal:
        return str(refusal)
