"""Containment by induction: if the error is in its set at a sample, it is in the next set at the next sample.

The set of `UnknownInputObserver` at sample k+1 is the image of that at sample k under N_i, widened by what the factors can do to any
state in the set and in the a-priori box, by the noise, and by the input error. The state of the next sample is in it because

    e+ = N_i e + P_i E d + P_i directions s + noise,      |s_k| <= 1,      P_i E = 0,

holds exactly for the plant; what has to be checked of the numbers is that P_i E is zero and that nominal plant and factors give the plant
on its whole box. Both hold up to `level`, which rounding leaves.
"""

from collections.abc import Sequence

import numpy as np
from flint import fmpq

from luenberger.algebra import Polynomial
from luenberger.algebra.definiteness import exact
from luenberger.certify.continuum import Verdict
from luenberger.certify.switched_claim import SwitchedClaim
from luenberger.core import Outcome
from luenberger.systems import Switched, System
from luenberger.systems.decoupled_error import DecoupledError
from luenberger.systems.uncertainty import uncovered

# What P E and what is left out of the plant may be and still pass for rounding, as a share of the largest entry of E, and of [A, B, E].
ROUNDING = 1e-9


def containment_verdict(
    system: Switched, errors: Sequence[DecoupledError], claim: SwitchedClaim
) -> tuple[str, Verdict]:
    """Decide a containment claim.

    Args:
        system: plant with its modes.
        errors: exact error of every mode.
        claim: of kind "containment".

    Returns:
        what failed, and the verdict.
    """
    if system.first.noise_bound is None and system.first.nv and _noisy(errors):
        return "bounds", Verdict(Outcome.REFUTED, 0.0, {}, 0)
    level = exact(claim.level)[()]
    for i, (mode, error) in enumerate(zip(system.modes, errors, strict=True)):
        missing = _largest_of(error.projection, error) @ uncovered(mode, error.uncertain)
        found = {"P E": leak(error), "left out": max(np.ravel(missing), default=fmpq(0))}
        allowed = {"P E": level if mode.disturbance_bound is not None else min(level, _rounding(mode, "E"))}
        allowed["left out"] = min(level, _rounding(mode, "ABE"))
        for what, worst in found.items():
            if worst > allowed[what]:
                return claim.kind, Verdict(Outcome.REFUTED, 0.0, {"mode": float(i), what: _near(worst)}, 1)
    if claim.vector is None:
        return "", Verdict(Outcome.PROVED, 0.0, {}, len(errors))
    return _invariant(system, errors, claim)


def _invariant(system: Switched, errors: Sequence[DecoupledError], claim: SwitchedClaim) -> tuple[str, Verdict]:
    """|N| w + |P directions| m + noise <= w in every mode, m the largest of the rows over the stated signals."""
    w = exact(np.asarray(claim.vector, dtype=float).reshape(-1))
    plant = system.first
    if w.shape != (plant.nx,) or min(w) < 0:
        return "vector", Verdict(Outcome.REFUTED, 0.0, {}, 0)
    noise = exact(np.asarray(plant.noise_bound or [0.0] * plant.nv, dtype=float))
    unknown = exact(np.asarray(plant.disturbance_bound or [0.0] * plant.nd, dtype=float))
    margin = None
    for i, error in enumerate(errors):
        total = _largest_of(error.A, error) @ w + (_largest(error, "noise") + _largest(error, "next noise")) @ noise
        total = total + _largest(error, "disturbance") @ unknown
        if error.uncertain.nk:
            signals = _signals(system, claim)
            if signals is None:
                return "bounds", Verdict(Outcome.UNDECIDED, 0.0, {"mode": float(i)}, 0)
            rows = _largest_of(error.uncertain.rows.map(exact), error)
            total = total + _largest(error, "uncertainty") @ (rows @ signals)
        room = min(w - total)
        if room < 0:
            return "vector", Verdict(Outcome.REFUTED, 0.0, {"mode": float(i), "room": _near(room)}, 1)
        margin = room if margin is None else min(margin, room)
    return "", Verdict(Outcome.PROVED, 0.0 if margin is None else _near(margin), {}, len(errors))


def _signals(system: Switched, claim: SwitchedClaim) -> np.ndarray | None:
    """Bounds of [x; u; d], None where one is missing."""
    plant = system.first
    if claim.state_bound is None:
        return None
    given = exact(np.asarray(claim.state_bound, dtype=float).reshape(-1))
    if given.shape != (plant.nx + plant.nu,) or (plant.nd and plant.disturbance_bound is None and _deviates(system)):
        return None
    return np.concatenate([given, exact(np.asarray(plant.disturbance_bound or [0.0] * plant.nd, dtype=float))])


def _deviates(system: Switched) -> bool:
    return any(mode.polynomial("E").names for mode in system.modes)


def leak(error: DecoupledError) -> fmpq:
    """Return the largest |entry of P E|, what a free unknown input is multiplied by.

    Args:
        error: exact error of a mode.
    """
    return max(np.ravel(_largest(error, "disturbance")), default=fmpq(0))


def leaks(mode: System, error: DecoupledError) -> bool:
    """Whether more of the unknown input than rounding reaches the error.

    Args:
        mode: mode of the plant.
        error: its exact error.
    """
    return leak(error) > _rounding(mode, "E")


def _rounding(mode: System, letters: str) -> fmpq:
    entries = [abs(x) for letter in letters for _, c in mode.polynomial(letter) for x in np.ravel(exact(c))]
    return exact(ROUNDING)[()] * max(entries, default=fmpq(0))


def _near(value: fmpq) -> float:
    return int(value.p) / int(value.q)


def _largest(error: DecoupledError, channel: str) -> np.ndarray:
    return _largest_of(error.inputs[channel], error)


def _largest_of(matrix: Polynomial, error: DecoupledError) -> np.ndarray:
    """Entrywise bound of |matrix| over the scheduling box, exact."""
    found = matrix.bernstein(error.box)
    return np.max([abs(np.asarray(c, dtype=object)) for c in found.values()], axis=0)


def _noisy(errors: Sequence[DecoupledError]) -> bool:
    return any(np.any(_largest(error, "next noise") != 0) or np.any(_largest(error, "noise") != 0) for error in errors)
