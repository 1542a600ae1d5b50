"""The double track beside other simulators: how far they differ when driven by one steering and one speed."""

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from math import cos, pi, sin
from pathlib import Path
from typing import Any

import diffrax
import jax.numpy as jnp
import numpy as np

from luenberger.core import MissingExtra, Signal, Trajectory
from luenberger.experiment.published.row import Row, judged
from luenberger.logs import read_log
from luenberger.simulate import TruthModel, simulate
from luenberger.vehicle.cars import carmaker_car, wang_car
from luenberger.vehicle.double_track import DoubleTrack
from luenberger.vehicle.double_track_parameters import DoubleTrackParameters
from luenberger.vehicle.parameters import GRAVITY, Quantity, VehicleParameters

# The gravity of commonroad-vehicle-models, to recover its axle stiffness from stiffness per load.
COMMONROAD_GRAVITY = 9.81
STEP = 1e-3
SLALOM = Path(__file__).parents[1] / "data" / "carmaker_slalom.csv"
CARSIM = Path(__file__).parents[4].parent / "shared" / "data" / "carsim-exports"
_UNITS = {"yaw_rate": "rad/s", "lateral_acceleration": "m/s^2", "lateral_speed": "m/s"}


@dataclass(frozen=True)
class Reference:
    """A recorded run of another simulator and the car that it is believed to be.

    Args:
        log: steering, speed, and those of yaw rate, lateral acceleration and lateral speed that are compared.
        parameters: the car for our model, taken from what is stated about the other.
        lateral_speed: channel of `DoubleTrack` that means the lateral speed of the log.
        band: largest rms difference over rms signal that counts as agreement.
        reason: what the two models do differently.
    """

    log: Trajectory
    parameters: DoubleTrackParameters
    lateral_speed: str
    band: float
    reason: str


def double_lane(time: Any) -> tuple[Any, Any]:
    """Return steering angle [rad] and its rate [rad/s] of the double lane change of 10 s, for a float or an array.

    Two lobes A 0.7698 (sin 2 pi s - sin(4 pi s) / 2), s = (t - t0) / 2.5 s, (A, t0) = (0.022, 0.5 s) and (-0.045, 4 s).

    Args:
        time: [s].
    """
    angle, rate = np.zeros_like(time, dtype=float), np.zeros_like(time, dtype=float)
    for size, start in ((0.022, 0.5), (-0.045, 4.0)):
        s = (np.asarray(time) - start) / 2.5
        inside = (s >= 0) & (s <= 1)
        angle = angle + inside * size * 0.7698 * (np.sin(2 * pi * s) - 0.5 * np.sin(4 * pi * s))
        rate = rate + inside * size * 0.7698 * 2 * pi / 2.5 * (np.cos(2 * pi * s) - np.cos(4 * pi * s))
    return angle, rate


def slowing(time: float) -> float:
    """Return the acceleration [m/s^2] that slows from 78 km/h to 23 km/h along half a cosine between 1 s and 9 s.

    Args:
        time: [s].
    """
    return -(78 - 23) / 3.6 / 2 * pi / 8 * sin(pi * (time - 1) / 8) if 1 <= time <= 9 else 0.0


def followed(parameters: DoubleTrackParameters, log: Trajectory, tracking: float = 5.0) -> Trajectory:
    """Return our double track driven by the steering and speed of a log.

    The acceleration demand is the slope of the logged speed plus `tracking` times the speed error; the steering demand leads
    by the lag of the actuator, so that the road-wheel angle is the logged one where the rate limit allows.

    Args:
        parameters: the car.
        log: channels "steering" [rad] and "speed" [m/s].
        tracking: inverse time constant of the speed error [1/s].
    """
    model = DoubleTrack(parameters)
    steering, speed = log["steering"].values, log["speed"].values

    def tracked(u: Any, x: Any) -> Any:
        return jnp.stack([u[0], u[1] + tracking * (u[2] - x[3])])

    driven = TruthModel(
        dynamics=lambda t, x, u, r: model.dynamics(t, x, tracked(u, x)),
        output=lambda t, x, u, r: model.output(t, x, tracked(u, x)),
        states=model.states,
        inputs=("steering_demand", "acceleration_ahead", "speed_demand"),
        outputs=model.outputs,
        units=model.units,
        name=model.name,
    )
    lead = steering + parameters.steering_lag * np.gradient(steering, log.time)
    u = np.stack([lead, np.gradient(speed, log.time), speed], axis=1)
    x0 = model.start(float(speed[0])).at[8].set(float(steering[0]))
    # 1e-6 of a slip angle is far below every difference reported here.
    return simulate(
        driven, time=log.time, x0=x0, u=u, interpolation="linear", rtol=1e-6, atol=1e-8, solver=diffrax.Tsit5()
    )


