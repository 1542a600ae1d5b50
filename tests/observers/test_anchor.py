"""Anchors say what their function says, whatever came before."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from luenberger.core import BadInput
from luenberger.observers import AlgebraicEstimate, zero_estimate


def sideslip(u: jax.Array, y: jax.Array, r: jax.Array) -> jax.Array:
    return jnp.stack([u[0] * r[0], y[0]])


def test_estimate_is_the_function_of_the_sample() -> None:
    anchor = AlgebraicEstimate(sideslip, 0.1, ("vy", "yaw_rate"))
    state, estimate = jax.jit(anchor.step)(anchor.init(None), jnp.array([2.0]), jnp.array([3.0]), jnp.array([5.0]))
    assert state == ()
    assert estimate.x.tolist() == [10.0, 3.0]
    assert estimate.covariance is None


def test_scalars_become_vectors() -> None:
    anchor = AlgebraicEstimate(lambda u, y, r: y[0], 0.1)
    assert anchor.step((), jnp.zeros(0), jnp.array([3.0]), jnp.zeros(0))[1].x.shape == (1,)


def test_zero_anchor_keeps_the_precision_of_its_samples() -> None:
    anchor = zero_estimate(3, 0.1)
    for dtype in (jnp.float32, jnp.float64):
        x = anchor.step((), jnp.zeros(0), jnp.ones(1, dtype), jnp.zeros(0))[1].x
        assert x.dtype == dtype
        assert x.tolist() == [0.0, 0.0, 0.0]
    assert jax.tree.structure(zero_estimate(3, 0.1)) == jax.tree.structure(anchor)


@pytest.mark.parametrize("dt", [0.0, np.nan])
def test_a_positive_step_is_needed(dt: float) -> None:
    with pytest.raises(BadInput, match="positive step"):
        AlgebraicEstimate(sideslip, dt)
