"""Law: the observer of every design runs under jit and vmap, traces once, and stays finite in float32."""

from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from catalogue import Row
from luenberger.design import Design, SwitchedDesign
from luenberger.systems import Switched, System

DT = 0.005
AnyDesign = Design | SwitchedDesign


def plant_of(design: AnyDesign) -> System:
    """The plant, or the first of its modes."""
    return Switched.of(design.system).first


def sample_time(design: AnyDesign) -> float:
    """A discrete plant brings its own."""
    return plant_of(design).dt or DT


def assert_close(one: Any, two: Any) -> None:
    """The same up to the last digits, for states of any kind."""
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
    def step(state: Any, u: jax.Array, y: jax.Array, r: jax.Array) -> Any:
        traces.append(1)
        return observer.step(state, u, y, r)[0]

    plain = fast = observer.init(np.zeros(plant_of(any_design).nx))
    for u, y, r in zip(*samples(any_design, 3, 0), strict=True):
        plain, fast = observer.step(plain, u, y, r)[0], step(fast, u, y, r)
        assert_close(plain, fast)
    assert len(traces) == 1


def test_vmap_is_a_loop(any_design: AnyDesign, any_row: Row) -> None:
    observer = any_design.observer(sample_time(any_design), **any_row.options)
    u, y, r = (a[0] for a in samples(any_design, 1, 1))
    starts = jnp.asarray(np.random.default_rng(2).uniform(-1, 1, (4, plant_of(any_design).nx)))
    one = jax.jit(lambda x: observer.step(observer.init(x), u, y, r)[0])
    batch, loop = jax.jit(jax.vmap(one))(starts), [one(x) for x in starts]
    assert_close(batch, jax.tree.map(lambda *states: jnp.stack(states), *loop))


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
