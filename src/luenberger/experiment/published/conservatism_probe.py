"""A quick look at whether a design may exist at a strength: one solve, no centring, no proof; only the search relies on it."""

from collections.abc import Callable
from typing import Any

import cvxpy as cp
import numpy as np

from luenberger.algebra import Polynomial, symmetric
from luenberger.core import BadInput, Infeasible
from luenberger.lmi import Block, Problem, solve
from luenberger.methods.channels import Channels
from luenberger.methods.dissipative_design import DissipativeDesign, Supply
from luenberger.methods.extended_luenberger import ExtendedLuenberger
from luenberger.methods.method import Method, gain_blocks, gain_bound, scheduled_variable
from luenberger.methods.polytopic import PolytopicLuenberger
from luenberger.methods.printed_two_dof import PrintedTwoDof
from luenberger.methods.structured_lipschitz import StructuredLipschitz
from luenberger.methods.two_dof import TwoDofLuenberger
from luenberger.methods.two_dof_inequality import Limits, Posing
from luenberger.methods.two_dof_search import zero_gain
from luenberger.systems import System
from luenberger.systems.jacobian_box import as_floats

Blocks = tuple[list[Block], dict[str, cp.Variable]]
# Unit of P L, so that gains around the limit of the comparison go with numbers of like size.
_UNIT = 30.0
_QUICK = ("CLARABEL",)


def seems_possible(system: System, method: Method, gain_limit: float) -> bool:
    """Return whether one solve finds a gain within the limit.

    Args:
        system: what the method is given.
        method: one of the comparison.
        gain_limit: largest |L| that counts.

    Raises:
        NotAccepted: the theorem does not speak of the plant.
    """
    try:
        method.accept(system)
        least = least_gain(system, method)
    except (Infeasible, BadInput):
        return False
    return least is not None and least <= gain_limit


def least_gain(system: System, method: Method) -> float | None:
    """Return the bound of the gain that one solve for the smallest gives, None where it gives nothing.

    Args:
        system: accepted plant.
        method: one of the comparison.

    Raises:
        Infeasible: a method without a quick way refuses the plant.
    """
    if isinstance(method, PolytopicLuenberger):
        return least_gain(system, ExtendedLuenberger())
    if isinstance(method, DissipativeDesign):
        design = method
        return _least(system, lambda P, Y: design.dissipates(system, P, Y, Supply("decay", np.zeros((system.nx,) * 2))))
    if isinstance(method, StructuredLipschitz):
        return _least(system, lambda P, Y: _channel(system, P, Y))
    if isinstance(method, TwoDofLuenberger):
        return _two_gains(system, method)
    if isinstance(method, PrintedTwoDof):
        posed = method.posed(system)
        found = solve(posed.problem, solvers=_QUICK)
        return None if found is None else gain_bound(system, posed.gains(found.values)[0]).level
    return gain_bound(system, method.design(system).gain).level


def _least(system: System, decay: Callable[[Polynomial, Polynomial], Blocks]) -> float | None:
    P = cp.Variable((system.nx, system.nx), symmetric=True, name="P")
    like = [as_floats(system.A), as_floats(system.C)]
    Y, variables = scheduled_variable(system.nx, system.ny, like, system.scheduling_names, "Y")
    squared = cp.Variable(name="squared")
    blocks, more = decay(Polynomial.constant(P), Y * _UNIT)
    blocks = [*blocks, *gain_blocks(P, Y, squared, system.scheduling_box)]
    found = solve(Problem({"P": P, "squared": squared, **variables, **more}, blocks, squared), solvers=_QUICK)
    if found is None:
        return None
    gain = Y.map(lambda y: _UNIT * np.linalg.solve(found.values["P"], np.asarray(y.value)))
    return gain_bound(system, gain).level


def _channel(system: System, P: Polynomial, Y: Polynomial) -> Blocks:
    f = system.nonlinearity
    assert f is not None
    s: Any = cp.Variable(nonneg=True, name="s")
    A, C, F = (as_floats(getattr(system, letter)) for letter in "ACF")
    drift = P @ A - Y @ C
    corner = drift + drift.T + Polynomial.constant(s * f.lipschitz_bound**2 * (f.H.T @ f.H))
    matrix = symmetric([[corner, P @ F], [Polynomial.constant(-s * np.eye(F.shape[1]))]])
    return [Block("decay", matrix, system.scheduling_box)], {"s": s}


def _two_gains(system: System, method: TwoDofLuenberger) -> float | None:
    channels = Channels.of(system, method.shift)
    posing = Posing(system, channels, 0.0, None, "disturbance", True, method.relaxation)
    unknowns = posing.fixed(zero_gain(system)) if method.argument_gain_limit == 0 else posing.free()
    found = solve(posing.problem(unknowns, Limits()), solvers=_QUICK)
    return None if found is None else gain_bound(system, unknowns.gains(found.values)[0]).level
