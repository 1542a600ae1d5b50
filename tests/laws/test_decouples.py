"""Law: an unknown input reaches neither error nor set of an observer that decouples it, whatever the modes and the parameters do.

The error is that of the printed recursion, written out here; the set is that of the observer which a design hands out.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from catalogue import SWITCHED_ROWS, Row
from discrete_drives import Motion, at_modes, chosen, drawn, moved, reported, times, worst
from luenberger.certify import SwitchedClaim
from luenberger.design import SwitchedDesign
from luenberger.observers import UnknownInputObserver
from luenberger.systems import Switched

RUNS, STEPS = 48, 100
# Sums of some ten terms of size 10, rounded in a contracting loop.
ROUNDING = 1e-12


@pytest.fixture(params=SWITCHED_ROWS, ids=lambda row: row.name)
def row(request: pytest.FixtureRequest) -> Row:
    return request.param


@cache
def motion(row: Row, told: str = "all", free: float = 1e3) -> Motion:
    """The plant of a row in random drives; "quiet" without noise and with parameters at their middle."""
    plant = Switched.of(row.system())
    if told == "quiet":
        modes = [m.freeze(**m.uncertainty).replace(noise_bound=[0.0] * m.nv) for m in plant.modes]
        plant = replace(plant, modes=tuple(modes))
    half = np.array(row.options["initial_half_width"])
    return moved(plant, drawn(plant.first, RUNS, STEPS, 3), half, 4, row.drive, free)


def errors(design: SwitchedDesign, ran: Motion) -> tuple[np.ndarray, np.ndarray]:
    """e_k = x_k - xh_k of the printed recursion from xh_0 = 0, and what drives it, w_k = e_(k+1) - N e_k."""
    plant, kept, driven = design.system, [], []
    guess = np.zeros_like(ran.x[:, 0])
    for k in range(ran.x.shape[1]):
        mode, r = ran.mode[:, k], ran.r[:, k]
        e = ran.x[:, k] - guess
        kept.append(e)
        if k > 0:
            driven.append(e - times(N, kept[-2]))
        if k + 1 == ran.x.shape[1]:
            break
        A, B, C = (at_modes(plant, letter, mode, r) for letter in "ABC")
        K, H = (chosen(gains, plant, mode, r) for gains in (design.gains, design.decoupling))
        P = np.eye(plant.first.nx) + H @ C
        N = P @ A - K @ C
        fed = times(K, ran.y[:, k]) + times(P @ B, ran.u[:, k]) - times(H, ran.y[:, k + 1])
        guess = times(N, guess) + fed
    return np.stack(kept, axis=1), np.stack(driven, axis=1)


def stability(design: SwitchedDesign) -> SwitchedClaim:
    return next(c for c in design.certificate.claims if c.kind == "iss")


def stored(claim: SwitchedClaim, e: np.ndarray, mode: np.ndarray) -> np.ndarray:
    """V of the mode at every sample."""
    Q = np.stack([np.asarray(q) for q in claim.storages])
    return np.einsum("...i,...ij,...j->...", e, Q[np.minimum(mode, len(Q) - 1)], e)


def test_the_error_falls_at_least_as_fast_as_claimed(design: SwitchedDesign, row: Row) -> None:
    claim, ran = stability(design), motion(row, "quiet")
    e, w = errors(design, ran)
    # An unknown input of any size cancels up to the rounding of what it does to state and output.
    room = 1e-12 * np.abs(ran.x).max()
    assert np.abs(w).max() <= room
    V = stored(claim, e, ran.mode)
    grown = np.where(ran.mode[:, 1:] == ran.mode[:, :-1], 1.0, claim.growth)
    assert (V[:, 1:] <= grown * (1 - claim.fade) * V[:, :-1] + room * (1 + np.sqrt(V[:, :-1])) * 100).all()
    assert (np.abs(e[:, -1]).max() < 1e-6 * np.abs(e[:, 0]).max()) or claim.fade < 0.13


def test_no_drive_exceeds_the_bounds_of_the_error(design: SwitchedDesign, row: Row) -> None:
    claim, ran = stability(design), motion(row)
    e, w = errors(design, ran)
    assert np.abs(w).max() > 1e-4
    V, size = stored(claim, e, ran.mode), (w**2).sum(axis=-1)
    if claim.growth == 1.0:
        assert (V[:, 1:] <= ((1 - claim.fade) * V[:, :-1] + claim.supply * size) * (1 + 1e-9)).all()
    worst = np.sqrt(size).max(axis=1)
    late = np.linalg.norm(e[:, STEPS // 2 :], axis=-1).max(axis=1)
    assert (late <= claim.level * worst * (1 + 1e-9)).all()


def test_no_drive_leaves_the_set(design: SwitchedDesign, row: Row) -> None:
    ran = motion(row)
    estimate = reported(design.observer(**row.options), ran)
    low, high = np.asarray(estimate.lower), np.asarray(estimate.upper)
    assert np.maximum(low - ran.x, ran.x - high).max() <= ROUNDING * np.abs(ran.x).max()
    width = high - low
    # A set that grew without end would hold the state too.
    assert width[:, -1].max() < 3 * width[:, STEPS // 2].max()


def test_the_estimate_does_not_feel_the_unknown_input(design: SwitchedDesign, row: Row) -> None:
    near, far = (motion(row, "quiet", free) for free in (0.0, 1e5))
    observer = design.observer(**row.options)
    centers = [np.asarray(reported(observer, ran).x) - ran.x for ran in (near, far)]
    np.testing.assert_allclose(*centers, atol=1e-12 * np.abs(far.x).max())


@pytest.mark.parametrize("forgotten", ["noise", "parameters"])
def test_what_is_not_told_loses_the_state(design: SwitchedDesign, row: Row, forgotten: str) -> None:
    ran = motion(row)
    told = [
        m.replace(noise_bound=[0.1 * b for b in m.noise_bound]) if forgotten == "noise" else m.freeze(**m.uncertainty)
        for m in design.system.modes
    ]
    observer = replace(design, system=replace(design.system, modes=tuple(told))).observer(**row.options)
    estimate = reported(observer, ran)
    gap = np.maximum(np.asarray(estimate.lower) - ran.x, ran.x - np.asarray(estimate.upper))
    assert gap.max() > 1e-3


def test_without_reduction_the_set_is_what_noise_can_do(design: SwitchedDesign, row: Row) -> None:
    # One mode at rest, nothing uncertain: the worst noise for a state drives it to the end of the set, and no further.
    last = design.system.modes[-1]
    values = {p.name: 0.5 * (p.lower + p.upper) for p in last.parameters}
    plant = last.freeze(**values)
    A, B, C, G, Nu = (np.asarray(plant.at(letter)) for letter in "ABCGN")
    K = np.asarray(design.gains[-1]({n: values[n] for n in design.gains[-1].names}))
    H, vbar = np.asarray(design.decoupling[-1]({})), np.array(plant.noise_bound)
    P = np.eye(plant.nx) + H @ C
    N = P @ A - K @ C
    drive = np.hstack([np.zeros((plant.nx, plant.nd)), (N @ H @ G - K @ G - P @ B @ Nu) * vbar])
    unknown = worst((N, drive, np.eye(plant.nx), H @ G * vbar), plant, STEPS)
    gusts = np.random.default_rng(8).uniform(-1e3, 1e3, unknown.disturbance.shape)
    ran = moved(plant, replace(unknown, disturbance=gusts), np.zeros(plant.nx), 0, row.drive)
    observer = UnknownInputObserver(plant, [K], [H], initial_half_width=np.zeros(plant.nx), count=400)
    estimate = reported(observer, ran)
    states = np.arange(plant.nx)
    reached = np.abs(ran.x - np.asarray(estimate.x))[states, -1, states]
    half = 0.5 * np.asarray(estimate.upper - estimate.lower)[0, -1]
    # Loops forget by a third a step and more; rounding of states of size ten is the rest.
    np.testing.assert_allclose(reached, half, rtol=1e-9)
