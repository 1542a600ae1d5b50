"""What a sampled observer does to its error in one step, as an exact polynomial, and the proof that it contracts.

A certificate of a continuous design speaks of a differential equation; code runs a map, x+ = psi(x, u, y, r). For two states of that
map under the same signals the difference obeys e+ = M e, where M is built from the closed loop A - L C + F J H (I - L2 C) at the stages
of the integration, each with a Jacobian J of its own inside the declared box (mean value theorem, stage by stage). Proved is

    M' P M < level^2 P      for every scheduling vector in the box and all Jacobians,

written as a matrix linear in M. So the sampled observer forgets its start by the factor `level` a step in the norm of P; and where the
sampled plant obeys x+ = psi(x, u, C x + D u, r) + s, the error ends below sup |s|_P / (1 - level).
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from luenberger.algebra import Polynomial, symmetric
from luenberger.algebra.definiteness import exact
from luenberger.certify.continuum import Verdict, negative_definite
from luenberger.certify.inequality import exact_lift
from luenberger.core import BadInput, NotAccepted
from luenberger.core.checks import nearest
from luenberger.systems import Nonlinearity, Parameter, System
from luenberger.systems.error_system import ErrorSystem
from luenberger.systems.jacobian_box import error_box

SCHEMES = ("map", "rk4", "exact")


@dataclass(frozen=True)
class Sampling:
    """How a step of an observer is carried out.

    Args:
        scheme: "map" of a discrete plant, "rk4" or "exact", see `CorrectionObserver`.
        dt: sample time [s].
        parts: equal parts of the step, each carried out by the scheme.
        degree: Taylor degree of the exponential under "exact", of which the parts are then the halvings.

    Raises:
        BadInput: an unknown scheme, or numbers out of range.
    """

    scheme: str
    dt: float
    parts: int = 1
    degree: int = 0

    def __post_init__(self) -> None:
        if self.scheme not in SCHEMES:
            raise BadInput(f"`scheme` is `{self.scheme}`.{nearest(self.scheme, SCHEMES)}")
        if not (np.isfinite(self.dt) and self.dt > 0) or self.parts < 1 or (self.scheme == "exact" and self.degree < 1):
            raise BadInput(f"{self} is no sampling; a positive step, at least one part and degree one are needed.")


@dataclass(frozen=True)
class OneStep:
    """The map of the error over one part of a step.

    Args:
        M: exact polynomial, shape (nx, nx).
        box: name -> interval of its parameters.
    """

    M: Polynomial
    box: dict[str, tuple[float, float]]

    @staticmethod
    def of(
        system: System,
        gain: Polynomial,
        sampling: Sampling,
        argument_gain: Polynomial | None = None,
        lift: Any = exact_lift,
    ) -> "OneStep":
        """Build the map of one part.

        Args:
            system: plant that the observer copies.
            gain: L(r).
            sampling: how a step is carried out.
            argument_gain: L2(r), None for zero.
            lift: arithmetic; exact rationals for proofs.

        Raises:
            NotAccepted: matrices as functions, or a nonlinearity held over several parts of an exponential.
        """
        plant = _as_read(system)
        if sampling.scheme == "exact" and sampling.parts > 1 and plant.nonlinearity is not None:
            # f is held over the whole step, so the parts are no map of their own.
            raise NotAccepted(
                f"`{plant.name}` is advanced by an exponential in {sampling.parts} parts with f held over all of them; only one part has a "
                'map that is written here. Take a shorter step, or method="rk4".'
            )
        error = ErrorSystem.of(plant, gain, lift, argument_gain=argument_gain)
        h = (
            _number(sampling.dt, lift) * _number(1, lift) / sampling.parts
            if lift is exact_lift
            else sampling.dt / sampling.parts
        )
        eye = error.eye(plant.nx)
        if sampling.scheme == "map":
            return OneStep(error.A, error_box(plant))
        if sampling.scheme == "rk4":
            stages = [_renamed(error.A, plant, k) for k in range(4)]
            k1 = stages[0]
            k2 = stages[1] @ (eye + k1 * (h / 2))
            k3 = stages[2] @ (eye + k2 * (h / 2))
            k4 = stages[3] @ (eye + k3 * h)
            M = eye + (k1 + k2 * 2 + k3 * 2 + k4) * (h / 6)
            return OneStep(M, _staged(plant, 4))
        bare = ErrorSystem.of(_linear(plant), gain, lift).A
        # phi(Z) = (e^Z - 1) / Z up to the degree, as the observer evaluates it: x + h phi(h (A - L C)) (loop x).
        phi = eye
        for k in range(sampling.degree, 1, -1):
            phi = eye + bare @ phi * (h / k)
        return OneStep(eye + phi @ error.A * h, error_box(plant))


def sampled_decay_verdict(
    system: System,
    gain: Polynomial,
    sampling: Sampling,
    level: float,
    storage: np.ndarray,
    *,
    argument_gain: Polynomial | None = None,
    pieces: int = 400,
) -> tuple[str, Verdict]:
    """Decide whether a sampled observer forgets its start by a factor a step.

    Args:
        system: plant that the observer copies; its box is where the scheduling is clipped to.
        gain: L(r), its doubles taken as they are.
        sampling: how a step is carried out.
        level: claimed factor over the whole step.
        storage: P, (nx, nx).
        argument_gain: L2(r), None for zero.
        pieces: effort.

    Returns:
        what failed ("" where nothing did), and the verdict.

    Raises:
        BadInput: a level of one and more, which is no decay.
        NotAccepted: matrices as functions, or unmeasured parameters.
    """
    if not 0 <= level < 1:
        raise BadInput(f"`level` is {level}; a factor a step in [0, 1) is needed.")
    P = exact(np.asarray(storage, dtype=float))
    verdict = negative_definite(Polynomial.constant(-P), {})
    if verdict.outcome.value != "proved":
        return "storage", verdict
    step = OneStep.of(system, gain, sampling, argument_gain)
    # The part's factor, rounded down, so that its power stays below the level.
    part = exact(np.nextafter(level ** (1 / sampling.parts), 0.0))[()] if sampling.parts > 1 else exact(level)[()]
    lifted = Polynomial.constant(P)
    matrix = symmetric([[-(lifted * (part * part)), step.M.T @ lifted], [-lifted]])
    return "sampled_decay", negative_definite(matrix, step.box, pieces=pieces)


def _as_read(system: System) -> System:
    """The plant at the scheduling that the observer reads, a Lipschitz bound as a box of the Jacobian."""
    if system.uncertainty:
        system = system.freeze(**system.uncertainty)
    parameters = [Parameter(p.name, p.lower, p.upper, p.unit) for p in system.parameters]
    changes: dict[str, Any] = {"parameters": parameters, "scheduling_error": None}
    f = system.nonlinearity
    if f is not None and f.jacobian_lower is None:
        g = np.full((f.size, f.H.shape[0]), f.lipschitz_bound)
        changes["nonlinearity"] = Nonlinearity.bounded(f.function, f.H, size=f.size, jacobian=(-g, g))
    return system.replace(**changes)


def _linear(plant: System) -> System:
    return plant.replace(F=None, nonlinearity=None)


def _entries(plant: System) -> list[str]:
    return [n for n in error_box(plant) if n not in plant.scheduling_names]


def _renamed(loop: Polynomial, plant: System, stage: int) -> Polynomial:
    """The loop with Jacobian entries of its own."""
    entries = {n: f"{n} at stage {stage + 1}" for n in _entries(plant)}
    return Polynomial(tuple(entries.get(n, n) for n in loop.names), loop.terms)


def _staged(plant: System, stages: int) -> dict[str, tuple[float, float]]:
    box, entries = error_box(plant), _entries(plant)
    found = {n: i for n, i in box.items() if n not in entries}
    return found | {f"{n} at stage {k + 1}": box[n] for n in entries for k in range(stages)}


def _number(value: float, lift: Callable[..., Any]) -> Any:
    if lift is not exact_lift:
        return value
    return exact(float(value))[()]
