"""What a zonotopic observer reads of its plant: the matrices at a sample, and generators for what of them nobody knows.

With modes, the measured signal picks the matrices. Unmeasured parameters and the errors of measured ones are factors, see
`Uncertain`: x+ = A0 x + B0 u + E d + sum_k direction_k s_k (row_k [x; u; d]), |s_k| <= 1. At a sample each factor moves the state
along its direction by no more than the largest |row_k [x; u; d]| over what x, u and d can be then, so it is one generator more.
"""

from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from luenberger.algebra import Polynomial
from luenberger.core import BadInput, NotAccepted
from luenberger.observers.correction import checked_gain
from luenberger.observers.uncertainty_bound import factor_bound
from luenberger.sets import Interval
from luenberger.systems.switched import Switched
from luenberger.systems.system import System
from luenberger.systems.uncertainty import Uncertain

Factors = tuple[tuple[np.ndarray, Polynomial], ...]


def bounded(system: System | Switched | Sequence[System]) -> System | Switched:
    """Return a plant whose sets can be carried along; several modes as a `Switched`, one as a `System`.

    Args:
        system: plant, or plants of the modes.

    Raises:
        NotAccepted: continuous, or with a nonlinearity.
        BadInput: without `noise_bound`, or with E and without `disturbance_bound`.
    """
    switched = Switched.of(system)
    for mode in switched.modes:
        if mode.dt is None:
            raise NotAccepted(
                f"`{mode.name}` is continuous; a set of sampled states needs a discrete plant. Discretise it, with a disturbance that "
                "covers what the input does between samples."
            )
        if mode.nonlinearity is not None:
            raise NotAccepted(f"`{mode.name}` has a nonlinearity; zonotopes carry linear plants.")
        if mode.noise_bound is None or (mode.nd and mode.disturbance_bound is None):
            missing = "no `noise_bound`" if mode.noise_bound is None else "an E without `disturbance_bound`"
            raise BadInput(
                f"`{mode.name}` has {missing}; a guarantee needs bounds of noise and disturbance. Give numbers, zero where there is nothing."
            )
    return switched if len(switched.modes) > 1 else switched.first


def generator_count(count: int | None, nx: int) -> int:
    """Return how many generators a set keeps: what is asked for, or twenty, and five for each state where there are more than four.

    Args:
        count: what is asked for; None for the default.
        nx: number of states.

    Raises:
        BadInput: fewer than one for each state.
    """
    kept = max(20, 5 * nx) if count is None else count
    if kept < nx:
        raise BadInput(
            f"`count` is {kept}; at least one generator for each of the {nx} states is needed, five are advised."
        )
    return kept


def require_noise(plant: System | Switched) -> None:
    """Refuse a plant with an output that no noise reaches: gains that follow the set invert what the noise spans.

    Args:
        plant: from `bounded`.

    Raises:
        BadInput: noise that spans fewer directions than there are outputs.
    """
    for mode in Switched.of(plant).modes:
        G = np.asarray(mode.at("G", [0.0] * mode.nr)) * np.asarray(mode.noise_bound)
        if np.linalg.matrix_rank(G) < mode.ny:
            raise BadInput(
                f"The noise of `{mode.name}` spans {np.linalg.matrix_rank(G)} of {mode.ny} outputs; the gain needs noise in every "
                "output. Give a small bound, or use `ZonotopicLuenberger`."
            )


def factors_of(plant: System | Switched) -> Factors | None:
    """Return directions and rows of each mode, with one number of factors; None for a plant that is known exactly.

    Args:
        plant: from `bounded`.

    Raises:
        NotAccepted: outputs or noise that depend on what nobody knows, matrices as functions, a scheduling error declared as a map.
    """
    modes = Switched.of(plant).modes
    if not any(m.uncertainty or m.measured_scheduling is not None for m in modes):
        return None
    found = [_factors(m) for m in modes]
    most = max(directions.shape[1] for directions, _ in found)
    return tuple(_padded(directions, rows, most) for directions, rows in found) if most else None


