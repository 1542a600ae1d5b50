"""The matrix inequalities of a claim about the error, and their proof in exact rationals or balls."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from luenberger.algebra import Polynomial, symmetric
from luenberger.algebra.ball import Ball
from luenberger.algebra.definiteness import exact
from luenberger.algebra.jaxpr import BALL, Trace, trace
from luenberger.certify.claim import Claim
from luenberger.certify.continuum import Verdict, negative_definite
from luenberger.core import NotAccepted, Outcome
from luenberger.systems import System
from luenberger.systems.error_system import ErrorSystem, Form, Lift
from luenberger.systems.jacobian_box import error_box, jacobian_corners
from luenberger.systems.matrix import MatrixFunction, PlantMatrix
from luenberger.systems.scheduling_error import scheduling_rates

Posed = Callable[[Lift], Polynomial]
# Inequalities about the error, which differ from corner to corner of a Jacobian hull.
ERROR_KINDS = ("decay", "l2_gain", "h2_gain")


@dataclass(frozen=True)
class Loop:
    """What closes the loop around a plant with one Jacobian set.

    Args:
        system: plant, or a corner of it.
        gain: L(r).
        model: what the observer copies; None for the plant itself.
        argument_gain: L2(r); None for zero.
    """

    system: System
    gain: Polynomial
    model: System | None
    argument_gain: Polynomial | None

    def error(self, lift: Lift, form: Form) -> ErrorSystem:
        """Return the error system in one arithmetic."""
        return ErrorSystem.of(
            self.system, self.gain, lift, model=self.model, form=form, argument_gain=self.argument_gain
        )


def claim_verdict(
    system: System,
    gain: Polynomial,
    claim: Claim,
    model: System | None = None,
    *,
    argument_gain: Polynomial | None = None,
) -> tuple[str, Verdict]:
    """Decide a claim about the error from plant, gain and witnesses.

    Args:
        system: plant.
        gain: L(r).
        claim: decay, L2 gain, H2 gain, or a bound on a gain.
        model: what the observer copies; None for the plant itself.
        argument_gain: L2(r) of an observer with two degrees of freedom; None for zero.

    Returns:
        the inequality that failed (empty where none did), and the verdict.
    """
    plants = [system] if model is None else [system, model]
    functions = [m for plant in plants for m in plant.matrices.values() if isinstance(m, MatrixFunction)]
    # Each function is read once; pieces only evaluate what was read.
    traces = {id(m): _traced(m) for m in functions}
    loops = [Loop(corner, gain, model, argument_gain) for corner in jacobian_corners(system)]
    margin, pieces, settled = np.inf, 0, set[str]()
    for loop in loops:
        box = error_box(loop.system) | ({} if functions else scheduling_rates(system.parameters)[1])
        for name, posed in _posed(loop, claim).items():
            if name in settled:
                continue
            matrix = _on_pieces(posed, traces) if functions else posed(exact_lift)
            verdict = negative_definite(matrix, box)
            if verdict.outcome is not Outcome.PROVED:
                return name, verdict
            if name == claim.kind:
                margin, pieces = min(margin, verdict.margin), pieces + verdict.pieces
            if name not in ERROR_KINDS:
                settled.add(name)  # says nothing of the Jacobian
    return "", Verdict(Outcome.PROVED, float(margin), {}, pieces)


def exact_lift(matrix: PlantMatrix) -> Polynomial:
    """The lift of proofs: exact rational coefficients.

    Args:
        matrix: a polynomial with float coefficients.

    Raises:
        NotAccepted: a function on the domain.
    """
    if not isinstance(matrix, Polynomial):
        raise NotAccepted("A function on the domain has no exact polynomial form; it is proved with balls.")
    return matrix.map(exact)


def _posed(loop: Loop, claim: Claim) -> dict[str, Posed]:
    """Name -> symmetric matrix that must be negative definite on the box for the claim to hold."""
    level, system = exact(np.array([[claim.level]]))[0, 0], loop.system
    if claim.kind in ("gain_bound", "argument_gain_bound"):
        bounded = loop.gain if claim.kind == "gain_bound" else loop.argument_gain
        if bounded is None:
            bounded = Polynomial.constant(np.zeros(loop.gain.shape))
        return {claim.kind: lambda lift: _norm_bound(system, lift(bounded), claim.level, lift)}
    # An H2 claim states B B' against the level itself, an L2 claim against its square.
    squared = level if claim.kind == "h2_gain" else level * level
    multiplier = exact(np.array([[claim.multiplier or 0.0]]))[0, 0]

    def storage(lift: Lift) -> Polynomial:
        P = Polynomial.constant(claim.storage)
        if any(P.degree.values()):
            return P.map(exact)
        return Polynomial.constant(exact(np.asarray(P(dict.fromkeys(P.names, 0.0)))))

    def positive(lift: Lift) -> Polynomial:
        error = loop.error(lift, claim.form)
        P = error.storage(storage(lift))[0]
        if claim.kind != "h2_gain":
            return -P
        return -symmetric([[P, exact(np.asarray(claim.weight).T)], [exact(np.asarray(claim.trace))]])

    def inequality(lift: Lift) -> Polynomial:
        error = loop.error(lift, claim.form)
        P = storage(lift)
        if claim.kind == "decay":
            return error.dissipation(P, rate=level, multiplier=multiplier)
        weight = Polynomial.constant(exact(np.asarray(claim.weight))) if claim.kind == "l2_gain" else None
        return error.dissipation(
            P,
            rate=0 if system.dt is None else 1,
            weight=weight,
            inputs=error.joined(claim.inputs),
            gain_squared=squared,
            multiplier=multiplier,
        )

    posed: dict[str, Posed] = {"storage": positive, claim.kind: inequality}
    if claim.kind == "h2_gain":
        size = exact(np.array([[np.trace(np.asarray(claim.trace))]]))
        size[0, 0] = sum(exact(np.asarray(claim.trace)).diagonal()) - level
        posed["trace"] = lambda lift: Polynomial.constant(size)
    return posed


def _norm_bound(system: System, gain: Polynomial, level: float, lift: Lift) -> Polynomial:
    """[[level I, L], [L', level I]] > 0 wherever the measured scheduling may be."""
    nx, ny = gain.shape
    error = system.measured_scheduling
    L = gain if error is None else gain.compose({n: lift(p) for n, p in error.measured.items()})
    return -symmetric([[Polynomial.constant(exact(level * np.eye(nx))), L], [exact(level * np.eye(ny))]])


def _on_pieces(posed: Posed, traces: Mapping[int, Trace]) -> Callable[[Mapping[str, Ball]], np.ndarray]:
    def on_piece(values: Mapping[str, Ball]) -> np.ndarray:
        def lift(matrix: PlantMatrix) -> Polynomial:
            if isinstance(matrix, Polynomial):
                return Polynomial.constant(_ball_values(matrix, values))
            point = np.array([values[n] for n in matrix.names], dtype=object)
            return Polynomial.constant(traces[id(matrix)](point, arithmetic=BALL))

        inequality = posed(lift)
        return inequality({n: values[n] for n in inequality.names})

    return on_piece


def _traced(matrix: MatrixFunction) -> Trace:
    names = matrix.names

    def at(r: Any) -> Any:
        return matrix({n: r[k] for k, n in enumerate(names)})

    return trace(at, np.zeros(len(names)))


def _ball_values(matrix: Polynomial, values: Mapping[str, Ball]) -> np.ndarray:
    balls = np.vectorize(Ball.exact, otypes=[object])
    return matrix.map(lambda c: balls(c) if c.size else c.astype(object))(values)
