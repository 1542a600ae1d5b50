"""The set of errors from which a bound on f that holds on a domain may be used, proved in exact rationals.

The Jacobian bound of f holds on a box of states. Let the plant keep the distance m_k from both faces of state k. With
e = x - xhat the observer takes f at x - e, or, with two degrees of freedom, at x - (I - L2 C) e, as long as no noise
enters. That argument lies in the box where |((I - L2 C) e)_k| < m_k. If every e with e' P e <= c meets this, then, the box
being convex, the mean value theorem puts the Jacobian between state and argument inside its bounds, V = e' P e falls, the
error stays in the set, and the argument is in the box at the next instant too: what was assumed of it is now concluded.

Where L2 is not zero the estimate itself may leave the box, and so may states that f does not read: f takes no notice.
"""

from collections.abc import Iterator

import numpy as np
from flint import fmpq

from luenberger.algebra import Polynomial, symmetric
from luenberger.algebra.definiteness import exact, positive_definite
from luenberger.certify.claim import Claim
from luenberger.certify.continuum import Verdict, negative_definite
from luenberger.certify.inequality import claim_verdict, exact_lift
from luenberger.core import BadInput, NotAccepted, Outcome
from luenberger.systems import System


def domain_verdict(
    system: System, gain: Polynomial, claim: Claim, argument_gain: Polynomial | None = None
) -> tuple[str, Verdict]:
    """Decide a domain claim from plant, gains and witnesses.

    Proved where, for each state k that f reads, with h_k(r) the k-th row of I - L2(r) C(r),

        [[P, h_k'], [h_k, m_k^2 / c]] > 0  on the whole scheduling box,  i.e.  c h_k P^-1 h_k' < m_k^2,

    and V = e' P e falls, he(P (A - L C + F J H (I - L2 C))) < 0, on scheduling box and Jacobian set (a discrete plant:
    V falls from step to step; a Lipschitz bound: with the multiplier of the claim).

    Args:
        system: plant whose nonlinearity has a domain.
        gain: L(r).
        claim: of kind "domain"; `level` is c, `storage` a constant P, `state_bound` m with zeros for states f does not read.
        argument_gain: L2(r) of an observer with two degrees of freedom; None for zero.

    Returns:
        the condition that failed (empty where none did), and the verdict.

    Raises:
        NotAccepted: no nonlinearity with a domain, a storage that moves, or L2 beside an output matrix in function form.
        BadInput: `state_bound` of the wrong length.
    """
    margin, pieces = 0.0, 0
    for name, verdict in _conditions(system, gain, claim, argument_gain):
        if verdict.outcome is not Outcome.PROVED:
            return name, verdict
        # The strips are made to be touched; what has a margin is the decay, which comes last.
        margin, pieces = verdict.margin, pieces + verdict.pieces
    return "", Verdict(Outcome.PROVED, margin, {}, pieces)


def _conditions(
    system: System, gain: Polynomial, claim: Claim, argument_gain: Polynomial | None
) -> Iterator[tuple[str, Verdict]]:
    """Name and verdict of everything that has to hold, the cheap ones first."""
    f = system.nonlinearity
    if f is None or f.domain is None:
        raise NotAccepted(f"`{system.name}` has no nonlinearity with a `domain`; there is nothing to stay inside of.")
    P, m = claim.storage, claim.state_bound
    if not isinstance(P, np.ndarray):
        raise NotAccepted("A domain claim needs a constant storage matrix; its level sets must not move.")
    if m is None or m.shape != (system.nx,):
        given = None if m is None else m.shape
        raise BadInput(f"`state_bound` has shape {given}; a domain claim needs shape ({system.nx},).")
    yield "storage", _decided(positive_definite(exact(P)) is Outcome.PROVED)
    read = [int(k) for k in np.flatnonzero(np.any(np.asarray(f.H) != 0, axis=0))]
    kept, c = exact(m), exact(np.array([claim.level]))[0]
    lower, upper = exact(f.domain[0]), exact(f.domain[1])
    for k in read:
        # A distance above half the width would leave the plant no room, and the claim no content.
        yield f"room of {system.states[k]}", _decided(kept[k] > 0 and 2 * kept[k] <= upper[k] - lower[k])
    box = dict(system.scheduling_box)
    rows = _rows(system, argument_gain)
    for k in read:
        yield f"argument {system.states[k]}", _inside(P, rows, k, kept[k] * kept[k] / c, box)
    falling = Claim("decay", 0.0 if system.dt is None else 1.0, P, claim.multiplier)
    failed, verdict = claim_verdict(system, gain, falling, argument_gain=argument_gain)
    yield failed or "decay", verdict


def _decided(holds: bool) -> Verdict:
    return Verdict(Outcome.PROVED if holds else Outcome.REFUTED, 0.0, {}, 0)


def _rows(system: System, argument_gain: Polynomial | None) -> Polynomial:
    """What takes e to the distance of the argument of f from the state: I - L2 C."""
    one = Polynomial.constant(exact(np.eye(system.nx)))
    if argument_gain is None:
        return one
    if not isinstance(system.C, Polynomial):
        raise NotAccepted(
            f"`C` of `{system.name}` is a function; a domain claim with an argument gain needs a polynomial."
        )
    return one - exact_lift(argument_gain) @ exact_lift(system.C)


def _inside(P: np.ndarray, rows: Polynomial, k: int, square: fmpq, box: dict[str, tuple[float, float]]) -> Verdict:
    h = Polynomial.constant(exact(np.eye(1, P.shape[0], k))) @ rows
    size = np.array([[square]], dtype=object)
    return negative_definite(-symmetric([[exact(P), h.T], [size]]), box)
