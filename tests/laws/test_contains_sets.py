"""Law: a set that is drawn around the estimate of a discrete plant never loses the state, and claimed boxes are what an adversary reaches.

Every discrete row of the catalogue is driven from the volume and the vertices of all that is unknown, and by the drive that is worst
for each state. A set that is told bounds one percent too small has to lose the state; otherwise the law would test nothing.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from catalogue import ROWS, Row
from discrete_drives import Motion, drawn, moved, reported, textbook, worst
from luenberger.certify import Claim
from luenberger.design import Design
from luenberger.methods import KalmanGain

RUNS, STEPS = 64, 80
# Sums of some hundred terms near one, rounded in a contracting loop.
ROUNDING = 1e-12
DISCRETE = [row for row in ROWS if row.system().dt is not None]
SETS = [row for row in DISCRETE if "initial_half_width" in row.options]
BOXED = [row for row in DISCRETE if not isinstance(row.method, KalmanGain)]
each = pytest.mark.parametrize


def violation(motion: Motion, estimate: object) -> float:
    """By how much the worst state is outside of its bounds."""
    low, high = np.asarray(estimate.lower), np.asarray(estimate.upper)  # type: ignore[attr-defined]
    return float(np.maximum(low - motion.x, motion.x - high).max())


@each("row", SETS, ids=lambda row: row.name)
def test_no_drive_leaves_the_set(design: Design, row: Row) -> None:
    system = design.system
    half = np.array(row.options["initial_half_width"])
    motion = moved(system, drawn(system, RUNS, STEPS, 1), half, 2, row.drive)
    estimate = reported(design.observer(**row.options), motion)
    assert violation(motion, estimate) <= ROUNDING
    # A set that grew without end would hold the state too.
    width = np.asarray(estimate.upper - estimate.lower)
    assert width[:, STEPS // 2 :].max() < 3 * width[:, STEPS // 4 : STEPS // 2].max()
    assert width[:, -1].max() < 20


def boxes(design: Design) -> list[Claim]:
    return [c for c in design.certificate.claims if c.kind in ("steady_box", "filter_box")]


@cache
def adversary(design: Design, kind: str) -> Motion:
    system = design.system
    return moved(system, worst(textbook(design, kind == "filter_box"), system, STEPS), np.zeros(system.nx), 0)


@each("row", BOXED, ids=lambda row: row.name)
def test_claimed_boxes_are_reached_and_never_left(design: Design, row: Row) -> None:
    assert boxes(design)
    for claim in boxes(design):
        filtered = claim.kind == "filter_box"
        # What is claimed of the prediction is about the point observer where the design is a filter.
        observer = design.observer(**row.options) if filtered or design.filter_gain is None else design.observer()
        motion = adversary(design, claim.kind)
        errors = np.abs(motion.x - np.asarray(reported(observer, motion).x))
        box = np.asarray(claim.vector)
        assert (errors <= box + ROUNDING).all()
        reached = errors[np.arange(len(box)), -1, np.arange(len(box))]
        # Loops of factors up to 0.71 a step leave 1e-12 of the sum after 80 steps; a millionth of the box was added to prove it.
        assert (reached >= box * (1 - 1e-5)).all()


@each("row", [row for row in SETS if row in BOXED and row.system().ny == 1], ids=lambda row: row.name)
def test_bounds_that_are_too_small_lose_the_state(design: Design) -> None:
    motion, system = adversary(design, boxes(design)[-1].kind), design.system
    told = system.replace(
        disturbance_bound=[0.99 * b for b in system.disturbance_bound or ()],
        noise_bound=[0.99 * b for b in system.noise_bound or ()],
    )
    # Nothing is reduced, so that the set is exactly what can be reached.
    observer = replace(design, system=told).observer(initial_half_width=[0.0] * system.nx, count=400)
    assert violation(motion, reported(observer, motion)) > 1e-4