def compared(reference: Reference) -> list[Row]:
    """Return one row for each channel: rms and peak there, rms difference and peak here.

    Args:
        reference: the other simulator.
    """
    ours = followed(reference.parameters, reference.log)
    found = []
    for theirs, unit in _UNITS.items():
        if theirs not in reference.log:
            continue
        own = reference.lateral_speed if theirs == "lateral_speed" else theirs
        logged, simulated = reference.log[theirs].values, ours[own].values
        miss, size = (float(np.sqrt(np.mean(v**2))) for v in (simulated - logged, logged))
        found.append(
            judged(
                f"{theirs.replace('_', ' ')}, {reference.log.name}",
                reference.log.source,
                f"rms {size:.4g} {unit}, peak {np.abs(logged).max():.4g} {unit}",
                f"rms difference {miss:.4g} {unit} ({100 * miss / size:.1f} %), peak {np.abs(simulated).max():.4g} {unit}",
                f"Not tuned. Agreement is called below {100 * reference.band:.0f} % rms. {reference.reason}",
                reproduced=miss <= reference.band * size,
                deviation=miss,
            )
        )
    return found


def single_track_drift(alike: bool = False) -> Reference:
    """Return the single-track drift model with the numbers of Wang's car on the double lane change.

    Args:
        alike: both models are brought to the physics that they share, as far as their numbers allow: theirs loses the side
            force that braking turns out, ours the roll, the relaxation and the degressive stiffness. What is left checks the equations.

    Raises:
        MissingExtra: commonroad-vehicle-models is not installed.
    """
    p = _commonroad("parameters_vehicle2")()
    p.m, p.I_z, p.a, p.b, p.h_s, p.h_cg = wang_car.mass, wang_car.yaw_inertia, 0.948, 1.422, 0.5, 0.5
    p.tire.p_ky1 = -(wang_car.front_stiffness + wang_car.rear_stiffness) / (wang_car.mass * COMMONROAD_GRAVITY)
    known = _known(p)
    if alike:
        p.tire.r_vy1 = p.tire.r_vy3 = 0.0
        known |= {"front_relaxation": 0.03, "rear_relaxation": 0.03, "peak_load_ratio": 1e3, "pitch_lag": 0.01}
        known |= {"roll_stiffness": 2e6, "roll_damping": 6e4}

    def observed(x: list[float], f: list[float]) -> list[float]:
        v, beta = x[3], x[6]
        ay = f[3] * sin(beta) + v * cos(beta) * (f[6] + x[5])
        return [x[2], v * cos(beta), x[5], ay, v * sin(beta)]

    name = "commonroad single-track drift" + ", both with shared physics only" * alike
    parameters = DoubleTrackParameters.of(wang_car, f"{_COMMONROAD}, single-track drift model", **known)
    log = _recorded(name, "std", p, observed)
    return Reference(log, parameters, "lateral_speed", 0.05 if alike else 0.1, _ALIKE if alike else _DRIFT)


_COMMONROAD = "commonroad-vehicle-models 3.0.2"
_DRIFT = (
    "The other has wheel speeds, a side force that braking turns out and stiffness proportional to axle load; ours has roll, "
    "lateral load transfer, degressive stiffness and a relaxation length of 0.4 m (all assumed)."
)
_ALIKE = (
    "Roll, relaxation and degressive stiffness are taken from ours, the side force turned out by braking from the other. Wheel "
    "speeds and weighting curves of combined slip there, the friction ellipse and a relaxation of 0.03 m here remain; without "
    "braking the lateral speed differs by 2.0 %. These rows check the equations; those before show what modelling is worth."
)


