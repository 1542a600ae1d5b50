"""The fishhook of Wang 2014, section 5.4.2, driven by two truths, and everybody who estimates its slip angles.

One truth is the single track with the brush tyres that the observers believe in, the other the double track, which nobody
believes in. The steering and the times are ours: the dissertation prints the speeds at the ends and shows curves of CarSim.
"""

from collections.abc import Mapping
from functools import cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from luenberger.algebra import Polynomial
from luenberger.core import Signal, Trajectory
from luenberger.experiment.drives import GRIPPY, braked_fishhook, braking_fishhook
from luenberger.experiment.entrant import Setting
from luenberger.experiment.entrants import build
from luenberger.experiment.published.wang_gains import HINF, NONE, printed_gain, slip_plant
from luenberger.experiment.published.wang_manoeuvre import STEP
from luenberger.experiment.published.wang_plants import ACCELERATION, SPEED
from luenberger.experiment.published.wang_runs import FIRST, SCORED, START, Readings, run, slip_truth
from luenberger.observers import CorrectionObserver, Observer, TwoDofObserver
from luenberger.replay import replay
from luenberger.simulate import TruthModel, simulate
from luenberger.systems import System
from luenberger.vehicle import (
    brush_tyres,
    lateral_speed_from_rear_slip,
    slip_angle_channels,
    slip_angle_plant,
    slip_angles,
    wang_car,
)

# The double track is steered as in the drive of the experiments. The single track, whose rear wheels lose no load in a bend, slides
# at that angle; at the smaller one both of its axles reach 0.12 rad.
SINGLE_TRACK_ANGLE = 0.06
DRIVE = braking_fishhook(SINGLE_TRACK_ANGLE)
# Ours, certified where tyres may lose nine tenths of their stiffness; in (1/vx, ax/vx) as the print.
OURS = ((0.6519, -1.0642), (10.7832, -18.8658), (-0.4137, 0.2837))
# (5.73): L1, which is not what is injected, and L2.
PRINTED_FIRST = ((9.6103, 10.1651), (-72.1241, -84.5006), (-0.4527, -0.5227))
PRINTED_SECOND = ((0.5307, 0.4693), (0.5170, -0.5154), (-0.018, 0.0187))
# Share of the stiffness that the trusted slip angles may lose.
LOST = 0.9
# Filters run at the rate of a car [s].
FILTER_STEP = 0.01
LINEAR, CHAPTER3 = "LPV without correction", "LPV, H-infinity gain of section 3.3"
COPY, NONLINEAR, FIXED = "nonlinear without correction", "nonlinear", "nonlinear, gain fixed at 60 km/h"
FILTERS = {
    "EKF": {"kind": "ekf", "friction": 0.85},
    "UKF": {"kind": "ukf", "friction": 0.85},
    "EKF without accelerometer": {"kind": "ekf_yaw_rate", "friction": 0.85},
}
AXLES = ("front", "rear")


def slip_limit(lost: float = LOST) -> float:
    """Return the slip angle [rad] at which the brush tyres have lost a share of their stiffness.

    Args:
        lost: share, from 0 to 1.
    """
    return (1 - np.sqrt(1 - lost)) / float(brush_tyres(wang_car)[0].theta)


@cache
def brush_plant(lost: float = LOST) -> System:
    """Return the plant of (5.64) to (5.72), its tyres continued beyond the slip limit, with force and torque unknown.

    Args:
        lost: share of the stiffness that the trusted slip angles may lose.
    """
    tyres = brush_tyres(wang_car)
    plant = slip_angle_plant(wang_car, SPEED, ACCELERATION, tyres=tyres, slip_limit=slip_limit(lost), disturbance=True)
    assert plant.nonlinearity is not None
    return plant.replace(nonlinearity=plant.nonlinearity.clipped())


@cache
def matched_truth() -> Trajectory:
    """Drive the single track with the brush tyres of the observers; channels of `slip_angle_channels`."""
    times = np.linspace(0.0, DRIVE.duration, round(DRIVE.duration / STEP) + 1)
    u = np.stack([np.asarray(f(times)) for f in (DRIVE.steering, DRIVE.steering_rate)], axis=1)
    model = TruthModel(
        _brush_rate,
        lambda t, x, u, r: jnp.concatenate([DRIVE.acceleration(t)[None], _forces(x, u, r)]),
        states=("lateral_speed", "yaw_rate"),
        inputs=("steering", "steering_rate"),
        outputs=("acceleration", "front_force", "rear_force"),
        scheduling_names=("speed",),
        units={
            "lateral_speed": "m/s",
            "yaw_rate": "rad/s",
            "steering": "rad",
            "steering_rate": "rad/s",
            "acceleration": "m/s^2",
            "front_force": "N",
            "rear_force": "N",
            "speed": "m/s",
        },
        name="single track with brush tyres",
    )
    r = np.asarray(DRIVE.speed(times))[:, None]
    driven = simulate(model, time=times, x0=[0.0, 0.0], u=u, r=r, interpolation="linear", rtol=1e-9, atol=1e-11)
    force = driven["front_force"].values + driven["rear_force"].values
    felt = Signal("lateral_acceleration", "m/s^2", force / wang_car.mass)
    return slip_angle_channels(driven.with_signals(felt), wang_car)


@cache
def double_track_truth(friction: float = GRIPPY) -> Trajectory:
    """Drive the double track; channels of `slip_angle_channels`, with the exact rates of steering and speed.

    Args:
        friction: of the road.
    """
    driven = braked_fishhook(wang_car, STEP, friction=friction)
    rates = [
        Signal(name, unit, np.gradient(driven[of].values, driven.time))
        for name, unit, of in (("acceleration", "m/s^2", "speed"), ("steering_rate", "rad/s", "steering"))
    ]
    return slip_angle_channels(driven.with_signals(*rates), wang_car)


