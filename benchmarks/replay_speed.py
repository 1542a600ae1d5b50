"""Seconds per step of the observers on a 36 000-sample log of a single-track car, beside filterpy's unscented filter.

Run `python benchmarks/replay_speed.py [log.csv[.gz]]`. The log needs the columns t, vx, yawRate, delta and ayCG (SI); without
one a synthetic drive is used. filterpy steps a cut of the same samples in the same run. The process exits with 1 where a bar is
missed: a fixed gain 100 times faster a step than filterpy's unscented filter, the Kalman filters 20 times.
"""

import os
import sys
import time as clock
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from filterpy.kalman import MerweScaledSigmaPoints
from filterpy.kalman import UnscentedKalmanFilter as FilterpyUnscented
from rich.console import Console
from rich.table import Table

from luenberger.algebra import Polynomial
from luenberger.core import Signal, Trajectory
from luenberger.observers import (
    AlgebraicEstimate,
    CorrectionObserver,
    ExtendedKalmanFilter,
    KalmanFilter,
    Observer,
    UnscentedKalmanFilter,
    zero_estimate,
)
from luenberger.replay import Channels, Replay, replay
from luenberger.systems import Parameter, System

DT = 0.01
SAMPLES = 36_000
CUT = 3_000
LOG = Path(os.environ.get("LUENBERGER_DATA", "shared/data")) / "revs-250lm" / "targa2014_250lm_150_510s.csv.gz"
BARS = {
    "fixed gain": 100.0,
    "fixed gain, exact hold": 100.0,
    "Kalman": 20.0,
    "extended Kalman": 20.0,
    "unscented Kalman": 20.0,
}
CHANNELS = Channels(inputs=("delta",), outputs=("yawRate", "ayCG"), scheduling=("vx", "inverse_vx"))
TUNING: dict[str, Any] = {
    "measurement_covariance": np.diag([1e-4, 1.0]),
    "initial_covariance": np.diag([1.0, 0.1]),
    "process_density": np.diag([1.0, 0.1]),
}


def single_track() -> System:
    """Return the linear single-track car: states vy [m/s] and yaw rate [rad/s], scheduled by vx and 1/vx."""
    mass, inertia, front, rear, stiff_front, stiff_rear = 982.0, 1500.0, 1.33, 1.07, 60e3, 94e3
    total = stiff_front + stiff_rear
    moment = front * stiff_front - rear * stiff_rear
    turning = front**2 * stiff_front + rear**2 * stiff_rear
    slip = np.array([[-total / mass, -moment / mass], [-moment / inertia, -turning / inertia]])
    A = Polynomial.affine(np.zeros((2, 2)), vx=np.array([[0.0, -1.0], [0.0, 0.0]]), inverse_vx=slip)
    B = np.array([[stiff_front / mass], [front * stiff_front / inertia]])
    C = Polynomial.affine(np.array([[0.0, 1.0], [0.0, 0.0]]), inverse_vx=np.vstack([np.zeros(2), slip[0]]))
    D = np.array([[0.0], [stiff_front / mass]])
    box = [Parameter("vx", 15.0, 65.0, "m/s"), Parameter("inverse_vx", 1 / 65, 1 / 15, "s/m")]
    names = {"states": ("vy", "yawRate"), "inputs": ("delta",), "outputs": ("yaw_rate", "ay")}
    return System.lpv(A, B, C, D, parameters=box, name="single track", **names)


def read_drive(path: Path) -> Trajectory:
    """Return the log, or a synthetic drive where the file is missing."""
    units = {"vx": "m/s", "vy": "m/s", "yawRate": "rad/s", "delta": "rad", "ayCG": "m/s^2"}
    if path.exists():
        table = pd.read_csv(path).iloc[:SAMPLES]
        columns = {name: table[name].to_numpy(float) for name in units}
        source = str(path.name)
    else:
        t = DT * np.arange(SAMPLES)
        vx, delta = 35 + 15 * np.sin(t / 12), 0.04 * np.sin(0.9 * t) * np.sin(t / 20)
        yaw_rate = 8.0 * delta
        columns = {"vx": vx, "vy": -0.4 * yaw_rate, "yawRate": yaw_rate, "delta": delta, "ayCG": vx * yaw_rate}
        source = "synthetic"
    columns["inverse_vx"] = 1.0 / columns["vx"]
    signals = [Signal(name, units.get(name, "s/m"), values) for name, values in columns.items()]
    # The time stamps of the log are rounded to its print; its rate is exact.
    return Trajectory(DT * np.arange(len(columns["vx"])), signals, "drive", source)


