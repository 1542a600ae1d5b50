"""Proofs of claims from System + gain + witness alone, and the certificate that lists them."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np

from luenberger.algebra import Polynomial, symmetric
from luenberger.algebra.ball import Ball
from luenberger.algebra.definiteness import exact, positive_definite
from luenberger.algebra.jaxpr import BALL, Trace, trace
from luenberger.certify.claim import Claim, from_text, to_text
from luenberger.certify.continuum import Verdict, negative_definite
from luenberger.core import NotAccepted, Outcome
from luenberger.systems import System
from luenberger.systems.error_system import ErrorSystem, error_box
from luenberger.systems.matrix import MatrixFunction, PlantMatrix


@dataclass(frozen=True, eq=False)
class Proof:
    """A claim with what came of checking it.

    Args:
        claim: the statement and its witness.
        outcome: proved, refuted or undecided.
        margin: proved definiteness margin of the inequality, 0 where none.
        point: where the claim fails (refuted) or the effort ended (undecided).
        pieces: sub-boxes examined.
        reason: one sentence.
    """

    claim: Claim
    outcome: Outcome
    margin: float
    point: Mapping[str, float]
    pieces: int
    reason: str


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
    def claims(self) -> tuple[Claim, ...]:
        """The claims, proved or not."""
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
    def from_text(data: dict[str, Any]) -> "Certificate":
        """Read what `as_text` wrote; the outcomes are what the file says until `certify` checks them again."""
        proofs = [
            Proof(
                Claim.from_text(p["claim"]),
                Outcome(p["outcome"]),
                from_text(p["margin"]),
                p["point"],
                p["pieces"],
                p["reason"],
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
    def certificate(self) -> Certificate:
        """The claims."""
        ...


def certify(design: Certifiable) -> Certificate:
    """Check every claim of a design again, from its plant, gain and witnesses alone; no solver is used.

    Args:
        design: plant, gain and claims.

    Returns:
        a fresh certificate; read `.outcome`.
    """
    return certify_claims(design.system, design.gain, design.certificate.claims)


def certify_claims(system: System, gain: Polynomial, claims: Sequence[Claim]) -> Certificate:
    """Prove claims about the closed loop of a plant and a gain over the whole box.

    Assumes: the plant class of `System` with every parameter inside its interval, arbitrarily fast.
    Certifies: see `Claim`.

    Args:
        system: plant.
        gain: L(r), shape (nx, ny); its doubles are taken as they are.
        claims: what to prove.
    """
    start = time.perf_counter()
    proofs = tuple(prove(system, gain, claim) for claim in claims)
    return Certificate(proofs, assumptions(system), time.perf_counter() - start)


def prove(system: System, gain: Polynomial, claim: Claim) -> Proof:
    """Prove, refute or leave undecided one claim; see `certify_claims`."""
    if claim.kind != "gain_bound":
        P = exact(np.asarray(claim.storage))
        if P.shape[0] != system.nx:
            return Proof(
                claim,
                Outcome.REFUTED,
                0.0,
                {},
                0,
                f"The storage has {P.shape[0]} rows; the plant has {system.nx} states.",
            )
        if claim.weight is not None and np.asarray(claim.weight).shape[1] != system.nx:
            shape = np.asarray(claim.weight).shape
            return Proof(
                claim, Outcome.REFUTED, 0.0, {}, 0, f"The weight has shape {shape}; it needs {system.nx} columns."
            )
        if positive_definite(P) is not Outcome.PROVED:
            return Proof(claim, Outcome.REFUTED, 0.0, {}, 0, "The storage matrix is not positive definite.")
    if system.dt is not None and claim.kind == "decay" and claim.level >= 1:
        return Proof(claim, Outcome.REFUTED, 0.0, {}, 0, "A factor a step of one or more is no decay.")
    if any(isinstance(m, MatrixFunction) for m in system.matrices.values()):
        verdict = _prove_with_balls(system, gain, claim)
    else:
        verdict = negative_definite(_inequality(system, gain, claim, _exact_lift), error_box(system))
    return Proof(claim, verdict.outcome, verdict.margin, verdict.point, verdict.pieces, _reason(claim, verdict))


def assumptions(system: System) -> tuple[str, ...]:
    """Return what a certificate of this plant rests on, one sentence each.

    Args:
        system: plant.
    """
    time_axis = "continuous time" if system.dt is None else f"discrete time with step {system.dt:g} s"
    lines = [
        f"The plant is `{system.name}` in {time_axis}; the claim is about that model, not about another sampling of it."
    ]
    for p in system.parameters:
        word = "is measured exactly" if p.measured else "is not measured"
        lines.append(
            f"{p.name} {word} and stays in [{p.lower:.6g}, {p.upper:.6g}] {p.unit}".rstrip()
            + ", however fast it changes."
        )
    f = system.nonlinearity
    if f is not None and f.jacobian_lower is not None and f.jacobian_upper is not None:
        how = (
            "proved by ball arithmetic when the plant was built"
            if f.bound_status == "proved"
            else "declared by the user"
        )
        lines.append(
            f"The Jacobian of the nonlinearity stays in its box ({how}): {_box_text(f.jacobian_lower, f.jacobian_upper)}."
        )
    elif f is not None:
        lines.append(f"The nonlinearity has Lipschitz constant {f.lipschitz_bound:.6g} (declared by the user).")
    if f is not None and f.domain is not None:
        lines.append(f"State and estimate stay in the box {_box_text(*f.domain)}.")
    return tuple(lines)


def _inequality(system: System, gain: Polynomial, claim: Claim, lift: Any) -> Polynomial:
    """The symmetric matrix that must be negative definite for the claim to hold."""
    level = exact(np.array([[claim.level]]))[0, 0]
    if claim.kind == "gain_bound":
        nx, ny = gain.shape
        return -symmetric(
            [[Polynomial.constant(exact(claim.level * np.eye(nx))), lift(gain)], [exact(claim.level * np.eye(ny))]]
        )
    error = ErrorSystem.of(system, gain, lift)
    P = exact(np.asarray(claim.storage))
    multiplier = exact(np.array([[claim.multiplier or 0.0]]))[0, 0]
    if claim.kind == "decay":
        return error.dissipation(P, rate=level, multiplier=multiplier)
    rate = 0 if system.dt is None else 1
    inputs = {
        "disturbance": lambda: error.disturbance,
        "noise": lambda: error.noise,
        "both": lambda: _beside(error.disturbance, error.noise),
    }[claim.inputs]()
    weight = Polynomial.constant(exact(np.asarray(claim.weight)))
    return error.dissipation(
        P, rate=rate, weight=weight, inputs=inputs, gain_squared=level * level, multiplier=multiplier
    )


def _beside(left: Polynomial, right: Polynomial) -> Polynomial:
    rows, columns = left.shape[1], right.shape[1]
    first = exact(np.eye(rows, rows + columns))
    second = exact(np.eye(columns, rows + columns, rows))
    return left @ first + right @ second


def _exact_lift(matrix: PlantMatrix) -> Polynomial:
    if not isinstance(matrix, Polynomial):
        raise NotAccepted("A function on the domain has no exact polynomial form; it is proved with balls.")
    return matrix.map(exact)


def _prove_with_balls(system: System, gain: Polynomial, claim: Claim) -> Verdict:
    # Each function is read once; pieces only evaluate what was read.
    traces = {id(m): _traced(m) for m in system.matrices.values() if isinstance(m, MatrixFunction)}

    def on_piece(values: Mapping[str, Ball]) -> np.ndarray:
        def lift(matrix: PlantMatrix) -> Polynomial:
            if isinstance(matrix, Polynomial):
                return Polynomial.constant(_ball_values(matrix, values))
            point = np.array([values[n] for n in matrix.names], dtype=object)
            return Polynomial.constant(traces[id(matrix)](point, arithmetic=BALL))

        inequality = _inequality(system, gain, claim, lift)
        return inequality({n: values[n] for n in inequality.names})

    return negative_definite(on_piece, error_box(system))


def _traced(matrix: MatrixFunction) -> Trace:
    names = matrix.names

    def at(r: Any) -> Any:
        return matrix({n: r[k] for k, n in enumerate(names)})

    return trace(at, np.zeros(len(names)))


def _ball_values(matrix: Polynomial, values: Mapping[str, Ball]) -> np.ndarray:
    balls = np.vectorize(Ball.exact, otypes=[object])
    return matrix.map(lambda c: balls(c) if c.size else c.astype(object))(values)


def _reason(claim: Claim, verdict: Verdict) -> str:
    if verdict.outcome is Outcome.PROVED:
        return f"{Outcome.PROVED.sentence} Definite with margin {verdict.margin:.3g} on {verdict.pieces} piece(s)."
    where = ", ".join(f"{n} = {v:.6g}" for n, v in verdict.point.items()) or "the only point there is"
    if verdict.outcome is Outcome.REFUTED:
        return f"The inequality of `{claim.kind}` at level {claim.level:.6g} fails at {where}."
    return f"The inequality of `{claim.kind}` was not decided near {where} after {verdict.pieces} pieces."


def _box_text(lower: np.ndarray, upper: np.ndarray) -> str:
    return ", ".join(f"[{a:.6g}, {b:.6g}]" for a, b in zip(np.ravel(lower), np.ravel(upper), strict=True))
