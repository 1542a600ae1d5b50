"""Where a bound on f holds on a domain only: the errors from which a design may start, proved."""

from dataclasses import replace
from typing import Any

import numpy as np

from luenberger.certify import Certificate, Claim, Proof, certify_claims
from luenberger.certify.certificate import assumptions
from luenberger.core import BadInput, NotCertified, Outcome
from luenberger.core.checks import finite_array
from luenberger.design import Design
from luenberger.lmi.validity import Objective, validity_storage
from luenberger.systems import Nonlinearity, System

# Shares of the semi-axes given away for a margin, tried in this order.
BACK_OFFS = (0.01, 0.05, 0.2)


def domain_of_validity(design: Design, operating: tuple[Any, Any], *, objective: Objective = "volume") -> Design:
    """Return the design with one more claim: a set of initial errors that never lead the observer out of the domain of f.

    A Jacobian bound that holds on a box of states proves a decay only while plant and observer stay in that box. Trust the
    plant to stay in a smaller one, and this finds the largest ellipsoid of errors that keeps the argument of f inside too,
    so that nothing has to be assumed of the observer any more. Choose it after a design for a plant whose nonlinearity is
    bounded on a domain. Where the ellipsoid is too small, `Nonlinearity.clipped` needs none, at the price of an observer
    that runs the continued f; where the operating box lies close to the domain, enlarge the domain or trust less.

    Assumes: dx = A x + B u + F f(H x, u) with df/dz bounded on a box, no disturbance and no noise.
    Certifies: e' P e <= c  =>  the argument of f (xhat, or zeta with an argument gain) stays in the domain, e' P e falls,
        and e goes to zero.

    Args:
        design: what `synthesize` returned.
        operating: state box (lower, upper) in which the plant is trusted to stay, each (nx,), in the units of the states;
            strictly inside the domain in every state that f reads, of no effect in the others.
        objective: "volume" for the largest volume of the ellipsoid, "ball" for the largest ball inside it in units of the
            distances between the two boxes.

    Returns:
        the design with a proved claim "domain" in the place of an earlier one; `admits` asks it about an initial error.

    Raises:
        BadInput: no nonlinearity with a domain, one that is clipped and needs no such claim, no decay claim, an operating
            box of the wrong shape or not strictly inside the domain, or an unknown objective.
        NotCertified: no such set was proved.

    Reference: S. Boyd, L. El Ghaoui, E. Feron, V. Balakrishnan, Linear Matrix Inequalities in System and Control Theory
        (SIAM 1994), section 5.2; the strip of an argument gain, |((I - L2 C) e)_k| < m_k, is ours.

    Example:
        >>> from luenberger.methods import PolytopicLuenberger
        >>> from luenberger.synthesize import synthesize
        >>> f = Nonlinearity.enclosed(lambda z, u: (1 - z[0] ** 2) * z[1], np.eye(2), ([-5, -5], [5, 5]))
        >>> plant = System.nonlinear([[0, 1], [-1, 0]], None, [[1, 0]], F=[[0], [1]], nonlinearity=f, name="Van der Pol")
        >>> design = domain_of_validity(synthesize(plant, PolytopicLuenberger(decay_rate=1.0)), ([-2.1, -2.8], [2.1, 2.8]))
        >>> admits(design, [[0.0, 2.0], [0.5, 0.0]]).tolist()
        [True, False]
    """
    bound = _distances(design.system, _domain(design), operating)
    for back_off in BACK_OFFS:
        proof = _attempt(design, bound, objective, back_off)
        if proof is not None and proof.outcome is Outcome.PROVED:
            break
    else:
        why = "no decaying storage was found" if proof is None else proof.reason
        raise NotCertified(
            f"No set of errors was proved to keep `{design.system.name}` inside its domain: {why} Ask `synthesize` for a faster "
            "decay, or use a clipped nonlinearity."
        )
    kept = design.certificate
    proofs = (*(p for p in kept.proofs if p.claim.kind != "domain"), proof)
    certificate = Certificate(
        proofs, assumptions(design.system, [p.claim for p in proofs]), kept.seconds + proof.seconds
    )
    return replace(design, certificate=certificate)


