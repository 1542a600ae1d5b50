"""The single track in a cross wind: lateral speed and yaw rate, driven by steering and by a gust that nobody measures."""

from typing import Any

import numpy as np

from luenberger.algebra import Polynomial
from luenberger.core import BadInput
from luenberger.systems import Parameter, System
from luenberger.vehicle.parameters import VehicleParameters


def wind_plant(
    car: VehicleParameters,
    speed: tuple[float, float],
    *,
    gust_arm: float,
    stiffness: tuple[tuple[float, float], tuple[float, float]] | None = None,
    yaw_rate_noise: float = 0.0,
    steering_error: float = 0.0,
    speed_error: float = 0.0,
    gust_bound: float | None = None,
) -> System:
    """Return the plant with lateral speed and yaw rate as states, steering measured, yaw rate as the output, a gust as unknown input.

    Choose it for observers that decouple or bound a side wind. With s = 1 / vx and the gust force fw at the distance lw ahead of
    the centre of gravity:

        d vy/dt = -s (Cf + Cr)/m vy     + (s (b Cr - a Cf)/m - vx) r        + Cf/m delta   + fw/m
        d r/dt  = s (b Cr - a Cf)/Iz vy - s (a^2 Cf + b^2 Cr)/Iz r          + a Cf/Iz delta + lw/Iz fw        y = r + v

    Decoupling the gust leaves the error -(Cf (lw - a) + Cr (lw + b)) / (m vx lw) [1/s], whatever the gain: unstable for
    -(b Cr - a Cf) / (Cf + Cr) < lw < 0, and impossible at lw = 0.

    Args:
        car: mass, inertia, axle distances, and stiffness where no interval is given.
        speed: interval of vx [m/s], positive; one number twice makes no scheduling go away, `freeze` does.
        gust_arm: lw [m], ahead of the centre of gravity.
        stiffness: intervals of Cf and Cr [N/rad], which become the unmeasured front_stiffness and rear_stiffness.
        yaw_rate_noise: bound of the error of the gyro [rad/s].
        steering_error: bound of the error of the steering angle [rad].
        speed_error: bound of the error of the speed [m/s]. The error of its inverse follows at the slowest speed, so a wide range is
            better split into plants of a few m/s each, as modes of a `Switched`.
        gust_bound: largest |fw| [N] trusted; left out: none, the gust has to be decoupled.

    Returns:
        States lateral_speed, yaw_rate; input steering; output yaw_rate; scheduling speed, inverse_speed; continuous.

    Raises:
        BadInput: empty or non-positive interval, negative bounds, a speed error as large as the speed.

    Reference: Ifqir, Puig, Ichalal, Ait-Oufroukh, Mammar 2020, equation 38, whose A_v lacks a sign in entry (2,2) and has -vx
        outside entry (1,2), and whose E_v lacks lw.
    """
    slow, fast = float(speed[0]), float(speed[1])
    if not (0 < slow <= fast < np.inf) or not (0 <= speed_error < slow):
        raise BadInput(
            f"`speed` is [{slow:g}, {fast:g}] m/s with `speed_error` {speed_error:g}; 0 < lower <= upper and an error below the "
            "lower end are needed."
        )
    if not (np.isfinite(gust_arm) and min(yaw_rate_noise, steering_error) >= 0):
        raise BadInput(
            f"`gust_arm` {gust_arm}, `yaw_rate_noise` {yaw_rate_noise}, `steering_error` {steering_error}: finite, and bounds >= 0, "
            "are needed."
        )
    m, Iz, a, b = car.mass, car.yaw_inertia, car.front_axle_distance, car.rear_axle_distance
    # What one N/rad of either axle does to (vy, r) and to delta.
    front = np.array([[-1 / m, -a / m], [-a / Iz, -(a**2) / Iz]]), np.array([[1 / m], [a / Iz]])
    rear = np.array([[-1 / m, b / m], [b / Iz, -(b**2) / Iz]])
    turn = np.array([[0.0, -1.0], [0.0, 0.0]])
    names: tuple[str, ...] = ("speed", "inverse_speed")
    uncertain: list[Parameter] = []
    if stiffness is None:
        A = Polynomial(names, {(1, 0): turn, (0, 1): car.front_stiffness * front[0] + car.rear_stiffness * rear})
        B = Polynomial.constant(car.front_stiffness * front[1])
    else:
        axles = ("front_stiffness", "rear_stiffness")
        for name, (lower, upper) in zip(axles, stiffness, strict=True):
            if not 0 < lower <= upper:
                raise BadInput(f"`{name}` is [{lower:g}, {upper:g}] N/rad; 0 < lower <= upper is needed.")
            uncertain.append(Parameter(name, float(lower), float(upper), "N/rad", measured=False))
        A = Polynomial((*names, *axles), {(1, 0, 0, 0): turn, (0, 1, 1, 0): front[0], (0, 1, 0, 1): rear})
        B = Polynomial(("front_stiffness",), {(1,): front[1]})
    inverse_error = 1 / (slow - speed_error) - 1 / slow if speed_error else 0.0
    options: dict[str, Any] = {} if gust_bound is None else {"disturbance_bound": [gust_bound]}
    return System.lpv(
        A,
        B,
        [[0.0, 1.0]],
        E=[[1 / m], [gust_arm / Iz]],
        G=[[1.0, 0.0]],
        N=[[0.0, 1.0]],
        noise_bound=[yaw_rate_noise, steering_error],
        parameters=[
            Parameter("speed", slow, fast, "m/s", error=speed_error),
            Parameter("inverse_speed", 1 / fast, 1 / slow, "s/m", error=inverse_error),
            *uncertain,
        ],
        states=("lateral_speed", "yaw_rate"),
        inputs=("steering",),
        outputs=("yaw_rate",),
        units={
            "lateral_speed": "m/s",
            "yaw_rate": "rad/s",
            "steering": "rad",
            "speed": "m/s",
            "inverse_speed": "s/m",
            **{p.name: "N/rad" for p in uncertain},
        },
        name=f"lateral motion of {car.name} in the wind",
        **options,
    )
