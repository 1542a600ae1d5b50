"""Channels that observers of the single track need and a log does not hold: scheduling, inputs, outputs, truth."""

import numpy as np

from luenberger.core import BadInput, Signal, Trajectory
from luenberger.vehicle.parameters import VehicleParameters
from luenberger.vehicle.sideslip import sideslip_from_lateral_speed, slip_angles


def slip_angle_channels(
    trajectory: Trajectory, car: VehicleParameters, *, time_constant: float = 0.05, centred: bool = False
) -> Trajectory:
    """Add to a log what the observers of the single track are scheduled by, driven by and scored against.

    Reads `speed`, `steering`, `yaw_rate` and, where there is one, `lateral_speed`. Adds

        inverse_speed     1 / vx [s/m]
        acceleration      d vx/dt [m/s^2], smoothed; not what an accelerometer reads, which is d vx/dt - r vy
        steering_rate     d delta/dt [rad/s], smoothed
        slip_difference   delta - (a + b) r / vx [rad], equal to alpha_f - alpha_r
        front_slip, rear_slip, sideslip     truth [rad], from the lateral speed

    `acceleration` and `steering_rate` are kept where the log already has them. See `rate_of_change` for the smoothing.

    Args:
        trajectory: log or simulation with the channels above, in SI.
        car: gives a and b.
        time_constant: of the smoothing [s].
        centred: smooth without delay, looking ahead; for truth, never for what an observer may know.

    Raises:
        BadInput: channel missing, a value missing, or a speed that is not positive.
    """
    speed, steering, yaw_rate = (_complete(trajectory, name) for name in ("speed", "steering", "yaw_rate"))
    if (still := np.flatnonzero(speed <= 0)).size:
        k = int(still[0])
        raise BadInput(
            f"`speed` of `{trajectory.name}` is {speed[k]:g} m/s at t = {trajectory.time[k]:g} s ({still.size} samples <= 0); slip "
            "angles need a speed above zero. Cut the log with `.between(start, stop)`."
        )
    how = f"{'centred' if centred else 'causal'} first-order smoothing, {time_constant:g} s"
    added = [
        Signal("inverse_speed", "s/m", 1.0 / speed, "1 / speed"),
        Signal("slip_difference", "rad", steering - car.wheelbase * yaw_rate / speed, "delta - (a + b) r / vx"),
    ]
    for name, unit, values in (("acceleration", "m/s^2", speed), ("steering_rate", "rad/s", steering)):
        if name not in trajectory:
            rate = rate_of_change(trajectory.time, values, time_constant, centred)
            added.append(Signal(name, unit, rate, f"d {'speed' if values is speed else 'steering'}/dt, {how}"))
    if "lateral_speed" in trajectory:
        lateral_speed = trajectory["lateral_speed"].values
        front, rear = slip_angles(lateral_speed, yaw_rate, speed, steering, car)
        added += [
            Signal("front_slip", "rad", np.asarray(front), "delta - (vy + a r) / vx"),
            Signal("rear_slip", "rad", np.asarray(rear), "-(vy - b r) / vx"),
            Signal("sideslip", "rad", np.asarray(sideslip_from_lateral_speed(lateral_speed, speed)), "atan(vy / vx)"),
        ]
    return trajectory.with_signals(*added)


def rate_of_change(time: np.ndarray, values: np.ndarray, time_constant: float, centred: bool = False) -> np.ndarray:
    """Return the smoothed time derivative of a sampled signal.

    The slopes between neighbouring samples pass a first-order low-pass, which is s / (T s + 1) applied exactly to the
    broken line through the samples; steps may differ. At sample k nothing later than sample k is used, except that the
    first sample takes the first slope. The delay is T. `centred` averages this with the same filter run backwards in
    time, s / (1 - (T s)^2): no delay, but it looks ahead.

    Args:
        time: sample times [s], shape (nt,), increasing.
        values: samples, shape (nt,).
        time_constant: T [s], positive.
        centred: average of forward and backward filter.

    Raises:
        BadInput: T is not positive.
    """
    if not (np.isfinite(time_constant) and time_constant > 0):
        raise BadInput(f"`time_constant` is {time_constant}; a positive time in seconds is needed.")
    forward = _lagged_slope(time, values, time_constant)
    if not centred:
        return forward
    # Against reversed time the slope changes its sign.
    return 0.5 * (forward - _lagged_slope(-time[::-1], values[::-1], time_constant)[::-1])


def _lagged_slope(time: np.ndarray, values: np.ndarray, time_constant: float) -> np.ndarray:
    steps = np.diff(time)
    slopes = np.diff(values) / steps
    decay = np.exp(-steps / time_constant)
    rate = np.empty(time.size)
    rate[0] = slopes[0]
    for k in range(steps.size):
        rate[k + 1] = slopes[k] + (rate[k] - slopes[k]) * decay[k]
    return rate


def _complete(trajectory: Trajectory, name: str) -> np.ndarray:
    values = trajectory[name].values
    if (bad := np.flatnonzero(~np.isfinite(values))).size:
        raise BadInput(
            f"`{name}` of `{trajectory.name}` has no value at t = {trajectory.time[bad[0]]:g} s ({bad.size} such samples); "
            'read the log with missing="interpolate" or cut it.'
        )
    return values
