"""Cars: parameter sets with sources, tyres, single-track plants and truth model, sideslip algebra, derived channels."""

from luenberger.vehicle.algebraic import rear_axle_force, rear_axle_sideslip
from luenberger.vehicle.cars import CARS, car_named, carmaker_car, ferrari_250lm, wang_car
from luenberger.vehicle.parameters import Quantity, VehicleParameters
from luenberger.vehicle.sideslip import (
    lateral_speed_from_front_slip,
    lateral_speed_from_rear_slip,
    sideslip_from_lateral_speed,
    sideslip_from_rear_slip,
    slip_angles,
)
from luenberger.vehicle.single_track import lateral_speed_plant, slip_angle_plant
from luenberger.vehicle.slip_channels import rate_of_change, slip_angle_channels
from luenberger.vehicle.truth import SingleTrack
from luenberger.vehicle.tyres import BrushTyre, LinearTyre, MagicFormulaTyre, Tyre, brush_tyres, linear_tyres

__all__ = [
    "CARS",
    "BrushTyre",
    "LinearTyre",
    "MagicFormulaTyre",
    "Quantity",
    "SingleTrack",
    "Tyre",
    "VehicleParameters",
    "brush_tyres",
    "car_named",
    "carmaker_car",
    "ferrari_250lm",
    "lateral_speed_from_front_slip",
    "lateral_speed_from_rear_slip",
    "lateral_speed_plant",
    "linear_tyres",
    "rate_of_change",
    "rear_axle_force",
    "rear_axle_sideslip",
    "sideslip_from_lateral_speed",
    "sideslip_from_rear_slip",
    "slip_angle_channels",
    "slip_angle_plant",
    "slip_angles",
    "wang_car",
]
