"""What is claimed of an unknown-input observer with rounded gains, each claim with a witness made for these very gains."""

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction

import numpy as np

from luenberger.algebra import Polynomial, block
from luenberger.certify.switched_claim import SwitchedClaim
from luenberger.core import NotCertified
from luenberger.lmi import Bernstein, rounded_storage, solve
from luenberger.methods.method import gain_bound
from luenberger.methods.unknown_input_inequality import Form, posed_supply
from luenberger.methods.unknown_input_plant import OpenMode
from luenberger.methods.unknown_input_search import ultimate_bound
from luenberger.systems import Switched, System
from luenberger.systems.uncertainty import Uncertain, uncovered

# Room of the claimed supply over the one that floating point finds for the rounded storages.
ROOM = 1e-6
# Room of what follows from it by a few floating-point operations.
_DIGITS = 1e-9
# Powers of the allowed growth that are tried for a claim with a dwell time.
_GROWTHS = (0.1, 0.2, 0.4, 0.6, 0.8, 1.0)
# Steps and size after which a box of errors is given up.
_STEPS = 20000
_HUGE = 1e12

Loop = tuple[Polynomial, Polynomial, dict[str, tuple[float, float]]]


def unknown_input_claims(
    plant: Switched,
    modes: Sequence[OpenMode],
    gains: Sequence[Polynomial],
    decoupling: Sequence[Polynomial],
    form: Form,
    fade: float,
) -> list[SwitchedClaim]:
    """Return the claims on decoupling, gains, input-to-state stability and, where noise is bounded, containment.

    Args:
        plant: accepted plant.
        modes: its modes, read.
        gains: rounded K, one a mode.
        decoupling: H, one a mode.
        form: which inequality the design used.
        fade: share by which V falls in a step.

    Raises:
        NotCertified: no storages were found for the rounded gains.
    """
    H = [np.asarray(h({}), dtype=float) for h in decoupling]
    claims = [
        SwitchedClaim("decoupling", max(_leak(mode, h) for mode, h in zip(modes, H, strict=True))),
        SwitchedClaim("gain_bound", max(gain_bound(s, K).level for s, K in zip(plant.modes, gains, strict=True))),
        _stability(plant, modes, gains, H, form, fade),
    ]
    if plant.first.noise_bound is not None or plant.first.nv == 0:
        left = max(_left_out(s, mode, h) for s, mode, h in zip(plant.modes, modes, H, strict=True))
        claims.append(SwitchedClaim("containment", max(claims[0].level, left), vector=_box(modes, gains, H)))
    return claims


def channels(modes: Sequence[OpenMode]) -> str:
    """Return the names of the inputs that reach the error one by one, joined by "+".

    Args:
        modes: modes of the plant.
    """
    factors = ["uncertainty"] if any(mode.uncertain.shape[1] for mode in modes) else []
    noises = ["noise", "next noise"] if modes[0].measured.shape[1] else []
    return "+".join([*factors, *noises])


def _stability(
    plant: Switched,
    modes: Sequence[OpenMode],
    gains: Sequence[Polynomial],
    H: Sequence[np.ndarray],
    form: Form,
    fade: float,
) -> SwitchedClaim:
    """The least ultimate bound that rounded storages show for these gains."""
    loops: list[Loop] = []
    for mode, K, h in zip(modes, gains, H, strict=True):
        entering = Polynomial.constant(np.eye(len(h))) if form.attenuate == "lumped" else mode.driven(K, h)
        loops.append((mode.error(K, h), entering * (1.0 / form.unit), mode.box))
    dwelling = form.storage == "dwell" and len(modes) > 1
    forms = [form]
    if dwelling:
        # The growth that was allowed is seldom needed, and a smaller one gives a smaller bound.
        forms = [replace(form, storage="common")]
        forms += [replace(form, growth=form.growth**share) for share in _GROWTHS]
    shown = [made for tried in forms if (made := _shown(plant, loops, tried, fade)) is not None]
    if not shown:
        raise NotCertified(
            f"With its rounded gains the observer of `{plant.name}` does not provably fade by {fade:g} a step any more; ask for a "
            "smaller `fade`, or for more digits."
        )
    best = min(shown, key=lambda claim: claim.level)
    return best if form.attenuate == "lumped" else replace(best, inputs=channels(modes))