def slip_observers() -> dict[str, Observer]:
    """Return the observers of the slip-angle plant: linear tyres beside brush tyres."""
    nonlinear, gain = brush_plant(), printed_gain(OURS, flipped=False)
    # At 60 km/h and no acceleration; the plant is what it was.
    held = np.asarray(gain({"inverse_speed": 3.6 / 60, "acceleration": 0.0}))
    return {
        LINEAR: CorrectionObserver(slip_plant(), printed_gain(NONE), STEP, method="exact"),
        CHAPTER3: CorrectionObserver(slip_plant(), printed_gain(HINF), STEP, method="exact"),
        COPY: CorrectionObserver(nonlinear, printed_gain(NONE), STEP),
        NONLINEAR: CorrectionObserver(nonlinear, gain, STEP),
        FIXED: CorrectionObserver(nonlinear, Polynomial.constant(held), STEP),
    }


def printed_observer(lost: float, turned: bool = False) -> TwoDofObserver:
    """Return the observer (5.38) with the printed gains (5.73), which injects L1 - Bf K1 L2 with K1 = -lost c1.

    Args:
        lost: kappa, which the dissertation does not print.
        turned: the second entry of L2,0 with the other sign.
    """
    plant, (injected, second) = brush_plant(), printed_pair(lost, turned)
    return TwoDofObserver(plant, injected, second, STEP, substeps=4)


def printed_pair(lost: float, turned: bool = False) -> tuple[Polynomial, Polynomial]:
    """Return the injected gain and L2 of `printed_observer`; arguments as there.

    Args:
        lost: kappa.
        turned: the second entry of L2,0 with the other sign.
    """
    first = PRINTED_SECOND[0]
    second = printed_gain(((first[0], -first[1] if turned else first[1]), *PRINTED_SECOND[1:]), flipped=False)
    F = brush_plant().F
    assert F is not None
    lower = -lost * np.diag([wang_car.front_stiffness, wang_car.rear_stiffness])
    split = F @ Polynomial.constant(lower) @ second
    return printed_gain(PRINTED_FIRST, flipped=False) - split, second


def estimates(observers: Mapping[str, Observer], truth: Trajectory) -> dict[str, np.ndarray]:
    """Run observers of the slip-angle plant from one second on; return name -> slip angles, shape (nt, 2).

    Args:
        observers: name -> observer.
        truth: one of the truths.
    """
    return {n: np.asarray(e.x)[0] for n, e in run(observers, [Readings.of(truth)]).items()}


def filtered(truth: Trajectory, options: Mapping[str, Mapping[str, Any]] | None = None) -> dict[str, np.ndarray]:
    """Run the filters at 100 Hz from the same guess; return name -> slip angles at the samples from one second on, (nt, 2).

    Args:
        truth: one of the truths.
        options: name -> kind and options of an entrant; left out: `FILTERS`.
    """
    every = round(FILTER_STEP / STEP)
    late = truth.between(float(truth.time[FIRST]), float(truth.time[-1]) + STEP).resample(FILTER_STEP)
    setting = Setting(wang_car, SPEED, ACCELERATION, FILTER_STEP)
    made = {n: build(setting, o) for n, o in (options or FILTERS).items()}
    constants: dict[str, Signal] = {}
    for entrant in made.values():
        for name, value in entrant.constants.items():
            constants[name] = Signal(name, "", np.full(len(late), value))
    log = late.with_signals(*constants.values())
    vx, delta = (float(log[n].values[0]) for n in ("speed", "steering"))
    rate = (delta - (START[0] - START[1])) * vx / wang_car.wheelbase
    guess = np.array([float(lateral_speed_from_rear_slip(START[1], vx, rate, wang_car)), rate])
    ran = replay({n: e.observer for n, e in made.items()}, log, {n: e.channels for n, e in made.items()}, guess)
    found = {}
    for name in made:
        x = np.asarray(ran.estimates[name].x)
        pair = slip_angles(x[:, 0], x[:, 1], log["speed"].values, log["steering"].values, wang_car)
        # Held over the samples of the truth, as a reader of the filter would hold it.
        found[name] = np.repeat(np.stack([np.asarray(p) for p in pair], axis=1), every, axis=0)[
            : len(truth.time) - FIRST
        ]
    return found


def root_mean_squares(estimate: np.ndarray, truth: Trajectory, kept: np.ndarray | None = None) -> np.ndarray:
    """Return the root mean square errors of both slip angles from two seconds on [mrad], shape (2,).

    Args:
        estimate: from one second on, shape (nt, 2).
        truth: what it is of.
        kept: samples from two seconds on that count; left out: all.
    """
    squares = ((estimate - slip_truth(truth))[SCORED:]) ** 2
    return 1e3 * np.sqrt(np.mean(squares if kept is None else squares[kept], axis=0))


def everybody(truth: Trajectory) -> dict[str, np.ndarray]:
    """Return name -> slip angles of observers and filters.

    Args:
        truth: one of the truths.
    """
    return {**estimates(slip_observers(), truth), **filtered(truth)}


def _brush_rate(t: Any, x: Any, u: Any, r: Any) -> jax.Array:
    force = _forces(x, u, r)
    arms = jnp.array([wang_car.front_axle_distance, -wang_car.rear_axle_distance])
    return jnp.stack([jnp.sum(force) / wang_car.mass - r[0] * x[1], jnp.sum(arms * force) / wang_car.yaw_inertia])


def _forces(x: Any, u: Any, r: Any) -> jax.Array:
    pair = slip_angles(x[0], x[1], r[0], u[0], wang_car)
    return jnp.stack([tyre(slip) for tyre, slip in zip(brush_tyres(wang_car), pair, strict=True)])
