"""Steps per second of the interval observer in Monte Carlo on two cores, beside filterpy's unscented filter on one drive.

Run `python benchmarks/interval_speed.py`. A braked double lane change is driven with steering of another size, tyres at another
vertex and another start in every drive; observer and truth run in one compiled scan, vectorised over the drives, in double
precision. "Observer" is the observer alone on held samples; "with truth" integrates the plant beside it and counts the samples
outside the bounds. The filter steps the same drive in NumPy in the same run. The process exits with 1 where the observer alone
makes fewer than two million steps a second with 10 000 drives of 1000 samples, or where a state is lost.
"""

import sys
import time as clock
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from filterpy.kalman import MerweScaledSigmaPoints
from filterpy.kalman import UnscentedKalmanFilter as FilterpyUnscented
from rich.console import Console
from rich.table import Table

from luenberger.algebra import Polynomial
from luenberger.observers.interval import IntervalObserver
from luenberger.systems import System
from luenberger.systems.exponential import HoldOrder, affine_hold
from luenberger.vehicle import slip_angle_plant, wang_car

DT, SAMPLES, DRIVES, CUT, REPEATS = 0.01, 1000, 10_000, 1000, 3
BAR = 2e6
SPEED, ACCELERATION, STIFFNESS = (15 / 3.6, 150 / 3.6), (-8.0, 4.0), ((60e3, 90e3), (35e3, 65e3))
NOISE, SCALE = (1e-3, 0.02, 5e-3), ((-0.1, 0.1), (-0.15, 0.15))
# Keeps order for all tyres, and with a speed that is read ten percent wrong.
GAIN = Polynomial(("inverse_speed",), {(1,): np.array([[7.0], [-9.0]])})
PLANTS: dict[str, dict[str, Any]] = {
    "tyres": {},
    "noise, force offset": {"noise": NOISE, "force_offset": 30.0},
    "scheduling error": {"noise": NOISE, "force_offset": 30.0, "scale_error": SCALE, "output": "slip_constraint"},
}


def manoeuvre(samples: int = SAMPLES) -> tuple[np.ndarray, np.ndarray]:
    """Return steering rate and yaw rate, and the scheduling, of a braked double lane change."""
    t = DT * np.arange(samples)
    speed = 15.0 + 7.0 * np.cos(np.pi * t / t[-1])
    scheduling = np.stack([1 / speed, np.gradient(speed, DT)], axis=1)
    return np.stack([0.2 * np.cos(2.5 * t), 0.3 * np.sin(2.5 * t - 0.4)], axis=1), scheduling


def draws(count: int) -> dict[str, np.ndarray]:
    """Return what differs between the drives."""
    rng = np.random.default_rng(0)
    tyres = np.stack([rng.choice(ends, count) for ends in STIFFNESS], axis=1)
    return {"size": rng.uniform(0.2, 1.5, count), "tyres": tyres, "start": rng.uniform(-0.05, 0.05, (count, 2))}


def monte_carlo(plant: System, observer: IntervalObserver, truth: bool, samples: int = SAMPLES) -> Any:
    """Return the compiled run: drives -> widest enclosure [rad] and samples outside it."""
    driven, scheduling = manoeuvre(samples)
    base = wang_car.wheelbase
    A, B = plant.polynomial("A"), plant.polynomial("B")

    def one(draw: Any) -> tuple[Any, Any]:
        def advance(carry: Any, sample: Any) -> tuple[Any, None]:
            x, state, width, lost = carry
            (rate, yaw_rate), r = sample[0] * draw["size"], sample[1]
            u = jnp.stack([x[0] - x[1] + base * r[0] * yaw_rate, rate, yaw_rate])
            y = x[:1] - x[1:] if plant.outputs == ("slip_difference",) else jnp.zeros(1)
            state, estimate = observer.step(state, u, y, r)
            lower, upper = jnp.asarray(estimate.lower), jnp.asarray(estimate.upper)
            outside = jnp.any((x < lower) | (x > upper))
            if truth:
                names = ("inverse_speed", "acceleration", "front_stiffness", "rear_stiffness")
                values: dict[str, Any] = dict(zip(names, [*r, *draw["tyres"]], strict=True))
                slope, forced = (jnp.asarray(m(values)) for m in (A, B))
                x = affine_hold(slope, jnp.sum(forced * u, axis=1), x, DT, HoldOrder(8, 0))
                lost = lost + outside
            return (x, state, jnp.maximum(width, jnp.max(upper - lower)), lost), None

        begin = (jnp.zeros(2), observer.init(draw["start"]), jnp.zeros(()), jnp.zeros((), int))
        return jax.lax.scan(advance, begin, (driven, scheduling))[0][2:]

    return jax.jit(jax.vmap(one))


