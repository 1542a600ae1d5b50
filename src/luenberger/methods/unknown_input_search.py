"""How the gain of an unknown-input observer is found: the least supply for a fade, the tamest gain beside it, and the best fade."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import cvxpy as cp
import numpy as np

from luenberger.algebra import Polynomial
from luenberger.core import Infeasible
from luenberger.lmi import Solution, charged_block, solve
from luenberger.methods.unknown_input_inequality import Form, PosedGain, posed_gain
from luenberger.methods.unknown_input_plant import OpenMode

# Share of the least supply given away, so that the error of the other modes and directions can be made small as well.
BACK_OFF = 1e-3
# How much free directions of H count beside S N: enough to settle them, too little to be traded against the error.
_FREE_WEIGHT = 1e-3
# Shares of the largest fade that are tried before the best one is approached.
_SHARES = (0.02, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.96)
_GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0
# Width of the last interval of fades, relative to the largest; the bound is flat around its least value.
_WIDTH = 2e-3
_HALVINGS = 12


@dataclass(frozen=True, eq=False)
class FoundGain:
    """Gains of all modes, full digits, with the least supply that was met before any was given away.

    Args:
        K: gains.
        H: decoupling matrices.
        supply: the least supply / alpha, in the units of the inputs.
        solution: that of the last solve, for its statistics.
    """

    K: tuple[Polynomial, ...]
    H: tuple[np.ndarray, ...]
    supply: float
    solution: Solution


def ultimate_bound(supply: float, fade: float, growth: float = 1.0, dwell: int = 1, alpha: float = 1.0) -> float:
    """Return c with limsup |e| <= c sup |w|: sqrt(supply / (alpha fade)), a sum of powers of (1 - fade), and what switches add.

    Just after a switch V has grown by `growth` at most and then falls for `dwell` samples, which multiplies its limit by
    growth (1 - s) / (1 - growth s), s = (1 - fade)^dwell.

    Args:
        supply: V+ <= (1 - fade) V + supply |w|^2.
        fade: share by which V falls in a step.
        growth: largest V_j / V_i at a switch.
        dwell: least number of samples between two switches.
        alpha: lower bound of V / |e|^2.
    """
    s = (1.0 - fade) ** dwell
    if growth * s >= 1.0 and growth > 1.0:
        return math.inf
    return math.sqrt(supply / (alpha * fade) * growth * (1.0 - s) / (1.0 - growth * s))


def found_gain(modes: Sequence[OpenMode], form: Form, fade: float) -> FoundGain | None:
    """Return the gains of least supply; among those within `BACK_OFF` of it, the ones with the smallest S N. None where none is.

    The supply is set by the worst mode in its worst direction; nothing else would be told apart by it.

    Args:
        modes: modes before their gains are chosen.
        form: which inequality.
        fade: share by which V falls in a step.
    """
    posed = posed_gain(modes, form, fade)
    best = solve(posed.problem)
    if best is None:
        return None
    kept = posed.recovered(modes)
    supply = posed.problem.objective
    tame = solve(
        replace(posed.problem, objective=_size(posed, modes)), extra=[supply <= best.objective * (1 + BACK_OFF)]
    )
    K, H = kept if tame is None else posed.recovered(modes)
    spent = best if tame is None else _spent(best, tame)
    return FoundGain(K, H, float(best.objective) * form.unit**2, spent)


def least_supply(modes: Sequence[OpenMode], form: Form, fade: float) -> float:
    """Return the least supply / alpha for a fade, infinite where there is none.

    Args:
        modes: modes before their gains are chosen.
        form: which inequality.
        fade: share by which V falls in a step.
    """
    best = solve(posed_gain(modes, form, fade).problem, solvers=("CLARABEL",))
    return math.inf if best is None or not best.objective > 0 else float(best.objective) * form.unit**2


def best_fade(cost: Callable[[float], float], largest: float) -> float:
    """Return the fade with the least cost, by a few samples and golden section around the best of them.

    Args:
        cost: fade -> ultimate bound, infinite where nothing was found.
        largest: no fade from here on is feasible.

    Raises:
        Infeasible: the cost is infinite at every sample.
    """
    fades = [share * largest for share in _SHARES]
    costs = [cost(fade) for fade in fades]
    k = int(np.argmin(costs))
    if math.isinf(costs[k]):
        raise Infeasible(
            f"No observer of this form was found for any `fade` between {fades[0]:.3g} and {fades[-1]:.3g}. Try "
            'storage="mode" or "dwell", take a longer dwell time, or add a sensor.'
        )
    low, high = fades[k - 1] if k else 0.0, fades[k + 1] if k + 1 < len(fades) else largest
    inner = [high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)]
    value = [cost(fade) for fade in inner]
    while high - low > _WIDTH * largest:
        if value[0] <= value[1]:
            high, inner, value = inner[1], [0.0, inner[0]], [0.0, value[0]]
            inner[0] = high - _GOLDEN * (high - low)
            value[0] = cost(inner[0])
        else:
            low, inner, value = inner[0], [inner[1], 0.0], [value[1], 0.0]
            inner[1] = low + _GOLDEN * (high - low)
            value[1] = cost(inner[1])
    found = min([*zip(value, inner, strict=True), (costs[k], fades[k])])[1]
    return float(f"{found:.6g}")


def no_gain(modes: Sequence[OpenMode], form: Form, fade: float, largest: float) -> Infeasible:
    """Return the refusal of a fade that the zeros allow and the inequality does not, with the largest that was found.

    Args:
        modes: modes before their gains are chosen.
        form: which inequality.
        fade: the fade that was asked for.
        largest: the limit that the zeros set.
    """
    low, high = 0.0, min(fade, largest)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if math.isfinite(least_supply(modes, form, middle)) else (low, middle)
    block = charged_block(posed_gain(modes, form, fade).problem)
    blame = f" The inequality `{block}` stands in the way." if block else ""
    wider = {
        "common": '"mode", "last" or "dwell"',
        "mode": '"last" or "dwell"',
        "last": '"dwell", which needs a dwell time,',
    }.get(form.storage)
    advice = "a larger `growth`" if wider is None else f"storage={wider}"
    if low <= high / 2**_HALVINGS:
        return Infeasible(
            f"No observer of this form was found for fade = {fade:.6g}, nor for a smaller one.{blame} Take {advice}, or add a sensor.",
            block,
        )
    return Infeasible(
        f"No observer of this form was found for fade = {fade:.6g}; the largest found was {low:.6g}.{blame} Ask for that `fade` or "
        f"less, or take {advice}.",
        block,
        low,
    )


def _size(posed: PosedGain, modes: Sequence[OpenMode]) -> cp.Expression:
    """Norms of all S N over the boxes, and a little of the free part of H."""
    norms = [
        cp.norm(c, "fro") / len(hull)
        for mode, loop in zip(modes, posed.loops, strict=True)
        for hull in [loop.bernstein(mode.box)]
        for c in hull.values()
    ]
    norms += [_FREE_WEIGHT * cp.norm(X, "fro") for X in posed.free if X is not None]
    return sum(norms[1:], start=norms[0])


def _spent(first: Solution, last: Solution) -> Solution:
    """The last solution with the time of both and the optimum of the first."""
    return replace(
        last,
        optimum=first.objective,
        solver_seconds=first.solver_seconds + last.solver_seconds,
        seconds=first.seconds + last.seconds,
    )
