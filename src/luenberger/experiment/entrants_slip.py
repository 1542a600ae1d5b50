"""Certified observers of the slip angles: linear tyres, or brush tyres with the remainder beyond the linear part in the design.

All of them read steering, its rate, the yaw rate and the speed, and no accelerometer.
"""

from collections.abc import Callable, Mapping

import numpy as np

from luenberger.core import Trajectory
from luenberger.experiment.entrant import Entrant, Setting
from luenberger.methods.extended_luenberger import ExtendedLuenberger
from luenberger.methods.method import Method
from luenberger.methods.polytopic import PolytopicLuenberger
from luenberger.methods.two_dof import TwoDofLuenberger
from luenberger.replay import Channels
from luenberger.synthesize import synthesize
from luenberger.systems import System
from luenberger.vehicle import VehicleParameters, brush_tyres, sideslip_from_rear_slip, slip_angle_plant

Builder = Callable[[Setting, Mapping[str, float]], Entrant]
SLIP_CHANNELS = Channels(
    ("steering", "steering_rate", "yaw_rate"), ("slip_difference",), ("inverse_speed", "acceleration")
)


def lpv_linear(setting: Setting, options: Mapping[str, float]) -> Entrant:
    """Build the observer with linear tyres, whose loop is held exactly over a step.

    Args:
        setting: car, box, sample time.
        options: decay_rate [1/s].
    """
    plant = slip_angle_plant(setting.car, setting.speed, setting.acceleration)
    design = synthesize(plant, PolytopicLuenberger(decay_rate=options["decay_rate"]))
    observer = design.observer(setting.dt, method="exact", clip_scheduling=True)
    return Entrant(observer, SLIP_CHANNELS, _sideslip(setting.car), design=design)


def lpv_nonlinear(method: Callable[[Mapping[str, float]], Method], *, disturbance: bool = False) -> Builder:
    """Return the builder of an observer with brush tyres, followed by Runge-Kutta.

    With a disturbance in the plant the tyres are continued beyond the slip limit with a slope inside the bounds of the design,
    so that the proof asks the limit of the car alone, not of the estimate.

    Args:
        method: options -> design method.
        disturbance: an unknown lateral force and yaw torque enter the plant.
    """

    def built(setting: Setting, options: Mapping[str, float]) -> Entrant:
        car, limit = setting.car.with_values(friction=options["friction"]), options["slip_limit"]
        plant = slip_angle_plant(
            car,
            setting.speed,
            setting.acceleration,
            tyres=brush_tyres(car),
            slip_limit=limit,
            disturbance=disturbance,
        )
        design = synthesize(_continued(plant) if disturbance else plant, method(options))
        observer = design.observer(setting.dt, method="rk4", clip_scheduling=True)
        return Entrant(observer, SLIP_CHANNELS, _sideslip(car), design=design)

    return built


def smallest_gain(options: Mapping[str, float]) -> Method:
    """Return the design of the smallest gain for a decay rate.

    Args:
        options: decay_rate [1/s].
    """
    return PolytopicLuenberger(decay_rate=options["decay_rate"])


def least_disturbance(options: Mapping[str, float]) -> Method:
    """Return the design of the least L2 gain from force and torque to both slip angles, at the vertices.

    Args:
        options: gain_limit [1/s], the largest gain allowed.
    """
    return ExtendedLuenberger(goal="l2", gain_limit=options["gain_limit"])


def least_disturbance_two_dof(options: Mapping[str, float]) -> Method:
    """Return the same with a second gain that corrects the argument of the tyres, by multipliers.

    Args:
        options: gain_limit [1/s], of the first gain.
    """
    return TwoDofLuenberger(goal="l2", gain_limit=options["gain_limit"])


def _continued(plant: System) -> System:
    assert plant.nonlinearity is not None
    return plant.replace(nonlinearity=plant.nonlinearity.clipped())


def _sideslip(car: VehicleParameters) -> Callable[[np.ndarray, Trajectory], np.ndarray]:
    def sideslip(x: np.ndarray, trajectory: Trajectory) -> np.ndarray:
        speed, yaw_rate = trajectory["speed"].values, trajectory["yaw_rate"].values
        return np.asarray(sideslip_from_rear_slip(x[:, 1], speed, yaw_rate, car))

    return sideslip