def seconds(run: Any, count: int) -> tuple[float, float, int]:
    """Return the best time of some runs after a warm-up [s], the time of the first [s], and the samples lost."""
    given = jax.device_put(draws(count))
    begin = clock.perf_counter()
    _, lost = jax.block_until_ready(run(given))
    first, best = clock.perf_counter() - begin, np.inf
    for _ in range(REPEATS):
        begin = clock.perf_counter()
        jax.block_until_ready(run(given))
        best = min(best, clock.perf_counter() - begin)
    return best, first, int(np.sum(lost))


def filterpy_step(plant: System) -> float:
    """Return seconds per step of filterpy's unscented filter on one drive, with Runge-Kutta in NumPy and the mean tyres."""
    driven, scheduling = manoeuvre()
    A, B = ({e: np.asarray(c) for e, c in plant.freeze(**plant.uncertainty).polynomial(k)} for k in "AB")

    def slope(x: np.ndarray, u: np.ndarray, r: np.ndarray) -> np.ndarray:
        matrices = [sum(r[0] ** e[0] * r[1] ** e[1] * c for e, c in terms.items()) for terms in (A, B)]
        return matrices[0] @ x + matrices[1] @ u

    def advance(x: np.ndarray, dt: float, u: np.ndarray, r: np.ndarray) -> np.ndarray:
        k1 = slope(x, u, r)
        k2 = slope(x + dt / 2 * k1, u, r)
        k3 = slope(x + dt / 2 * k2, u, r)
        return x + dt / 6 * (k1 + 2 * k2 + 2 * k3 + slope(x + dt * k3, u, r))

    points = MerweScaledSigmaPoints(2, alpha=1.0, beta=2.0, kappa=0.0)
    unscented = FilterpyUnscented(dim_x=2, dim_z=1, dt=DT, hx=lambda x: x[:1] - x[1:], fx=advance, points=points)
    unscented.P, unscented.R, unscented.Q = np.eye(2) * 1e-3, np.eye(1) * 1e-5, np.eye(2) * 1e-7
    begin = clock.perf_counter()
    for k in range(CUT):
        u = np.array([0.0, *driven[k]])
        unscented.update(np.zeros(1))
        unscented.predict(u=u, r=scheduling[k])
    return (clock.perf_counter() - begin) / CUT


def main() -> int:
    """Time, compare, tabulate."""
    reference, met, lost_samples = (
        filterpy_step(slip_angle_plant(wang_car, SPEED, ACCELERATION, stiffness=STIFFNESS)),
        True,
        0,
    )
    table = Table(title=f"interval observer, double precision; filterpy UKF {reference * 1e6:.0f} µs a step")
    for head in ("plant", "run", "drives", "samples", "M steps/s", "µs a step", "times UKF", "compile, s", "lost"):
        table.add_column(head, justify="left" if head in ("plant", "run") else "right", no_wrap=True)
    for name, options in PLANTS.items():
        plant = slip_angle_plant(wang_car, SPEED, ACCELERATION, stiffness=STIFFNESS, **options)
        observer = IntervalObserver(plant, GAIN, DT, initial_half_width=[0.06, 0.06])
        for truth in (False, True):
            # How it grows: first with the drives, then with the samples.
            grid = (
                [(1, SAMPLES), (100, SAMPLES), (DRIVES, SAMPLES), (100, 10 * SAMPLES)]
                if name == "tyres"
                else [(DRIVES, SAMPLES)]
            )
            for count, samples in grid:
                run = monte_carlo(plant, observer, truth, samples)
                best, first, lost = seconds(run, count)
                step = best / (count * samples)
                label = f"{'with truth' if truth else 'observer'}, {observer.substeps} parts"
                numbers = (f"{1e-6 / step:.2f}", f"{step * 1e6:.3f}", f"{reference / step:.0f}", f"{first - best:.1f}")
                table.add_row(name, label, str(count), str(samples), *numbers, str(lost) if truth else "")
                met &= truth or count < DRIVES or 1 / step >= BAR
                lost_samples += lost
    Console(width=120).print(table)
    print(
        f"bar {BAR / 1e6:g} million steps/s with {DRIVES} drives: {'met' if met else 'MISSED'}; samples lost: {lost_samples}"
    )
    return 0 if met and not lost_samples else 1


if __name__ == "__main__":
    sys.exit(main())
