"""What a double track needs beyond the single track, each number with its unit and source, and plausible defaults."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import isfinite, sqrt

from luenberger.core import BadInput
from luenberger.core.checks import known_keys
from luenberger.vehicle.parameters import GRAVITY, Quantity, Row, VehicleParameters

_UNITS = {
    "centre_height": ("m", "height of the centre of gravity above the road, where the roll axis lies"),
    "front_track": ("m", "distance of the front wheels"),
    "rear_track": ("m", "distance of the rear wheels"),
    "roll_inertia": ("kg m^2", "moment of inertia about the longitudinal axis through the centre of gravity"),
    "roll_stiffness": ("N m/rad", "springs and stabilisers of both axles"),
    "front_roll_share": ("", "part of the roll stiffness and damping at the front axle"),
    "roll_damping": ("N m s/rad", "dampers of both axles"),
    "pitch_lag": ("s", "time constant with which the wheel loads follow the longitudinal acceleration"),
    "front_relaxation": ("m", "relaxation length of the front tyres"),
    "rear_relaxation": ("m", "relaxation length of the rear tyres"),
    "steering_lag": ("s", "time constant of the steering actuator"),
    "steering_rate": ("rad/s", "greatest rate of the road-wheel angle"),
    "brake_front_share": ("", "part of the brake force at the front axle"),
    "drive_front_share": ("", "part of the drive force at the front axle"),
    "longitudinal_share": ("", "part of mu Fz that a slip controller lets braking and driving take"),
    "peak_load_ratio": ("", "wheel load of the greatest cornering stiffness over the static wheel load"),
    "tyre_shape": ("", "shape factor C of the tyre curve"),
    "tyre_curvature": ("", "curvature factor E of the tyre curve"),
    "friction": ("", "friction coefficient of the road where none is given"),
}
_SHARES = ("front_roll_share", "brake_front_share", "drive_front_share")


@dataclass(frozen=True, kw_only=True)
class DoubleTrackParameters:
    """A car as the double track sees it: a `VehicleParameters` and what load transfer, roll and actuators need.

    Build it with `of`, which fills what is not known, or with `stated`, which asks for every number with its source. The
    front and rear loads of the car are not used: the wheels carry m g, shared by the axle distances.

    Args:
        car: mass, inertia, axle distances, stiffness of the axles at their static load.
        centre_height: [m].
        front_track: [m].
        rear_track: [m].
        roll_inertia: [kg m^2].
        roll_stiffness: [N m/rad], more than m g centre_height.
        front_roll_share: from 0 to 1.
        roll_damping: [N m s/rad].
        pitch_lag: [s].
        front_relaxation: [m].
        rear_relaxation: [m].
        steering_lag: [s].
        steering_rate: [rad/s].
        brake_front_share: from 0 to 1.
        drive_front_share: from 0 to 1.
        longitudinal_share: above 0 and below 1.
        peak_load_ratio: above 0.
        tyre_shape: from 1 to below 2.
        tyre_curvature: at most 1.
        friction: mu.
        sources: name of a number -> where it was taken from.

    Raises:
        BadInput: a number outside its range, or a source for an unknown number.
    """

    car: VehicleParameters
    centre_height: float
    front_track: float
    rear_track: float
    roll_inertia: float
    roll_stiffness: float
    front_roll_share: float
    roll_damping: float
    pitch_lag: float
    front_relaxation: float
    rear_relaxation: float
    steering_lag: float
    steering_rate: float
    brake_front_share: float
    drive_front_share: float
    longitudinal_share: float
    peak_load_ratio: float
    tyre_shape: float
    tyre_curvature: float
    friction: float
    sources: Mapping[str, str] = field(default_factory=dict, hash=False, repr=False)

    def __post_init__(self) -> None:
        known_keys(f"`sources` of `{self.car.name}`", self.sources, list(_UNITS))
        for name in _UNITS:
            object.__setattr__(self, name, float(getattr(self, name)))
            low, high, words = _range(name)
            value = getattr(self, name)
            if not (isfinite(value) and low <= value <= high):
                raise BadInput(f"`{name}` of `{self.car.name}` is {value:g} {_UNITS[name][0]}; {words} is needed.")
        tipping = self.car.mass * GRAVITY * self.centre_height
        if self.roll_stiffness <= tipping:
            raise BadInput(
                f"`roll_stiffness` of `{self.car.name}` is {self.roll_stiffness:g} N m/rad; more than m g h = {tipping:g} N m/rad "
                "is needed, or the body falls over. Raise the stiffness or lower the centre."
            )

    @staticmethod
    def stated(car: VehicleParameters, **quantities: Quantity) -> "DoubleTrackParameters":
        """Build the parameters from quantities that carry unit and source, none left out.

        Args:
            car: the single-track numbers.
            quantities: name -> `Quantity` in the SI unit of that number.

        Raises:
            BadInput: an unknown or missing number, or a unit other than the expected one.
        """
        known_keys(f"`{car.name}`", quantities, list(_UNITS))
        if lacking := [name for name in _UNITS if name not in quantities]:
            raise BadInput(
                f"`{car.name}` lacks {', '.join(f'`{n}`' for n in lacking)}; `of` fills in plausible numbers."
            )
        for name, quantity in quantities.items():
            if quantity.unit != _UNITS[name][0]:
                raise BadInput(
                    f"`{name}` of `{car.name}` is given in `{quantity.unit}`; it needs to be in `{_UNITS[name][0]}`."
                )
        return DoubleTrackParameters(
            car=car,
            **{name: quantity.value for name, quantity in quantities.items()},
            sources={name: quantity.source for name, quantity in quantities.items()},
        )

    @staticmethod
    def of(car: VehicleParameters, source: str = "set by hand", **known: float) -> "DoubleTrackParameters":
        """Return a plausible double track of a car; what is known takes the place of what is assumed.

        Args:
            car: the single-track numbers.
            source: where the known numbers were taken from.
            known: name -> value in its SI unit.

        Raises:
            BadInput: an unknown name or a number outside its range.
        """
        known_keys(f"`{car.name}`", known, list(_UNITS))
        filled = _plausible(car, known)
        return DoubleTrackParameters.stated(
            car,
            **{name: Quantity(value, _UNITS[name][0], known_source) for name, (value, known_source) in filled.items()}
            | {name: Quantity(value, _UNITS[name][0], source) for name, value in known.items()},
        )

    def table(self) -> list[Row]:
        """Return one row for each number used: name, value, unit, meaning, source; those of the car come first."""
        rows = [Row(n, getattr(self, n), *_UNITS[n], self.sources.get(n, "not stated")) for n in _UNITS]
        unused = ("front_load", "rear_load", *_UNITS)
        return [row for row in self.car.table() if row.name not in unused] + rows


def _range(name: str) -> tuple[float, float, str]:
    if name in _SHARES:
        return 0.0, 1.0, "a share from 0 to 1"
    if name == "longitudinal_share":
        return 1e-3, 0.999, "a share from 0.001 to 0.999"
    if name == "tyre_shape":
        return 1.0, 1.999, "a factor from 1 to below 2"
    if name == "tyre_curvature":
        return -20.0, 1.0, "a factor from -20 to 1"
    return 1e-6, 1e9, "a positive finite number"


def _plausible(car: VehicleParameters, known: Mapping[str, float]) -> dict[str, tuple[float, str]]:
    """Return value and source of each number; formulas use what is known of the others."""
    height = known.get("centre_height", car.centre_height or 0.5)
    track = 0.58 * car.wheelbase
    inertia = known.get("roll_inertia", car.mass * (0.33 * track) ** 2)
    tipping = car.mass * GRAVITY * height
    stiffness = known.get("roll_stiffness", tipping * (1.0 + 1.0 / 0.09))
    # A body that falls over is refused later, with its own message.
    damping = 0.6 * sqrt(max(stiffness - tipping, 1.0) * (inertia + car.mass * height**2))
    ours = "assumed, "
    return {
        "centre_height": (
            height,
            ours + "low saloon" if car.centre_height is None else car.source("centre_height"),
        ),
        "front_track": (track, ours + "0.58 wheelbases as a saloon of 2.6 m and 1.5 m"),
        "rear_track": (track, ours + "0.58 wheelbases as a saloon of 2.6 m and 1.5 m"),
        "roll_inertia": (inertia, ours + "radius of gyration of a third of the track"),
        "roll_stiffness": (stiffness, ours + "the body rolls 0.09 rad (5 deg) at 1 g"),
        "front_roll_share": (0.55, ours + "stabiliser stiffer at the front"),
        "roll_damping": (damping, ours + "damping ratio 0.3"),
        "pitch_lag": (0.1, ours + "pitch mode near 1.5 Hz"),
        "front_relaxation": (0.4, ours + "0.3 m to 0.6 m for passenger car tyres"),
        "rear_relaxation": (0.4, ours + "0.3 m to 0.6 m for passenger car tyres"),
        "steering_lag": (0.05, ours + "electric power steering of about 3 Hz"),
        "steering_rate": (0.8, ours + "about 700 deg/s at the steering wheel with ratio 15"),
        "brake_front_share": (0.65, ours + "near the load share under 0.5 g braking"),
        "drive_front_share": (1.0, ours + "front-wheel drive"),
        "longitudinal_share": (0.95, ours + "slip control that keeps some steering under full braking"),
        "peak_load_ratio": (2.5, ours + "stiffness grows as load to the power 0.7 at static load"),
        "tyre_shape": (1.35, ours + "usual lateral shape factor of passenger car tyres"),
        "tyre_curvature": (0.0, ours + "no further curvature"),
        "friction": (
            0.9 if car.friction is None else car.friction,
            ours + "dry asphalt" if car.friction is None else car.source("friction"),
        ),
    }
