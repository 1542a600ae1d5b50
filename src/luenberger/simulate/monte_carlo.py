"""Many random runs of one pure function, and random signals that stay within a box."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from luenberger.core import BadInput
from luenberger.core.checks import finite_array, is_whole


def run_key(seed: int, k: int) -> Any:
    """Return the random key of one run, to repeat it alone; it depends on neither the number of runs nor the chunk.

    Args:
        seed: seed of all runs.
        k: number of the run, from 0.
    """
    return jax.random.fold_in(jax.random.key(seed), k)


def monte_carlo(
    run: Callable[[Any], Any],
    number: int,
    *,
    seed: int = 0,
    chunk: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Any:
    """Run a pure function with many random keys, compiled once, and return all results.

    Runs of a chunk are computed side by side (vmap), chunks one after the other, so a chunk bounds the memory. The last chunk is
    filled up with runs whose results are dropped. Run k has the key `run_key(seed, k)`.

    Args:
        run: JAX function: random key -> pytree of arrays.
        number: number of runs.
        seed: seed of all runs.
        chunk: runs computed side by side; left out: all.
        progress: called after each chunk with the runs done and `number`.

    Returns:
        The pytree of `run` with NumPy leaves of shape (number, ...).

    Raises:
        BadInput: a number or chunk that is no positive integer.
    """
    side = number if chunk is None else chunk
    for word, value in (("number", number), ("chunk", side)):
        if not is_whole(value) or value <= 0:
            raise BadInput(f"`{word}` is {value!r}; a positive whole number of runs is needed.")
    side = min(side, number)
    base = jax.random.key(seed)
    batch = jax.jit(lambda numbers: jax.vmap(lambda k: run(jax.random.fold_in(base, k)))(numbers))
    parts = []
    for first in range(0, number, side):
        # Always of one size, so that there is nothing to compile again.
        part = jax.tree.map(np.asarray, batch(jnp.arange(first, first + side)))
        done = min(first + side, number)
        parts.append(jax.tree.map(lambda leaf, kept=done - first: leaf[:kept], part))
        if progress is not None:
            progress(done, number)
    return jax.tree.map(lambda *leaves: np.concatenate(leaves), *parts)


def piecewise_signal(
    key: Any,
    time: Float[Array | np.ndarray, "nt"],
    lower: Any,
    upper: Any,
    hold: float,
    *,
    smooth: bool = False,
    vertex_probability: float = 0.5,
) -> Float[Array, "nt nc"]:
    """Return a random signal in a box: a level for each stretch of time, constant or joined by half cosines.

    Take it for stiffness that varies in time and for scheduling errors in tests of containment: such tests need corners of
    the box, which uniform draws never meet, so a level is a corner with `vertex_probability` and uniform otherwise. Pure in
    `key`; samples of the constant kind are meant to be held, jumps fall on the first sample at or after k hold.

    Args:
        key: `jax.random` key.
        time: sample times [s], concrete.
        lower: lower corner of the box, shape (nc,).
        upper: upper corner, shape (nc,).
        hold: length of a stretch [s]; smooth signals pass a level at each multiple and change no faster than
            pi / 2 (upper - lower) / hold.
        smooth: join the levels instead of jumping.
        vertex_probability: probability of a corner of the box as a level.

    Raises:
        BadInput: an empty box, a hold that is not positive, or a probability outside [0, 1].
    """
    low, high = np.atleast_1d(finite_array("lower", lower)), np.atleast_1d(finite_array("upper", upper))
    times = finite_array("time", time)
    if low.ndim != 1 or low.shape != high.shape or (low > high).any():
        raise BadInput(
            f"`lower` is {low.tolist()} and `upper` {high.tolist()}; one lower <= upper a channel is needed."
        )
    if not (np.isfinite(hold) and hold > 0):
        raise BadInput(f"`hold` is {hold} s; a positive time is needed.")
    if not 0 <= vertex_probability <= 1:
        raise BadInput(f"`vertex_probability` is {vertex_probability}; a probability in [0, 1] is needed.")
    # A sample meant to lie on a multiple of hold may fall short of it by rounding.
    place = (times - times[0]) / hold + 1e-9
    stretch = np.floor(place).astype(int)
    corner_key, end_key, level_key = jax.random.split(key, 3)
    shape = (int(stretch[-1]) + 2, low.size)
    corners = jnp.where(jax.random.bernoulli(end_key, 0.5, shape), high, low)
    # Rounding of the product may leave the box, which a test of containment would notice.
    inside = jnp.clip(low + (high - low) * jax.random.uniform(level_key, shape), low, high)
    levels = jnp.where(jax.random.bernoulli(corner_key, vertex_probability, (shape[0], 1)), corners, inside)
    if not smooth:
        return levels[stretch]
    share = 0.5 * (1 - np.cos(np.pi * np.clip(place - stretch - 1e-9, 0.0, 1.0)))[:, None]
    return jnp.clip(levels[stretch] + share * (levels[stretch + 1] - levels[stretch]), low, high)