def multi_body() -> Reference:
    """Return the multi-body model of a BMW 320i, untouched, on the double lane change.

    Raises:
        MissingExtra: commonroad-vehicle-models is not installed.
    """
    p = _commonroad("parameters_vehicle2")()

    def observed(x: list[float], f: list[float]) -> list[float]:
        parts = ((p.m_s, 10), (p.m_uf, 15), (p.m_ur, 20))
        ay = sum(mass * (f[k] + x[5] * x[3]) for mass, k in parts) / p.m
        return [x[2], x[3], x[5], ay, x[10]]

    source = f"{_COMMONROAD}, vehicle 2"
    stiffness = -p.tire.p_ky1 * p.m * COMMONROAD_GRAVITY / (p.a + p.b)
    car = VehicleParameters.stated(
        "BMW 320i of commonroad",
        mass=Quantity(p.m, "kg", source),
        yaw_inertia=Quantity(p.I_z, "kg m^2", source),
        front_axle_distance=Quantity(p.a, "m", source),
        rear_axle_distance=Quantity(p.b, "m", source),
        front_stiffness=Quantity(stiffness * p.b, "N/rad", f"{source}, p_ky1 times load"),
        rear_stiffness=Quantity(stiffness * p.a, "N/rad", f"{source}, p_ky1 times load"),
    )
    # Springs and stabilisers of each axle about its middle; the auxiliary stiffness is stated with a minus sign.
    front, rear = (k * t**2 / 2 - extra for k, t, extra in ((p.K_sf, p.T_f, p.K_tsf), (p.K_sr, p.T_r, p.K_tsr)))
    known = _known(p) | {"front_track": p.T_f, "rear_track": p.T_r, "roll_inertia": p.I_Phi_s}
    known |= {"roll_stiffness": front + rear, "front_roll_share": front / (front + rear)}
    known["roll_damping"] = p.K_sdf * p.T_f**2 / 2 + p.K_sdr * p.T_r**2 / 2
    log = _recorded("commonroad multi-body BMW 320i", "mb", p, observed)
    # The slip of its tyres is computed from the lateral speed of the body without the roll that lies between the two.
    return Reference(log, DoubleTrackParameters.of(car, source, **known), "lateral_speed", 0.2, _MULTI_BODY)


_MULTI_BODY = (
    "The other has camber thrust that jumps with the sign of the camber, compliant joints, springing tyres and no relaxation "
    "length; ours has degressive stiffness and a relaxation length (assumed). The lateral speed is small, 3 mrad of sideslip."
)


def carmaker_slalom() -> Reference:
    """Return the recorded slalom at 20 km/h that ships with the package, and its car as published."""
    channels = {
        "steering": {"column": ["Car.SteerAngleFL", "Car.SteerAngleFR"], "unit": "rad"},
        "speed": {"column": "Car.vx", "unit": "m/s"},
        "yaw_rate": {"column": "Car.YawRate", "unit": "rad/s"},
        "lateral_acceleration": {"column": "Car.ay", "unit": "m/s^2"},
        "lateral_speed": {"column": "Car.vy", "unit": "m/s"},
    }
    log = read_log(SLALOM, channels, time="Time", name="CarMaker slalom", source="github nastarankhds/KalmanFilter")
    reason = "Mass, inertia, axles and stiffness are published; roll, tracks and relaxation are assumed."
    return Reference(log, DoubleTrackParameters.of(carmaker_car), "body_lateral_speed", 0.2, reason)


_CARSIM = "CarSim export of the double lane change"
_SLIP = f"{_CARSIM}; axle force on the slip angle of rigid wheels below 1 deg, so compliance steer counts as stiffness"
carsim_car = VehicleParameters.stated(
    "car of the CarSim exports",
    mass=Quantity(1501.1, "kg", f"{_CARSIM}; sum of the wheel loads at rest"),
    yaw_inertia=Quantity(2270.0, "kg m^2", f"{_CARSIM}; yaw acceleration on axle forces, 2220 to 2310"),
    front_axle_distance=Quantity(1.05, "m", f"{_CARSIM}; load share 0.361 of an assumed wheelbase of 2.91 m"),
    rear_axle_distance=Quantity(1.86, "m", f"{_CARSIM}; load share 0.639 of an assumed wheelbase of 2.91 m"),
    front_stiffness=Quantity(142.5e3, "N/rad", _SLIP),
    rear_stiffness=Quantity(113e3, "N/rad", _SLIP),
    friction=Quantity(0.83, "", f"{_CARSIM}; largest force over load of a wheel, 0.82 to 0.84"),
)
_CARSIM_REASON = (
    "Axle stiffness, friction and load transfer are read from forces and slip in the log, not from the motion (tried first: tyre "
    "stiffness without compliance steer and friction 0.9, which spins at 120 km/h, 89 % in yaw rate). Suspension kinematics, "
    "aerodynamics and the tyre table of the other are not ours; roll damping, relaxation and tyre shape are assumed. At 0.79 g of "
    "0.83 g the rear axle of ours lets go; 0.65 of the roll stiffness in front would leave 30 %."
)


