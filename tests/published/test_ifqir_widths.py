"""Widths and containment of the corrected recursions, beside the same recursions written in plain loops."""

import numpy as np
import pytest

from luenberger.experiment.published.ifqir_car import (
    INPUT_ERROR,
    NOISE,
    SHARE,
    SPEEDS,
    START,
    STATE_BOUND,
    STEP,
    Axles,
    switched,
)
from luenberger.experiment.published.ifqir_drive import cars, choices, drive
from luenberger.experiment.published.ifqir_estimates import point_estimates, printed_left, runs
from luenberger.experiment.published.ifqir_runs import VARIANTS, Enclosure, enclosed, observer, variant_enclosure
from luenberger.experiment.published.ifqir_widths import exact_hull, scheduled_enclosure
from luenberger.vehicle.cars import gust_car

EXPECTED = {"c0": 1.530, "c1": 0.852, "c2": 0.686, "c3": 0.637, "c4": 0.177}


def plain(variant: str, steering_error: float = 0.0) -> np.ndarray:
    """Half widths of the lateral speed, (runs, nt), in plain loops: N = diag(z, 0), so the hull obeys a scalar recursion."""
    uncertainty, reuse, closed = VARIANTS[variant]
    road, found = runs(steering_error)
    estimate = point_estimates(road, found)
    stiffness = SHARE * STEP * np.array([gust_car.front_stiffness, gust_car.rear_stiffness])
    # `own` is the half width without the noise of the last output where noise is counted once, with it otherwise.
    own, fresh, listed = np.full(len(estimate), START), 0.0, []
    K_of_H = 0.0
    for k in range(len(road.time)):
        car = Axles.at(float(road.local[k]))
        seen, B = car.decoupled(STEP), car.sampled(STEP)[1]
        half = own + fresh
        listed.append(half)
        u = road.steering[k]
        low, high = np.tile(-STATE_BOUND, (len(half), 1)), np.tile(STATE_BOUND, (len(half), 1))
        if closed:
            yaw = START if k == 0 else NOISE
            around = np.stack([half, np.full_like(half, yaw)], axis=1)
            low, high = np.maximum(low, estimate[:, k] - around), np.minimum(high, estimate[:, k] + around)
        middle, radius = 0.5 * (low + high), 0.5 * (high - low)
        if uncertainty == "structured":
            front = np.abs(middle @ car.slips[0] + u) + radius @ np.abs(car.slips[0]) + steering_error
            rear = np.abs(middle @ car.slips[1]) + radius @ np.abs(car.slips[1])
            pushed = np.abs((seen.P @ car.directions)[0]) @ (stiffness * np.stack([front, rear], axis=1)).T
        else:
            factor = 2.0 if uncertainty == "lemma" else 1.0
            entries = factor * (np.abs(car.directions) * stiffness) @ np.abs(car.slips) @ STATE_BOUND
            largest = abs(u) + steering_error
            if uncertainty == "lemma":
                largest = max(u + steering_error, 0.0) + max(-(u - steering_error), 0.0)
            entries = entries + np.abs(car.directions[:, 0]) * stiffness[0] * largest
            pushed = np.full_like(half, np.abs(seen.P[0]) @ entries)
        pushed = pushed + abs((seen.P @ B)[0, 0]) * steering_error
        z, H, K = abs(seen.zero), abs(seen.H[0, 0]) * NOISE, abs(seen.K[0, 0]) * NOISE
        if reuse:
            K_of_H = abs((seen.N @ seen.H * (k > 0) - seen.K)[0, 0]) * NOISE
            own, fresh = z * own + K_of_H + pushed, H
        else:
            own, fresh = z * half + K + H + pushed, 0.0
    return np.array(listed).T


@pytest.fixture(scope="module")
def found() -> dict[str, Enclosure]:
    return {name: variant_enclosure(name) for name in VARIANTS}


def test_widths_of_all_recursions(found: dict[str, Enclosure]) -> None:
    widths = {name: e.width for name, e in found.items()}
    # Another drive gave the expected widths; 3 % is what drives of this kind differ by.
    assert widths == pytest.approx(EXPECTED, rel=0.03)
    assert widths["c0"] > widths["c1"] > widths["c2"] > widths["c3"] > widths["c4"]
    assert widths["c4"] <= 0.18


def test_nobody_leaves_the_bounds(found: dict[str, Enclosure]) -> None:
    states = runs()[1].states
    assert len(states) == 52
    for name, enclosure in found.items():
        assert not enclosure.left(states).any(), name
    # The adversaries come near, so what is contained is not just wide.
    assert 0.9 <= found["c4"].reach(states) <= 1.0


@pytest.mark.parametrize("variant", list(VARIANTS))
def test_the_observer_is_the_recursion_in_plain_loops(found: dict[str, Enclosure], variant: str) -> None:
    enclosure = found[variant]
    half = 0.5 * (enclosure.upper - enclosure.lower)[..., 0]
    road, cars_ = runs()
    # Same arithmetic in another order, over 500 steps; 1e-9 m/s is a millionth of a percent of the width.
    assert np.abs(half - plain(variant)).max() < 1e-9
    assert np.abs(enclosure.estimate - point_estimates(road, cars_)).max() < 1e-9


def test_an_input_error_needs_its_generator() -> None:
    road, cars_ = runs(INPUT_ERROR)
    enclosure = variant_enclosure("c4", INPUT_ERROR)
    assert not enclosure.left(cars_.states).any()
    # 3 % as above.
    assert enclosure.width == pytest.approx(0.393, rel=0.03)
    blind = enclosed(observer("c4"), cars_, road.speed[:, None])
    assert blind.left(cars_.states).any()


@pytest.mark.parametrize(("share", "least"), [(0.02, 10), (0.01, 30)])
def test_the_printed_recursion_is_left_where_noise_outweighs_uncertainty(share: float, least: int) -> None:
    # Another drive gave 16 and 36 of 42 runs; how many it is depends on the drive, that it is many does not.
    noise = 0.02
    outside, count, _ = printed_left(share, noise)
    assert count == 52
    assert outside >= least
    road = drive()
    cars_ = cars(road, choices(), share=share, noise=noise)
    corrected = enclosed(observer("c0", share=share, noise=noise), cars_, road.speed[:, None])
    assert not corrected.left(cars_.states).any()


def test_speed_that_varies_within_a_mode() -> None:
    road, cars_ = runs(varying=True)
    constant = enclosed(observer("c4"), cars_, road.speed[:, None])
    assert constant.left(cars_.states).all()
    scheduled, states = scheduled_enclosure()
    assert not scheduled.left(states).any()
    # The speeds of the drive that gave 0.1754 m/s are not known: the width goes with them.
    assert scheduled.width == pytest.approx(0.1754, rel=0.15)


def test_the_exact_set_is_inside_the_recursion() -> None:
    road = drive()
    exact = exact_hull(road, 0, steps=2)
    enclosure = variant_enclosure("c4")
    width = (enclosure.upper - enclosure.lower)[0, 2, 0]
    assert 0.5 * width < exact <= width


def test_speeds_of_the_modes_are_those_of_the_plant() -> None:
    for v, mode in zip(SPEEDS, switched().modes, strict=True):
        assert np.allclose(np.asarray(mode.at("E")), Axles.at(v).sampled(STEP)[2])
