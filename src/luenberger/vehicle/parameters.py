"""The numbers of a car, each with its unit and the place it was taken from."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from luenberger.core import BadInput
from luenberger.core.checks import is_number, known_keys

GRAVITY = 9.80665
# Sums of products of two-digit data: a Cf and b Cr of a car meant to be neutral agree to rounding, not exactly.
_NEUTRAL = 1e-9

_UNITS = {
    "mass": ("kg", "mass"),
    "yaw_inertia": ("kg m^2", "moment of inertia about the vertical axis through the centre of gravity"),
    "front_axle_distance": ("m", "centre of gravity to front axle, a"),
    "rear_axle_distance": ("m", "centre of gravity to rear axle, b"),
    "front_stiffness": ("N/rad", "cornering stiffness of the front axle, both wheels, Cf"),
    "rear_stiffness": ("N/rad", "cornering stiffness of the rear axle, both wheels, Cr"),
    "friction": ("", "friction coefficient between tyre and road, mu"),
    "front_load": ("N", "vertical load of the front axle"),
    "rear_load": ("N", "vertical load of the rear axle"),
    "centre_height": ("m", "height of the centre of gravity above the road"),
}
_NEEDED = tuple(_UNITS)[:6]


class Quantity(NamedTuple):
    """A number with its unit and source.

    Args:
        value: the number.
        unit: SI unit as text.
        source: where the number was taken from.
    """

    value: float
    unit: str
    source: str


class Row(NamedTuple):
    """One line of `VehicleParameters.table`: name, value, unit, meaning, source."""

    name: str
    value: float
    unit: str
    meaning: str
    source: str


@dataclass(frozen=True, kw_only=True)
class VehicleParameters:
    """A car as the single-track models see it; lengths from the centre of gravity, stiffness of whole axles.

    Shipped cars and cars for a report are built with `VehicleParameters.stated`, which asks for unit and source.

    Args:
        name: how the car is called in tables.
        mass: m [kg].
        yaw_inertia: Iz [kg m^2].
        front_axle_distance: a [m].
        rear_axle_distance: b [m].
        front_stiffness: Cf [N/rad], both wheels.
        rear_stiffness: Cr [N/rad], both wheels.
        friction: mu, needed by saturating tyres.
        front_load: vertical load of the front axle [N]; left out: the static share of m g.
        rear_load: vertical load of the rear axle [N]; left out: the static share of m g.
        centre_height: height of the centre of gravity [m].
        sources: parameter name -> where the number was taken from.

    Raises:
        BadInput: a value that is no positive finite number, or a source for an unknown parameter.
    """

    name: str
    mass: float
    yaw_inertia: float
    front_axle_distance: float
    rear_axle_distance: float
    front_stiffness: float
    rear_stiffness: float
    friction: float | None = None
    front_load: float | None = None
    rear_load: float | None = None
    centre_height: float | None = None
    sources: Mapping[str, str] = field(default_factory=dict, hash=False, repr=False)

    def __post_init__(self) -> None:
        for name in _UNITS:
            value = getattr(self, name)
            if value is None:
                continue
            if not is_number(value) or value <= 0:
                raise BadInput(
                    f"`{name}` of `{self.name}` is {value!r} {_UNITS[name][0]}; a positive finite number"
                    f"{' in ' * bool(_UNITS[name][0])}{_UNITS[name][0]} is needed."
                )
            object.__setattr__(self, name, float(value))
        known_keys(f"`sources` of `{self.name}`", self.sources, list(_UNITS))

    @staticmethod
    def stated(name: str, **quantities: Quantity) -> "VehicleParameters":
        """Build a car from quantities that carry unit and source.

        Args:
            name: how the car is called.
            quantities: parameter name -> `Quantity` in the SI unit of that parameter.

        Raises:
            BadInput: unknown or missing parameter, or a unit other than the expected one.
        """
        known_keys(f"`{name}`", quantities, list(_UNITS))
        if lacking := [n for n in _NEEDED if n not in quantities]:
            raise BadInput(f"`{name}` lacks {', '.join(f'`{n}`' for n in lacking)}; a car needs {', '.join(_NEEDED)}.")
        for key, quantity in quantities.items():
            if quantity.unit != _UNITS[key][0]:
                raise BadInput(
                    f"`{key}` of `{name}` is given in `{quantity.unit}`; it needs to be in `{_UNITS[key][0]}`."
                )
        values = {key: quantity.value for key, quantity in quantities.items()}
        return VehicleParameters(name=name, **values, sources={k: q.source for k, q in quantities.items()})

    def with_values(self, source: str = "", **values: float) -> "VehicleParameters":
        """Return the car with some numbers replaced.

        Args:
            source: where the new numbers come from; left out: that they were set here, and the old value.
            values: parameter name -> value in its SI unit.

        Raises:
            BadInput: unknown parameter or a value that is no positive number.
        """
        known_keys(f"`{self.name}`", values, list(_UNITS))
        old = {
            n: "" if getattr(self, n) is None else f", instead of {getattr(self, n):g} {_UNITS[n][0]}" for n in values
        }
        new = {n: source or f"set by hand{old[n]}".rstrip() for n in values}
        return replace(self, **values, sources={**self.sources, **new})

    def unit(self, name: str) -> str:
        """Return the SI unit of a parameter."""
        known_keys(f"`{self.name}`", [name], list(_UNITS))
        return _UNITS[name][0]

    def source(self, name: str) -> str:
        """Return where the number of a parameter was taken from, "not stated" where nobody said."""
        known_keys(f"`{self.name}`", [name], list(_UNITS))
        return self.sources.get(name, "not stated")

    def table(self) -> list[Row]:
        """Return one row for each number that is known: name, value, unit, meaning, source."""
        given = {name: getattr(self, name) for name in _UNITS}
        return [Row(n, v, *_UNITS[n], self.source(n)) for n, v in given.items() if v is not None]

    @property
    def wheelbase(self) -> float:
        """Distance of the axles, a + b [m]."""
        return self.front_axle_distance + self.rear_axle_distance

    @property
    def front_axle_load(self) -> float:
        """Vertical load of the front axle [N]: `front_load`, or the static share m g b / (a + b)."""
        static = self.mass * GRAVITY * self.rear_axle_distance / self.wheelbase
        return static if self.front_load is None else self.front_load

    @property
    def rear_axle_load(self) -> float:
        """Vertical load of the rear axle [N]: `rear_load`, or the static share m g a / (a + b)."""
        static = self.mass * GRAVITY * self.front_axle_distance / self.wheelbase
        return static if self.rear_load is None else self.rear_load

    @property
    def understeer_gradient(self) -> float:
        """Steering angle per lateral acceleration beyond the kinematic one, m / (a + b) (b / Cf - a / Cr) [rad s^2/m].

        Positive understeers, zero is neutral, negative oversteers and has a critical speed.
        """
        front = self.rear_axle_distance / self.front_stiffness
        rear = self.front_axle_distance / self.rear_stiffness
        return self.mass / self.wheelbase * (front - rear)

    @property
    def is_neutral_steer(self) -> bool:
        """True where a Cf = b Cr to rounding: the slip angles are then unobservable from their difference."""
        front = self.front_axle_distance * self.front_stiffness
        rear = self.rear_axle_distance * self.rear_stiffness
        return abs(front - rear) <= _NEUTRAL * (front + rear)
