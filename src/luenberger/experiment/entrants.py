"""Who takes part in a sideslip comparison: how each entrant is built from the car, and how its estimate becomes sideslip.

Every entrant has the same freedom where a file asks for tuning: the stiffness it believes in, and one number of its own.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from scipy.signal import lfilter

from luenberger.core import BadInput, Trajectory
from luenberger.core.checks import is_number, known_keys, nearest
from luenberger.experiment.entrant import Entrant, Kind, Setting
from luenberger.experiment.entrants_slip import (
    least_disturbance,
    least_disturbance_two_dof,
    lpv_linear,
    lpv_nonlinear,
    smallest_gain,
)
from luenberger.experiment.envelope import OPTIONS, envelope
from luenberger.methods.interval import IntervalLuenberger
from luenberger.methods.interval_width import IntervalWidth
from luenberger.methods.kalman_gain import KalmanGain
from luenberger.methods.method import Method
from luenberger.observers import AlgebraicEstimate, ExtendedKalmanFilter, UnscentedKalmanFilter, zero_estimate
from luenberger.replay import Channels
from luenberger.synthesize import synthesize
from luenberger.systems.discretize import runge_kutta
from luenberger.vehicle import (
    BrushTyre,
    LinearTyre,
    SingleTrack,
    Tyre,
    VehicleParameters,
    lateral_speed_plant,
    rear_axle_sideslip,
    sideslip_from_lateral_speed,
)

# Measurement noise every filter assumes [rad/s, m/s^2]: a production yaw-rate sensor and a vibrating accelerometer.
SENSOR_DEVIATION = (0.01, 0.5)
TYRE: tuple[str, ...] = ("front_stiffness", "rear_stiffness", "friction")


def build(setting: Setting, options: Mapping[str, Any], knobs: Mapping[str, float] | None = None) -> Entrant:
    """Build one entrant.

    Args:
        setting: car, box, sample time.
        options: `kind` and the options of that kind.
        knobs: tuned values that replace options and the stiffness of the car.

    Raises:
        BadInput: unknown kind or option (the nearest known one is named), option not a positive number.
    """
    kind = kind_of(options)
    given = {k: v for k, v in options.items() if k != "kind"}
    known_keys(f"An entrant of kind `{options['kind']}`", given, [*kind.options])
    for name, value in given.items():
        if not is_number(value) or value <= 0:
            raise BadInput(f"Option `{name}` of kind `{options['kind']}` is {value!r}; a positive number is needed.")
    tuned = dict(knobs or {})
    stiffness = {k: tuned.pop(k) for k in ("front_stiffness", "rear_stiffness") if k in tuned}
    believed = replace(setting, car=setting.car.with_values("", **stiffness))
    return kind.build(believed, {**kind.options, **given, **tuned})


def kind_of(options: Mapping[str, Any]) -> Kind:
    """Return the kind an entrant names.

    Args:
        options: table of an entrant, with `kind`.

    Raises:
        BadInput: missing or unknown kind.
    """
    name = str(options.get("kind", ""))
    if name not in KINDS:
        raise BadInput(f"An entrant has the unknown kind `{name}`.{nearest(name, KINDS)}")
    return KINDS[name]


def _zero(setting: Setting, options: Mapping[str, float]) -> Entrant:
    return Entrant(zero_estimate(1, setting.dt, ("sideslip",)), Channels(), lambda x, trajectory: x[:, 0])


def _rear_axle(tyre: str) -> Callable[[Setting, Mapping[str, float]], Entrant]:
    def built(setting: Setting, options: Mapping[str, float]) -> Entrant:
        channels = Channels((), ("yaw_rate", "lateral_acceleration"), ("speed", "rear_stiffness", "friction"))
        return Entrant(
            AlgebraicEstimate(_rear_axle_formula(_without_tyres(setting.car), tyre), setting.dt, ("sideslip",)),
            channels,
            lambda x, trajectory: _low_pass(x[:, 0], setting.dt, options["time_constant"]),
            {"rear_stiffness": setting.car.rear_stiffness, "friction": options.get("friction", 1.0)},
        )

    return built


@cache
def _rear_axle_formula(car: VehicleParameters, tyre: str) -> Callable[[Any, Any, Any], jax.Array]:
    def formula(u: Any, y: Any, r: Any) -> jax.Array:
        rear = LinearTyre(r[1]) if tyre == "linear" else BrushTyre(r[1], r[2] * car.rear_axle_load)
        return jnp.atleast_1d(rear_axle_sideslip(y[0], r[0], y[1], car, tyre=rear))

    return formula


def _low_pass(values: np.ndarray, dt: float, time_constant: float) -> np.ndarray:
    """Causal first-order filter, at rest at its first sample."""
    keep = float(np.exp(-dt / time_constant))
    return np.asarray(lfilter([1 - keep], [1, -keep], values, zi=[keep * values[0]])[0])


def _without_tyres(car: VehicleParameters) -> VehicleParameters:
    """The stiffness comes in as a signal, so cars that differ in it alone share one compiled function."""
    return car.with_values("read from a signal", front_stiffness=1.0, rear_stiffness=1.0)


def _lpv_kalman_gain(setting: Setting, options: Mapping[str, float]) -> Entrant:
    plant = lateral_speed_plant(setting.car, setting.speed, outputs=("yaw_rate", "lateral_acceleration"))
    # Covariances of sampled noise become spectral densities when multiplied by the sample time.
    densities = np.diag(np.square(SENSOR_DEVIATION)) * setting.dt
    design = synthesize(plant, KalmanGain(np.diag([1.0, 0.1]) * options["process_density"], densities))
    channels = Channels(("steering",), ("yaw_rate", "lateral_acceleration"), ("speed", "inverse_speed"))
    return Entrant(
        design.observer(setting.dt, method="exact", clip_scheduling=True), channels, _from_lateral_speed, design=design
    )


def _filter(
    filter_type: type[ExtendedKalmanFilter] | type[UnscentedKalmanFilter],
    tyre: str,
    outputs: tuple[str, ...] = ("yaw_rate", "lateral_acceleration"),
) -> Callable[[Setting, Mapping[str, float]], Entrant]:
    def built(setting: Setting, options: Mapping[str, float]) -> Entrant:
        car = setting.car
        observer = filter_type(
            _single_track_maps(_without_tyres(car), tyre, setting.dt, len(outputs)),
            setting.dt,
            measurement_covariance=np.diag(np.square(SENSOR_DEVIATION[: len(outputs)])),
            initial_covariance=np.diag([1.0, 0.1]),
            process_density=np.diag([1.0, 0.1]) * options["process_density"],
            states=("lateral_speed", "yaw_rate"),
        )
        channels = Channels(("steering",), outputs, ("speed", *TYRE))
        constants = dict(
            zip(TYRE, (car.front_stiffness, car.rear_stiffness, options.get("friction", 1.0)), strict=True)
        )
        return Entrant(observer, channels, _from_lateral_speed, constants)

    return built


@cache
def _single_track_maps(
    car: VehicleParameters, tyre: str, dt: float, ny: int
) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """Return (one-step map, first outputs) of the single track with r = (speed, front stiffness, rear stiffness, friction)."""

    def model(r: Any) -> SingleTrack:
        def axle(stiffness: Any, load: float) -> Tyre:
            return LinearTyre(stiffness) if tyre == "linear" else BrushTyre(stiffness, r[3] * load)

        return SingleTrack(car, axle(r[1], car.front_axle_load), axle(r[2], car.rear_axle_load))

    def advance(x: Any, u: Any, r: Any) -> jax.Array:
        return runge_kutta(lambda z: model(r)(0.0, z, u, r), x, dt)

    def output(x: Any, u: Any, r: Any) -> jax.Array:
        return model(r).output(0.0, x, u, r)[:ny]

    return advance, output


def _from_lateral_speed(x: np.ndarray, trajectory: Trajectory) -> np.ndarray:
    return np.asarray(sideslip_from_lateral_speed(x[:, 0], trajectory["speed"].values))


def _narrowest(options: Mapping[str, float]) -> Method:
    # The sideslip is read off the rear slip angle; the front one only has to stay bounded.
    return IntervalWidth([options["slip_limit"]] * 2, weights=[0.1, 1.0])


_STIFFNESS = ("front_stiffness", "rear_stiffness")
KINDS: Mapping[str, Kind] = {
    "zero": Kind(_zero, {}, (), "sideslip is zero"),
    "rear_axle": Kind(
        _rear_axle("linear"),
        {"time_constant": 0.01},
        ("rear_stiffness", "time_constant"),
        "force balance of the rear axle from yaw rate, speed and lateral acceleration, linear tyre",
    ),
    "rear_axle_brush": Kind(
        _rear_axle("brush"),
        {"time_constant": 0.01, "friction": 1.0},
        ("rear_stiffness", "time_constant", "friction"),
        "the same force balance with a brush tyre that saturates",
    ),
    "lpv_brush": Kind(
        lpv_nonlinear(smallest_gain),
        {"decay_rate": 0.3, "friction": 1.0, "slip_limit": 0.1},
        (*_STIFFNESS, "friction", "decay_rate"),
        "certified LPV observer of the slip angles with brush tyres, from steering, speed and yaw rate",
    ),
    "lpv_extended": Kind(
        lpv_nonlinear(least_disturbance, disturbance=True),
        {"gain_limit": 10.0, "friction": 1.0, "slip_limit": 0.1},
        (*_STIFFNESS, "friction", "gain_limit"),
        "certified gain-scheduled nonlinear observer with brush tyres and least L2 gain, from steering, speed and yaw rate",
    ),
    "lpv_two_dof": Kind(
        lpv_nonlinear(least_disturbance_two_dof, disturbance=True),
        {"gain_limit": 10.0, "friction": 1.0, "slip_limit": 0.06},
        (*_STIFFNESS, "friction", "gain_limit"),
        "the same with a second gain in the argument of the tyres, by multipliers",
    ),
    "lpv_luenberger": Kind(
        lpv_linear,
        {"decay_rate": 3.0},
        (*_STIFFNESS, "decay_rate"),
        "certified LPV observer of the slip angles from steering, speed and yaw rate",
    ),
    "lpv_kalman_gain": Kind(
        _lpv_kalman_gain,
        {"process_density": 1.0},
        (*_STIFFNESS, "process_density"),
        "certified LPV Kalman gain from yaw rate and lateral acceleration",
    ),
    "interval": Kind(
        envelope(lambda options: IntervalLuenberger("mismatch", noise=True)),
        OPTIONS,
        (),
        "interval observer with proved containment, gain by the stiffness-weighted L2 bound of the width",
    ),
    "interval_residual": Kind(
        envelope(lambda options: IntervalLuenberger("residual")),
        OPTIONS,
        (),
        "interval observer with proved containment, gain by the L2 bound of the dissertation",
    ),
    "interval_width": Kind(
        envelope(_narrowest),
        OPTIONS,
        (),
        "interval observer with proved containment, gain by the steady width itself",
    ),
    "kalman": Kind(
        _filter(ExtendedKalmanFilter, "linear"),
        {"process_density": 1.0},
        (*_STIFFNESS, "process_density"),
        "Kalman filter, linear tyres",
    ),
    "ekf": Kind(
        _filter(ExtendedKalmanFilter, "brush"),
        {"process_density": 1.0, "friction": 1.0},
        (*_STIFFNESS, "friction", "process_density"),
        "extended Kalman filter, brush tyres",
    ),
    "ekf_yaw_rate": Kind(
        _filter(ExtendedKalmanFilter, "brush", ("yaw_rate",)),
        {"process_density": 1.0, "friction": 1.0},
        (*_STIFFNESS, "friction", "process_density"),
        "extended Kalman filter, brush tyres, without the accelerometer: what the slip-angle observers read",
    ),
    "ukf": Kind(
        _filter(UnscentedKalmanFilter, "brush"),
        {"process_density": 1.0, "friction": 1.0},
        (*_STIFFNESS, "friction", "process_density"),
        "unscented Kalman filter, brush tyres",
    ),
}
