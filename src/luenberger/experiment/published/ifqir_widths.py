"""What becomes of the bounds of Ifqir et al. 2020 once corrected: five recursions on one drive, the exact set, varying speed."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import product

import numpy as np

from luenberger.algebra import Polynomial
from luenberger.experiment.published.ifqir_car import (
    ENDS,
    INPUT_ERROR,
    NOISE,
    SHARE,
    SPEEDS,
    START,
    STATE_BOUND,
    STEP,
    Axles,
    scheduled,
)
from luenberger.experiment.published.ifqir_drive import Choices, Drive, cars, choices, drive
from luenberger.experiment.published.ifqir_estimates import point_estimates, printed_left, runs
from luenberger.experiment.published.ifqir_runs import VARIANTS, WORDS, Enclosure, enclosed, observer, variant_enclosure
from luenberger.experiment.published.row import INDEPENDENT, Row, judged
from luenberger.observers.unknown_input import UnknownInputObserver
from luenberger.systems import Switched, System
from luenberger.vehicle.cars import gust_car

# Mean widths of another implementation on a drive of its own [m/s].
EXPECTED = {"c0": 1.530, "c1": 0.852, "c2": 0.686, "c3": 0.637, "c4": 0.177}
EXPECTED_INPUT = {"c0": 1.715, "c1": 1.035, "c2": 0.853, "c3": 0.804, "c4": 0.393}
_SHARE_APART = 0.03
_VARYING_APART = 0.15
SPEED_ERROR = 0.2
# Parts of the speeds where the speed is read with an error.
RANGES = 8
# Noise that outweighs a small uncertainty [rad/s].
NOISY = 0.02
# First sample of the four steps of which the exact set is found.
_CORNER = 217


def width_rows() -> Iterator[Row]:
    """Rows of the corrected recursions."""
    for name in VARIANTS:
        yield _variant(name, 0.0, EXPECTED[name])
    for name in VARIANTS:
        yield _variant(name, INPUT_ERROR, EXPECTED_INPUT[name])
    for share in (0.02, 0.01):
        yield _left(share)
    yield _input_error()
    yield _tight()
    yield _without_box()
    yield _exact_hull()
    yield _mode_constant()
    yield _scheduled(0.0, 0.1754)
    yield _scheduled(SPEED_ERROR, 0.2099)


def _variant(name: str, error: float, expected: float) -> Row:
    found, states = variant_enclosure(name, error), runs(error)[1].states
    left = int(found.left(states).sum())
    holds = left == 0 and abs(found.width / expected - 1) < _SHARE_APART
    return judged(
        f"Mean width of the bounds of v_y, {name} ({WORDS[name]}), {'u ± 0.01' if error else 'u exact'}",
        f"(33) to (37), {INDEPENDENT}",
        f"{expected:.3f} m/s",
        f"{found.width:.3f} m/s; left on {left} of {len(states)} runs",
        f"`UnknownInputObserver`, uncertainty {VARIANTS[name][0]!r}, reuse_noise {VARIANTS[name][1]}, closed_loop {VARIANTS[name][2]}. The admissible "
        f"box alone is {2 * STATE_BOUND[0]:g} m/s wide. The drive is ours; 3 % is asked.",
        reproduced=holds,
        deviation=abs(found.width - expected),
    )


def _left(share: float) -> Row:
    outside, count, width = printed_left(share, NOISY)
    road = drive()
    found = cars(road, choices(), share=share, noise=NOISY)
    bounds = enclosed(observer("c0", share=share, noise=NOISY), found, road.speed[:, None])
    held = int(bounds.left(found.states).sum())
    return judged(
        f"Containment by the recursion as printed, stiffness ±{100 * share:g} %, noise {NOISY:g} rad/s",
        "(34), (36), (13)",
        '"in a guaranteed way"',
        f"left on {outside} of {count} runs (mean width {width:.3f} m/s); corrected (c0) on {held} ({bounds.width:.3f} m/s)",
        'Where noise outweighs uncertainty the spare room is gone. So are "no false alarms": the residual leaves the threshold without any fault.',
        reproduced=outside == 0,
        corrected=held == 0,
        deviation=outside / count,
    )


def _input_error() -> Row:
    """Runs whose steering is read wrongly, under an observer that believes it."""
    road, found = runs(INPUT_ERROR)
    believing = (observer("c4"), observer("c4", steering_error=INPUT_ERROR))
    left = [int(enclosed(one, found, road.speed[:, None]).left(found.states).sum()) for one in believing]
    seen = Axles.at(SPEEDS[-1])
    size = abs(float((seen.decoupled(STEP).P @ seen.sampled(STEP)[1])[0, 0])) * INPUT_ERROR
    return judged(
        "Input known within 0.01",
        "Assumption 4, section 5.2",
        "u ± 0.01 in dB u alone",
        f"a generator P B0 0.01 of {size:.3f} m/s a step is needed as well: without it left on {left[0]} of {len(found.states)} runs, with it on {left[1]}",
        "If the true angle differs from the measured one, B0 u differs too, not only its uncertain part.",
        reproduced=left[0] == 0,
        corrected=left[1] == 0,
        deviation=left[0] / len(found.states),
    )


def _tight() -> Row:
    reach = variant_enclosure("c4").reach(runs()[1].states)
    return judged(
        "How near an adversary comes to the bounds of c4",
        f"(13), {INDEPENDENT}",
        "0.95",
        f"{reach:.3f} of the half width",
        "Stiffness and noise that push the error furthest at every step, from either side. What is left bounds what better sets could gain.",
        reproduced=0.9 <= reach <= 1,
        deviation=abs(reach - 0.95),
    )


def _without_box() -> Row:
    """c4 with nothing known of the state but where it started."""
    road, found = runs()
    free = enclosed(observer("c4", bounded=False), found, road.speed[:, None])
    bound, left = variant_enclosure("c4").width, int(free.left(found.states).sum())
    radius = max(_feedback(v) for v in SPEEDS)
    return judged(
        "Whether the admissible states are needed",
        f"Assumption 4, {INDEPENDENT}",
        "needed; width 0.1768 m/s with and without",
        f"c4 without them {free.width:.4f} m/s, with them {bound:.4f} m/s; left on {left} of {len(found.states)} runs",
        f"Once the state is bounded by the estimate, the set bounds itself: |N| and what the uncertainty makes of the width of the set have the "
        f"spectral radius {radius:.3f} < 1. One assumption less that a drive could break.",
        reproduced=False,
        corrected=left == 0 and free.width < 1.01 * bound and radius < 1,
        deviation=abs(free.width - bound),
    )


def _feedback(speed: float) -> float:
    """Spectral radius of |N| + |P directions| radii |slips|."""
    car, seen = Axles.at(speed), Axles.at(speed).decoupled(STEP)
    radii = SHARE * STEP * np.array([gust_car.front_stiffness, gust_car.rear_stiffness])
    grown = np.abs(seen.N) + (np.abs(seen.P @ car.directions) * radii) @ np.abs(car.slips)
    return float(np.abs(np.linalg.eigvals(grown)).max())


def exact_hull(road: Drive, first: int, steps: int = 4) -> float:
    """Return the exact width of the errors of the lateral speed after some steps with wind and steering known [m/s].

    The error is affine in each unknown while the others stay, so its extremes lie at vertices: two of the start, two
    stiffnesses a step, a noise a sample.

    Args:
        road: what driver and wind do.
        first: sample at which the steps begin.
        steps: number of steps.
    """
    count = 2 + 2 * steps + steps + 1
    corners = np.array(list(product((-1.0, 1.0), repeat=count)))
    part = Drive(
        *(getattr(road, n)[first : first + steps + 1] for n in ("time", "speed", "mode", "local", "steering", "gust"))
    )
    stiffness = corners[:, 2 : 2 + 2 * steps].reshape(len(corners), steps, 2)
    noise = corners[:, 2 + 2 * steps :]
    stiffness = np.concatenate([stiffness, np.zeros((len(corners), 1, 2))], axis=1)
    unknown = Choices(
        corners[:, :2],
        stiffness.swapaxes(0, 1),
        np.stack([noise, np.zeros_like(noise)], axis=-1).swapaxes(0, 1),
        np.zeros(len(corners)),
        np.zeros(len(corners), dtype=bool),
    )
    found = cars(part, unknown)
    errors = found.states - point_estimates(part, found)
    return float(np.ptp(errors[:, -1, 0]))


def _exact_hull() -> Row:
    """Four steps in the middle mode, where steering is largest."""
    road, steps = drive(), 4
    exact = exact_hull(road, _CORNER, steps)
    part = slice(_CORNER, _CORNER + steps + 1)
    none = np.zeros((steps + 1, 1, 2))
    quiet = Choices(np.zeros((1, 2)), none, none, np.zeros(1), np.zeros(1, dtype=bool))
    part_road = Drive(*(getattr(road, n)[part] for n in ("time", "speed", "mode", "local", "steering", "gust")))
    found = cars(part_road, quiet)
    bounds = enclosed(observer("c4"), found, part_road.speed[:, None])
    ours = float((bounds.upper - bounds.lower)[0, -1, 0])
    return judged(
        "Exact set of errors after four steps",
        f"(37), {INDEPENDENT}",
        "0.1396 m/s; recursion 0.165 m/s",
        f"{exact:.4f} m/s from 32 768 vertices with the wind known; c4 {ours:.4f} m/s without knowing it",
        f"From the box of {START:g} around rest, at t = {road.time[_CORNER]:.2f} s of our drive, stiffness ±{100 * SHARE:g} % and noise {NOISE:g} rad/s. "
        "The recursion takes the worst state in its box at every step, so some of the difference cannot be had without the wind.",
        reproduced=exact <= ours <= 1.3 * exact,
        deviation=abs(exact - 0.1396),
    )


def _mode_constant() -> Row:
    """Cars whose speed follows the measured one, under the observer that takes it as constant within a mode."""
    road, found = runs(varying=True)
    bounds = enclosed(observer("c4"), found, road.speed[:, None])
    left = int(bounds.left(found.states).sum())
    rms = float(np.sqrt(np.mean((bounds.estimate - found.states)[..., 0] ** 2)))
    return judged(
        "Speed piecewise constant",
        "section 5.1",
        "local sub-models at constant speed",
        f"with the speed varying within a mode the bounds of c4 are left on {left} of {len(found.states)} runs; rms error {rms:.3f} m/s",
        "vx is measured and no part of xi, so no bound covers its deviation from the local speed. Schedule the observer by it instead, next rows.",
        reproduced=left == 0,
        corrected=left > 0,
        deviation=left / len(found.states),
    )


def scheduled_observer(speed_error: float = 0.0, ranges: int = 1) -> UnknownInputObserver:
    """Return the observer that is formed again at the measured speed of every sample.

    Args:
        speed_error: bound of the error of the speed [m/s].
        ranges: parts of the speeds, each with a bound of its own for the error of 1/vx, which is largest at the slowest speed.
    """
    ends = np.geomspace(ENDS[0], ENDS[-1], ranges + 1).tolist()
    plants = [_read(scheduled(speed_error=speed_error), slow, speed_error) for slow in ends[:-1]]
    H = Axles.at(SPEEDS[0]).decoupled(STEP).H
    A = plants[0].freeze(front_stiffness=gust_car.front_stiffness, rear_stiffness=gust_car.rear_stiffness).A
    assert isinstance(A, Polynomial)
    gain = (np.eye(2) + H @ np.array([[0.0, 1.0]])) @ A @ np.array([[0.0], [1.0]])
    return UnknownInputObserver(
        Switched.of(plants, "speed", ends, unit="m/s"),
        [gain] * ranges,
        [H] * ranges,
        initial_half_width=[START, START],
        state_bound=STATE_BOUND,
    )


def _read(plant: System, slow: float, error: float) -> System:
    """The plant with the error that 1/vx can have from one speed on."""
    inverse = 1 / (slow - error) - 1 / slow
    return plant.replace(
        parameters=[replace(p, error=inverse) if p.name == "inverse_speed" else p for p in plant.parameters]
    )


def scheduled_enclosure(speed_error: float = 0.0) -> tuple[Enclosure, np.ndarray]:
    """Return the bounds of the scheduled observer along cars of varying speed, and the states.

    Args:
        speed_error: bound of the error of the speed, taken by the readings from side to side [m/s].
    """
    road, found = runs(varying=True)
    # Within the range the plant is stated for.
    read = np.clip(road.speed + speed_error * np.sign(np.sin(2 * np.pi * road.time / 1.1)), ENDS[0], ENDS[-1])
    bounds = enclosed(
        scheduled_observer(speed_error, RANGES if speed_error else 1), found, np.stack([read, 1 / read], axis=1)
    )
    return bounds, found.states


def _scheduled(error: float, expected: float) -> Row:
    bounds, states = scheduled_enclosure(error)
    left = int(bounds.left(states).sum())
    rms = float(np.sqrt(np.mean((bounds.estimate - states)[..., 0] ** 2)))
    return judged(
        f"Observer scheduled by the speed, {'read within ±0.2 m/s' if error else 'read exactly'}: mean width of the bounds of v_y",
        f"section 5.1, {INDEPENDENT}",
        f"{expected:.4f} m/s",
        f"{bounds.width:.4f} m/s; left on {left} of {len(states)} runs; rms error {rms:.3f} m/s",
        "P and H do not depend on the speed, K(r) is affine in vx and 1/vx; N(r) is formed at every sample. "
        + (f"The error of 1/vx is bounded in {RANGES} ranges of speed, and apart from that of vx. " if error else "")
        + "The speeds of the other drive are not known; 15 % is asked.",
        reproduced=left == 0 and abs(bounds.width / expected - 1) < _VARYING_APART,
        deviation=abs(bounds.width - expected),
    )
