"""Claims about unknown-input observers with modes, proved in exact rationals mode by mode, or over the box of a scheduled mode.

With the error of mode i, e+ = N_i e + B_i w (see `DecoupledError`), and V_i = e' Q_i e, the inequality

    V_j(e+) <= (1 - fade) V_i(e) + supply |w|^2

holds for all e and w exactly where the matrix below is negative semidefinite; it is shown negative definite. Summed up,

    V <= (1 - fade)^k V_0 + supply / fade sup |w|^2,      |e|^2 <= V / alpha,      alpha I <= Q_i,

which has `fade` under the root, not 1 - fade. Where the storage may grow at a switch by `growth`, and at least tau samples lie between
two switches, supply / fade is multiplied by growth (1 - s) / (1 - growth s), s = (1 - fade)^tau.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from flint import fmpq

from luenberger.algebra import Polynomial, symmetric
from luenberger.algebra.definiteness import exact
from luenberger.certify.certificate import Certificate, Proof
from luenberger.certify.claim import Claim
from luenberger.certify.continuum import Verdict, negative_definite
from luenberger.certify.inequality import claim_verdict, exact_lift
from luenberger.certify.switched_box import containment_verdict, leaks
from luenberger.certify.switched_claim import SwitchedClaim
from luenberger.core import BadInput, NotAccepted, Outcome
from luenberger.systems import Parameter, Switched, System
from luenberger.systems.decoupled_error import DecoupledError
from luenberger.systems.uncertainty import Uncertain

Gains = Sequence[Polynomial]


def certify_switched_claims(
    system: Switched,
    gains: Gains,
    decoupling: Gains,
    claims: Sequence[SwitchedClaim],
    progress: Callable[[str, float], None] | None = None,
) -> Certificate:
    """Prove claims about the error of an unknown-input observer.

    Args:
        system: plant with its modes.
        gains: K_i(r), one a mode; their doubles are taken as they are.
        decoupling: H_i, one a mode.
        claims: what to prove.
        progress: called with what is being proved and the share done.

    Raises:
        BadInput: not one gain for each mode.
        NotAccepted: a continuous plant, or one without such an error, see `DecoupledError.of`.
    """
    if not len(gains) == len(decoupling) == len(system.modes):
        raise BadInput(
            f"`{system.name}` has {len(system.modes)} modes; {len(gains)} gains and {len(decoupling)} decoupling matrices are given."
        )
    if system.first.dt is None:
        raise NotAccepted(f"`{system.name}` is continuous; these claims are about steps. Give the plant its `dt`.")
    start = time.perf_counter()
    proofs: list[Proof] = []
    for k, claim in enumerate(claims):
        if progress is not None:
            progress(f"proving {claim.kind}", k / len(claims))
        begin = time.perf_counter()
        proof = prove_switched(system, gains, decoupling, claim)
        proofs.append(replace(proof, seconds=time.perf_counter() - begin, discrete=True))
    return Certificate(tuple(proofs), switched_assumptions(system, claims), time.perf_counter() - start)


def prove_switched(system: Switched, gains: Gains, decoupling: Gains, claim: SwitchedClaim) -> Proof:
    """Prove, refute or leave undecided one claim; see `certify_switched_claims`."""
    if claim.kind == "gain_bound":
        failed, verdict = _gain_bound(system, gains, claim)
    else:
        errors = [
            DecoupledError.of(mode, K, H, exact_lift)
            for mode, K, H in zip(system.modes, gains, decoupling, strict=True)
        ]
        if claim.kind == "decoupling":
            failed, verdict = _decoupling(errors, claim)
        elif claim.kind == "iss":
            failed, verdict = _stability(system, errors, claim)
        else:
            failed, verdict = containment_verdict(system, errors, claim)
    return Proof(claim, verdict.outcome, verdict.margin, verdict.point, verdict.pieces, _reason(claim, failed, verdict))


def switched_assumptions(system: Switched, claims: Sequence[SwitchedClaim] = ()) -> tuple[str, ...]:
    """Return what a certificate of a plant with modes rests on, one sentence each.

    Args:
        system: plant.
        claims: what is claimed.
    """
    first = system.first
    lines = [
        f"The plant is `{system.name}` in discrete time with step {first.dt:g} s; the claim is about that model, not about another sampling of it."
    ]
    if len(system.modes) > 1:
        pace = "at any sample" if system.dwell == 1 else f"not before {system.dwell} samples after the last switch"
        lines.append(
            f"The mode is known at every sample, from `{system.signal}` at {list(system.ends)}, and switches {pace}."
        )
        lines.append(
            "In a mode the plant is that of the mode: what selects the mode must not change the plant inside it."
        )
    told = [[_parameter_line(p) for p in mode.parameters] for mode in system.modes]
    if all(each == told[0] for each in told):
        lines += told[0]
    else:
        lines += [f"In mode {i}: {line}" for i, each in enumerate(told) for line in each]
    lines.append(
        "The unknown input is free."
        if first.disturbance_bound is None
        else f"Each unknown input stays within {list(first.disturbance_bound)}."
    )
    if first.noise_bound is not None:
        lines.append(f"Each noise stays within {list(first.noise_bound)}, errors of the inputs included.")
    if any(c.kind == "containment" for c in claims):
        lines.append(
            "The state starts inside the start set, and in the a-priori box of the observer where it has one, it stays there."
        )
    bounds = [c.state_bound for c in claims if c.state_bound is not None]
    if bounds:
        lines.append(f"The invariant box assumes |x| <= {np.asarray(bounds[0]).tolist()} (inputs after the states).")
    return tuple(lines)


def _parameter_line(p: Parameter) -> str:
    word = "is measured" if p.measured else "is not measured"
    off = "" if not p.measured or p.is_exact else f" with an offset up to {p.error:g} and a factor in {list(p.factor)}"
    said = f"{p.name} {word}{off} and stays in [{p.lower:.6g}, {p.upper:.6g}] {p.unit}".rstrip()
    return f"{said}, however fast it changes."


def _decoupling(errors: Sequence[DecoupledError], claim: SwitchedClaim) -> tuple[str, Verdict]:
    level = exact(claim.level)[()]
    for i, error in enumerate(errors):
        for coefficient in error.inputs["disturbance"].bernstein(error.box).values():
            worst = max((abs(x) for x in np.ravel(coefficient)), default=fmpq(0))
            if worst > level:
                return claim.kind, Verdict(Outcome.REFUTED, 0.0, {"mode": float(i)}, 1)
    return "", Verdict(Outcome.PROVED, 0.0, {}, len(errors))


def _gain_bound(system: Switched, gains: Gains, claim: SwitchedClaim) -> tuple[str, Verdict]:
    single = Claim("gain_bound", claim.level)
    margin = np.inf
    for i, (mode, K) in enumerate(zip(system.modes, gains, strict=True)):
        # The observer clips what it reads into the box, so the gain is taken there.
        _, verdict = claim_verdict(Uncertain.of(mode).nominal, K, single)
        if verdict.outcome is not Outcome.PROVED:
            return claim.kind, replace(verdict, point={"mode": float(i), **verdict.point})
        margin = min(margin, verdict.margin)
    return "", Verdict(Outcome.PROVED, float(margin), {}, len(gains))


def _stability(system: Switched, errors: Sequence[DecoupledError], claim: SwitchedClaim) -> tuple[str, Verdict]:
    count = len(errors)
    if len(claim.storages) not in (1, count) or claim.storages[0].shape != (system.first.nx,) * 2:
        return "storage", Verdict(Outcome.REFUTED, 0.0, {}, 0)
    for i, (mode, error) in enumerate(zip(system.modes, errors, strict=True)):
        if left := _left_out(mode, error, claim):
            return "inputs", Verdict(Outcome.REFUTED, 0.0, {"mode": float(i), left: 1.0}, 0)
    Q = [exact(claim.storages[i % len(claim.storages)]) for i in range(count)]
    failed, alpha = _smallest(Q)
    if alpha is None:
        return failed, Verdict(Outcome.REFUTED, 0.0, {}, count)
    if (verdict := _constants(system, claim, alpha)) is not None:
        return "level", verdict
    if claim.growth > 1:
        pairs = [(i, i) for i in range(count)]
        for i, j in system.transitions:
            verdict = negative_definite(Polynomial.constant(Q[j] - Q[i] * exact(claim.growth)[()]), {})
            if i != j and verdict.outcome is not Outcome.PROVED:
                return "growth", replace(verdict, point={"from": float(i), "to": float(j)})
    else:
        pairs = list(system.transitions) if len(claim.storages) > 1 else [(i, i) for i in range(count)]
    margin, pieces = np.inf, 0
    for i, j in pairs:
        acting = errors[j if claim.order == "last" else i]
        verdict = negative_definite(_step_inequality(system, acting, Q[i], Q[j], claim), acting.box)
        if verdict.outcome is not Outcome.PROVED:
            return claim.kind, replace(verdict, point={"from": float(i), "to": float(j), **verdict.point})
        margin, pieces = min(margin, verdict.margin), pieces + verdict.pieces
    return "", Verdict(Outcome.PROVED, float(margin), {}, pieces)


def _left_out(mode: System, error: DecoupledError, claim: SwitchedClaim) -> str:
    """A channel that reaches the error and is not in w: |e| would not be bounded by what the claim names."""
    named = claim.inputs.split("+")
    if "lumped" in named:
        return ""
    acting = [n for n in ("uncertainty", "noise", "next noise") if any(np.any(c != 0) for _, c in error.inputs[n])]
    acting += ["disturbance"] if leaks(mode, error) else []
    return next((n for n in acting if n not in named), "")


def _step_inequality(
    system: Switched, error: DecoupledError, before: np.ndarray, after: np.ndarray, claim: SwitchedClaim
) -> Polynomial:
    """[[-(1 - fade) Q_i, 0, N' Q_j], [., -supply I, B' Q_j], [., ., -Q_j]], negative definite for the claim to hold."""
    parts: list[Polynomial] = []
    for name in claim.inputs.split("+"):
        direction = error.inputs[name]
        bound = _unit(system, name, direction.shape[1])
        if direction.shape[1]:
            parts.append(direction @ Polynomial.constant(exact(np.diag(bound))))
    keep = 1 - exact(claim.fade)[()]
    supply = exact(claim.supply)[()]
    Qj = Polynomial.constant(after)
    rows: list[list[Any]] = [[Polynomial.constant(-before * keep), *[0] * len(parts), error.A.T @ Qj]]
    for k, B in enumerate(parts):
        size = B.shape[1]
        rows.append([Polynomial.constant(exact(np.eye(size)) * -supply), *[0] * (len(parts) - k - 1), B.T @ Qj])
    rows.append([-Qj])
    return symmetric(rows)


def _unit(system: Switched, channel: str, count: int) -> np.ndarray:
    plant = system.first
    given = {"disturbance": plant.disturbance_bound, "noise": plant.noise_bound, "next noise": plant.noise_bound}
    if channel not in given:
        return np.ones(count)
    bound = given[channel]
    if bound is None:
        raise BadInput(f"The claim counts `{channel}` in units of its bound, and `{plant.name}` has none; give it one.")
    return np.asarray(bound, dtype=float)


def _smallest(Q: Sequence[np.ndarray]) -> tuple[str, fmpq | None]:
    """A proved alpha > 0 with alpha I < Q_i for all i."""
    floats = [np.array([[int(x.p) / int(x.q) for x in row] for row in q]) for q in Q]
    estimate = min(float(np.linalg.eigvalsh(q)[0]) for q in floats)
    for share in (1e-12, 1e-9, 1e-6, 1e-3):
        alpha: fmpq = exact(estimate * (1 - share)).item()
        if estimate > 0 and all(
            negative_definite(Polynomial.constant(exact(np.eye(len(q))) * alpha - q), {}).outcome is Outcome.PROVED
            for q in Q
        ):
            return "", alpha
    return "storage", None


def _constants(system: Switched, claim: SwitchedClaim, alpha: fmpq) -> Verdict | None:
    """The level against sqrt(factor supply / (alpha fade)), None where it holds."""
    fade, supply, growth, level = (exact(v)[()] for v in (claim.fade, claim.supply, claim.growth, claim.level))
    factor = fmpq(1)
    if claim.growth > 1:
        left = (1 - fade) ** system.dwell
        if growth * left >= 1:
            return Verdict(Outcome.REFUTED, 0.0, {"dwell": float(system.dwell)}, 0)
        factor = growth * (1 - left) / (1 - growth * left)
    needed = factor * supply / (alpha * fade)
    if level * level < needed:
        return Verdict(Outcome.REFUTED, 0.0, {"level needed": float(np.sqrt(int(needed.p) / int(needed.q)))}, 0)
    return None


def _reason(claim: SwitchedClaim, failed: str, verdict: Verdict) -> str:
    if verdict.outcome is Outcome.PROVED:
        return f"{Outcome.PROVED.sentence} Margin {verdict.margin:.3g} on {verdict.pieces} piece(s)."
    where = ", ".join(f"{n} {v:.6g}" for n, v in verdict.point.items()) or "the only point there is"
    what = {
        "storage": "A storage is not positive definite, or of another size or number than the modes",
        "level": f"The level {claim.level:.6g} is below what storages, fade and supply give",
        "growth": f"A storage grows by more than {claim.growth:.6g} at a switch",
        "vector": "An error on the faces of the box leaves it",
        "bounds": "A bound that the claim needs is missing",
        "inputs": "Something reaches the error that the claim does not name",
    }.get(failed, f"The inequality of `{claim.kind}` at level {claim.level:.6g}")
    if verdict.outcome is Outcome.REFUTED:
        return f"{what} fails: {where}." if failed in ("", claim.kind) else f"{what}: {where}."
    return f"{what} was not decided near {where} after {verdict.pieces} pieces."
