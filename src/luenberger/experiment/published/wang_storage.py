"""How much a storage that moves with the scheduling buys: common P, P affine in (1/vx, ax/vx), and with a term in vx.

P = P0 + s P1 + s a P2 + P3 / s is no polynomial in s = 1/vx, but s P is, and s > 0; so every inequality is multiplied by s.
The rates are those of the car: s' = -s^2 a and a' the jerk.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import cvxpy as cp
import numpy as np

from luenberger.algebra import Polynomial, symmetric
from luenberger.algebra.definiteness import exact
from luenberger.certify.continuum import negative_definite
from luenberger.certify.inequality import exact_lift
from luenberger.core import Outcome
from luenberger.experiment.published.row import Row, judged
from luenberger.lmi import Bernstein, Block, Grid, Problem, Relaxation, centre
from luenberger.lmi.storage import affine_monomials, l2_storage, rounded_storage
from luenberger.systems import System
from luenberger.systems.error_system import ErrorSystem, Form, Lift
from luenberger.systems.jacobian_box import as_floats
from luenberger.vehicle import slip_angle_plant, wang_car

SPEED, ACCELERATION, JERK = (15 / 3.6, 150 / 3.6), (-8.0, 8.0), 10.0
# The gain of the well-posed H2 design with a constant L; the H-infinity level hardly depends on the gain.
GAIN = Polynomial.constant([[36.93], [-35.84]])
NO_GAIN = Polynomial.constant(np.zeros((2, 1)))
SPEED_NAME = "inverse_speed"
# `centre` gives away two percent of the squared level, one percent of the level.
BACK_OFF = np.sqrt(1.02)


@dataclass(frozen=True)
class Weighted:
    """s P(r) as a polynomial of the scheduling, with what it shows.

    Args:
        level: L2 gain found, after back-off.
        scaled: s P(r).
    """

    level: float
    scaled: Polynomial


def erring_car() -> System:
    """The car of the dissertation with speed and acceleration read up to 10 % and 20 % wrong, in the joint hull."""
    return slip_angle_plant(wang_car, SPEED, ACCELERATION, jerk=JERK, scale_error=((-0.1, 0.1), (-0.2, 0.2)))


def noisy_car() -> System:
    """The car with a unit disturbance on both states and noise of weight 0.2 on y."""
    return slip_angle_plant(wang_car, SPEED, ACCELERATION, jerk=JERK).replace(E=np.eye(2), G=[[0.2]])


def speed_weighted(
    system: System, gain: Polynomial, inputs: str, form: Form, relaxation: Relaxation
) -> Weighted | None:
    """Return the smallest L2 gain found with P affine in (s, s a) and a term in vx = 1/s; None where there is none.

    Args:
        system: slip-angle plant with a jerk bound.
        gain: L(r).
        inputs: channels of w joined by "+".
        form: which signal a scheduling error multiplies.
        relaxation: how the box is replaced by finitely many inequalities.
    """
    error = ErrorSystem.of(system, gain, form=form)
    parts = [cp.Variable((2, 2), symmetric=True, name=f"P{k}") for k in range(4)]
    squared = cp.Variable(nonneg=True, name="squared")
    storage, inequality = _inequalities(error, parts, inputs, squared)
    problem = Problem(
        {**{p.name(): p for p in parts}, "squared": squared},
        [
            Block("storage", storage, error.box, relaxation=relaxation),
            Block("l2_gain", inequality, error.box, relaxation=relaxation),
        ],
        squared,
    )
    found = centre(problem, back_off=0.02)
    if found is None:
        return None
    values = [rounded_storage(np.asarray(p.value)) for p in parts]
    return Weighted(float(np.sqrt(found.values["squared"])), _scaled(values))


def speed_weighted_outcome(system: System, gain: Polynomial, inputs: str, form: Form, found: Weighted) -> Outcome:
    """Prove or refute the level of a speed-weighted storage on the whole box, in exact rationals.

    Args:
        system: as in `speed_weighted`.
        gain: L(r).
        inputs: channels of w joined by "+".
        form: which signal a scheduling error multiplies.
        found: level and witness.
    """
    error = ErrorSystem.of(system, gain, exact_lift, form=form)
    parts = [exact(np.asarray(found.scaled.terms[key])) for key in _KEYS]
    level = exact(np.array([[found.level]]))[0, 0]
    total = Outcome.PROVED
    for matrix in _inequalities(error, parts, inputs, level * level, exact_lift):
        total = total & negative_definite(matrix, error.box).outcome
    return total


# s P0, s^2 P1, s^2 a P2 and P3 as exponents of (s, a).
_KEYS = ((1, 0), (2, 0), (2, 1), (0, 0))


def _scaled(parts: list) -> Polynomial:
    return Polynomial((SPEED_NAME, "acceleration"), dict(zip(_KEYS, parts, strict=True)))


def _inequalities(
    error: ErrorSystem, parts: list, inputs: str, squared: object, lift: Lift = as_floats
) -> tuple[Polynomial, Polynomial]:
    """-s P and s times the bounded-real matrix over the free parameters; both have to be negative definite."""
    names = (SPEED_NAME, "acceleration", "acceleration_rate")
    # s P' = s (s' P1 + (s a)' P2 + a P3), with s' = -s^2 a and (s a)' = s jerk - s^2 a^2.
    motion = Polynomial(names, {(3, 1, 0): -parts[1], (2, 0, 1): parts[2], (3, 2, 0): -parts[2], (1, 1, 0): parts[3]})
    s = lift(Polynomial((SPEED_NAME,), {(1,): np.ones((1, 1))}))
    Q = _scaled(parts)
    QA = Q @ error.A
    B = error.joined(inputs)
    corner = QA + QA.T + motion + error.eye(2) * s
    return -Q, symmetric([[corner, Q @ B], [-(error.eye(B.shape[1]) * s) * squared]])


def storage_rows() -> Iterator[Row]:
    """Rows of the comparison of storages, each level proved on the continuum or refuted with a point."""
    erring = erring_car()
    printed = {"the well-posed gain": (GAIN, 0.2217, 0.1482, 0.1252), "no gain": (NO_GAIN, 0.2240, 0.1498, 0.1264)}
    for name, (gain, common, affine, weighted) in printed.items():
        constant = l2_storage(erring, gain, np.eye(2), "scheduling", form="estimate")
        moving = l2_storage(
            erring,
            gain,
            np.eye(2),
            "scheduling",
            form="estimate",
            monomials=affine_monomials(erring),
            relaxation=Bernstein(parts=4),
        )
        best = speed_weighted(erring, gain, "scheduling", "estimate", Bernstein(parts=3))
        assert constant is not None
        assert moving is not None
        assert best is not None
        outcome = speed_weighted_outcome(erring, gain, "scheduling", "estimate", best)
        levels = [constant[0] / BACK_OFF, moving[0] / BACK_OFF, best.level / BACK_OFF]
        gap = max(abs(a - b) / b for a, b in zip(levels, (common, affine, weighted), strict=True))
        yield judged(
            f"robust H-infinity, joint hull, {name}: common P, affine P, affine P with a term in vx",
            "(3.43)",
            f"{common:.4f} / {affine:.4f} / {weighted:.4f}",
            " / ".join(f"{level:.4f}" for level in levels),
            f"Largest gap {100 * gap:.1f} %: those beside are of an independent implementation on a grid, ours hold on the whole box "
            f"(the last one {outcome.value} in exact rationals one percent above).",
            reproduced=gap <= 0.015 and outcome is Outcome.PROVED,
            deviation=max(abs(a - b) for a, b in zip(levels, (common, affine, weighted), strict=True)),
        )
    yield _lie()


def _lie() -> Row:
    """A level claimed on a coarse grid, against the whole box."""
    noisy, gain = noisy_car(), Polynomial.constant([[5.0], [-5.0]])
    coarse = speed_weighted(noisy, gain, "both", "plant", Grid(2))
    honest = speed_weighted(noisy, gain, "both", "plant", Bernstein(parts=3))
    assert coarse is not None
    assert honest is not None
    outcomes = [speed_weighted_outcome(noisy, gain, "both", "plant", found) for found in (coarse, honest)]
    return judged(
        "a coarse grid with a term in vx (unit disturbance, noise 0.2): claimed, and true",
        "(3.43)",
        "0.2614 claimed, 0.3226 true",
        f"{coarse.level:.4f} claimed ({outcomes[0].value}), {honest.level:.4f} {outcomes[1].value}",
        "Same effect with the gain (5, -5): between the grid points the storage is free, so the claim is refuted with a point. "
        "The gain of the printed pair is not stated.",
        reproduced=False,
        corrected=outcomes == [Outcome.REFUTED, Outcome.PROVED],
    )
