"""What is proved of the step that ships: of its rounded numbers, and of the sampled map instead of the differential equation."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.linalg

from luenberger.certify import Certificate
from luenberger.certify.one_step import OneStep, Sampling, sampled_decay_verdict
from luenberger.certify.rational_text import matrix_text, to_text
from luenberger.core import NotAccepted, Outcome
from luenberger.design import Design
from luenberger.observers import CorrectionObserver, Observer
from luenberger.systems import System
from luenberger.systems.jacobian_box import as_floats
from luenberger.systems.matrix import MatrixFunction

# Shares of the way from the largest factor met to one that are given away to prove it everywhere.
_SHARES = (0.02, 0.1, 0.3, 0.6)
# Points of the box at which the factor is looked for, half of them vertices.
_LOOKS = 400


@dataclass(frozen=True, eq=False)
class SampledStep:
    """The claim that a sampled observer forgets its start by `level` a step, in the norm of `storage`.

    Args:
        outcome: proved, refuted or undecided.
        level: factor over a step; without a proof the largest that was met, None where the step is not written as a map.
        storage: P, shape (nx, nx).
        sampling: scheme, step and parts.
    """

    outcome: Outcome
    level: float | None
    storage: np.ndarray
    sampling: Sampling

    @property
    def sentence(self) -> str:
        """The claim in words."""
        s = self.sampling
        how = "map of the discrete plant" if s.scheme == "map" else f"{s.scheme}, {s.parts} part(s)"
        what = f"sampled step of {s.dt!r} s ({how})"
        if self.outcome is not Outcome.PROVED:
            met = "" if self.level is None else f"; the largest factor met was {self.level:.6g} a step"
            return f"{self.outcome.value}: no decay of the {what} is proved{met}."
        return (
            f"proved: under equal signals two states of this {what} approach each other by the factor {self.level:.9g} a step in the norm "
            "of P; where the sampled plant follows this step up to s, the error ends below sup |s|_P / (1 - factor). Scheduling in the "
            "stated box, the argument of the nonlinearity in its domain at all stages."
        )

    def as_text(self) -> dict[str, Any]:
        """Plain data for JSON, numbers as rationals."""
        s = self.sampling
        return {
            "outcome": self.outcome.value,
            "level": None if self.level is None or not np.isfinite(self.level) else to_text(self.level),
            "storage": matrix_text(self.storage),
            "sampling": {"scheme": s.scheme, "dt": to_text(s.dt), "parts": s.parts, "degree": s.degree},
            "sentence": self.sentence,
        }


def sampling_of(observer: Observer) -> Sampling | None:
    """Return how an observer carries out its step, None where its error is no map of a copy of the plant.

    Args:
        observer: running observer.
    """
    if not isinstance(observer, CorrectionObserver):
        return None
    if observer.method == "exact":
        return Sampling("exact", observer.dt, 2**observer.order.squarings, observer.order.degree)
    return Sampling(observer.method, observer.dt, observer.substeps)


def sampled_step(design: Design, observer: Observer) -> SampledStep | None:
    """Prove a decay of the step that an observer of a design runs, or say what was met; None where there is no such step.

    The storage of the design's decay claim is tried first, then one made for the step at the middle of the box.

    Args:
        design: gain with its claims.
        observer: what `design.observer` handed out.
    """
    sampling = sampling_of(observer)
    system = design.system if design.model is None else design.model
    if sampling is None:
        return None
    if any(isinstance(m, MatrixFunction) for m in system.matrices.values()):
        return SampledStep(Outcome.UNDECIDED, None, np.eye(system.nx), sampling)
    try:
        step = OneStep.of(system, design.gain, sampling, design.argument_gain, lift=as_floats)
    except NotAccepted:
        return SampledStep(Outcome.UNDECIDED, None, np.eye(system.nx), sampling)
    found = [(np.inf, np.eye(system.nx))]
    for P in _storages(design, step):
        worst = _largest_factor(step, P) ** sampling.parts
        found.append((worst, P))
        for share in _SHARES:
            level = float(worst + share * (1 - worst))
            if not 0 <= level < 1:
                break
            _, verdict = sampled_decay_verdict(
                system, design.gain, sampling, level, P, argument_gain=design.argument_gain
            )
            if verdict.outcome is Outcome.PROVED:
                return SampledStep(Outcome.PROVED, level, P, sampling)
    worst, P = min(found, key=lambda f: f[0])
    return SampledStep(Outcome.UNDECIDED, worst, P, sampling)


def quantised(design: Design, precision: str) -> Design:
    """Return a design with the numbers that ship: gains rounded to the precision, and its claims checked again for them.

    Args:
        design: what was designed.
        precision: "double" leaves everything as it is, "float" rounds to single precision.
    """
    if precision != "float":
        return design
    rounded = {
        name: None if (value := getattr(design, name)) is None else value.map(_single)
        for name in ("gain", "argument_gain", "filter_gain")
    }
    changed = replace(design, **rounded)
    return replace(changed, certificate=changed.certify())


def quantised_plant(system: System, precision: str) -> System:
    """Return a plant as the code holds it: matrix entries rounded to the precision.

    Args:
        system: plant.
        precision: "double" or "float".
    """
    if precision != "float":
        return system
    letters = "ABCDEGN" if system.nonlinearity is None else "ABCDEFGN"
    return system.replace(**{k: system.polynomial(k).map(_single) for k in letters})


def proofs_text(
    certificate: Certificate | None, step: SampledStep | None, precision: str, statements: Sequence[str] = ()
) -> Mapping[str, Any]:
    """Return what was proved of exported code as plain data: of the design with the numbers that ship, and of the step.

    Args:
        certificate: of the quantised design.
        step: claim about the sampled step.
        precision: of the numbers.
        statements: what the header says of the sampled step.
    """
    return {
        "precision": precision,
        "design": None if certificate is None else certificate.as_text(),
        "step": None if step is None else step.as_text(),
        "statements": list(statements),
    }


def _storages(design: Design, step: OneStep) -> list[np.ndarray]:
    found = [c.storage for c in design.certificate.claims if c.kind == "decay" and isinstance(c.storage, np.ndarray)]
    middle = {n: 0.5 * (a + b) for n, (a, b) in step.box.items()}
    M = np.asarray(step.M({n: middle[n] for n in step.M.names}), dtype=float)
    radius = float(np.abs(np.linalg.eigvals(M)).max())
    if radius < 1:
        P = scipy.linalg.solve_discrete_lyapunov(M.T / np.sqrt(radius or 1.0), np.eye(len(M)))
        P = 0.5 * (P + P.T)
        found.append(P / np.linalg.norm(P, 2))
    return found


def _largest_factor(step: OneStep, P: np.ndarray) -> float:
    """The largest |M e|_P / |e|_P met at vertices and inner points."""
    rng, names = np.random.default_rng(0), list(step.box)
    ends = np.array([step.box[n] for n in names]).reshape(-1, 2)
    points = np.where(rng.random((_LOOKS, len(names))) < 0.5, ends[:, 0], ends[:, 1])
    points[::2] = rng.uniform(ends[:, 0], ends[:, 1], size=points[::2].shape)
    worst = 0.0
    for point in points if names else points[:1]:
        at = dict(zip(names, point, strict=True))
        M = np.asarray(step.M({n: at[n] for n in step.M.names}), dtype=float)
        worst = max(worst, float(scipy.linalg.eigh(M.T @ P @ M, P, eigvals_only=True)[-1]))
    return float(np.sqrt(max(worst, 0.0)))


def _single(coefficient: Any) -> np.ndarray:
    return np.asarray(coefficient, dtype=np.float32).astype(float)
