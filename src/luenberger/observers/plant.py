"""What running observers need of a plant: its numbers as compile-time constants, its sample time, its state vector."""

from typing import Any, Generic, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from luenberger.core import BadInput
from luenberger.systems.system import System

T = TypeVar("T")


class Fixed(Generic[T]):
    """A value that observers hold as a static field: it compares by content, arrays included.

    Two observers of equal plants therefore have one structure: they can be stacked for `vmap` and share one compiled
    program, while the plant's numbers are still constants of that program.

    Args:
        value: any pytree of concrete arrays, functions and settings.
    """

    def __init__(self, value: T):
        leaves, self._structure = jax.tree.flatten(value)
        self.value = value
        self._content = tuple(_content(leaf) for leaf in leaves)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Fixed) and self._content == other._content and self._structure == other._structure

    def __hash__(self) -> int:
        return hash(self._content)

    def __repr__(self) -> str:
        return f"Fixed({self.value!r})"

    def cast(self, dtype: Any) -> T:
        """Return the value with its floating arrays in another precision, so that a float32 state stays float32."""
        return jax.tree.map(lambda a: np.asarray(a, dtype) if eqx.is_inexact_array(a) else a, self.value)


def sample_time(system: System, dt: float | None) -> float:
    """Return the sample time of an observer of this plant.

    Args:
        system: plant.
        dt: wanted sample time [s], or None for that of a discrete plant.

    Raises:
        BadInput: none given for a continuous plant, not positive, or not that of the discrete plant.
    """
    if dt is None:
        dt = system.dt
    if dt is None:
        raise BadInput(f"`{system.name}` is continuous and `dt` is not given; give the sample time in seconds.")
    if not (np.isfinite(dt) and dt > 0):
        raise BadInput(f"`dt` is {dt}; a positive step in seconds is needed.")
    if system.dt is not None and abs(system.dt - dt) > 1e-12 * dt:
        raise BadInput(
            f"`dt` is {dt:g} s but `{system.name}` is a discrete plant with dt = {system.dt:g} s; leave `dt` out, or "
            "discretise the continuous plant with the wanted step."
        )
    return float(dt)


def state_vector(x0: Any, nx: int) -> jax.Array:
    """Return a first guess as a floating vector of nx states; a float32 guess stays float32.

    Args:
        x0: first guess.
        nx: number of states.

    Raises:
        BadInput: wrong shape.
    """
    x = jnp.asarray(x0)
    if x.shape != (nx,):
        raise BadInput(f"`x0` has shape {x.shape} but the plant has {nx} states; `x0` needs shape ({nx},).")
    return x if jnp.issubdtype(x.dtype, jnp.floating) else x.astype(float)


def _content(leaf: Any) -> Any:
    if eqx.is_array(leaf) or isinstance(leaf, np.ndarray):
        array = np.asarray(leaf)
        return (array.shape, array.dtype.str, array.tobytes())
    return leaf