def observers(plant: System) -> dict[str, Observer]:
    """Return what is timed, all on one plant."""
    gain = np.array([[0.5, 0.1], [10.0, 0.0]])
    return {
        "fixed gain": CorrectionObserver(plant, gain, DT),
        "fixed gain, exact hold": CorrectionObserver(plant, gain, DT, method="exact"),
        "Kalman": KalmanFilter(plant, DT, method="rk4", **TUNING),
        "extended Kalman": ExtendedKalmanFilter(plant, DT, **TUNING),
        "unscented Kalman": UnscentedKalmanFilter(plant, DT, **TUNING),
        "algebraic anchor": AlgebraicEstimate(lambda u, y, r: y[::-1] * r[1], DT, plant.states),
        "zero anchor": zero_estimate(2, DT, plant.states),
    }


def filterpy_step(plant: System, drive: Trajectory) -> float:
    """Return seconds per step of filterpy's unscented filter with the same Runge-Kutta map written in NumPy."""
    u, y, r = (drive.table(names)[:CUT] for names in (CHANNELS.inputs, CHANNELS.outputs, CHANNELS.scheduling))
    slip = plant.polynomial("A").terms[(0, 1)]
    B, D = (np.asarray(plant.polynomial(letter)({})) for letter in "BD")

    def advance(x: np.ndarray, dt: float, u: np.ndarray, r: np.ndarray) -> np.ndarray:
        A = r[1] * slip + np.array([[0.0, -r[0]], [0.0, 0.0]])
        forced = B @ u
        k1 = A @ x + forced
        k2 = A @ (x + dt / 2 * k1) + forced
        k3 = A @ (x + dt / 2 * k2) + forced
        k4 = A @ (x + dt * k3) + forced
        return x + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)

    def output(x: np.ndarray, u: np.ndarray, r: np.ndarray) -> np.ndarray:
        return np.array([x[1], r[1] * (slip[0] @ x)]) + D @ u

    points = MerweScaledSigmaPoints(2, alpha=1.0, beta=2.0, kappa=0.0)
    unscented = FilterpyUnscented(dim_x=2, dim_z=2, dt=DT, hx=output, fx=advance, points=points)
    unscented.P, unscented.R = TUNING["initial_covariance"].copy(), TUNING["measurement_covariance"]
    unscented.Q = TUNING["process_density"] * DT
    begin = clock.perf_counter()
    for k in range(CUT):
        unscented.update(y[k], u=u[k], r=r[k])
        unscented.predict(u=u[k], r=r[k])
    return (clock.perf_counter() - begin) / CUT


def report(done: Replay, reference: float) -> bool:
    """Print the table of ratios; True where every bar is met."""
    table = Table(
        title=f"{done.trajectory.source}: {done.time.size} samples, filterpy UKF {reference * 1e6:.1f} µs a step"
    )
    for head in ("observer", "µs a step", "times faster", "bar", "whole log, s"):
        table.add_column(head, justify="left" if head == "observer" else "right")
    met = True
    for name, seconds in (done.seconds_per_step or {}).items():
        ratio, bar = reference / seconds, BARS.get(name)
        met &= bar is None or ratio >= bar
        wanted = "" if bar is None else f"{bar:.0f} {'met' if ratio >= bar else 'MISSED'}"
        table.add_row(name, f"{seconds * 1e6:.3f}", f"{ratio:.0f}", wanted, f"{seconds * done.time.size:.4f}")
    Console(width=110).print(table)
    return met


def main() -> int:
    """Replay, time, compare."""
    drive = read_drive(Path(sys.argv[1]) if len(sys.argv) > 1 else LOG)
    plant = single_track()
    done = replay(observers(plant), drive, CHANNELS, np.zeros(2), timing=True)
    return 0 if report(done, filterpy_step(plant, drive)) else 1


if __name__ == "__main__":
    sys.exit(main())
