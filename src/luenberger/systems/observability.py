"""Which motions of a plant no output shows, and whether they die out by themselves."""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from luenberger.core import BadInput
from luenberger.systems.hidden_subspace import RELATIVE_TOLERANCE, Balanced, points
from luenberger.systems.mode import Mode, Report, named_modes, place, slowest_first
from luenberger.systems.system import System


def observability(system: System, r: Sequence[float] = (), *, linear_part: bool = False) -> Report:
    """Tell whether the outputs of a plant, frozen at one scheduling vector, show every state.

    Choose it to see what a sensor set misses. For the question a design asks, use `detectability`.

    Assumes: dx = A(r) x, y = C(r) x, uncertainties at the middle of their intervals.

    The unobservable subspace is found by a recursion on subspaces in balanced coordinates; singular values up to
    1e-9 of the norm of A count as zero. The observability matrix and the PBH matrix [A - s I; C] of every eigenvalue s
    are evaluated beside it, and the report says so where the three do not agree.

    Args:
        system: plant.
        r: scheduling, shape (nr,), in the order of `system.scheduling_names`.
        linear_part: True looks at A alone where the plant has a nonlinearity.

    Returns:
        report with the unobservable modes, slowest first.

    Raises:
        BadInput: r of the wrong length, or a nonlinear plant without `linear_part`.

    Reference: R. E. Kalman 1960, observability matrix; M. L. J. Hautus 1969, rank of [A - s I; C].

    Example:
        >>> from luenberger.systems import System
        >>> plant = System.linear([[-1, 0], [0, -2]], C=[[1, 0]])
        >>> observability(plant).modes[0].text
        '-2 1/s (x2)'
    """
    _refuse_nonlinear(system, linear_part)
    if len(r) != system.nr:
        raise BadInput(
            f"`r` has {len(r)} entries but `{system.name}` is scheduled by {list(system.scheduling_names)}; "
            "give one value for each, or look at `system.freeze(...)`."
        )
    where = dict(zip(system.scheduling_names, map(float, r), strict=True))
    A, C = (np.asarray(system.at(letter, r), dtype=float) for letter in "AC")
    pair = Balanced.of(A, C, np.zeros((system.nx, 0)))
    modes = slowest_first(named_modes(system, where, *pair.hidden_modes(), pair.roundoff))
    rank = system.nx - pair.hidden_subspace().shape[1]
    values = np.linalg.svd(observability_matrix(pair.A / pair.size, pair.C), compute_uv=False)
    sentences = [_rank_sentence(system, where, rank, values), *_pbh_sentences(system, pair, rank)]
    sentences += [f"No output shows the mode {mode.text}." for mode in modes]
    return Report("observability", rank == system.nx, modes, tuple(sentences), rank, values)


def detectability(system: System, decay_rate: float = 0.0, *, linear_part: bool = False) -> Report:
    """Tell whether everything the outputs miss dies out faster than a wanted rate, all over the scheduling box.

    The necessary condition for any observer gain with that decay. It is looked at where the plant is frozen at the
    vertices and the middle of the box (Jacobian box included; a Lipschitz bound allows f = 0, so A alone counts there);
    that finds obstacles, it does not prove that a gain exists.

    Assumes: constant parameters; an unobservable mode passes where Re s < -decay_rate, or for a discrete plant
    |z| < exp(-decay_rate dt).

    Args:
        system: plant.
        decay_rate: wanted decay of the error [1/s], >= 0, also for a discrete plant.
        linear_part: True looks at A alone where the plant has a nonlinearity.

    Returns:
        report with every unobservable mode found at every point, slowest first.

    Raises:
        BadInput: decay rate negative or not finite.
    """
    rate = checked_decay(decay_rate)
    modes: list[Mode] = []
    rank, values, count = system.nx, np.ones(system.nx), 0
    for where, A, C, _ in points(system, linear_part):
        pair = Balanced.of(A, C, np.zeros((system.nx, 0)))
        found = pair.hidden_modes()
        modes += named_modes(system, where, *found, pair.roundoff)
        count += 1
        if count == 1 or len(found[0]) > system.nx - rank:
            rank = system.nx - len(found[0])
            values = np.linalg.svd(observability_matrix(pair.A / pair.size, pair.C), compute_uv=False)
    ordered = slowest_first(modes)
    slow = [mode for mode in ordered if not mode.fades(rate)]
    sentences = (_detectable_sentence(system, ordered, slow, rate, count), *(_slow_sentence(m, rate) for m in slow[:3]))
    return Report("detectability", not slow, ordered, sentences, rank, values)


