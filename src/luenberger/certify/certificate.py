"""Proofs of claims from System + gain + witness alone, and the certificate that lists them."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol, runtime_checkable

import numpy as np

from luenberger.algebra import Polynomial
from luenberger.certify.claim import ENCLOSURE_KINDS, Claim
from luenberger.certify.continuum import Verdict
from luenberger.certify.enclosure import enclosure_verdict
from luenberger.certify.filter_box import filter_box_verdict
from luenberger.certify.inequality import claim_verdict
from luenberger.certify.rational_text import from_text, to_text
from luenberger.certify.steady_box import steady_box_verdict
from luenberger.certify.switched_claim import SwitchedClaim
from luenberger.certify.validity import domain_verdict
from luenberger.core import Outcome
from luenberger.systems import Parameter, System


@dataclass(frozen=True, eq=False)
class Proof:
    """A claim with what came of checking it.

    Args:
        claim: the statement and its witness, a `Claim`, or a `SwitchedClaim` of a plant with modes.
        outcome: proved, refuted or undecided.
        margin: proved definiteness margin of the inequality, 0 where none.
        point: where the claim fails (refuted) or the effort ended (undecided).
        pieces: sub-boxes examined.
        reason: one sentence.
        seconds: time the proof took [s]; not part of the text.
        discrete: the plant has a sample time, so that a decay is a factor a step; follows from the plant and is not part of the text.
    """

    claim: Any
    outcome: Outcome
    margin: float
    point: Mapping[str, float]
    pieces: int
    reason: str
    seconds: float = 0.0
    discrete: bool = False

    @property
    def sentence(self) -> str:
        """The claim in words, in the time of the plant."""
        return str(self.claim.sentence(self.discrete))


@dataclass(frozen=True, eq=False)
class Certificate:
    """Claims with their proofs, and the assumptions they rest on.

    Args:
        proofs: one for each claim.
        assumptions: sentences a user must be able to vouch for.
        seconds: time the proofs took [s].
    """

    proofs: tuple[Proof, ...]
    assumptions: tuple[str, ...]
    seconds: float = 0.0

    @property
    def outcome(self) -> Outcome:
        """All claims together; undecided where nothing is claimed."""
        total = Outcome.PROVED if self.proofs else Outcome.UNDECIDED
        for proof in self.proofs:
            total = total & proof.outcome
        return total

    @property
    def claims(self) -> tuple[Any, ...]:
        """The claims, proved or not: `Claim`, or `SwitchedClaim` of a plant with modes."""
        return tuple(p.claim for p in self.proofs)

    def level(self, kind: str) -> float | None:
        """Return the level of the first proved claim of a kind, or None."""
        return next((p.claim.level for p in self.proofs if p.claim.kind == kind and p.outcome is Outcome.PROVED), None)

    def as_text(self) -> dict[str, Any]:
        """Plain data for JSON."""
        proofs = [
            {
                "claim": p.claim.as_text(),
                "outcome": p.outcome.value,
                "margin": to_text(p.margin),
                "point": dict(p.point),
                "pieces": p.pieces,
                "reason": p.reason,
            }
            for p in self.proofs
        ]
        return {"proofs": proofs, "assumptions": list(self.assumptions)}

    @staticmethod
    def from_text(data: dict[str, Any], discrete: bool) -> "Certificate":
        """Read what `as_text` wrote; the outcomes are what the file says until `certify` checks them again.

        Args:
            data: plain data.
            discrete: the plant has a sample time.
        """
        proofs = [
            Proof(
                (SwitchedClaim if p["claim"].get("modes") else Claim).from_text(p["claim"]),
                Outcome(p["outcome"]),
                from_text(p["margin"]),
                p["point"],
                p["pieces"],
                p["reason"],
                discrete=discrete,
            )
            for p in data["proofs"]
        ]
        return Certificate(tuple(proofs), tuple(data["assumptions"]))


@runtime_checkable
class Certifiable(Protocol):
    """Anything with a plant, a gain and a certificate: a `Design`."""

    @property
    def system(self) -> System:
        """The plant."""
        ...

    @property
    def gain(self) -> Polynomial:
        """L(r)."""
        ...

    @property
    def model(self) -> System | None:
        """What the observer copies; None for the plant itself."""
        ...

    @property
    def argument_gain(self) -> Polynomial | None:
        """L2(r); None for zero."""
        ...

    @property
    def filter_gain(self) -> Polynomial | None:
        """K(r) of a filter with the current output; None for a predictor."""
        ...

    @property
    def certificate(self) -> Certificate:
        """The claims."""
        ...


def certify(design: Certifiable, progress: Callable[[str, float], None] | None = None) -> Certificate:
    """Check every claim of a design again, from its plant, gain and witnesses alone; no solver is used.

    Args:
        design: plant, gain and claims.
        progress: called with what is being proved and the share done.

    Returns:
        a fresh certificate; read `.outcome`.
    """
    claims = design.certificate.claims
    return certify_claims(
        design.system,
        design.gain,
        claims,
        design.model,
        progress,
        argument_gain=design.argument_gain,
        filter_gain=design.filter_gain,
    )


def certify_claims(
    system: System,
    gain: Polynomial,
    claims: Sequence[Claim],
    model: System | None = None,
    progress: Callable[[str, float], None] | None = None,
    *,
    argument_gain: Polynomial | None = None,
    filter_gain: Polynomial | None = None,
) -> Certificate:
    """Prove claims about the closed loop of a plant and a gain over the whole box.

    Assumes: the plant class of `System` with every parameter inside its interval, arbitrarily fast.
    Certifies: see `Claim`.

    Args:
        system: plant.
        gain: L(r), shape (nx, ny); its doubles are taken as they are.
        claims: what to prove.
        model: what the observer copies; None for the plant itself.
        progress: called with what is being proved and the share done.
        argument_gain: L2(r), shape (nx, ny), of an observer with two degrees of freedom; None for zero.
        filter_gain: K(r), shape (nx, ny), of a filter that uses the current output; None for a predictor.
    """
    start = time.perf_counter()
    proofs: list[Proof] = []
    for k, claim in enumerate(claims):
        if progress is not None:
            progress(f"proving {claim.kind}", k / len(claims))
        begin = time.perf_counter()
        proof = prove(system, gain, claim, model, argument_gain=argument_gain, filter_gain=filter_gain)
        proofs.append(replace(proof, seconds=time.perf_counter() - begin, discrete=system.dt is not None))
    return Certificate(tuple(proofs), assumptions(system, claims), time.perf_counter() - start)


def prove(
    system: System,
    gain: Polynomial,
    claim: Claim,
    model: System | None = None,
    *,
    argument_gain: Polynomial | None = None,
    filter_gain: Polynomial | None = None,
) -> Proof:
    """Prove, refute or leave undecided one claim; see `certify_claims`."""
    if refusal := _misfit(system, claim):
        return Proof(claim, Outcome.REFUTED, 0.0, {}, 0, refusal)
    if claim.kind in ENCLOSURE_KINDS:
        failed, verdict = enclosure_verdict(system, gain, claim)
    elif claim.kind == "domain":
        failed, verdict = domain_verdict(system, gain, claim, argument_gain)
    elif claim.kind == "steady_box" and model is None:
        failed, verdict = steady_box_verdict(system, gain, claim)
    elif claim.kind == "filter_box":
        if filter_gain is None or model is not None:
            return Proof(
                claim, Outcome.REFUTED, 0.0, {}, 0, "The claim is about a filter; the design has no filter gain."
            )
        failed, verdict = filter_box_verdict(system, filter_gain, claim)
    else:
        failed, verdict = claim_verdict(system, gain, claim, model, argument_gain=argument_gain)
    reason = _reason(claim, failed, verdict)
    return Proof(claim, verdict.outcome, verdict.margin, verdict.point, verdict.pieces, reason)


def _misfit(system: System, claim: Claim) -> str:
    """Why a witness cannot belong to this plant, or an empty string."""
    if claim.storage is not None and claim.storage.shape[0] != system.nx:
        return f"The storage has {claim.storage.shape[0]} rows; the plant has {system.nx} states."
    if claim.weight is not None and np.asarray(claim.weight).shape[1] != system.nx:
        return f"The weight has shape {np.asarray(claim.weight).shape}; it needs {system.nx} columns."
    if system.dt is not None and claim.kind == "decay" and claim.level >= 1:
        return "A factor a step of one or more is no decay."
    return ""


def assumptions(system: System, claims: Sequence[Claim] = ()) -> tuple[str, ...]:
    """Return what a certificate of this plant rests on, one sentence each.

    Args:
        system: plant.
        claims: what is claimed; a storage that depends on parameters rests on their rates.
    """
    by_rate = {n for c in claims if isinstance(c.storage, Polynomial) for n, d in c.storage.degree.items() if d}
    time_axis = "continuous time" if system.dt is None else f"discrete time with step {system.dt:g} s"
    lines = [
        f"The plant is `{system.name}` in {time_axis}; the claim is about that model, not about another sampling of it."
    ]
    for p in system.parameters:
        lines.append(_parameter_sentence(p, system.scheduling_error is not None, by_rate))
    if system.noise_bound is None and any(c.kind in ("containment", "width") for c in claims):
        lines.append("What is measured is taken without noise.")
    for what, bound in (("disturbance", system.disturbance_bound), ("noise", system.noise_bound)):
        if bound is not None:
            lines.append(
                f"Where a claim speaks of bounds, each {what} stays within {[float(f'{b:.6g}') for b in bound]}."
            )
    if any(c.kind == "domain" for c in claims):
        lines.append("The claim about the domain is made without disturbance and noise.")
    f = system.nonlinearity
    if f is not None and f.jacobian_lower is not None and f.jacobian_upper is not None:
        how = (
            "proved by ball arithmetic when the plant was built"
            if f.bound_status == "proved"
            else "declared by the user"
        )
        which = "box" if f.jacobian_vertices is None else f"hull of {len(f.jacobian_vertices)} matrices inside the box"
        lines.append(
            f"The Jacobian of the nonlinearity stays in its {which} ({how}): {_box_text(f.jacobian_lower, f.jacobian_upper)}."
        )
    elif f is not None:
        lines.append(f"The nonlinearity has Lipschitz constant {f.lipschitz_bound:.6g} (declared by the user).")
    if f is not None and f.domain is not None:
        who = "The state stays" if f.is_clipped else "State and estimate stay"
        proved = "; for errors in the proved set what enters f does while the state keeps the stated distances"
        lines.append(f"{who} in the box {_box_text(*f.domain)}{proved * any(c.kind == 'domain' for c in claims)}.")
    return tuple(lines)


def _reason(claim: Claim, failed: str, verdict: Verdict) -> str:
    if verdict.outcome is Outcome.PROVED:
        return f"{Outcome.PROVED.sentence} Margin {verdict.margin:.3g} on {verdict.pieces} piece(s)."
    where = ", ".join(f"{n} = {v:.6g}" for n, v in verdict.point.items()) or "the only point there is"
    if failed == "storage":
        return f"The storage matrix is not positive definite at {where}."
    what = (
        f"The inequality of `{claim.kind}` at level {claim.level:.6g}"
        if failed == claim.kind
        else f"`{failed}` of `{claim.kind}`"
    )
    if verdict.outcome is Outcome.REFUTED:
        return f"{what} fails at {where}."
    return f"{what} was not decided near {where} after {verdict.pieces} pieces."


def _parameter_sentence(p: Parameter, declared_error: bool, by_rate: set[str]) -> str:
    if not p.measured:
        word = "is not measured"
    elif declared_error:
        word = "is measured with the declared scheduling error"
    elif p.is_exact:
        word = "is measured exactly"
    else:
        word = f"is measured with a factor in [{p.factor[0]:.6g}, {p.factor[1]:.6g}] and an offset up to {p.error:.6g}"
    pace = ", however fast it changes."
    if p.name in by_rate:
        pace = ", and changes by its rate law." if p.rate_law else f", and changes by at most {p.rate:.6g} a second."
    return f"{p.name} {word} and stays in [{p.lower:.6g}, {p.upper:.6g}] {p.unit}".rstrip() + pace


def _box_text(lower: np.ndarray, upper: np.ndarray) -> str:
    return ", ".join(f"[{a:.6g}, {b:.6g}]" for a, b in zip(np.ravel(lower), np.ravel(upper), strict=True))
