"""Plants of the single track (bicycle) model, linear in the state, scheduled by speed.

Signs: x ahead, y to the left; steering delta, yaw rate r, vy, ay and tyre forces count to the left.

    m (d vy/dt + vx r) = Ff + Fr + w_force           alpha_f = delta - (vy + a r) / vx         Ff = Cf alpha_f
    Iz d r/dt          = a Ff - b Fr + w_torque      alpha_r = -(vy - b r) / vx                Fr = Cr alpha_r
"""

from collections.abc import Sequence
from typing import Any, Literal

import jax
import jax.numpy as jnp
import numpy as np

from luenberger.algebra import Polynomial
from luenberger.core import BadInput
from luenberger.core.checks import nearest
from luenberger.systems import Nonlinearity, Parameter, System
from luenberger.vehicle.parameters import VehicleParameters
from luenberger.vehicle.tyres import Tyre

_SPEED_LAW = ((-1.0, (("inverse_speed", 2), ("acceleration", 1))),)
_SLIP_UNITS = {
    "front_slip": "rad",
    "rear_slip": "rad",
    "steering": "rad",
    "steering_rate": "rad/s",
    "yaw_rate": "rad/s",
    "inverse_speed": "s/m",
    "acceleration": "m/s^2",
}
_LATERAL_UNITS = {
    "lateral_speed": "m/s",
    "yaw_rate": "rad/s",
    "steering": "rad",
    "lateral_acceleration": "m/s^2",
    "speed": "m/s",
    "inverse_speed": "s/m",
}


def slip_angle_plant(
    car: VehicleParameters,
    speed: tuple[float, float],
    acceleration: tuple[float, float],
    *,
    tyres: tuple[Tyre, Tyre] | None = None,
    slip_limit: float | None = None,
    jerk: float | None = None,
    disturbance: bool = False,
    stiffness: tuple[tuple[float, float], tuple[float, float]] | None = None,
    force_offset: float | tuple[float, float] | None = None,
    noise: tuple[float, float, float] | None = None,
    scale_error: tuple[tuple[float, float], tuple[float, float]] | None = None,
    output: Literal["slip_difference", "slip_constraint"] = "slip_difference",
) -> System:
    """Return the plant with the slip angles of the axles as states and the yaw rate as a measured input.

    Choose it for observers that must hold at all speeds: the speed enters through s = 1 / vx and the product s ax alone,
    with ax = d vx/dt (not the accelerometer), so the matrices are multi-affine and the four corners of the box decide.

    Derivation: differentiate alpha_f = delta - (vy + a r) / vx, with (vy + a r) / vx = delta - alpha_f and
    d vy/dt = (Ff + Fr) / m - vx r (the other row alike, without delta):

        d alpha_f/dt = -s ax alpha_f - s (1/m + a^2/Iz) Ff + s (a b/Iz - 1/m) Fr + s ax delta + d delta/dt + r
        d alpha_r/dt = -s ax alpha_r + s (a b/Iz - 1/m) Ff - s (1/m + b^2/Iz) Fr                            + r
        y            = alpha_f - alpha_r = delta - (a + b) r s

    so +r enters both rows. A box in (s, ax) is exactly the trapezoid of Wang (3.20) in (1/vx, ax/vx). Force and torque
    disturbances enter by s (-1/m, -a/Iz; -1/m, +b/Iz). y has to be computed from r, delta and the speed, so that an
    error of the speed is an error of y too. Where a Cf = b Cr (neutral steer) the state (1, 1) is unobservable.

    Args:
        car: the car.
        speed: interval of vx [m/s], positive.
        acceleration: interval of d vx/dt [m/s^2].
        tyres: front and rear tyre, whose remainder beyond the linear part becomes F f(x); left out: linear with Cf, Cr.
        slip_limit: largest slip angle [rad] for which the slope bounds of `tyres` are taken; left out: all.
        jerk: largest |d acceleration/dt| [m/s^3] trusted.
        disturbance: add E for an unknown lateral force [N] and yaw torque [N m].
        stiffness: intervals of Cf and Cr [N/rad], which become the unmeasured parameters front_stiffness and
            rear_stiffness; left out: the numbers of the car.
        force_offset: bound [N] of the part of either axle force that is not stiffness times slip angle, or one for
            each axle; adds E.
        noise: bounds of the errors of steering [rad], steering rate [rad/s] and yaw rate [rad/s]; all three enter
            the inputs and, through y, the output.
        scale_error: intervals of e1, e2 where the speed is read as (1 + e1) vx and its derivative as (1 + e2) ax.
        output: "slip_difference" takes y as measured without regard to how; "slip_constraint" states
            0 = alpha_f - alpha_r - delta + (a + b) r s, whose output is always zero, so that an error of the speed is an
            error of the correction, as it is in the car.

    Returns:
        States front_slip, rear_slip; inputs steering, steering_rate, yaw_rate; one output; scheduling inverse_speed,
        acceleration. `slip_angle_channels` makes these channels from a log.

    Raises:
        BadInput: empty or non-positive interval, a limit that is not positive, options that exclude each other.

    Reference: Wang 2014, equations 3.18 to 3.21 and 5.64 to 5.68; in (5.66) the second row is (-1/m, +b/Iz) / vx, the
        print has both signs turned.
    """
    slow, fast = _interval("speed", speed, "m/s", positive=True)
    brake, drive = _interval("acceleration", acceleration, "m/s^2")
    m, Iz, a, b = car.mass, car.yaw_inertia, car.front_axle_distance, car.rear_axle_distance
    if stiffness is not None and tyres is not None:
        raise BadInput("`stiffness` and `tyres` both say what the tyres are; give one of them.")
    if disturbance and force_offset is not None:
        raise BadInput("`disturbance` and `force_offset` both fill the unknown inputs; give one of them.")
    K = np.array([[-(1 / m + a**2 / Iz), a * b / Iz - 1 / m], [a * b / Iz - 1 / m, -(1 / m + b**2 / Iz)]])
    zero, names = (0, 0), ("inverse_speed", "acceleration")
    C0 = [car.front_stiffness, car.rear_stiffness] if tyres is None else [float(t.stiffness) for t in tyres]
    steer_in = np.array([[0.0, 1.0, 1.0], [0.0, 0.0, 1.0]])
    options: dict[str, Any] = {}
    if disturbance:
        options["E"] = Polynomial(names, {(1, 0): np.array([[-1 / m, -a / Iz], [-1 / m, b / Iz]])})
    if tyres is not None:
        options["F"] = Polynomial(names, {(1, 0): K})
        options["nonlinearity"] = _tyre_remainders(tyres, slip_limit)
    if force_offset is not None:
        offsets = force_offset if isinstance(force_offset, tuple) else (force_offset, force_offset)
        options |= {"E": Polynomial(names, {(1, 0): K}), "disturbance_bound": offsets}
    kinematic = np.array([[-1.0, 0.0, 0.0]]), np.array([[0.0, 0.0, a + b]])
    if output == "slip_constraint":
        options["D"] = Polynomial(names, {zero: kinematic[0], (1, 0): kinematic[1]})
    if noise is not None:
        options |= {"N": np.eye(3), "noise_bound": noise}
        seen = Polynomial(names, {zero: -kinematic[0], (1, 0): -kinematic[1]})
        options["G"] = seen if output == "slip_difference" else np.zeros((1, 3))
    uncertain, A = _axle_stiffness(K, C0, stiffness, names)
    speed_factor, acceleration_factor = _factors(scale_error)
    # d(1/vx)/dt = -ax / vx^2
    rate = max(abs(brake), abs(drive)) / slow**2
    return System.lpv(
        A + Polynomial(names, {(1, 1): -np.eye(2)}),
        Polynomial(names, {zero: steer_in, (1, 1): np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])}),
        [[1.0, -1.0]],
        parameters=[
            Parameter("inverse_speed", 1 / fast, 1 / slow, "s/m", rate=rate, factor=speed_factor, rate_law=_SPEED_LAW),
            Parameter("acceleration", brake, drive, "m/s^2", rate=jerk, factor=acceleration_factor),
            *uncertain,
        ],
        states=("front_slip", "rear_slip"),
        inputs=("steering", "steering_rate", "yaw_rate"),
        outputs=(output,),
        units={output: "rad", **_SLIP_UNITS, **{p.name: "N/rad" for p in uncertain}},
        name=f"slip angles of {car.name}",
        **options,
    )