def matrices(plant: System | Switched, r: jax.Array) -> dict[str, jax.Array]:
    """Return A, B, C, D, E, G, N at a sample, what nobody measures at its midpoint; in the precision of r.

    Args:
        plant: from `bounded`.
        r: measured scheduling, with the signal that selects the mode.
    """
    modes = Switched.of(plant).modes
    return {letter: by_mode(plant, r, lambda k, s, _=letter: modes[k].at(_, s)) for letter in "ABCDEGN"}


def pushed(
    plant: System | Switched, factors: Factors, r: jax.Array, x: Interval, u: jax.Array, input_error: jax.Array
) -> jax.Array:
    """Return one generator for each factor, shape (nx, nk).

    Args:
        plant: from `bounded`.
        factors: from `factors_of`.
        r: measured scheduling, with the signal that selects the mode.
        x: box that holds the state.
        u: measured input.
        input_error: largest |true - measured input|, shape (nu,).
    """
    first = Switched.of(plant).first
    directions = by_mode(plant, r, lambda k, s: factors[k][0])
    rows = by_mode(plant, r, lambda k, s: factors[k][1](_named(first, s)))
    disturbance = jnp.asarray(first.disturbance_bound or (), r.dtype)
    return directions * factor_bound(rows, x, u, input_error, disturbance)


def by_mode(plant: System | Switched, r: jax.Array, value: Callable[[int, jax.Array], Any]) -> jax.Array:
    """Return a value of the mode that holds, in the precision of r.

    Args:
        plant: from `bounded`.
        r: measured scheduling, with the signal that selects the mode.
        value: of the number of a mode and the scheduling of its matrices.
    """
    switched = Switched.of(plant)
    inner = switched.within(r)
    found, *others = (jnp.asarray(value(k, inner), r.dtype) for k in range(len(switched.modes)))
    if others:
        mode = switched.mode(r)
        for k, other in enumerate(others, 1):
            found = jnp.where(mode == k, other, found)
    return found


def checked_gains(plant: System | Switched, gain: Any) -> Polynomial | tuple[Polynomial, ...]:
    """Return the gain of a plant, or the gains of its modes.

    Args:
        plant: from `bounded`.
        gain: nested numbers or `Polynomial`; with modes a sequence with one for each.

    Raises:
        BadInput: another number of gains than of modes, or a gain that does not fit its mode.
    """
    if isinstance(plant, System):
        return checked_gain(plant, gain)
    if isinstance(gain, Polynomial) or len(gain) != len(plant.modes):
        raise BadInput(
            f"`gain` holds {1 if isinstance(gain, Polynomial) else len(gain)} gains but `{plant.name}` has {len(plant.modes)} modes; "
            "give a sequence with one for each."
        )
    return tuple(checked_gain(mode, one) for mode, one in zip(plant.modes, gain, strict=True))


def gain_at(plant: System | Switched, gain: Polynomial | tuple[Polynomial, ...], r: jax.Array) -> jax.Array:
    """Return the gain at a sample, in the precision of r.

    Args:
        plant: from `bounded`.
        gain: from `checked_gains`.
        r: measured scheduling, with the signal that selects the mode.
    """
    first = Switched.of(plant).first
    gains = [g.map(lambda c: jnp.asarray(c, r.dtype)) for g in ((gain,) if isinstance(gain, Polynomial) else gain)]
    return by_mode(plant, r, lambda k, s: gains[k](_named(first, s)))


def _factors(mode: System) -> tuple[np.ndarray, Polynomial]:
    """Directions and rows; what E does with the scheduling is known at run time here, so that factor goes."""
    uncertain = Uncertain.of(mode)
    known = {"E(r)"} - {p.name for p in mode.parameters}
    keep = [k for k, name in enumerate(uncertain.names) if name not in known]
    return uncertain.directions[:, keep], uncertain.rows.map(lambda c: np.asarray(c)[keep])


def _padded(directions: np.ndarray, rows: Polynomial, count: int) -> tuple[np.ndarray, Polynomial]:
    short = count - directions.shape[1]
    return np.pad(directions, ((0, 0), (0, short))), rows.map(lambda c: np.pad(c, ((0, short), (0, 0))))


def _named(mode: System, r: jax.Array) -> dict[str, Any]:
    return {name: r[k] for k, name in enumerate(mode.scheduling_names)}
