"""Cars: parameter sets with sources, tyres, roads, plants, single- and double-track truths, manoeuvres, derived channels."""

from luenberger.vehicle.algebraic import rear_axle_force, rear_axle_sideslip
from luenberger.vehicle.cars import CARS, car_named, carmaker_car, ferrari_250lm, gust_car, wang_car
from luenberger.vehicle.combined_tyres import DugoffTyre, LoadedTyre, MagicFormulaCombined, secant_stiffness
from luenberger.vehicle.double_track import DoubleTrack
from luenberger.vehicle.double_track_parameters import DoubleTrackParameters
from luenberger.vehicle.driver import (
    ClosedLoop,
    Course,
    PreviewDriver,
    SpeedKeeper,
    closed_loop,
    iso_3888_1,
    iso_3888_2,
)
from luenberger.vehicle.manoeuvres import (
    Manoeuvre,
    braking_lane_changes,
    fishhook,
    ramp_steer,
    sine_with_dwell,
    slalom,
    step_steer,
)
from luenberger.vehicle.parameters import Quantity, VehicleParameters
from luenberger.vehicle.road import Road
from luenberger.vehicle.sensor_sets import SENSOR_SETS, SensorData, sensors_on
from luenberger.vehicle.sideslip import (
    lateral_speed_from_front_slip,
    lateral_speed_from_rear_slip,
    sideslip_from_lateral_speed,
    sideslip_from_rear_slip,
    slip_angles,
)
from luenberger.vehicle.single_track import lateral_speed_plant, slip_angle_plant
from luenberger.vehicle.slip_channels import rate_of_change, slip_angle_channels
from luenberger.vehicle.stiffness_box import StiffnessBox, axle_forces, stiffness_box
from luenberger.vehicle.truth import SingleTrack
from luenberger.vehicle.tyres import BrushTyre, LinearTyre, MagicFormulaTyre, Tyre, brush_tyres, linear_tyres
from luenberger.vehicle.wind import wind_plant

__all__ = [
    "CARS",
    "SENSOR_SETS",
    "BrushTyre",
    "ClosedLoop",
    "Course",
    "DoubleTrack",
    "DoubleTrackParameters",
    "DugoffTyre",
    "LinearTyre",
    "LoadedTyre",
    "MagicFormulaCombined",
    "MagicFormulaTyre",
    "Manoeuvre",
    "PreviewDriver",
    "Quantity",
    "Road",
    "SensorData",
    "SingleTrack",
    "SpeedKeeper",
    "StiffnessBox",
    "Tyre",
    "VehicleParameters",
    "axle_forces",
    "braking_lane_changes",
    "brush_tyres",
    "car_named",
    "carmaker_car",
    "closed_loop",
    "ferrari_250lm",
    "fishhook",
    "gust_car",
    "iso_3888_1",
    "iso_3888_2",
    "lateral_speed_from_front_slip",
    "lateral_speed_from_rear_slip",
    "lateral_speed_plant",
    "linear_tyres",
    "ramp_steer",
    "rate_of_change",
    "rear_axle_force",
    "rear_axle_sideslip",
    "secant_stiffness",
    "sensors_on",
    "sideslip_from_lateral_speed",
    "sideslip_from_rear_slip",
    "sine_with_dwell",
    "slalom",
    "slip_angle_channels",
    "slip_angle_plant",
    "slip_angles",
    "step_steer",
    "stiffness_box",
    "wang_car",
    "wind_plant",
]
