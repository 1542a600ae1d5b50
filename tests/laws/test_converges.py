"""Law: the storage falls at least as fast as claimed, and the gain bound is never exceeded."""

from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from catalogue import Row
from luenberger.algebra import Polynomial
from luenberger.design import Design
from luenberger.systems.discretize import runge_kutta
from vector_fields import copy_slope

STEP = 1e-3


def require_copy_of_the_plant(design: Design) -> None:
    if design.model is not None:
        pytest.skip("the copy is not the plant, so its error is driven by the estimate")


@cache
def frozen_errors(design: Design, row: Row, starts: int) -> tuple[np.ndarray, np.ndarray]:
    """Carry plant and observer on from random errors at random frozen scheduling, driven by a sine."""
    system, nx = design.system, design.system.nx
    step, count = (STEP, 6000) if system.dt is None else (system.dt, 300)
    r = scheduling(design, starts)
    x0 = np.random.default_rng(1).uniform(-row.reach, row.reach, (starts, nx))

    def run(x0: jax.Array, r: jax.Array) -> jax.Array:
        copy = copy_slope(design, r)

        def advance(z: jax.Array, t: jax.Array) -> tuple[jax.Array, jax.Array]:
            u = row.drive * jnp.sin(2 * jnp.pi * t) * jnp.ones(system.nu)

            def slope(z: jax.Array) -> jax.Array:
                x, xhat = z[:nx], z[nx:]
                return jnp.concatenate([system.dynamics(t, x, u, r), copy(t, xhat, u, x)])

            after = runge_kutta(slope, z, step) if system.dt is None else slope(z)
            return after, z[:nx] - z[nx:]

        return jax.lax.scan(advance, jnp.concatenate([x0, jnp.zeros(nx)]), step * jnp.arange(count))[1]

    return step * np.arange(count), np.asarray(jax.jit(jax.vmap(run))(x0, r))


def scheduling(design: Design, starts: int) -> np.ndarray:
    box = np.array(list(design.system.scheduling_box.values())).reshape(-1, 2)
    return np.random.default_rng(0).uniform(box[:, 0], box[:, 1], (starts, len(box)))


def storages(design: Design, storage: object, starts: int) -> np.ndarray:
    """The storage at every frozen scheduling: one that moves has a value of its own at each."""
    if not isinstance(storage, Polynomial):
        return np.broadcast_to(np.asarray(storage), (starts, *np.shape(storage)))
    names = design.system.scheduling_names
    points = [dict(zip(names, r, strict=True)) for r in scheduling(design, starts)]
    return np.stack([np.asarray(storage({n: p[n] for n in storage.names})) for p in points])


def test_storage_falls_as_claimed(design: Design, row: Row) -> None:
    require_copy_of_the_plant(design)
    claim = next((c for c in design.certificate.claims if c.kind == "decay"), None)
    if claim is None:
        pytest.skip("an enclosure claims its width, see test_contains")
    time, errors = frozen_errors(design, row, 8)
    V = np.einsum("sti,sij,stj->st", errors, storages(design, claim.storage, 8), errors)
    falls = np.exp(-2 * claim.level * time) if design.system.dt is None else claim.level ** (2 * np.arange(len(time)))
    bound = V[:, :1] * falls
    # Runge-Kutta at 1 ms follows modes of 50 1/s to 1e-8 a second; rounding of the states leaves the absolute floor.
    assert np.all(bound * (1 + 1e-6) + 1e-18 * V.max() >= V)


def test_errors_vanish(design: Design, row: Row) -> None:
    require_copy_of_the_plant(design)
    _, errors = frozen_errors(design, row, 8)
    assert np.all(np.linalg.norm(errors[:, -1], axis=1) < np.linalg.norm(errors[:, 0], axis=1))


def test_gain_bound_holds_inside_the_box(design: Design) -> None:
    generator = np.random.default_rng(0)
    bound = next(c.level for c in design.certificate.claims if c.kind == "gain_bound")
    for _ in range(50):
        values = {n: generator.uniform(*i) for n, i in design.system.scheduling_box.items()}
        assert np.linalg.norm(np.asarray(design.gain(values)), 2) <= bound
