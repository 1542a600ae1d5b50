"""Methods times systems: every law in tests/laws runs over every row. A new method adds one row."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from luenberger.algebra import Polynomial
from luenberger.experiment.published.flexible_joint import TRANSFORM, flexible_joint, gravity
from luenberger.experiment.published.van_der_pol import tangent_polygon, van_der_pol
from luenberger.methods import (
    ExtendedLuenberger,
    FullBlockLuenberger,
    HInfinityGain,
    IntervalLuenberger,
    IntervalWidth,
    KalmanGain,
    LipschitzDisturbance,
    LipschitzPareto,
    LipschitzRiccati,
    Method,
    PolytopicLuenberger,
    PRadiusGain,
    PrintedTwoDof,
    RobustLuenberger,
    SegmentGain,
    SteadyWidth,
    StructuredLipschitz,
    TwoDofLuenberger,
    UnknownInputGain,
    UnstructuredObserver,
)
from luenberger.methods.method import SwitchedMethod
from luenberger.systems import Nonlinearity, Parameter, Switched, System
from luenberger.systems.discretize import discretize
from luenberger.vehicle import brush_tyres, carmaker_car, ferrari_250lm, gust_car, slip_angle_plant, wang_car
from luenberger.vehicle.wind import wind_plant


@dataclass(frozen=True)
class Row:
    """A method on a plant; how far the initial errors of the laws reach, the amplitude of their inputs, observer options.

    Plants with modes, and methods for them, have a table of their own.
    """

    name: str
    system: Callable[[], Any]
    method: Method | SwitchedMethod
    reach: float = 1.0
    drive: float = 1.0
    options: Mapping[str, Any] = field(default_factory=dict, hash=False)


def oscillator() -> System:
    """Lightly damped oscillator, position measured."""
    return System.linear([[0.0, 1.0], [-4.0, -0.2]], [[0.0], [1.0]], [[1.0, 0.0]], E=[[0.0], [1.0]], name="oscillator")


def scheduled_oscillator() -> System:
    """Oscillator whose stiffness and damping are scheduled, with a product of the two parameters."""
    A = Polynomial(
        ("stiffness", "damping"),
        {
            (0, 0): np.array([[0.0, 1.0], [0.0, 0.0]]),
            (1, 0): np.array([[0.0, 0.0], [-1.0, 0.0]]),
            (1, 1): np.array([[0.0, 0.0], [0.0, -1.0]]),
        },
    )
    parameters = [Parameter("stiffness", 1.0, 4.0), Parameter("damping", 0.05, 0.5)]
    return System.lpv(A, [[0.0], [1.0]], [[1.0, 0.0]], parameters=parameters, name="scheduled oscillator")


def robot(bound: str = "lipschitz") -> System:
    """Flexible-joint robot of Song and Hedrick, motor angle and speed measured, with either kind of bound."""
    plant = flexible_joint()
    if bound == "lipschitz":
        return plant
    f = Nonlinearity.bounded(gravity, [[0.0, 0.0, 1.0, 0.0]], jacobian=([[-3.33]], [[3.33]]))
    return plant.replace(nonlinearity=f)


def slip_angle_car() -> System:
    """Slip angles of the CarMaker car between 15 and 150 km/h."""
    return slip_angle_plant(carmaker_car, (15 / 3.6, 150 / 3.6), (-8.0, 4.0))


def erring_car() -> System:
    """Slip angles of the car of the dissertation, speed and acceleration read wrong, sensors noisy."""
    return slip_angle_plant(
        wang_car,
        (15 / 3.6, 150 / 3.6),
        (-8.0, 8.0),
        noise=(1e-3, 2e-2, 5e-3),
        scale_error=((-0.1, 0.1), (-0.2, 0.2)),
        output="slip_constraint",
    )


def sloping_car() -> System:
    """The same car with y taken as measured, as the unstructured observer of the dissertation has it."""
    return slip_angle_plant(
        wang_car, (15 / 3.6, 150 / 3.6), (-8.0, 8.0), scale_error=((-0.1, 0.1), (-0.2, 0.2)), output="slip_difference"
    )


def uncertain_car() -> System:
    """Slip angles of the car of the dissertation with the stiffness box of (4.45), noise and a force offset."""
    return slip_angle_plant(
        wang_car,
        (15 / 3.6, 150 / 3.6),
        (-8.0, 8.0),
        stiffness=((60e3, 90e3), (35e3, 65e3)),
        noise=(1e-3, 2e-2, 5e-3),
        force_offset=30.0,
    )


def hidden_oscillator(rate: float | None = 0.2) -> System:
    """A measured drift beside an oscillator nobody sees, whose stiffness varies ninefold: no common quadratic storage."""
    A = Polynomial.affine(
        np.array([[0.5, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -0.6]]),
        stiffness=np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, -1.0, 0.0]]),
    )
    return System.lpv(A, C=[[1.0, 0.0, 0.0]], parameters=[Parameter("stiffness", 1.0, 9.0, rate=rate)])


def saturating_car(disturbance: bool = False) -> System:
    """Slip angles of the Ferrari with brush tyres, up to 0.1 rad, at 58 to 223 km/h."""
    car = ferrari_250lm.with_values(front_stiffness=73e3, rear_stiffness=115e3, friction=1.25)
    tyres = brush_tyres(car)
    return slip_angle_plant(car, (16.0, 62.0), (-12.0, 8.0), tyres=tyres, slip_limit=0.1, disturbance=disturbance)


def cart() -> System:
    """A cart every tenth of a second: position measured with noise, pushed by a known force read wrong and by an unknown one."""
    return System.build(
        [[1.0, 0.1], [0.0, 0.95]],
        [[0.005], [0.1]],
        [[1.0, 0.0]],
        E=[[0.005], [0.1]],
        G=[[1.0, 0.0]],
        N=[[0.0, 1.0]],
        dt=0.1,
        disturbance_bound=[0.5],
        noise_bound=[0.05, 0.1],
        name="cart",
    )


def swing() -> System:
    """A swing every half second, both states seen through each other, with feedthrough and two unknown forces."""
    return System.build(
        [[0.9, -0.4], [0.4, 0.8]],
        [[0.0], [1.0]],
        [[1.0, 0.3], [0.2, 1.0]],
        [[0.1], [0.0]],
        E=[[1.0, 0.0], [-0.4, 0.2]],
        dt=0.5,
        disturbance_bound=[0.1, 0.3],
        noise_bound=[0.2, 0.4],
        name="swing",
    )


def scheduled_swing() -> System:
    """A swing whose stiffness and damping are scheduled, position measured."""
    A = Polynomial(
        ("stiffness", "damping"),
        {
            (0, 0): np.array([[1.0, 0.2], [0.0, 1.0]]),
            (1, 0): np.array([[0.0, 0.0], [-0.2, 0.0]]),
            (0, 1): np.array([[0.0, 0.0], [0.0, -0.2]]),
        },
    )
    parameters = [Parameter("stiffness", 1.0, 1.5), Parameter("damping", 0.2, 0.5)]
    return System.lpv(
        A,
        [[0.0], [0.2]],
        [[1.0, 0.0]],
        parameters=parameters,
        E=[[0.0], [0.2]],
        dt=0.2,
        disturbance_bound=[0.3],
        noise_bound=[0.1],
        name="scheduled swing",
    )


def windy_car(speed: tuple[float, float] = (8.0, 18.0)) -> System:
    """The single track in a side wind, sampled by Euler's method, tyres a tenth uncertain, gyro and steering with errors."""
    stiffness = ((54e3, 66e3), (58.5e3, 71.5e3))
    continuous = wind_plant(
        gust_car, speed, gust_arm=0.4, stiffness=stiffness, yaw_rate_noise=0.005, steering_error=0.01
    )
    return discretize(continuous, 0.06, "euler")