def _shown(plant: Switched, loops: Sequence[Loop], form: Form, fade: float) -> SwitchedClaim | None:
    """The storages of least supply, rounded, and what they show; None where they show nothing."""
    for faster in (ROOM, 100 * ROOM, 1e4 * ROOM):
        # Storages for a slightly larger fade: at the optimum for the fade itself V may fall by no more than it must in a direction
        # that no input reaches, and rounding would decide.
        problem, Q = posed_supply(loops, form, min(fade + faster * (1 - fade), 0.5 * (1 + fade)))
        found = solve(problem)
        if found is None:
            return None
        storages = tuple(rounded_storage(np.asarray(q.value)) for q in Q)
        steps, n = form.transitions(len(loops)), len(Q)
        supply = max(shown_supply(loops[k], storages[i % n], storages[j % n], fade) for i, k, j in steps)
        alpha = min(float(np.linalg.eigvalsh(q)[0]) for q in storages) * (1 - _DIGITS)
        if alpha > 0 and supply <= found.objective * (1 + ROOM):
            break
    else:
        return None
    supply *= form.unit**2 * (1 + ROOM)
    growth = 1.0
    if form.storage == "dwell":
        growth = max(_ratio(b, a) for a in storages for b in storages) * (1 + _DIGITS)
    level = ultimate_bound(supply, fade, growth, plant.dwell, alpha) * (1 + _DIGITS)
    if not np.isfinite(level):
        return None
    order = "last" if form.storage == "last" else "next"
    return SwitchedClaim("iss", level, storages, fade=fade, supply=supply, growth=growth, order=order)


def shown_supply(loop: Loop, before: np.ndarray, after: np.ndarray, fade: float) -> float:
    """Return the least supply that two storages show for one transition, infinite where they show none.

    (1 - fade) V_before - V_after(N e + B w) + supply |w|^2 >= 0, at every Bernstein coefficient of [N, B].

    Args:
        loop: N, B and the box of the mode that acts.
        before: storage of this mode, (nx, nx).
        after: storage of the mode that follows, (nx, nx).
        fade: share by which V falls in a step.
    """
    N, B, box = loop
    nx, worst = len(before), 0.0
    for both in Bernstein().matrices(block([[N, B]]), box):
        n, b = np.asarray(both)[:, :nx], np.asarray(both)[:, nx:]
        left = (1 - fade) * before - n.T @ after @ n
        if not np.linalg.eigvalsh(left)[0] > 0:
            return np.inf
        cross = n.T @ after @ b
        worst = max(worst, float(np.linalg.eigvalsh(b.T @ after @ b + cross.T @ np.linalg.solve(left, cross))[-1]))
    return worst


def _leak(mode: OpenMode, H: np.ndarray) -> float:
    """A bound of |P E| with its rounding."""
    terms = np.abs(mode.E) + np.abs(H) @ np.abs(mode.C) @ np.abs(mode.E)
    rounding = 4.0 * (len(mode.E) + 2) * np.finfo(float).eps
    return float((np.abs(mode.projection(H) @ mode.E) + rounding * terms).max(initial=0.0))


def _left_out(system: System, mode: OpenMode, H: np.ndarray) -> float:
    """A bound of what rounding of the factors leaves of [A, B, E] behind P, with its own rounding."""
    rest = np.array(
        [[float(Fraction(int(x.p), int(x.q))) for x in row] for row in uncovered(system, Uncertain.of(system))]
    )
    projection = np.eye(len(H)) + np.abs(H) @ np.abs(mode.C)
    return float((projection @ rest).max(initial=0.0)) * (1 + ROOM)


def _ratio(after: np.ndarray, before: np.ndarray) -> float:
    """The largest e' after e / e' before e."""
    root = np.linalg.inv(np.linalg.cholesky(before))
    return float(np.linalg.eigvalsh(root @ after @ root.T)[-1])


def _box(modes: Sequence[OpenMode], gains: Sequence[Polynomial], H: Sequence[np.ndarray]) -> np.ndarray | None:
    """Half widths of a box that no error leaves, where only noise acts; None where factors act, or the box would not hold."""
    if any(mode.uncertain.shape[1] for mode in modes):
        return None
    loops, drives = [], []
    for mode, K, h in zip(modes, gains, H, strict=True):
        loops.append(_hull(mode.error(K, h), mode))
        drives.append(_hull(mode.driven(K, h), mode).sum(axis=1))
    drive = np.array(drives)
    room = ROOM * (drive + drive.max())
    box = np.zeros(len(drive.T))
    for _ in range(_STEPS):
        wider = np.max([loop @ box for loop in loops] + drive + room, axis=0)
        if not (np.isfinite(wider).all() and wider.max() < _HUGE):
            return None
        # Half of the room is left for the proof.
        if (wider - box <= 0.5 * room.min(axis=0)).all():
            return wider if wider.min() > 0 else None
        box = wider
    return None


def _hull(matrix: Polynomial, mode: OpenMode) -> np.ndarray:
    """Bounds of |entry| over the box, entry by entry."""
    return np.max([np.abs(np.asarray(c)) for c in matrix.bernstein(mode.box).values()], axis=0)
