"""A [gust] experiment as a TOML file: a car, its modes, what of it is uncertain, and a drive through side winds."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from luenberger.core import BadInput
from luenberger.core.checks import is_number, is_whole, known_keys
from luenberger.experiment.gust_drive import Choices, Drive, choices, windy_road
from luenberger.experiment.specification import notes, table
from luenberger.systems import Switched, System
from luenberger.systems.discretize import discretize
from luenberger.vehicle import VehicleParameters, car_named, wind_plant


@dataclass(frozen=True)
class GustSpecification:
    """What the [gust] part of an experiment file says; the defaults are the drive that the published numbers are compared on.

    Args:
        study: "switched", "crossover" or "double_track".
        title: headline of the page.
        notes: what a reader must know, shown on the page.
        car: name of the vehicle parameters.
        sample_time: step [s].
        samples: length of the drive.
        speed: slowest and fastest speed of the drive [m/s].
        modes: speed of each mode [m/s].
        ends: limits of the modes [m/s]; the first and the last bound the scheduled plants too.
        arm: distance of the gust force ahead of the centre of gravity [m], not zero.
        force: largest gust force of the drive [N].
        period: how long a gust and the pause before it last [s].
        steering: amplitude of the steering angle [rad].
        steering_period: of the steering [s].
        stiffness_share: uncertainty of both cornering stiffnesses, as a share.
        yaw_rate_noise: bound of the error of the gyro [rad/s].
        steering_error: bound of the error of the steering angle [rad].
        initial_half_width: of the box of the first state [m/s, rad/s].
        state_bound: half widths of a box that the state is known not to leave [m/s, rad/s]; empty for none.
        fade: share by which the storage falls in a step.
        friction: of the road of the double track.
        bounds: gust bounds that the crossover tries [N].
        runs: number of random runs beside those at vertices and the adversaries.
        seed: of the random numbers.
    """

    study: str
    title: str = "A car in side wind"
    notes: tuple[str, ...] = ()
    car: str = "gust_car"
    sample_time: float = 0.06
    samples: int = 500
    speed: tuple[float, ...] = (6.05, 19.85)
    modes: tuple[float, ...] = (8.5, 13.55, 18.05)
    ends: tuple[float, ...] = (6.0, 11.0, 16.0, 19.899)
    arm: float = 0.4
    force: float = 800.0
    period: float = 10.0
    steering: float = 0.031
    steering_period: float = 7.5
    stiffness_share: float = 0.1
    yaw_rate_noise: float = 0.005
    steering_error: float = 0.0
    initial_half_width: float = 0.01
    state_bound: tuple[float, ...] = (0.8, 0.3)
    fade: float = 0.5
    friction: float = 0.85
    bounds: tuple[float, ...] = (50.0, 100.0, 200.0, 500.0, 1000.0, 2000.0, 5000.0)
    runs: int = 40
    seed: int = 0

    def __post_init__(self) -> None:
        positive = (
            "sample_time",
            "samples",
            "force",
            "period",
            "steering_period",
            "initial_half_width",
            "runs",
            "friction",
        )
        for name in positive:
            if not getattr(self, name) > 0:
                raise BadInput(f"[gust] {name} is {getattr(self, name)!r}; a positive number is needed.")
        for name in ("steering", "stiffness_share", "yaw_rate_noise", "steering_error"):
            if not getattr(self, name) >= 0:
                raise BadInput(f"[gust] {name} is {getattr(self, name)!r}; a number >= 0 is needed.")
        if self.arm == 0:
            raise BadInput(
                "[gust] arm is 0; a gust at the centre of gravity cannot be decoupled from the yaw rate. Give a distance."
            )
        for name, least in (("speed", 2), ("ends", 2), ("bounds", 2)):
            values = getattr(self, name)
            if len(values) < least or min(values) <= 0 or (np.diff(values) <= 0).any():
                raise BadInput(f"[gust] {name} is {list(values)}; at least {least} rising positive numbers are needed.")
        if len(self.ends) != len(self.modes) + 1 or not all(
            a <= v < b for a, v, b in zip(self.ends, self.modes, self.ends[1:], strict=False)
        ):
            raise BadInput(
                f"[gust] modes {list(self.modes)} and ends {list(self.ends)}: one speed between each two limits is needed."
            )
        if len(self.speed) != 2 or not self.ends[0] <= self.speed[0] < self.speed[1] <= self.ends[-1]:
            raise BadInput(
                f"[gust] speed is {list(self.speed)}; [slowest, fastest] within {[self.ends[0], self.ends[-1]]} m/s is needed."
            )
        if self.state_bound and (len(self.state_bound) != 2 or min(self.state_bound) <= 0):
            raise BadInput(
                f"[gust] state_bound is {list(self.state_bound)}; two positive numbers [m/s, rad/s], or none, are needed."
            )

    @property
    def vehicle(self) -> VehicleParameters:
        """The car."""
        return car_named(self.car)

    @property
    def options(self) -> dict[str, Any]:
        """Options of every observer that carries a set."""
        return {
            "initial_half_width": [self.initial_half_width] * 2,
            "state_bound": list(self.state_bound) if self.state_bound else None,
        }

    def scheduled(self, **options: Any) -> System:
        """Return the sampled plant over all speeds, by Euler's rule.

        Args:
            options: of `wind_plant`, in place of what the file says.
        """
        car = self.vehicle
        around = ((1 - self.stiffness_share) * np.ones(2), (1 + self.stiffness_share) * np.ones(2))
        low, high = (share * np.array([car.front_stiffness, car.rear_stiffness]) for share in around)
        given: dict[str, Any] = {
            "gust_arm": self.arm,
            "stiffness": ((float(low[0]), float(high[0])), (float(low[1]), float(high[1]))),
            "yaw_rate_noise": self.yaw_rate_noise,
            "steering_error": self.steering_error,
        }
        if self.stiffness_share == 0:
            del given["stiffness"]
        return discretize(
            wind_plant(car, (self.ends[0], self.ends[-1]), **{**given, **options}), self.sample_time, "euler"
        )

    def switched(self, dwell: int = 1, **options: Any) -> Switched:
        """Return the plant with one mode for each speed.

        Args:
            dwell: samples between two switches that are trusted.
            options: see `scheduled`.
        """
        plant = self.scheduled(**options)
        frozen = [plant.freeze(speed=v, inverse_speed=1 / v) for v in self.modes]
        return Switched.of(frozen, "speed", self.ends, dwell=dwell, unit="m/s")

    def with_force(self, force: float) -> "GustSpecification":
        """Return the experiment with other gusts.

        Args:
            force: of the largest [N].
        """
        return replace(self, force=force)

    def road(self) -> Drive:
        """Return the drive."""
        return windy_road(
            self.samples,
            self.sample_time,
            speed=(self.speed[0], self.speed[1]),
            modes=self.modes,
            ends=self.ends,
            steering=self.steering,
            steering_period=self.steering_period,
            gust=self.force,
            gust_period=self.period,
        )

    def unknown(self) -> Choices:
        """Return what stiffness and noise do on every run."""
        return choices(self.samples, random=self.runs, seed=self.seed)


def read_gust(path: str | Path) -> GustSpecification | None:
    """Read an experiment file, None where it has no [gust] part.

    Args:
        path: TOML file.

    Raises:
        BadInput: unknown keys, values of the wrong kind or out of range, other parts beside [gust].
    """
    path = Path(path)
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, tomllib.TOMLDecodeError):
        # Said better where every experiment file is read.
        return None
    if "gust" not in data:
        return None
    known_keys(f"`{path.name}`", data, ("title", "notes", "gust"))
    kinds: Mapping[str, Any] = {f.name: f.type for f in fields(GustSpecification)}
    given = table(data["gust"], "[gust]", path)
    known_keys(f"[gust] of `{path.name}`", given, [n for n in kinds if n not in ("title", "notes")])
    if "study" not in given:
        raise BadInput(f'[gust] of `{path.name}` has no `study`; add one of "switched", "crossover", "double_track".')
    values: dict[str, Any] = {name: _value(name, value, kinds[name]) for name, value in given.items()}
    title: dict[str, Any] = {"title": str(data["title"])} if "title" in data else {}
    return GustSpecification(**values, **title, notes=notes(data, path))


def _value(name: str, value: Any, kind: Any) -> Any:
    if kind is str and isinstance(value, str):
        return value
    if kind is int and is_whole(value):
        return value
    if kind is float and is_number(value):
        return float(value)
    if kind == tuple[float, ...] and isinstance(value, list) and all(map(is_number, value)):
        return tuple(map(float, value))
    needed = {str: "a text", int: "a whole number", float: "a number"}.get(kind, "a list of numbers")
    raise BadInput(f"[gust] {name} is {value!r}; {needed} is needed.")