def lateral_speed_plant(
    car: VehicleParameters,
    speed: tuple[float, float],
    *,
    outputs: Sequence[str] = ("yaw_rate",),
    disturbance: bool = False,
) -> System:
    """Return the plant with lateral speed and yaw rate as states, steered by delta, gyro and accelerometer as outputs.

    Choose it for Kalman filters, which want the sensors as outputs, and where the accelerometer is to be used; it is
    observable for a neutral-steer car with the accelerometer. With s = 1 / vx:

        d vy/dt = -s (Cf + Cr)/m vy    + (s (b Cr - a Cf)/m - vx) r       + Cf/m delta
        d r/dt  = s (b Cr - a Cf)/Iz vy - s (a^2 Cf + b^2 Cr)/Iz r        + a Cf/Iz delta
        ay      = (Ff + Fr)/m = d vy/dt + vx r

    The box takes speed and inverse speed as independent although their product is one: sound, but wider than the truth.

    Args:
        car: the car.
        speed: interval of vx [m/s], positive.
        outputs: any of "yaw_rate", "lateral_acceleration", in this order of the output vector.
        disturbance: add E for an unknown lateral force [N] and yaw torque [N m]; only without the accelerometer, which
            would feel the force at once.

    Returns:
        States lateral_speed, yaw_rate; input steering; scheduling speed, inverse_speed.

    Raises:
        BadInput: empty or non-positive interval, unknown output, or a disturbance beside the accelerometer.

    Reference: Wang 2014, equation 3.17.
    """
    slow, fast = _interval("speed", speed, "m/s", positive=True)
    m, Iz, a, b = car.mass, car.yaw_inertia, car.front_axle_distance, car.rear_axle_distance
    Cf, Cr = car.front_stiffness, car.rear_stiffness
    names = ("speed", "inverse_speed")
    cross = b * Cr - a * Cf
    forces = np.array([[-(Cf + Cr) / m, cross / m], [cross / Iz, -(a**2 * Cf + b**2 * Cr) / Iz]])
    rows = {
        "yaw_rate": ([0.0, 1.0], [0.0, 0.0], 0.0),
        "lateral_acceleration": ([0.0, 0.0], list(forces[0]), Cf / m),
    }
    for name in outputs:
        if name not in rows:
            raise BadInput(f"`{name}` is no output of the lateral plant.{nearest(name, rows)}")
    if not outputs:
        raise BadInput("`outputs` is empty; the lateral plant needs one of yaw_rate and lateral_acceleration.")
    if disturbance and "lateral_acceleration" in outputs:
        raise BadInput(
            "A lateral force reaches the accelerometer without delay, which y = C x + D u cannot say; leave `disturbance` "
            "or `lateral_acceleration` out, and give filters a process covariance instead."
        )
    fixed, scheduled, direct = (np.array([rows[n][k] for n in outputs]) for k in range(3))
    options: dict[str, Any] = {"E": np.diag([1 / m, 1 / Iz])} if disturbance else {}
    return System.lpv(
        Polynomial(names, {(0, 1): forces, (1, 0): np.array([[0.0, -1.0], [0.0, 0.0]])}),
        [[Cf / m], [a * Cf / Iz]],
        Polynomial(names, {(0, 0): fixed, (0, 1): scheduled}),
        direct[:, None],
        parameters=[Parameter("speed", slow, fast, "m/s"), Parameter("inverse_speed", 1 / fast, 1 / slow, "s/m")],
        states=("lateral_speed", "yaw_rate"),
        inputs=("steering",),
        outputs=tuple(outputs),
        units={k: v for k, v in _LATERAL_UNITS.items() if k != "lateral_acceleration" or k in outputs},
        name=f"lateral motion of {car.name}",
        **options,
    )


