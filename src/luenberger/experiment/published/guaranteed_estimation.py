"""Row by row: stored half widths of set-based observers on two planar problems, beside ours of the same class.

Two classes are kept apart, since they do not know the same: predictors, whose last box has used the outputs before it, and
filters, which cut it by the current output.
"""

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from luenberger.experiment.published.guaranteed_estimation_problem import PROBLEMS, Stored, stored
from luenberger.experiment.published.row import Row, collected, judged
from luenberger.methods.zonotopic_energy import HInfinityGain, SegmentGain
from luenberger.methods.zonotopic_plant import DrivenError
from luenberger.methods.zonotopic_radius import PRadiusGain
from luenberger.methods.zonotopic_width import SteadyWidth
from luenberger.observers.zonotopic import ZonotopicFilter, ZonotopicKalmanFilter, ZonotopicLuenberger
from luenberger.observers.zonotopic_strips import ZonotopicStripFilter
from luenberger.sets import pca

SOURCE = (
    "M. Althoff, J. Rath, Comparison of guaranteed state estimators for linear time-invariant systems, Automatica 130 (2021) "
    "109662; half widths as the tests of CORA 2026.0.1 store them"
)
# Sixteen digits are stored; sums over 200 generators round differently in the last three.
EXACT = 1e-12
_RULE = "Reproduced: ours to the stored digits; bettered: ours is wider in no state."


def rows(progress: Callable[[Row], None] | None = None, folder: Path | None = None) -> list[Row]:
    """Return every stored row of both problems beside ours, predictors and filters apart; some ten seconds on one core.

    Args:
        progress: called with each row as soon as it is known.
        folder: where the problems lie; None: $LUENBERGER_DATA, else shared/data here or one level up.

    Raises:
        BadInput: the problems are not there; the message names the folder.
        LuenbergerError: no solver found a gain.
    """
    return collected(_all(folder), progress)


def _all(folder: Path | None) -> Iterator[Row]:
    for name in PROBLEMS:
        problem = stored(name, folder)
        yield _equality(problem)
        yield from _classes(problem)
        yield from _narrowest(problem)


def _equality(problem: Stored) -> Row:
    """The zonotopic Kalman filter against the box that is stored with all digits."""
    observer = ZonotopicKalmanFilter(
        problem.system, initial_half_width=[0.0] * problem.system.nx, count=problem.count, reduction=pca
    )
    found = problem.run(observer)
    ours = np.stack([np.asarray(found.lower)[-1], np.asarray(found.upper)[-1]])
    apart = float(np.abs(ours - problem.boxes["FRad-C"]).max())
    return judged(
        f"{problem.name}, box of FRad-C at the last step",
        "stored box, predictor",
        _box_text(problem.boxes["FRad-C"]),
        _box_text(ours),
        f"`ZonotopicKalmanFilter` with PCA after the step, {problem.count} generators; equal to {EXACT:g} is asked.",
        reproduced=apart <= EXACT,
        deviation=apart,
    )


def _classes(problem: Stored) -> Iterator[Row]:
    """Each stored row beside the design of ours that goes by its name."""
    gains = {
        "Nom-G": (SegmentGain(), "least sum of squares of the steady generators"),
        "Hinf-G": (HInfinityGain(), "least energy gain from disturbance and noise in units of their bounds"),
        "PRad-E": (PRadiusGain(), "least ellipsoid around the steady errors"),
    }
    for name, (method, what) in gains.items():
        gain = method.design(problem.system).gain
        ours = problem.last(_predictor(problem, np.asarray(gain({}))))
        yield _beside(
            problem, name, ours, f"`{type(method).__name__}`, {what}. The stored row does not say its inequality."
        )
    ours = problem.last(
        ZonotopicFilter(problem.system, initial_half_width=[0.0] * problem.system.nx, count=problem.count)
    )
    yield _beside(problem, "FRad-A", ours, "`ZonotopicFilter`, strips of least Frobenius norm.")
    K = PRadiusGain(uses="current").filter_gain(problem.system)
    ours = problem.last(_filter(problem, K))
    yield _beside(
        problem,
        "PRad-C",
        ours,
        "`ZonotopicStripFilter` with `PRadiusGain`. The stored row does not say its inequality.",
    )


def _narrowest(problem: Stored) -> Iterator[Row]:
    """The width-optimal gains against every stored row of their class."""
    L = SteadyWidth().best(problem.system)
    K = SteadyWidth(uses="current").best(problem.system)
    steady = ", ".join(f"{w:.4f}" for w in DrivenError.of(problem.system).box(L))
    ours = {False: problem.last(_predictor(problem, L)), True: problem.last(_filter(problem, K))}
    for row in problem.half_widths:
        current = "current" in row
        which = "filter" if current else "predictor"
        reason = f"`SteadyWidth`, one constant gain, {which}."
        if not current:
            reason += f" The exact steady box is {steady}."
        if row.startswith("CZN"):
            reason += " Constrained zonotopes keep the strips themselves, which no zonotope can."
        yield _beside(problem, row.split(" ")[0], ours[current], reason, item=f"width-optimal {which} against")


def _beside(problem: Stored, name: str, ours: np.ndarray, reason: str, item: str = "") -> Row:
    row = next(r for r in problem.half_widths if r.split(" ")[0] == name)
    texts = problem.half_widths[row]
    theirs = np.array([float(t) for t in texts])
    digit = np.array([10.0 ** -len(t.partition(".")[2]) for t in texts])
    share = ", ".join(f"{100 * (a / b - 1):+.1f}%" for a, b in zip(ours, theirs, strict=True))
    return judged(
        f"{problem.name}, {item + ' ' if item else ''}{name}, half widths at the last step",
        f"stored table, {'filter with the current output' if 'current' in row else 'predictor'}",
        ", ".join(texts),
        f"{', '.join(f'{w:.4f}' for w in ours)} ({share})",
        f"{reason} In brackets ours against stored. {_RULE}",
        reproduced=bool((np.abs(ours - theirs) <= 0.5 * digit + EXACT).all()),
        bettered=bool((ours <= theirs + 0.5 * digit + EXACT).all()),
        deviation=float(np.abs(ours - theirs).max()),
    )


def _predictor(problem: Stored, L: np.ndarray) -> ZonotopicLuenberger:
    return ZonotopicLuenberger(problem.system, L, initial_half_width=[0.0] * problem.system.nx, count=problem.count)


def _filter(problem: Stored, K: np.ndarray) -> ZonotopicStripFilter:
    return ZonotopicStripFilter(problem.system, K, initial_half_width=[0.0] * problem.system.nx, count=problem.count)


def _box_text(box: np.ndarray) -> str:
    return ", ".join(f"[{low:.4f}, {high:.4f}]" for low, high in zip(*box, strict=True))
