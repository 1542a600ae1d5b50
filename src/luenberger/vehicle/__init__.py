"""Cars: parameters with sources, tyres, single-track plants, and the channels they are driven by."""

from luenberger.vehicle.channels import low_pass, slip_angle_channels
from luenberger.vehicle.parameters import CARS, VehicleParameters, carmaker_car, ferrari_250lm, named_car, wang_car
from luenberger.vehicle.single_track import lateral_forces, lateral_plant, single_track_dynamics, slip_angle_plant
from luenberger.vehicle.tyres import linear_force, magic_formula_force, parabolic_force

__all__ = [
    "CARS",
    "VehicleParameters",
    "carmaker_car",
    "ferrari_250lm",
    "lateral_forces",
    "lateral_plant",
    "linear_force",
    "low_pass",
    "magic_formula_force",
    "named_car",
    "parabolic_force",
    "single_track_dynamics",
    "slip_angle_channels",
    "slip_angle_plant",
    "wang_car",
]
