"""Claims about the enclosure that an interval observer draws: order, width, containment, in exact rationals."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from flint import fmpq

from luenberger.algebra import Polynomial, symmetric
from luenberger.algebra.definiteness import exact, positive_definite
from luenberger.algebra.polynomial import as_fmpq, fraction
from luenberger.certify.claim import Claim
from luenberger.certify.continuum import Verdict, negative_definite
from luenberger.certify.inequality import exact_lift
from luenberger.core import BadInput, NotAccepted, Outcome
from luenberger.core.checks import known_keys
from luenberger.systems import System
from luenberger.systems.enclosure_system import EnclosureSystem, off_diagonal
from luenberger.systems.error_system import beside
from luenberger.systems.width_rows import WidthRows
from luenberger.systems.worst_vertex import entry, vertices

_PROVED = Verdict(Outcome.PROVED, np.inf, {}, 0)
_REFUTED = Verdict(Outcome.REFUTED, 0.0, {}, 0)
_ENTRY = "entry"
Condition = tuple[str, Verdict]


def enclosure_verdict(system: System, gain: Polynomial, claim: Claim) -> tuple[str, Verdict]:
    """Decide a claim about the enclosure from plant, gain and witnesses.

    * cooperative: every entry of T (A - L C) T^-1 off the diagonal is >= 0, true scheduling and its errors ranging.
    * width_decay: he(P Mbar) + 2 level P < 0 with diagonal P > 0 for every largest matrix Mbar, and cooperative.
    * width_gain, inputs "residual": he(P M) + W'W + P P / level^2 < 0 for every true q: the L2 gain from what the
      maximisation adds to the drift. Inputs "mismatch": the same for Mbar with direction R diag(state_bound), the L2
      gain from |x| / state_bound, and cooperative. "+noise" adds 2 |T B N + L_z (G - D N)| noise_bound as directions.
    * width: vector > 0, Mbar vector + R |x| + U |u| + 2 slack <= 0 with `state_bound` for (x) or (x; u), and cooperative.
    * containment: cooperative, everything multi-affine in what is not measured, and every declared noise bounded.

    Args:
        system: plant.
        gain: L(r).
        claim: one of `ENCLOSURE_KINDS`.

    Returns:
        the condition that failed (empty where none did), and the verdict.

    Raises:
        NotAccepted: the claim has no meaning for this plant (discrete, nonlinear, unbounded noise).
        BadInput: witnesses of the wrong shape or unknown channels.
    """
    margin, pieces = np.inf, 0
    about_order = claim.kind in ("cooperative", "containment")
    for name, verdict in _conditions(system, gain, claim):
        if verdict.outcome is not Outcome.PROVED:
            return name, verdict
        # The margin is that of the claim itself, not of the order it rests on.
        if about_order or not name.startswith(_ENTRY):
            margin, pieces = min(margin, verdict.margin), pieces + verdict.pieces
    return "", Verdict(Outcome.PROVED, float(margin) if np.isfinite(margin) else 0.0, {}, pieces)


def _conditions(system: System, gain: Polynomial, claim: Claim) -> Iterator[Condition]:
    """Name and verdict of everything that has to hold, the cheap ones first."""
    if claim.kind == "width_gain" and claim.inputs.startswith("residual"):
        yield from _residual_gain(system, gain, claim)
        return
    yield from _order(system, gain, claim.transform)
    if claim.kind == "cooperative":
        return
    posed = _Posed.of(system, gain, claim.transform)
    if claim.kind == "containment":
        posed.require_bounded()
        posed.require_vertices()
    elif claim.kind == "width":
        yield from _width(posed, claim)
    else:
        yield from _mismatch(posed, claim)


def _order(system: System, gain: Polynomial, transform: np.ndarray | None) -> Iterator[Condition]:
    here = EnclosureSystem.of(system, transform, exact_lift, view="true")
    M = here.loop(here.correction(gain))
    names = _coordinates(system, transform)
    for i, j in off_diagonal(system.nx):
        yield f"{_ENTRY} ({names[i]}, {names[j]})", _nonpositive(-entry(M, i, j), here.box)


@dataclass(frozen=True)
class _Posed:
    """A plant over its measured scheduling with the gain in coordinates, and the vertex maxima of its rows."""

    here: EnclosureSystem
    correction: Polynomial

    @staticmethod
    def of(system: System, gain: Polynomial, transform: np.ndarray | None) -> "_Posed":
        here = EnclosureSystem.of(system, transform, exact_lift)
        return _Posed(here, here.correction(gain))

    def require_bounded(self) -> None:
        """Refuse a disturbance or a noise that someone described and nobody bounds."""
        system = self.here.system
        if system.nd and system.disturbance_bound is None:
            raise NotAccepted(
                f"`{system.name}` has {system.nd} unknown inputs without `disturbance_bound`; an enclosure needs one."
            )
        # A plant that says nothing of noise is taken without noise; one that shapes it has to bound it.
        shaped = _nonzero(self.here.N) or not _is_identity(self.here.G)
        if shaped and system.noise_bound is None:
            raise NotAccepted(f"`{system.name}` has {system.nv} noises without `noise_bound`; an enclosure needs one.")

    def require_vertices(self) -> None:
        """Refuse powers of what is not measured: the largest drift is sought at vertices."""
        here, Y = self.here, self.correction
        for value in (here.drift(Y), here.steer(Y), here.noise(Y), here.E):
            vertices(value, here.hidden, here.box)


def _width(posed: _Posed, claim: Claim) -> Iterator[Condition]:
    here, system = posed.here, posed.here.system
    posed.require_bounded()
    v = exact(_vector("vector", claim.vector, (system.nx,)))
    fits = all(x > 0 for x in v) and exact(np.array([claim.level]))[0] >= max(v)
    yield "vector", _PROVED if fits else _REFUTED
    rows = here.rows(posed.correction)
    x, u = _bounds(system, claim, rows)
    names = _coordinates(system, claim.transform)
    for i in range(system.nx):
        for total in rows.totals(i, list(v), x, u):
            yield f"row {names[i]}", _nonpositive(total, here.box)


def _mismatch(posed: _Posed, claim: Claim) -> Iterator[Condition]:
    """The dissipation inequality on the largest matrices; diagonal storage, since only nonnegative widths are meant."""
    here, system = posed.here, posed.here.system
    yield from _storage(claim, diagonal=True)
    largest_loops = here.upper(here.loop(posed.correction))
    if claim.kind == "width_decay":
        for loop in largest_loops:
            yield claim.kind, negative_definite(_dissipation(claim, loop, None), here.box)
        return
    known_keys("`inputs` of a width gain", [claim.inputs], ["mismatch", "mismatch+noise", "residual", "residual+noise"])
    ones = np.ones(system.nx)
    scale = ones if claim.state_bound is None else _vector("state_bound", claim.state_bound, (system.nx,))
    ranges = [R @ exact(np.diag(scale)) for R in here.spread(here.drift(posed.correction))]
    for loop, R, S in product(largest_loops, ranges, _noise_columns(posed, claim)):
        yield claim.kind, negative_definite(_dissipation(claim, loop, _joined(R, S)), here.box)


def _residual_gain(system: System, gain: Polynomial, claim: Claim) -> Iterator[Condition]:
    yield from _storage(claim, diagonal=False)
    noisy = claim.inputs != "residual"
    here = EnclosureSystem.of(system, claim.transform, exact_lift, view="measured" if noisy else "true")
    posed = _Posed(here, here.correction(gain))
    known_keys("`inputs` of a width gain", [claim.inputs], ["mismatch", "mismatch+noise", "residual", "residual+noise"])
    one = Polynomial.constant(exact(np.eye(system.nx)))
    for S in _noise_columns(posed, claim):
        matrix = _dissipation(claim, here.loop(posed.correction), _joined(one, S))
        yield claim.kind, negative_definite(matrix, here.box)


def _storage(claim: Claim, diagonal: bool) -> Iterator[Condition]:
    if not isinstance(claim.storage, np.ndarray):
        raise BadInput(f"The claim `{claim.kind}` needs a constant storage matrix.")
    P = claim.storage
    if diagonal:
        yield "diagonal storage", _PROVED if np.array_equal(P, np.diag(np.diag(P))) else _REFUTED
    yield "storage", _PROVED if positive_definite(exact(P)) is Outcome.PROVED else _REFUTED


def _dissipation(claim: Claim, M: Polynomial, inputs: Polynomial | None) -> Polynomial:
    """he(P M) + 2 rate P, or [he(P M) + W'W, P B; B'P, -level^2 I]."""
    P = Polynomial.constant(exact(np.asarray(claim.storage)))
    level = exact(np.array([claim.level]))[0]
    PM = P @ M
    if inputs is None:
        return PM + PM.T + P * (level * 2)
    W = exact(np.asarray(claim.weight))
    size = Polynomial.constant(exact(np.eye(inputs.shape[1]))) * (level * level)
    return symmetric([[PM + PM.T + Polynomial.constant(W.T @ W), P @ inputs], [-size]])


def _noise_columns(posed: _Posed, claim: Claim) -> Sequence[Polynomial | None]:
    if not claim.inputs.endswith("+noise"):
        return [None]
    here = posed.here
    if here.system.noise_bound is None:
        raise NotAccepted(f"`{here.system.name}` has no `noise_bound`; a width gain from noise needs one.")
    doubled = here.noise(posed.correction) @ exact(2 * np.diag(here.system.noise_bound))
    return list(here.size(doubled))


def _joined(direction: Polynomial, noise: Polynomial | None) -> Polynomial:
    return direction if noise is None else beside(direction, noise, exact_lift)


def _nonpositive(scalar: Polynomial, box: Mapping[str, tuple[float, float]]) -> Verdict:
    """Decide scalar <= 0 on the box; zero is allowed, so that entries which vanish are no obstacle."""
    top = max(fraction(c[0, 0]) for c in scalar.bernstein(box).values())
    if top <= 0:
        return Verdict(Outcome.PROVED, float(-top), {}, 1)
    verdict = negative_definite(scalar, box)
    if verdict.outcome is not Outcome.REFUTED:
        return verdict
    point = {n: as_fmpq(fraction(verdict.point.get(n, 0.0))) for n in scalar.names}
    if scalar(point)[0, 0] > 0:
        return verdict
    return Verdict(Outcome.UNDECIDED, 0.0, verdict.point, verdict.pieces)


def _bounds(system: System, claim: Claim, rows: WidthRows) -> tuple[list[fmpq], list[fmpq]]:
    """Bounds of |x| and |u|; what has no range needs none."""
    nx, nu = system.nx, system.nu
    uncertain_x, uncertain_u = (
        any(_nonzero(p) for row in cells for c in row for p in c) for cells in (rows.states, rows.inputs)
    )
    bound = claim.state_bound
    given = np.zeros(0) if bound is None else np.abs(_vector("state_bound", bound, (nx, nx + nu)))
    if uncertain_x and not given.size:
        raise NotAccepted(
            f"The drift of `{system.name}` is uncertain; a width claim needs `state_bound`, {nx} numbers."
        )
    if uncertain_u and given.size < nx + nu:
        raise NotAccepted(
            f"The input matrix of `{system.name}` is uncertain; `state_bound` needs {nx + nu} numbers, states then inputs."
        )
    padded = exact(np.concatenate([given, np.zeros(nx + nu - given.size)]))
    return list(padded[:nx]), list(padded[nx:])


def _vector(name: str, given: Any, lengths: tuple[int, ...]) -> np.ndarray:
    value = np.ravel(np.asarray(given, dtype=float))
    if value.size not in lengths or not np.isfinite(value).all():
        raise BadInput(f"`{name}` is {value.tolist()}; {' or '.join(map(str, lengths))} finite numbers are needed.")
    return value


def _nonzero(value: Polynomial) -> bool:
    return any(x != 0 for _, c in value for x in np.ravel(c))


def _is_identity(value: Polynomial) -> bool:
    return not _nonzero(value - exact(np.eye(*value.shape)))


def _coordinates(system: System, transform: np.ndarray | None) -> Sequence[str]:
    """Names of the rows of z = T x: those of the states where T only turns signs."""
    if transform is None or np.array_equal(np.abs(transform), np.eye(system.nx)):
        return system.states
    return [f"z{k + 1}" for k in range(system.nx)]