def require_detectable(system: System, decay_rate: float = 0.0) -> None:
    """Refuse a decay that no gain can meet, before any solver runs.

    Args:
        system: plant; its nonlinearity counts through its bounds, see `detectability`.
        decay_rate: wanted decay of the error [1/s], >= 0.

    Raises:
        BadInput: an unobservable mode is too slow; the message names it and the largest decay it allows. Also for a
            decay rate that is negative or not finite.
    """
    report = detectability(system, decay_rate)
    if not report:
        raise BadInput(_slow_sentence(report.modes[0], float(decay_rate)))


def observability_matrix(A: np.ndarray, C: np.ndarray) -> np.ndarray:
    """Return [C; C A; ...; C A^(nx-1)], shape (ny nx, nx).

    Args:
        A: state matrix, (nx, nx).
        C: output matrix, (ny, nx).
    """
    rows = [C]
    for _ in range(A.shape[0] - 1):
        rows.append(rows[-1] @ A)
    return np.vstack(rows)


def checked_decay(decay_rate: float) -> float:
    """Return the decay rate as a float.

    Args:
        decay_rate: wanted rate [1/s].

    Raises:
        BadInput: negative, NaN or infinite.
    """
    if not (math.isfinite(decay_rate) and decay_rate >= 0):
        raise BadInput(
            f"`decay_rate` is {decay_rate} 1/s, an indefinite request; give a finite rate >= 0, "
            "0.0 for convergence alone."
        )
    return float(decay_rate)


def _refuse_nonlinear(system: System, linear_part: bool) -> None:
    if system.nonlinearity is not None and not linear_part:
        raise BadInput(
            f"`{system.name}` has a nonlinearity and its observability depends on the state; pass `linear_part=True` "
            "to look at A alone, or ask `detectability`, which uses the bounds of the nonlinearity."
        )


def _rank_sentence(system: System, where: Mapping[str, float], rank: int, values: np.ndarray) -> str:
    verb = "is" if rank == system.nx else "is not"
    counted = int(np.sum(values > RELATIVE_TOLERANCE * values[0]))
    text = (
        f"`{system.name}` {verb} observable{place(where)}: {rank} of {system.nx} states are shown; singular values of "
        f"the observability matrix from {values[0]:.3g} to {values[-1]:.3g}, relative tolerance {RELATIVE_TOLERANCE:g}."
    )
    if counted != rank:
        text += (
            f" Those values alone would count {counted}; powers of A lose digits, so the subspace recursion decides."
        )
    return text


def _pbh_sentences(system: System, pair: Balanced, rank: int) -> list[str]:
    eigenvalues = np.linalg.eigvals(pair.A)
    small = np.array([_pbh(pair, s) for s in eigenvalues])
    weakest = int(np.argmin(small))
    s = complex(eigenvalues[weakest])
    named = Mode(complex(s.real, abs(s.imag)), np.zeros(system.nx), "", {}, system.dt).value
    missed = bool((small <= RELATIVE_TOLERANCE).any())
    text = f"The PBH test is weakest at the eigenvalue {named}: relative singular value {small[weakest]:.3g}."
    if missed == (rank < system.nx):
        return [text]
    return [text + " It disagrees with the rank above; the plant is within roundoff of losing a mode there."]


def _pbh(pair: Balanced, s: complex) -> float:
    pencil = np.vstack([(pair.A - s * np.eye(len(pair.scale))) / pair.size, pair.C])
    return float(np.linalg.svd(pencil, compute_uv=False)[-1])


def _detectable_sentence(system: System, modes: Sequence[Mode], slow: Sequence[Mode], rate: float, count: int) -> str:
    at = "" if count == 1 else f" at all {count} vertices and middle points of its box"
    faster = f" faster than {rate:g} 1/s" if rate else ""
    if not modes:
        return f"`{system.name}` has no unobservable mode{at}; detectability sets no limit to the decay."
    if not slow:
        return f"Every unobservable mode of `{system.name}` dies out{faster}{at}; the slowest is {modes[0].text}."
    decay = f" with decay {rate:g} 1/s" if rate else ""
    return f"`{system.name}` is not detectable{decay}: {len(slow)} unobservable mode{'s are' if len(slow) > 1 else ' is'} too slow."


def _slow_sentence(mode: Mode, rate: float) -> str:
    start = f"The pair (A, C) has an unobservable mode at {mode.text}"
    if not mode.fades(0.0):
        return f"{start}, which does not die out; no gain lets the error converge. Add a sensor that shows it."
    law = "" if mode.dt is None else f", a decay of {mode.decay:.3g} 1/s"
    return (
        f"{start}{law}; decay_rate = {rate} 1/s cannot be met by any gain; "
        f"ask for less than {mode.decay:.3g} 1/s or add a sensor."
    )