def gusty_car(dwell: int = 1) -> Switched:
    """The same car at three speeds, which its speed selects."""
    plant = windy_car((6.0, 19.9))
    modes = [plant.freeze(speed=v, inverse_speed=1 / v) for v in (8.5, 13.55, 18.05)]
    return Switched.of(modes, "speed", (6.0, 11.0, 16.0, 19.9), unit="m/s", dwell=dwell)


HALF = {"initial_half_width": (0.1, 0.1)}
# Few generators: the reduction is then a part of every step.
UNIT = {"initial_half_width": (1.0, 1.0), "count": 8}
ROWS = (
    Row("polytopic, linear", oscillator, PolytopicLuenberger(decay_rate=1.0)),
    Row("polytopic, scheduled", scheduled_oscillator, PolytopicLuenberger(decay_rate=0.5)),
    Row("polytopic, one gain", scheduled_oscillator, PolytopicLuenberger(decay_rate=0.3, schedule="constant")),
    Row("polytopic, Jacobian box", lambda: robot("jacobian"), PolytopicLuenberger(decay_rate=1.0)),
    Row("structured Lipschitz", robot, StructuredLipschitz(decay_rate=1.0)),
    Row("polytopic, slip angles", slip_angle_car, PolytopicLuenberger(decay_rate=3.0), reach=0.1),
    Row("polytopic, brush tyres", saturating_car, PolytopicLuenberger(decay_rate=0.5), reach=0.01, drive=0.0),
    Row("Kalman gain, linear", oscillator, KalmanGain(np.eye(2), np.eye(1))),
    Row("Kalman gain, scheduled", scheduled_oscillator, KalmanGain(np.eye(2), np.eye(1))),
    Row("Lipschitz by Riccati", robot, LipschitzRiccati(1.0, TRANSFORM)),
    Row("Lipschitz, Pareto", robot, LipschitzPareto(0.5, 1 / 4.0, TRANSFORM)),
    Row("Lipschitz with disturbance", lambda: flexible_joint("motor_angle"), LipschitzDisturbance(0.1, 0.2, TRANSFORM)),
    Row("structured Lipschitz, no decay asked", robot, StructuredLipschitz()),
    Row("polytopic, moving storage", hidden_oscillator, PolytopicLuenberger(storage="scheduled")),
    Row("robust L2", erring_car, RobustLuenberger("l2", "scheduling+noise", schedule="constant"), reach=0.1),
    Row("robust H2", erring_car, RobustLuenberger("h2", "scheduling+noise", schedule="constant"), reach=0.1),
    Row("interval, residual", uncertain_car, IntervalLuenberger(), reach=0.1, options=HALF),
    Row("unstructured L2", sloping_car, UnstructuredObserver("l2"), reach=0.1),
    Row("interval, width", uncertain_car, IntervalWidth([0.05, 0.05], gain_limit=40.0), reach=0.1, options=HALF),
    Row(
        "extended, hull of the Jacobian",
        lambda: van_der_pol(5.0, hull=tangent_polygon(5.0, 16)),
        ExtendedLuenberger(decay_rate=0.5),
    ),
    Row(
        "extended L2, brush tyres",
        lambda: saturating_car(disturbance=True),
        ExtendedLuenberger(goal="l2", gain_limit=60.0),
        reach=0.01,
        drive=0.0,
    ),
    Row("extended, argument gain given", lambda: van_der_pol(2.0), ExtendedLuenberger(argument_gain=((1.0,), (1.5,)))),
    Row("full block", lambda: robot("jacobian"), FullBlockLuenberger(decay_rate=1.0)),
    Row("two-DOF, Van der Pol", lambda: van_der_pol(5.0), TwoDofLuenberger(decay_rate=0.5)),
    Row(
        "two-DOF L2, brush tyres",
        lambda: saturating_car(disturbance=True),
        TwoDofLuenberger(goal="l2", gain_limit=60.0),
        reach=0.01,
        drive=0.0,
    ),
    Row("two-DOF as printed", lambda: saturating_car(disturbance=True), PrintedTwoDof("l2"), reach=0.01, drive=0.0),
    Row("interval, mismatch", uncertain_car, IntervalLuenberger("mismatch", noise=True), reach=0.1, options=HALF),
    Row("steady width", cart, SteadyWidth(), options=UNIT),
    Row("steady width, current output", cart, SteadyWidth(uses="current"), options=UNIT),
    Row("least segments", swing, SegmentGain(), options=UNIT),
    Row("least energy gain", cart, HInfinityGain()),
    Row("P-radius", cart, PRadiusGain()),
    Row("P-radius, strips one by one", swing, PRadiusGain("current", "one by one"), options=UNIT),
    Row("Kalman gain, discrete", cart, KalmanGain(np.diag([1e-4, 1e-2]), 1e-3 * np.eye(1))),
    Row("Kalman gain, discrete and scheduled", scheduled_swing, KalmanGain(np.eye(2), np.eye(1)), options=UNIT),
)
WINDY = {"initial_half_width": (0.5, 0.1)}
SWITCHED_ROWS = (
    Row("unknown input, three modes", gusty_car, UnknownInputGain(), drive=0.05, options=WINDY),
    Row(
        "unknown input, a storage for each mode",
        lambda: gusty_car(dwell=5),
        UnknownInputGain(storage="dwell"),
        drive=0.05,
        options=WINDY,
    ),
    Row("unknown input, scheduled", windy_car, UnknownInputGain(fade=0.4), drive=0.05, options=WINDY),
)
