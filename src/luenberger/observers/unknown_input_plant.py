"""What an unknown-input observer reads of its plant: the modes taken apart, and the matrices of the mode that holds."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from luenberger.algebra import Polynomial
from luenberger.core import BadInput, NotAccepted
from luenberger.systems.matrix import PlantMatrix
from luenberger.systems.switched import Switched
from luenberger.systems.system import System
from luenberger.systems.uncertainty import Uncertain

# P E = 0 holds up to rounding of a decoupling matrix of doubles; anything larger lets the unknown input in.
_DECOUPLED = 1e-9


class OpenMode(eqx.Module):
    """A mode without its gain: the nominal plant, and what is uncertain around it, see `Uncertain`.

    Args:
        A: nominal state matrix over the measured scheduling, (nx, nx).
        B: nominal input matrix, (nx, nu).
        C: outputs, (ny, nx).
        E: unknown inputs, (nx, nd).
        G: noise of the outputs, (ny, nv).
        N: noise of the measured inputs, (nu, nv).
        directions: of the uncertain factors, (nx, nk).
        rows: what each factor multiplies, (nk, nx + nu + nd).
    """

    A: PlantMatrix
    B: PlantMatrix
    C: np.ndarray
    E: np.ndarray
    G: PlantMatrix
    N: PlantMatrix
    directions: np.ndarray
    rows: Polynomial

    @staticmethod
    def of(mode: System) -> "OpenMode":
        """Take a mode apart.

        Args:
            mode: what `require_form` accepts.

        Raises:
            NotAccepted: see `Uncertain.of`.
        """
        uncertain = Uncertain.of(mode)
        plant = uncertain.nominal
        C, E = constant_part("C", plant.C), constant_part("E", plant.E)
        return OpenMode(plant.A, plant.B, C, E, plant.G, plant.N, uncertain.directions, uncertain.rows)


class ModeAt(eqx.Module):
    """The matrices of the mode that holds at a sample, letters as in `OpenMode`.

    Args:
        A: (nx, nx).
        B: (nx, nu).
        E: (nx, nd).
        G: (ny, nv).
        N: (nu, nv).
        K: gain, (nx, ny).
        H: decoupling matrix, (nx, ny).
        directions: (nx, nk).
        rows: (nk, nx + nu + nd).
    """

    A: jax.Array
    B: jax.Array
    E: jax.Array
    G: jax.Array
    N: jax.Array
    K: jax.Array
    H: jax.Array
    directions: jax.Array
    rows: jax.Array


def mode_at(
    plant: Switched,
    modes: tuple[OpenMode, ...],
    gains: tuple[Polynomial, ...],
    decoupling: tuple[Any, ...],
    r: jax.Array,
) -> ModeAt:
    """Return the matrices of the mode that r selects, in the precision of r.

    Args:
        plant: says which mode holds.
        modes: its modes taken apart.
        gains: K of every mode.
        decoupling: H of every mode.
        r: measured scheduling, with the signal that selects the mode.
    """
    within = dict(zip(plant.first.scheduling_names, plant.within(r), strict=True))

    def value(matrix: PlantMatrix) -> jax.Array:
        return jnp.asarray(matrix(within), r.dtype)

    most = max(m.directions.shape[1] for m in modes)
    found: list[ModeAt] = []
    for m, K, H in zip(modes, gains, decoupling, strict=True):
        A, B, G, N, gain = (value(part) for part in (m.A, m.B, m.G, m.N, K.map(lambda c: jnp.asarray(c, r.dtype))))
        # As many factors in every mode; those of no effect are zero.
        missing = most - m.directions.shape[1]
        directions = jnp.pad(jnp.asarray(m.directions), ((0, 0), (0, missing)))
        rows = jnp.pad(value(m.rows), ((0, missing), (0, 0)))
        found.append(ModeAt(A, B, jnp.asarray(m.E), G, N, gain, jnp.asarray(H, r.dtype), directions, rows))
    chosen, number = found[0], plant.mode(r)
    for k, other in enumerate(found[1:], 1):
        chosen = jax.tree.map(lambda a, b, k=k: jnp.where(number == k, b, a), chosen, other)
    return chosen


def one_each(name: str, given: Any, plant: Switched) -> tuple[Any, ...]:
    """Return one matrix for each mode.

    Args:
        name: how the matrices are called in messages.
        given: one for all modes, or a sequence with one for each.
        plant: plant with its modes.

    Raises:
        BadInput: a sequence of another length than there are modes.
    """
    if isinstance(given, Polynomial) or not (any(isinstance(g, Polynomial) for g in given) or np.ndim(given) != 2):
        return (given,) * len(plant.modes)
    if len(given) != len(plant.modes):
        raise BadInput(f"`{name}` has {len(given)} entries but `{plant.name}` needs {len(plant.modes)}, one a mode.")
    return tuple(given)


def constant_part(name: str, value: PlantMatrix) -> np.ndarray:
    """Return a matrix that may not vary within a mode.

    Args:
        name: how the matrix is called in messages.
        value: polynomial that should be constant.

    Raises:
        NotAccepted: it varies.
    """
    varying = not isinstance(value, Polynomial) or any(np.any(c) for e, c in value if any(e))
    if varying:
        raise NotAccepted(
            f"`{name}` depends on {list(value.names)}; within a mode of an unknown-input observer it has to be constant. Split the "
            "plant into modes, each with its own constant matrix."
        )
    return np.asarray(value(dict.fromkeys(value.names, 0.0)), dtype=float)


def require_form(mode: System, first: System) -> None:
    """Refuse a mode that the observer does not cover.

    Args:
        mode: the mode.
        first: the first mode, whose C all need.

    Raises:
        NotAccepted: continuous, a feedthrough D, or C that varies or is not that of the first mode.
        BadInput: no `noise_bound`.
    """
    if mode.dt is None:
        raise NotAccepted(
            f"`{mode.name}` is continuous; an unknown-input observer runs a discrete plant. Discretise it, and freeze its scheduling "
            "for modes."
        )
    if np.any(constant_part("D", mode.D)):
        raise NotAccepted(f"`{mode.name}` has a feedthrough D; take D u off the outputs first.")
    if mode.noise_bound is None:
        raise BadInput(
            f"`{mode.name}` has no `noise_bound`; a guarantee needs one. Give numbers, zero where there is nothing."
        )
    if not np.array_equal(constant_part("C", mode.C), constant_part("C", first.C)):
        raise NotAccepted(
            f"`C` differs between the modes of `{first.name}`; y of the next sample would belong to another C than H was made for. Give "
            "all modes the same outputs."
        )


def require_decoupled(plant: System, mode: OpenMode, H: np.ndarray) -> None:
    """Refuse a decoupling matrix that lets an unknown input without bound through.

    Args:
        plant: the first mode, for the bounds.
        mode: a mode taken apart.
        H: its decoupling matrix, (nx, ny).

    Raises:
        BadInput: (I + H C) E is far from zero and d has no bound.
    """
    leak = mode.E + H @ mode.C @ mode.E
    if plant.disturbance_bound is None and np.abs(leak).max(initial=0.0) > _DECOUPLED * np.abs(mode.E).max(initial=0.0):
        raise BadInput(
            f"(I + H C) E of `{plant.name}` is {leak.tolist()}, not zero, so an unknown input without bound drives the error. Give "
            "H = -E (C E)^+ + Y (I - C E (C E)^+), or a `disturbance_bound`."
        )
