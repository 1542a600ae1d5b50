"""From a plant and a method to a design whose claims are proved, or to a refusal that says why."""

import time
from collections.abc import Sequence
from dataclasses import asdict, is_dataclass, replace
from functools import partial
from typing import Any, overload

import numpy as np

from luenberger.algebra import Polynomial
from luenberger.certify import Certificate, Claim, certify_claims, certify_switched_claims
from luenberger.core import BadInput, NotAccepted, NotCertified, Outcome
from luenberger.design import Design, SwitchedDesign
from luenberger.design.design import predictor_gain
from luenberger.lmi import decay_storage
from luenberger.methods.method import Candidate, Method, SwitchedMethod
from luenberger.systems import Switched, System


@overload
def synthesize(system: System, method: Method, *, digits: int = 7, require: bool = True) -> Design: ...


@overload
def synthesize(
    system: System | Switched | Sequence[System], method: SwitchedMethod, *, digits: int = 7, require: bool = True
) -> SwitchedDesign: ...


def synthesize(
    system: System | Switched | Sequence[System],
    method: Method | SwitchedMethod,
    *,
    digits: int = 7,
    require: bool = True,
) -> Design | SwitchedDesign:
    """Find an observer gain by a published method and prove what is claimed about it.

    The gain is rounded first, so the claims are about the digits that ship; then every claim is recomputed from plant,
    rounded gain and witnesses in exact arithmetic. A design whose claims do not recompute is refused.

    Args:
        system: plant with its trusted bounds; for methods that take modes a `Switched`, or a tuple of frozen plants.
        method: the method with its options, e.g. `PolytopicLuenberger(decay_rate=3.0)`.
        digits: significant decimal digits of the gain coefficients.
        require: False returns an uncertified design with its certificate instead of raising.

    Returns:
        the design; `design.observer(dt)` runs, `design.certificate` holds the proofs. A method that takes modes returns a
        `SwitchedDesign`, also for a single plant.

    Raises:
        NotAccepted: the plant lies outside the theorem.
        BadInput: options that no gain can satisfy (an unobservable mode slower than the decay, say).
        Infeasible: nothing was found.
        NotCertified: a gain was found but a claim could not be proved.
    """
    if isinstance(method, type) or not hasattr(method, "accept"):
        given = f"the class `{method.__name__}`" if isinstance(method, type) else f"a `{type(method).__name__}`"
        raise BadInput(
            f"`synthesize` takes a plant and a method, but the method given is {given}; pass a method with its options, e.g. "
            "`synthesize(plant, UnknownInputGain(fade=0.2))`."
        )
    if getattr(method, "takes_modes", False):
        return _switched(Switched.of(system), method, digits, require)  # type: ignore[arg-type]
    if not isinstance(system, System):
        raise NotAccepted(f"`{type(method).__name__}` takes one plant; a switched plant needs e.g. `UnknownInputGain`.")
    start = time.perf_counter()
    method.accept(system)  # type: ignore[arg-type]
    candidate = method.design(system)  # type: ignore[arg-type]
    assert isinstance(candidate, Candidate)
    gain = candidate.gain.map(lambda c: _rounded(c, digits))
    cut = candidate.filter_gain
    if cut is not None:
        # What is claimed of the prediction and of the filter has to speak of the same digits.
        cut = cut.map(lambda c: _rounded(c, digits))
        gain = predictor_gain(system, cut)
    model = None if candidate.model is None else _rounded_model(candidate.model, digits)
    second = None
    if candidate.argument_gain is not None:
        second = candidate.argument_gain.map(lambda c: _rounded(c, digits))
    claims = candidate.claims(gain, *(g for g in (second, cut) if g is not None))
    certificate = _certified(system, gain, claims, model, second, cut)
    if require:
        _require_proved(method, certificate)
    total = time.perf_counter() - start
    statistics = {**candidate.statistics, "certificate_seconds": certificate.seconds, "seconds": total}
    return Design(
        system,
        gain,
        certificate,
        type(method).__name__,
        _options(method),
        method.references,
        statistics,
        model,
        second,
        cut,
    )


def _switched(system: Switched, method: SwitchedMethod, digits: int, require: bool) -> SwitchedDesign:
    """The same for plants with modes."""
    start = time.perf_counter()
    method.accept(system)
    candidate = method.design(system)
    gains = tuple(K.map(lambda c: _rounded(c, digits)) for K in candidate.gains)
    claims = candidate.claims(gains, candidate.decoupling)
    certificate = certify_switched_claims(system, gains, candidate.decoupling, claims)
    if require:
        _require_proved(method, certificate)
    total = time.perf_counter() - start
    statistics = {**candidate.statistics, "certificate_seconds": certificate.seconds, "seconds": total}
    options, references = _options(method), method.references
    name = type(method).__name__
    return SwitchedDesign(system, gains, candidate.decoupling, certificate, name, options, references, statistics)


def _require_proved(method: Method | SwitchedMethod, certificate: Certificate) -> None:
    if certificate.outcome is Outcome.PROVED:
        return
    worst = next(p for p in certificate.proofs if p.outcome is not Outcome.PROVED)
    raise NotCertified(
        f"`{type(method).__name__}` found a gain, but its claim `{worst.claim.kind}` is {worst.outcome.value}: {worst.reason} "
        "Ask for a lower level, or pass `require=False` to look at the design."
    )


def _certified(
    system: System,
    gain: Polynomial,
    claims: Sequence[Claim],
    model: System | None,
    argument_gain: Polynomial | None,
    filter_gain: Polynomial | None,
) -> Certificate:
    """Prove the claims; where a decay witness broke under rounding, look once for a better witness of the same claim."""
    proved = partial(certify_claims, system, gain, model=model, argument_gain=argument_gain, filter_gain=filter_gain)
    certificate = proved(claims=claims)
    if certificate.outcome is Outcome.PROVED:
        return certificate
    mended: list[Claim] = []
    for proof in certificate.proofs:
        found = None
        if proof.claim.kind == "decay" and proof.outcome is not Outcome.PROVED and model is None:
            found = decay_storage(system, gain, proof.claim.level, argument_gain=argument_gain)
        mended.append(proof.claim if found is None else replace(proof.claim, storage=found[0], multiplier=found[1]))
    return proved(claims=mended)


def _rounded_model(model: System, digits: int) -> System:
    """What an unstructured observer copies is part of its gains, and is rounded with them."""
    return model.replace(**{k: model.polynomial(k).map(lambda c: _rounded(c, digits)) for k in "AB"})


def _rounded(coefficient: np.ndarray, digits: int) -> np.ndarray:
    return np.array([float(f"{x:.{digits}g}") for x in coefficient.flat]).reshape(coefficient.shape)


def _options(method: Method | SwitchedMethod) -> dict[str, Any]:
    if not is_dataclass(method):
        return {}
    return {k: _plain(v) for k, v in asdict(method).items()}


def _plain(value: Any) -> Any:
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    if isinstance(value, int | float | str | bool | dict | None):
        return value
    return value.tolist() if hasattr(value, "tolist") else str(value)
