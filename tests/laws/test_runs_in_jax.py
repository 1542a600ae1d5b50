"""Law: the observer of every design runs under jit and vmap, traces once, and stays finite in float32."""

from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from catalogue import Row
from luenberger.design import Design, SwitchedDesign
from luenberger.observers import Estimate
from luenberger.systems import Switched, System

DT = 0.005
AnyDesign = Design | SwitchedDesign


def plant_of(design: AnyDesign) -> System:
    """The plant, or the first of its modes."""
    return Switched.of(design.system).first


def sample_time(design: AnyDesign) -> float:
    """A discrete plant brings its own."""
    return plant_of(design).dt or DT


def assert_close(one: Estimate, two: Estimate) -> None:
    """The same up to the last digits: estimate, covariance and bounds, where there are any.

    Not the states: generators of equal length may be kept in either order.
    """
    # Fused and unfused multiply-adds differ in the last digits, amplified by the gains of one step.
    jax.tree.map(partial(np.testing.assert_allclose, rtol=1e-9, atol=1e-12), one, two)


def samples(design: AnyDesign, count: int, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    generator = np.random.default_rng(seed)
    switched, plant = Switched.of(design.system), plant_of(design)
    u, y = (generator.uniform(-1, 1, (count, n)) for n in (plant.nu, plant.ny))
    ends = [(switched.ends[0], switched.ends[-1])] if switched.signal else []
    box = np.array([*plant.scheduling_box.values(), *ends]).reshape(-1, 2)
    return u, y, generator.uniform(box[:, 0], box[:, 1], (count, len(box)))


def test_jit_is_the_plain_step_and_traces_once(any_design: AnyDesign, any_row: Row) -> None:
    observer = any_design.observer(sample_time(any_design), **any_row.options)
    traces = []

    @jax.jit
    def step(state: Any, u: jax.Array, y: jax.Array, r: jax.Array) -> tuple[Any, Estimate]:
        traces.append(1)
        return observer.step(state, u, y, r)

    plain = fast = observer.init(np.zeros(plant_of(any_design).nx))
    for u, y, r in zip(*samples(any_design, 3, 0), strict=True):
        plain, said = observer.step(plain, u, y, r)
        fast, again = step(fast, u, y, r)
        assert_close(said, again)
    assert len(traces) == 1


def test_vmap_is_a_loop(any_design: AnyDesign, any_row: Row) -> None:
    observer = any_design.observer(sample_time(any_design), **any_row.options)
    first, second = zip(*samples(any_design, 2, 1), strict=True)
    starts = jnp.asarray(np.random.default_rng(2).uniform(-1, 1, (4, plant_of(any_design).nx)))
    one = jax.jit(lambda x: observer.step(observer.step(observer.init(x), *first)[0], *second)[1])
    batch, loop = jax.jit(jax.vmap(one))(starts), [one(x) for x in starts]
    assert_close(batch, jax.tree.map(lambda *said: jnp.stack(said), *loop))


def test_float32_stays_finite_and_close(any_design: AnyDesign, any_row: Row) -> None:
    observer = any_design.observer(sample_time(any_design), **any_row.options)
    u, y, r = samples(any_design, 200, 3)

    def run(dtype: type) -> np.ndarray:
        start = observer.init(jnp.zeros(plant_of(any_design).nx, dtype))
        signals = tuple(jnp.asarray(a, dtype) for a in (u, y, r))
        last, estimates = jax.lax.scan(lambda s, x: observer.step(s, *x), start, signals)
        assert all(leaf.dtype == dtype for leaf in jax.tree.leaves(last))
        known = [a for a in (estimates.x, estimates.lower, estimates.upper) if a is not None]
        return np.concatenate([np.asarray(a) for a in known], axis=-1)

    single, double = run(jnp.float32), run(jnp.float64)
    assert np.all(np.isfinite(single))
    # 200 steps of a contracting loop: rounding of 6e-8 times the size of states and a few hundred operations.
    assert np.abs(single - double).max() <= 1e-3 * (1 + np.abs(double).max())
