"""The pure core of simulation against closed forms, under jit and vmap."""

import jax
import jax.numpy as jnp
import numpy as np

from luenberger.simulate import HeldSamples, integrate, iterate

TIME = np.linspace(0.0, 2.0, 21)


def nothing(t: jax.Array) -> jax.Array:
    return jnp.zeros(0)


def test_batches_of_starts_meet_the_closed_form() -> None:
    def run(x0: jax.Array) -> jax.Array:
        done = integrate(lambda t, x, u, r: jnp.stack([x[1], -4.0 * x[0]]), TIME, x0, nothing, nothing)
        return done.x

    starts = np.array([[1.0, 0.0], [0.0, 2.0], [-0.5, 1.0]])
    found = jax.jit(jax.vmap(run))(starts)
    for x, (p, v) in zip(found, starts, strict=True):
        # Relative tolerance 1e-10 a step of an order-8 pair: global error below 1e-9.
        np.testing.assert_allclose(x[:, 0], p * np.cos(2 * TIME) + v / 2 * np.sin(2 * TIME), atol=1e-9)


def test_jumps_are_met_exactly() -> None:
    jump = np.array([0.333])

    def run(jumps: np.ndarray | None) -> float:
        done = integrate(
            lambda t, x, u, r: u,
            TIME[:2] * 10,
            np.zeros(1),
            lambda t: jnp.where(t < 0.333, 1.0, -1.0)[None],
            nothing,
            jump_times=jumps,
        )
        return float(done.x[-1, 0])

    # 0.333 up, 0.667 down; piecewise linear, so only the place of the jump matters: one representable time.
    assert abs(run(jump) - (0.333 - 0.667)) < 1e-14


def test_failure_is_reported_not_raised() -> None:
    done = integrate(lambda t, x, u, r: x**2, TIME, np.ones(1), nothing, nothing, max_steps=300)
    assert not bool(done.succeeded)
    assert int(done.steps) == 300
    # x = 1 / (1 - t) up to t = 1.
    np.testing.assert_allclose(done.x[:9, 0], 1 / (1 - TIME[:9]), rtol=1e-8)
    assert not np.isfinite(np.asarray(done.x)[12:]).any()


def test_discrete_plants_are_iterated() -> None:
    u = HeldSamples(np.arange(4.0), np.array([[1.0], [0.0], [2.0], [5.0]]))
    x = iterate(lambda t, x, u, r: 0.5 * x + u, np.arange(4.0), np.array([4.0]), u, nothing)
    assert x[:, 0].tolist() == [4.0, 3.0, 1.5, 2.75]
