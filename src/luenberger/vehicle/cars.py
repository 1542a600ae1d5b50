"""Cars from the literature and from recorded logs."""

from luenberger.core import BadInput
from luenberger.core.checks import nearest
from luenberger.vehicle.parameters import Quantity, VehicleParameters

_WANG = "Wang 2014, section 3.3"
_WANG_TYRE = "Wang 2014, figure 5.4"
_INFERRED = "inferred from 3 mu Fz theta = C with theta = 5 1/rad, which fits both axles of chapter 3; not printed, and more than m g"
_CARMAKER = "github nastarankhds/KalmanFilter, commit 4f6aa8c, MIT"
_STANFORD = "github MBDS/sideslip-angle-vehicle-estimation, commit 0446c76"

wang_car = VehicleParameters.stated(
    "car of Wang 2014",
    mass=Quantity(800.0, "kg", _WANG),
    yaw_inertia=Quantity(1152.0, "kg m^2", _WANG),
    front_axle_distance=Quantity(0.948, "m", _WANG),
    rear_axle_distance=Quantity(1.422, "m", _WANG),
    front_stiffness=Quantity(76500.0, "N/rad", _WANG),
    rear_stiffness=Quantity(51000.0, "N/rad", _WANG),
    friction=Quantity(0.85, "", _WANG_TYRE),
    front_load=Quantity(6000.0, "N", f"{_WANG_TYRE}; {_INFERRED}"),
    rear_load=Quantity(4000.0, "N", _INFERRED),
)

carmaker_car = VehicleParameters.stated(
    "IPG CarMaker car of the slalom log",
    mass=Quantity(1574.02, "kg", _CARMAKER),
    yaw_inertia=Quantity(2245.322, "kg m^2", _CARMAKER),
    front_axle_distance=Quantity(1.024, "m", _CARMAKER),
    rear_axle_distance=Quantity(1.602, "m", _CARMAKER),
    front_stiffness=Quantity(188970.0, "N/rad", _CARMAKER),
    rear_stiffness=Quantity(149900.0, "N/rad", _CARMAKER),
    friction=Quantity(0.9, "", _CARMAKER),
    centre_height=Quantity(0.561, "m", _CARMAKER),
)

ferrari_250lm = VehicleParameters.stated(
    "Ferrari 250 LM of 1965",
    mass=Quantity(982.0, "kg", _STANFORD),
    yaw_inertia=Quantity(1500.0, "kg m^2", f"{_STANFORD}, middle of 1400 to 1600"),
    front_axle_distance=Quantity(1.33, "m", _STANFORD),
    rear_axle_distance=Quantity(1.07, "m", _STANFORD),
    front_stiffness=Quantity(60000.0, "N/rad", "linear fit of the log where |ay| < 4 m/s^2, correlation 0.92"),
    rear_stiffness=Quantity(94000.0, "N/rad", "linear fit of the log where |ay| < 4 m/s^2, correlation 0.93"),
)

_CHOSEN = "chosen for a medium-sized car; Ifqir et al. 2020 print no parameters"

gust_car = VehicleParameters.stated(
    "medium-sized car",
    mass=Quantity(1500.0, "kg", _CHOSEN),
    yaw_inertia=Quantity(2500.0, "kg m^2", _CHOSEN),
    front_axle_distance=Quantity(1.2, "m", _CHOSEN),
    rear_axle_distance=Quantity(1.6, "m", _CHOSEN),
    front_stiffness=Quantity(60000.0, "N/rad", _CHOSEN),
    rear_stiffness=Quantity(65000.0, "N/rad", _CHOSEN),
)

CARS = {"gust_car": gust_car, "wang_car": wang_car, "carmaker_car": carmaker_car, "ferrari_250lm": ferrari_250lm}


def car_named(name: str) -> VehicleParameters:
    """Return a shipped car by the name an experiment file uses.

    Args:
        name: key of `CARS`.

    Raises:
        BadInput: unknown car; the nearest known one is named.
    """
    if name not in CARS:
        raise BadInput(f"There is no car `{name}`.{nearest(name, CARS)}")
    return CARS[name]
