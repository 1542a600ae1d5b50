"""How two gains are found where one convex problem does not say all: limits by bisection, bilinear terms in turn."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from luenberger.algebra import Polynomial
from luenberger.lmi import Solution, solve
from luenberger.methods.method import NEGLIGIBLE
from luenberger.methods.two_dof_inequality import Limits, Posing, Unknowns
from luenberger.systems import System

# Share of the squared level that may be given away for smaller gains; the centring gives away one percent more.
SHARE = 0.005
# An L2 gain is often approached by ever larger gains; without a limit on them this much of its square, and at least this
# square in scaled units (a twentieth of what a unit input adds to the state in one second), is not worth them.
L2_SHARE, L2_NEGLIGIBLE = 0.04, 2.5e-3
# Room above the smallest limit, without which a point has no margin.
ROOM = 1.05
# Norms between which a smallest one is looked for; without any limit a solver may stop at 1e12.
SEARCHED, LARGEST, HALVINGS = (1e-6, 1e6), 1e9, 6
ROUNDS, PROGRESS = 15, 1e-3
# Share of the limit of L2 that is used, so that rounding does not carry the gain over it.
KEPT = 1 - 1e-5


def improved(posing: Posing, L2: Polynomial, limits: Limits) -> tuple[Unknowns, Solution] | None:
    """Improve (storage, multipliers, L) beside L2, then (L, L2) beside those, until the level falls no more.

    Args:
        posing: plant and goal.
        L2: start.
        limits: of the gains.

    Returns:
        unknowns beside the last L2 and their solution, or None where the start has no level.
    """
    last: tuple[Unknowns, Solution] | None = None
    for _ in range(ROUNDS):
        unknowns = posing.fixed(L2)
        now = solve(posing.problem(unknowns, limits))
        if now is None or (last is not None and now.objective > last[1].objective * (1 - PROGRESS)):
            return last
        last = unknowns, now
        gains = posing.stored(unknowns, now.values)
        argument = None if limits.argument is None else KEPT * limits.argument
        found = solve(posing.problem(gains, replace(limits, argument=argument)))
        if found is None:
            return last
        L2 = gains.gains(found.values)[1]
    return last


def best_improved(posing: Posing, starts: Sequence[Polynomial], limits: Limits) -> tuple[Unknowns, Solution] | None:
    """Return the best that `improved` reaches from several starts, or None where no start has a level.

    Args:
        posing: plant and goal.
        starts: each an L2.
        limits: of the gains.
    """
    found = [f for L2 in starts if (f := improved(posing, L2, limits)) is not None]
    return min(found, key=lambda f: f[1].objective) if found else None


def smallest(
    posing: Posing, unknowns: Unknowns, limits: Limits, which: Literal["gain", "argument"], level: float | None = None
) -> Limits:
    """Return limits with the smallest value of one that leaves the level nearly as it is, and a little room above it.

    Args:
        posing: plant and goal.
        unknowns: what is looked for.
        limits: the others; returned as they are where this one is given already.
        which: field of `Limits`.
        level: best value of the objective; None for that of these unknowns without this limit.
    """
    best = None if getattr(limits, which) is not None else solve(posing.problem(unknowns, limits))
    if best is None:
        return limits
    level = best.objective if level is None else level
    allowed = level + SHARE * max(abs(level), NEGLIGIBLE if posing.weight is None else 0.0)
    if which == "gain":
        allowed = max((1 + L2_SHARE) * level, L2_NEGLIGIBLE)

    def fits(limit: float) -> bool:
        found = solve(posing.problem(unknowns, replace(limits, **{which: limit})), solvers=("CLARABEL",))
        return found is not None and found.objective <= allowed

    first, second = unknowns.gains(best.values)
    high = float(np.clip(largest_norm(posing.system, first if which == "gain" else second), *SEARCHED))
    while not fits(high):
        high *= 10
        if high > LARGEST:
            return limits
    while high > SEARCHED[0] and fits(high / 10):
        high /= 10
    low = high / 10
    for _ in range(HALVINGS):
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if fits(middle) else (middle, high)
    return replace(limits, **{which: ROOM * high})


def largest_norm(system: System, gain: Polynomial) -> float:
    """Return a bound on the norm of a gain over the scheduling box.

    Args:
        system: plant.
        gain: polynomial of the scheduling with numbers as coefficients.
    """
    return max(float(np.linalg.norm(c, 2)) for c in gain.bernstein(system.scheduling_box).values())


def zero_gain(system: System) -> Polynomial:
    """Return L2 = 0.

    Args:
        system: plant.
    """
    return Polynomial.constant(np.zeros((system.nx, system.ny)))