def carsim_runs(folder: Path = CARSIM) -> list[Reference]:
    """Return two CarSim runs, a double lane change at 120 km/h and slowly increasing steering at 80 km/h.

    Args:
        folder: where the exports lie.
    """
    parameters = DoubleTrackParameters.of(
        carsim_car,
        f"{_CARSIM}: wheel speeds in the turn, load transfer and roll angle over lateral acceleration",
        centre_height=0.57,
        front_track=1.69,
        rear_track=1.69,
        roll_stiffness=carsim_car.mass * GRAVITY * 0.57 * (1 + 1 / 0.0675),
        front_roll_share=0.52,
    )
    common: dict[str, dict[str, Any]] = {
        "steering": {"column": ["Steer_L1", "Steer_R1"], "unit": "deg"},
        "speed": {"column": "Vx", "unit": "km/h"},
        "lateral_acceleration": {"column": "Ay", "unit": "g"},
    }
    fast = {"yaw_rate": {"column": "AVz", "unit": "deg/s"}, "lateral_speed": {"column": "Vy", "unit": "km/h"}}
    found = []
    for file, name, channels in (
        ("dlc_120kmh_baseline.csv", "CarSim double lane change at 120 km/h", common | fast),
        ("slowly_increasing_steer_80kmh.csv", "CarSim slowly increasing steer at 80 km/h", common),
    ):
        log = read_log(folder / file, channels, time="t", name=name, source="CarSim 2022.0")
        found.append(Reference(log, parameters, "body_lateral_speed", 0.2, _CARSIM_REASON))
    return found


def rows(progress: Callable[[Row], None] | None = None) -> list[Row]:
    """Return the differences between our double track and four other simulators, none tuned away.

    Args:
        progress: called with each row as soon as it is known.
    """
    found: list[Row] = []

    def told(fresh: list[Row]) -> None:
        found.extend(fresh)
        if progress is not None:
            for row in fresh:
                progress(row)

    if find_spec("vehiclemodels") is None:
        told([_skipped("commonroad single-track drift and multi-body", "package vehiclemodels is not installed")])
    else:
        for reference in (single_track_drift(), single_track_drift(alike=True), multi_body()):
            told(compared(reference))
    told(compared(carmaker_slalom()))
    if not CARSIM.is_dir():
        told([_skipped("CarSim exports", "folder absent")])
    else:
        for reference in carsim_runs():
            told(compared(reference))
    return found


def _skipped(item: str, lacking: str) -> Row:
    return judged(item, "-", "-", f"skipped: {lacking}", "There is nothing to compare with.", reproduced=False)


def _commonroad(name: str) -> Any:
    """Return the function that commonroad-vehicle-models keeps in a file of its own name, loaded only when asked for."""
    if find_spec("vehiclemodels") is None:
        raise MissingExtra("The comparison needs another package; run `pip install commonroad-vehicle-models`.")
    return getattr(import_module(f"vehiclemodels.{name}"), name)


def _known(p: Any) -> dict[str, float]:
    tyre = {"friction": p.tire.p_dy1, "tyre_shape": p.tire.p_cy1, "tyre_curvature": p.tire.p_ey1}
    return tyre | {"centre_height": p.h_cg, "brake_front_share": p.T_sb, "drive_front_share": p.T_se}


def _recorded(name: str, model: str, p: Any, observed: Callable[[list[float], list[float]], list[float]]) -> Trajectory:
    """Run a model of commonroad over the double lane change by classical Runge-Kutta steps and keep every tenth one."""
    dynamics = _commonroad(f"vehicle_dynamics_{model}")
    x = np.array(_commonroad(f"init_{model}")([0.0, 0.0, 0.0, 78 / 3.6, 0.0, 0.0, 0.0], p), dtype=float)
    kept, time = [], np.arange(10_001) * STEP

    def rate(state: np.ndarray, t: float) -> np.ndarray:
        # The models write into the state that they are given.
        return np.array(dynamics(list(state), [float(double_lane(t)[1]), slowing(t)], p))

    for k, t in enumerate(time):
        first = rate(x, t)
        if k % 10 == 0:
            kept.append(observed(list(x), list(first)))
        second = rate(x + STEP / 2 * first, t + STEP / 2)
        third = rate(x + STEP / 2 * second, t + STEP / 2)
        x = x + STEP / 6 * (first + 2 * second + 2 * third + rate(x + STEP * third, t + STEP))
    units = {"steering": "rad", "speed": "m/s"} | _UNITS
    signals = [Signal(n, unit, values) for (n, unit), values in zip(units.items(), np.array(kept).T, strict=True)]
    return Trajectory(time[::10], signals, name, _COMMONROAD)
