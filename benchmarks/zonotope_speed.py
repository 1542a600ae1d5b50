"""Seconds per step of a zonotopic estimator, six states and sixty generators: jitted, a thousand at once, and in NumPy.

Run `python benchmarks/zonotope_speed.py`. All are timed in turns in one process and compared by ratio, the least of several
rounds each. The process exits with 1 where a bar is missed: the jitted step in a scan five times faster than the same step in
NumPy, a thousand estimators under vmap twenty times faster, per estimator and step, than one jitted estimator called from Python
sample by sample. Their ratio to NumPy is printed beside. Most of a single call is the way into the compiled program, so the second
bar says what a batch saves and the ratio to NumPy what the arithmetic does. A batch takes all cores that are free, the others one;
`taskset -c 0 python benchmarks/zonotope_speed.py` keeps everything on one core.
"""

import os
import sys
import time as clock
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from rich.console import Console
from rich.table import Table

from luenberger.observers.zonotopic import ZonotopicKalmanFilter, ZonotopicLuenberger, ZonotopicObserver
from luenberger.sets import Zonotope
from luenberger.systems import System

STATES, OUTPUTS, DISTURBANCES, GENERATORS = 6, 2, 3, 60
STEPS, BATCH, BATCH_STEPS, ROUNDS = 2000, 1000, 5, 25
SINGLE_BAR, BATCH_BAR = 5.0, 20.0


def plant() -> System:
    """Return a stable plant with six states, two noisy outputs and three disturbances."""
    generator = np.random.default_rng(0)
    A = generator.normal(size=(STATES, STATES))
    return System.build(
        0.9 * A / np.abs(np.linalg.eigvals(A)).max(),
        generator.normal(size=(STATES, 1)),
        generator.normal(size=(OUTPUTS, STATES)),
        E=generator.normal(size=(STATES, DISTURBANCES)),
        dt=0.01,
        disturbance_bound=[0.1] * DISTURBANCES,
        noise_bound=[0.05] * OUTPUTS,
    )


class Plain:
    """The same step in NumPy, as one would write it there: matrices at hand, generators ranked by a sort."""

    def __init__(self, system: System, gain: np.ndarray | None):
        self.A, self.B, self.C = (np.asarray(system.at(k)) for k in "ABC")
        self.W = np.asarray(system.at("E")) * np.asarray(system.disturbance_bound)
        self.V = np.asarray(system.at("G")) * np.asarray(system.noise_bound)
        self.VV, self.gain = self.V @ self.V.T, gain

    def step(self, c: np.ndarray, G: np.ndarray, u: np.ndarray, y: np.ndarray) -> tuple[Any, ...]:
        """Return center, generators and the bounds of the box before the step."""
        radius = np.abs(G).sum(axis=1)
        L = self.gain
        if L is None:
            seen = self.C @ G
            L = self.A @ np.linalg.solve(seen @ seen.T + self.VV, seen @ G.T).T
        wide = np.concatenate([(self.A - L @ self.C) @ G, self.W, -L @ self.V], axis=1)
        size = np.abs(wide)
        order = np.argsort(-(size.sum(axis=0) - size.max(axis=0)), kind="stable")
        kept, rest = order[: GENERATORS - STATES], order[GENERATORS - STATES :]
        reduced = np.concatenate([wide[:, kept], np.diag(size[:, rest].sum(axis=1))], axis=1)
        return self.A @ c + self.B @ u + L @ (y - self.C @ c), reduced, c - radius, c + radius


@eqx.filter_jit
def run(observer: ZonotopicObserver, start: Zonotope, u: Any, y: Any) -> Any:
    """Scan one estimator over a record; the last set and all boxes."""

    def advance(state: Zonotope, now: Any) -> tuple[Zonotope, Any]:
        after, seen = observer.step(state, now[0], now[1], jnp.zeros(0))
        return after, (seen.lower, seen.upper)

    return jax.lax.scan(advance, start, (u, y))


@eqx.filter_jit
def run_many(observer: ZonotopicObserver, starts: Zonotope, u: Any, y: Any) -> Any:
    """Scan a thousand estimators at once, each with signals of its own; the sums of their upper bounds."""

    def advance(states: Zonotope, now: Any) -> tuple[Zonotope, Any]:
        after, seen = jax.vmap(lambda s, a, b: observer.step(s, a, b, jnp.zeros(0)))(states, *now)
        return after, jnp.asarray(seen.upper).sum(axis=0)

    return jax.lax.scan(advance, starts, (u, y))


