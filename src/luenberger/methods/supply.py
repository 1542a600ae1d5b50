"""What stands beside V' in a dissipation inequality of the error: S, the inputs in units of their own, and P Be affine in P L."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from luenberger.algebra import Polynomial
from luenberger.systems import System
from luenberger.systems.error_system import ErrorSystem, beside
from luenberger.systems.jacobian_box import as_floats


@dataclass(frozen=True)
class Supply:
    """The terms beside V' in one dissipation inequality.

    Args:
        name: how its blocks are called.
        square: S, shape (nx, nx), affine in the variables.
        inputs: channels of w; empty where there is no input.
        reach: what multiplies |w|^2, w in units of `unit`.
        unit: number by which the direction of w is divided, so that a solver meets numbers of like size.
    """

    name: str
    square: Any
    inputs: str = ""
    reach: Any = None
    unit: float = 1.0


def entering(system: System, error: ErrorSystem, P: Polynomial, Y: Polynomial, supply: Supply) -> Polynomial:
    """Return P Be in units of the input, Be = (E, -L (G - D N) + what of v enters without L).

    Args:
        system: plant.
        error: its error under zero gain.
        P: storage variable.
        Y: P L.
        supply: which inputs.
    """
    return (P @ error.joined(supply.inputs) - Y @ injected(system, supply.inputs)) * (1.0 / supply.unit)


def injected(system: System, inputs: str) -> Polynomial:
    """Return the part of the inputs that the output error shows: (0, G - D N), shape (ny, nw).

    Args:
        system: plant.
        inputs: "disturbance", "noise" or "both".
    """
    still = Polynomial.constant(np.zeros((system.ny, system.nd)))
    if inputs == "disturbance":
        return still
    seen = as_floats(system.G)
    if not isinstance(system.N, Polynomial) or any(np.any(c) for _, c in system.N):
        seen = seen - as_floats(system.D) @ as_floats(system.N)
    return seen if inputs == "noise" else beside(still, seen)


def open_loop(system: System, argument_gain: Polynomial | None = None) -> ErrorSystem:
    """Return the error under L = 0, off which the terms without L are read.

    Args:
        system: plant.
        argument_gain: L2, or None.
    """
    zero = Polynomial.constant(np.zeros((system.nx, system.ny)))
    return ErrorSystem.of(system, zero, argument_gain=argument_gain)


def input_unit(system: System, inputs: str) -> float:
    """Return the size of the directions of w, by which they are divided; one where they are zero.

    Args:
        system: plant.
        inputs: "disturbance", "noise" or "both".
    """
    box: Mapping[str, tuple[float, float]] = system.scheduling_box
    seen = injected(system, inputs)
    direct = {"disturbance": system.E, "noise": system.G}.get(inputs, system.E)
    sizes = [np.linalg.norm(c, 2) for p in (as_floats(direct), seen) for c in p.bernstein(box).values() if c.size]
    return float(max(sizes, default=0.0)) or 1.0
