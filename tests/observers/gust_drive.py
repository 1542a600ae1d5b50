"""A drive through three modes with steering and gusts, and many cars on it: all that stiffness and sensors may do within bounds.

The plain form of the car is written out here, apart from `vehicle.wind`, so that containment is checked against another hand.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from luenberger.algebra import Polynomial
from luenberger.observers.observer import Estimate
from luenberger.observers.unknown_input import UnknownInputObserver
from luenberger.systems import Switched, System
from luenberger.systems.discretize import discretize
from luenberger.vehicle.cars import gust_car
from luenberger.vehicle.wind import wind_plant

STEP, ARM = 0.06, 0.4
SPEEDS, ENDS = (8.5, 13.55, 18.05), (6.0, 11.0, 16.0, 19.899)
STATE_BOUND, START = np.array([0.8, 0.3]), np.array([0.01, 0.01])
STIFFNESS = np.array([60e3, 65e3])
VARIANTS: dict[str, dict[str, Any]] = {
    "c0": {"uncertainty": "lemma", "reuse_noise": False, "closed_loop": False},
    "c1": {"uncertainty": "interval", "reuse_noise": False, "closed_loop": False},
    "c2": {"uncertainty": "structured", "reuse_noise": False, "closed_loop": False},
    "c3": {"uncertainty": "structured", "reuse_noise": True, "closed_loop": False},
    "c4": {},
}


@dataclass(frozen=True)
class Runs:
    """Cars on the drive, at every sample.

    Args:
        x: states, shape (runs, nt, 2).
        u: measured steering [rad], shape (runs, nt, 1).
        y: measured yaw rate [rad/s], shape (runs, nt, 1).
        speed: measured speed [m/s], shape (runs, nt).
    """

    x: np.ndarray
    u: np.ndarray
    y: np.ndarray
    speed: np.ndarray


def car(speed: tuple[float, float] = (6.0, 19.899), **changes: Any) -> System:
    """The sampled car over an interval of speeds, scheduled by the speed and its inverse."""
    options: dict[str, Any] = {
        "gust_arm": ARM, "stiffness": ((54e3, 66e3), (58.5e3, 71.5e3)), "yaw_rate_noise": 0.005, "steering_error": 0.0,
    }  # fmt: skip
    return discretize(wind_plant(gust_car, speed, **(options | changes)), STEP, "euler")


def three_modes(**changes: Any) -> Switched:
    """The car frozen at the speed of each mode."""
    plant = car(**changes)
    modes = [plant.freeze(speed=v, inverse_speed=1 / v) for v in SPEEDS]
    return Switched.of(modes, "speed", ENDS, unit="m/s")


def scheduled(parts: int, speed_error: float) -> Switched:
    """The scheduled car in parts of the speed, each with its own bound on the error of 1/vx, which is largest at its slowest speed."""
    ends = np.geomspace(8.0, 18.6, parts + 1)
    plants = [car((a - speed_error, b + speed_error), speed_error=speed_error) for a, b in pairwise(ends.tolist())]
    return Switched.of(plants, "speed", ends.tolist(), unit="m/s")


def decoupled(system: System) -> tuple[Polynomial, np.ndarray]:
    """K(r) that leaves only the fixed zero, and the H that decouples, for the car with its stiffnesses at their middle."""
    nominal = system.freeze(**system.uncertainty)
    H = np.array([[-gust_car.yaw_inertia / (gust_car.mass * ARM)], [-1.0]])
    P = np.eye(2) + H @ np.array([[0.0, 1.0]])
    return (P @ nominal.polynomial("A")) @ np.array([[0.0], [1.0]]), H


def observer(plant: Switched | System, **options: Any) -> UnknownInputObserver:
    """The observer of a plant of this page."""
    found = [decoupled(mode) for mode in Switched.of(plant).modes]
    options = {"initial_half_width": START, "state_bound": STATE_BOUND} | options
    return UnknownInputObserver(plant, [K for K, _ in found], [H for _, H in found], **options)


def profile(samples: int, amplitude: float = 0.031) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Speed [m/s], steering [rad] and gust [N]: once up through the modes and down again, slalom, gusts from both sides."""
    t = STEP * np.arange(samples)
    speed = 13.275 - 4.775 * np.cos(2 * np.pi * np.arange(samples) / (samples - 1))
    steering = amplitude * np.sin(2 * np.pi * t / 7.5)
    gust = 800.0 * np.where((t // 5) % 4 == 1, 1.0, np.where((t // 5) % 4 == 3, -1.0, 0.0))
    return speed, steering, gust


def cars(
    samples: int = 500,
    *,
    random: int = 40,
    steering_error: float = 0.0,
    varying: bool = False,
    speed_error: float = 0.0,
    noise: float = 0.005,
    share: float = 0.1,
    amplitude: float = 0.031,
    seed: int = 0,
) -> Runs:
    """Run the drive: random cars (half at vertices), eight that stay at a vertex, and four adversaries.

    Two adversaries choose what drives the error of vy furthest up, or down, a step later. The other two do the same, but turn the
    noise at every fifth sample, since its effects on this error and on the next have opposite signs.

    Args:
        samples: length.
        random: number of random cars.
        steering_error: bound of the steering angle [rad].
        varying: the true speed is that of the drive; False: that of the mode.
        speed_error: bound of the measured speed [m/s].
        noise: bound of the yaw rate [rad/s].
        share: uncertainty of both stiffnesses.
        amplitude: steering [rad].
        seed: of the random numbers.
    """
    rng = np.random.default_rng(seed)
    drive, steering, gust = profile(samples, amplitude)
    count = random + 12
    draw = rng.uniform(-1, 1, (samples, count, 5))
    draw[:, : random // 2] = np.sign(draw[:, : random // 2])
    corners = [[f, r, v, -v, f * v] for f in (-1, 1) for r in (-1, 1) for v in (-1, 1)]
    draw[:, random : random + 8] = np.array(corners)
    way = np.array([1.0, -1.0, 1.0, -1.0])[:, None]
    x = START * np.sign(rng.uniform(-1, 1, (count, 2)))
    rows: list[tuple[np.ndarray, ...]] = []
    for k in range(samples):
        local = SPEEDS[int(drive[k] >= ENDS[1]) + int(drive[k] >= ENDS[2])]
        s, v, slip = draw[k, :, :2], draw[k, :, 2:4] * [noise, steering_error], draw[k, :, 4]
        true = drive[k] if varying else local
        _push(s[-4:], v[-4:], way, x[-4:], steering[k], true, noise, steering_error)
        if k % 5 == 4:
            v[-2:, 0] *= -1
        measured = drive[k] + speed_error * slip
        rows.append((x, np.full((count, 1), steering[k]), x[:, 1:] + v[:, :1], measured))
        x = _next(x, steering[k] - v[:, 1], STIFFNESS * (1 + share * s), true, gust[k])
    return Runs(*(np.stack(column, axis=1) for column in zip(*rows, strict=True)))


def _next(x: np.ndarray, delta: np.ndarray, stiffness: np.ndarray, v: float, gust: float) -> np.ndarray:
    """One Euler step of the single track, one car a row."""
    m, Iz, a, b = gust_car.mass, gust_car.yaw_inertia, gust_car.front_axle_distance, gust_car.rear_axle_distance
    vy, r = x.T
    front, rear = stiffness[:, 0] * (delta - (vy + a * r) / v), -stiffness[:, 1] * (vy - b * r) / v
    slope = np.stack([(front + rear + gust) / m - v * r, (a * front - b * rear + ARM * gust) / Iz], axis=1)
    return x + STEP * slope


def _push(
    s: np.ndarray, v: np.ndarray, way: np.ndarray, x: np.ndarray, u: float, speed: float, noise: float, angle: float
) -> None:
    """Choose stiffness, noise and steering error that drive the next error of vy furthest up, or down."""
    m, Iz, a, b = gust_car.mass, gust_car.yaw_inertia, gust_car.front_axle_distance, gust_car.rear_axle_distance
    g = Iz / (m * ARM)
    slips = np.stack([u - (x[:, 0] + a * x[:, 1]) / speed, -(x[:, 0] - b * x[:, 1]) / speed], axis=1)
    felt = np.array([1 / m - g * a / Iz, 1 / m + g * b / Iz])
    s[:] = way * np.sign(slips * felt)
    # The error of vy holds -g v of this sample and answers the sample before through N H - K = P A H.
    PA = np.array([1.0, -g]) @ (np.eye(2) + STEP * _state_matrix(speed))
    v[:, 0] = way[:, 0] * noise * np.sign(PA @ [-g, -1.0])
    v[:, 1] = way[:, 0] * angle * -np.sign(felt[0])


def _state_matrix(v: float) -> np.ndarray:
    m, Iz, a, b = gust_car.mass, gust_car.yaw_inertia, gust_car.front_axle_distance, gust_car.rear_axle_distance
    cf, cr = STIFFNESS
    return np.array(
        [
            [-(cf + cr) / (m * v), (b * cr - a * cf) / (m * v) - v],
            [(b * cr - a * cf) / (Iz * v), -(a**2 * cf + b**2 * cr) / (Iz * v)],
        ]
    )


@eqx.filter_jit
def enclosed(observer: UnknownInputObserver, start: Any, u: Any, y: Any, r: Any) -> Estimate:
    """All runs in one compiled batch."""

    def one(u: Any, y: Any, r: Any) -> Estimate:
        return jax.lax.scan(lambda state, now: observer.step(state, *now), start, (u, y, r))[1]

    return jax.vmap(one)(u, y, r)


def boxes(observer: UnknownInputObserver, runs: Runs, dtype: Any = float) -> Estimate:
    """The boxes of all runs; shape (runs, nt, 2) each."""
    names = observer.plant.value.scheduling_names
    known = {"speed": runs.speed, "inverse_speed": 1 / runs.speed}
    r = np.stack([known[name] for name in names], axis=-1)
    start = observer.init(jnp.zeros(2, dtype))
    return enclosed(observer, start, *(jnp.asarray(part, dtype) for part in (runs.u, runs.y, r)))


def leavers(box: Estimate, x: np.ndarray, slack: float = 1e-9) -> np.ndarray:
    """Which runs leave their box anywhere."""
    assert box.lower is not None
    assert box.upper is not None
    outside = (x < np.asarray(box.lower) - slack) | (x > np.asarray(box.upper) + slack)
    return np.asarray(outside.any(axis=(1, 2)))


def reach(box: Estimate, x: np.ndarray, after: int = 20) -> float:
    """Largest share of the half width of vy that an error takes, once the start is forgotten."""
    assert box.lower is not None
    assert box.upper is not None
    half = 0.5 * np.asarray(box.upper - box.lower)[..., 0]
    return float((np.abs(x[..., 0] - np.asarray(box.x)[..., 0]) / half)[:, after:].max())


def mean_width(box: Estimate) -> float:
    """Mean width of the interval of vy over all runs and samples [m/s]."""
    assert box.lower is not None
    assert box.upper is not None
    return float(np.asarray(box.upper - box.lower)[..., 0].mean())