def least(work: dict[str, tuple[Callable[[], Any], int]]) -> dict[str, float]:
    """Time pieces of work in turns; name -> least seconds a step."""
    best = dict.fromkeys(work, np.inf)
    for _ in range(ROUNDS):
        for name, (call, steps) in work.items():
            begin = clock.perf_counter()
            jax.block_until_ready(call())
            best[name] = min(best[name], (clock.perf_counter() - begin) / steps)
    return best


def compared(title: str, observer: ZonotopicObserver, plain: Plain) -> bool:
    """Time one estimator in all ways, print the table; True where the bars are met."""
    generator = np.random.default_rng(1)
    u, y = generator.normal(size=(STEPS, 1)), generator.normal(size=(STEPS, OUTPUTS))
    many_u, many_y = (np.stack([s[:BATCH_STEPS]] * BATCH, axis=1) for s in (u, y))
    start = observer.init(Zonotope(jnp.zeros(STATES), jnp.asarray(generator.normal(size=(STATES, GENERATORS)))))
    starts = jax.tree.map(lambda leaf: jnp.stack([leaf] * BATCH), start)
    single = eqx.filter_jit(observer.step)
    r = jnp.zeros(0)

    def in_numpy() -> list[Any]:
        c, G, boxes = np.asarray(start.center), np.asarray(start.generators), []
        for k in range(STEPS):
            c, G, low, high = plain.step(c, G, u[k], y[k])
            boxes.append((low, high))
        return boxes

    def call_by_call() -> Any:
        state, seen = start, None
        for k in range(STEPS // 10):
            state, seen = single(state, u[k], y[k], r)
        return seen

    def together() -> Any:
        return run_many(observer, starts, many_u, many_y)

    ours, theirs = run(observer, start, u, y)[1], in_numpy()
    # Reduction is a discrete choice: bounds agree until rounding decides a tie, so only the first steps are compared closely.
    np.testing.assert_allclose(np.asarray(ours[1])[:5], [box[1] for box in theirs[:5]], rtol=1e-9)
    call_by_call()
    together()
    seconds = least(
        {
            "NumPy": (in_numpy, STEPS),
            "jitted, in a scan": (lambda: run(observer, start, u, y), STEPS),
            "jitted, called from Python": (call_by_call, STEPS // 10),
            f"{BATCH} under vmap": (together, BATCH_STEPS * BATCH),
        }
    )
    one, many = "jitted, called from Python", f"{BATCH} under vmap"
    bars = {"jitted, in a scan": ("NumPy", SINGLE_BAR), many: (one, BATCH_BAR)}
    return report(title, seconds, bars)


def report(title: str, seconds: dict[str, float], bars: dict[str, tuple[str, float]]) -> bool:
    """Print the table of ratios; True where every bar is met."""
    cores = len(os.sched_getaffinity(0))
    table = Table(title=f"{title}: {STATES} states, {GENERATORS} generators, {cores} cores, best of {ROUNDS} rounds")
    for head in ("step", "µs per estimator and step", "times faster than NumPy", "bar"):
        table.add_column(head, justify="left" if head == "step" else "right")
    met = True
    for name, value in seconds.items():
        wanted = ""
        if name in bars:
            other, bar = bars[name]
            ratio = seconds[other] / value
            met &= ratio >= bar
            wanted = f"{ratio:.1f} of {bar:.0f} against {other}: {'met' if ratio >= bar else 'MISSED'}"
        table.add_row(name, f"{value * 1e6:.2f}", f"{seconds['NumPy'] / value:.1f}", wanted)
    Console(width=140).print(table)
    return met


def main() -> int:
    """Time both estimators."""
    system = plant()
    L = 0.1 * np.random.default_rng(2).normal(size=(STATES, OUTPUTS))
    options: dict[str, Any] = {"initial_half_width": [1.0] * STATES, "count": GENERATORS}
    met = compared("constant gain", ZonotopicLuenberger(system, L, **options), Plain(system, L))
    met &= compared("zonotopic Kalman filter", ZonotopicKalmanFilter(system, **options), Plain(system, None))
    return 0 if met else 1


if __name__ == "__main__":
    sys.exit(main())
