"""Law: the observer of every design runs under jit and vmap, traces once, and stays finite in float32."""

import jax
import jax.numpy as jnp
import numpy as np

from catalogue import Row
from luenberger.design import Design

DT = 0.005


def samples(design: Design, count: int, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    generator = np.random.default_rng(seed)
    system = design.system
    u, y = (generator.uniform(-1, 1, (count, n)) for n in (system.nu, system.ny))
    box = np.array(list(system.scheduling_box.values())).reshape(-1, 2)
    return u, y, generator.uniform(box[:, 0], box[:, 1], (count, len(box)))


def test_jit_is_the_plain_step_and_traces_once(design: Design, row: Row) -> None:
    observer = design.observer(DT, **row.options)
    traces = []

    @jax.jit
    def step(state: jax.Array, u: jax.Array, y: jax.Array, r: jax.Array) -> jax.Array:
        traces.append(1)
        return observer.step(state, u, y, r)[0]

    plain = fast = observer.init(np.zeros(design.system.nx))
    for u, y, r in zip(*samples(design, 5, 0), strict=True):
        plain, fast = observer.step(plain, u, y, r)[0], step(fast, u, y, r)
        # Fused and unfused multiply-adds differ in the last digits, amplified by the gains of one step.
        np.testing.assert_allclose(plain, fast, rtol=1e-9, atol=1e-12)
    assert len(traces) == 1


def test_vmap_is_a_loop(design: Design, row: Row) -> None:
    observer = design.observer(DT, **row.options)
    u, y, r = (a[0] for a in samples(design, 1, 1))
    starts = jnp.asarray(np.random.default_rng(2).uniform(-1, 1, (4, design.system.nx)))
    batch = jax.vmap(lambda x: observer.step(observer.init(x), u, y, r)[0])(starts)
    loop = jnp.stack([observer.step(observer.init(x), u, y, r)[0] for x in starts])
    np.testing.assert_allclose(batch, loop, rtol=1e-9, atol=1e-12)


def test_float32_stays_finite_and_close(design: Design, row: Row) -> None:
    observer = design.observer(DT, **row.options)
    u, y, r = samples(design, 200, 3)

    def run(dtype: type) -> np.ndarray:
        start = observer.init(jnp.zeros(design.system.nx, dtype))
        signals = tuple(jnp.asarray(a, dtype) for a in (u, y, r))
        last, estimates = jax.lax.scan(lambda s, x: observer.step(s, *x), start, signals)
        assert last.dtype == dtype
        return np.asarray(estimates.x)

    single, double = run(jnp.float32), run(jnp.float64)
    assert np.all(np.isfinite(single))
    # 200 steps of a contracting loop: rounding of 6e-8 times the size of states and a few hundred operations.
    assert np.abs(single - double).max() <= 1e-3 * (1 + np.abs(double).max())