def admits(design: Design, error: Any) -> np.ndarray:
    """Return whether initial errors x - xhat lie in the proved set of `domain_of_validity`.

    Args:
        design: what `domain_of_validity` returned.
        error: initial errors, shape (..., nx), in the units of the states.

    Returns:
        booleans, shape (...).

    Raises:
        BadInput: no proved claim "domain", or errors of another length.
    """
    claim = next(
        (p.claim for p in design.certificate.proofs if p.claim.kind == "domain" and p.outcome is Outcome.PROVED), None
    )
    if claim is None or not isinstance(claim.storage, np.ndarray):
        raise BadInput("The design has no proved claim `domain`; `domain_of_validity(design, operating)` adds one.")
    e, nx = finite_array("error", error), design.system.nx
    if e.ndim < 1 or e.shape[-1] != nx:
        raise BadInput(f"`error` has shape {e.shape} but the plant has {nx} states; it needs shape (..., {nx}).")
    return np.asarray(np.einsum("...i,ij,...j->...", e, claim.storage, e) <= claim.level)


def _domain(design: Design) -> Nonlinearity:
    """The nonlinearity whose domain the claim is about."""
    f, name = design.system.nonlinearity, design.system.name
    if f is None:
        raise BadInput(f"`{name}` has no nonlinearity; its claims hold for every error, and no domain limits them.")
    if f.domain is None:
        raise BadInput(f"The nonlinearity of `{name}` has no `domain`; its bound holds for all states already.")
    if f.is_clipped:
        raise BadInput(
            f"The nonlinearity of `{name}` is clipped; its bound holds for every estimate already, and only the plant has to "
            "stay in the domain."
        )
    if not any(c.kind == "decay" for c in design.certificate.claims):
        raise BadInput(
            f"The design of `{design.method}` claims no decay; a set of errors can only be kept where they fall."
        )
    return f


def _distances(system: System, f: Nonlinearity, operating: tuple[Any, Any]) -> np.ndarray:
    """How far the operating box keeps from both faces of the domain in each state f reads; zero in the others."""
    lower, upper = (
        finite_array(f"operating {which}", end) for which, end in zip(("lower", "upper"), operating, strict=True)
    )
    if lower.shape != (system.nx,) or upper.shape != (system.nx,) or (lower > upper).any():
        raise BadInput(
            f"`operating` has shapes {lower.shape} and {upper.shape}; both ends need shape ({system.nx},), lower <= upper."
        )
    assert f.domain is not None
    bound = np.zeros(system.nx)
    for k in np.flatnonzero(np.any(np.asarray(f.H) != 0, axis=0)):
        start, end = f.domain[0][k], f.domain[1][k]
        bound[k] = min(lower[k] - start, end - upper[k])
        if not bound[k] > 0:
            name = system.states[k]
            unit = system.units.get(name, "")
            raise BadInput(
                f"`operating` gives {name} the interval [{lower[k]:g}, {upper[k]:g}] {unit}".rstrip()
                + f" but f is bounded on [{start:g}, {end:g}] only; keep the plant strictly inside, or bound f on a larger domain."
            )
    # The subtraction may have rounded up; a smaller distance claims less.
    return np.nextafter(bound, 0.0)


def _attempt(design: Design, bound: np.ndarray, objective: Objective, back_off: float) -> Proof | None:
    found = validity_storage(
        design.system, design.gain, bound, argument_gain=design.argument_gain, objective=objective, back_off=back_off
    )
    if found is None:
        return None
    P, level, multiplier = found
    claim = Claim("domain", level, P, multiplier=multiplier, state_bound=bound)
    return certify_claims(design.system, design.gain, [claim], argument_gain=design.argument_gain).proofs[0]