def _tyre_remainders(tyres: tuple[Tyre, Tyre], slip_limit: float | None) -> Nonlinearity:
    if slip_limit is not None and not (np.isfinite(slip_limit) and slip_limit > 0):
        raise BadInput(f"`slip_limit` is {slip_limit} rad; a positive finite angle is needed, or None for all angles.")
    front, rear = tyres
    ranges = [tyre.slope_range(np.inf if slip_limit is None else slip_limit) for tyre in tyres]
    slopes = [[end - float(t.stiffness) for end in ends] for t, ends in zip(tyres, ranges, strict=True)]
    lower, upper = np.diag([s[0] for s in slopes]), np.diag([s[1] for s in slopes])

    def remainders(z: Any, u: Any) -> jax.Array:
        return jnp.stack([front.remainder(z[0]), rear.remainder(z[1])])

    domain = None if slip_limit is None else (np.full(2, -slip_limit), np.full(2, slip_limit))
    return Nonlinearity.bounded(remainders, np.eye(2), size=2, jacobian=(lower, upper), domain=domain)


def _axle_stiffness(
    K: np.ndarray, C0: list[float], stiffness: tuple[tuple[float, float], tuple[float, float]] | None, names: Any
) -> tuple[list[Parameter], Polynomial]:
    """Unmeasured parameters and s K diag(Cf, Cr) over them."""
    if stiffness is None:
        return [], Polynomial(names, {(1, 0): K * C0})
    axles = ("front_stiffness", "rear_stiffness")
    ends = [_interval(n, i, "N/rad", positive=True) for n, i in zip(axles, stiffness, strict=True)]
    columns = {(1, 0, 1, 0): K * [1.0, 0.0], (1, 0, 0, 1): K * [0.0, 1.0]}
    parameters = [
        Parameter(n, lower, upper, "N/rad", measured=False) for n, (lower, upper) in zip(axles, ends, strict=True)
    ]
    return parameters, Polynomial((*names, *axles), columns)


def _factors(scale_error: Any) -> tuple[tuple[float, float], tuple[float, float]]:
    """Intervals of measured / true of 1/vx and of ax."""
    if scale_error is None:
        return (1.0, 1.0), (1.0, 1.0)
    (e1, E1), (e2, E2) = scale_error
    if not (-1 < e1 <= 0 <= E1 and -1 < e2 <= 0 <= E2):
        raise BadInput(f"`scale_error` is {scale_error}; intervals around zero with ends above -1 are needed.")
    return (1 / (1 + E1), 1 / (1 + e1)), (1 + e2, 1 + E2)


def _interval(name: str, ends: tuple[float, float], unit: str, positive: bool = False) -> tuple[float, float]:
    lower, upper = float(ends[0]), float(ends[1])
    if not (np.isfinite(lower) and np.isfinite(upper) and lower <= upper and (lower > 0 or not positive)):
        needed = "two finite numbers, lower <= upper" + (", above zero" if positive else "")
        raise BadInput(f"`{name}` is [{lower:g}, {upper:g}] {unit}; {needed}, are needed.")
    return lower, upper
