"""Admissible drives of discrete plants, in plain NumPy: what nobody knows at random, at its ends, or as an adversary chooses it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from luenberger.algebra import Polynomial
from luenberger.design import Design
from luenberger.observers import Observer
from luenberger.systems import Switched, System


@dataclass(frozen=True)
class Unknown:
    """What drives a plant in units of its bounds: start (runs, nx), disturbance (runs, steps, nd), noise (runs, steps, nv)."""

    start: np.ndarray
    disturbance: np.ndarray
    noise: np.ndarray


@dataclass(frozen=True)
class Motion:
    """States and what is measured of them, (runs, steps, ...)."""

    x: np.ndarray
    u: np.ndarray
    y: np.ndarray
    r: np.ndarray
    mode: np.ndarray


def drawn(system: System, runs: int, steps: int, seed: int) -> Unknown:
    """Half of the runs draw from the volume, half from the vertices."""
    rng = np.random.default_rng(seed)

    def unit(*shape: int) -> np.ndarray:
        inside = rng.uniform(-1, 1, shape)
        inside[: runs // 2] = np.where(inside[: runs // 2] < 0, -1.0, 1.0)
        return inside

    return Unknown(unit(runs, system.nx), unit(runs, steps, system.nd), unit(runs, steps, system.nv))


def worst(driven: tuple[np.ndarray, ...], system: System, steps: int) -> Unknown:
    """One run for each state, from zero error, that drives its entry of T e + D v to the largest value at the last sample."""
    F, M, T, D = driven
    signs, power = np.zeros((system.nx, steps, system.nd + system.nv)), T
    for k in reversed(range(steps - 1)):
        signs[:, k] = np.sign(power @ M)
        power = power @ F
    signs[:, -1, system.nd :] = np.sign(D)
    return Unknown(np.zeros((system.nx, system.nx)), signs[..., : system.nd], signs[..., system.nd :])


def textbook(design: Design, filtered: bool) -> tuple[np.ndarray, ...]:
    """F, M, T, D of the error e+ = F e + M (d, v) and of what is reported of it, T e + D v, in units of the bounds."""
    system = design.system
    A, B, C, D, E, G, N = (np.asarray(system.at(letter)) for letter in "ABCDEGN")
    dbar, vbar, eye = np.array(system.disturbance_bound or ()), np.array(system.noise_bound), np.eye(system.nx)
    seen, L = G - D @ N, np.asarray(design.gain({}))
    if not filtered:
        return A - L @ C, np.hstack([E * dbar, -(B @ N + L @ seen) * vbar]), eye, np.zeros((system.nx, system.nv))
    assert design.filter_gain is not None
    K = np.asarray(design.filter_gain({}))
    return A - A @ K @ C, np.hstack([E * dbar, -(B @ N + A @ K @ seen) * vbar]), eye - K @ C, -K @ seen * vbar


def moved(
    plant: System | Switched, unknown: Unknown, half_width: np.ndarray, seed: int, drive: float = 1.0, free: float = 1.0
) -> Motion:
    """The plant itself, driven by a sine; its mode, scheduling and unmeasured parameters jump, or rest at their ends.

    Args:
        plant: discrete, with noise bounds.
        unknown: what drives it, in units of its bounds.
        half_width: of the start box around zero.
        seed: of scheduling and parameters.
        drive: amplitude of the inputs.
        free: amplitude of disturbances that have no bound.
    """
    switched = Switched.of(plant)
    first, (runs, steps) = switched.first, unknown.noise.shape[:2]
    rng = np.random.default_rng(seed)
    r, mode = _scheduled(switched, runs, steps, rng)
    hidden = [p for p in first.parameters if not p.measured]
    x, states, outputs, inputs = unknown.start * half_width, [], [], []
    dbar, vbar = np.array(first.disturbance_bound or [free] * first.nd), np.array(first.noise_bound)
    for k in range(steps):
        q = {p.name: _jumping(p.lower, p.upper, runs, rng) for p in hidden}
        A, B, C, D, E, G, N = (at_modes(switched, letter, mode[:, k], r[:, k], q) for letter in "ABCDEGN")
        u = drive * np.sin(0.3 * k + np.arange(runs))[:, None] * np.ones(first.nu)
        d, v = dbar * unknown.disturbance[:, k], vbar * unknown.noise[:, k]
        states.append(x)
        outputs.append(times(C, x) + times(D, u) + times(G, v))
        inputs.append(u + times(N, v))
        x = times(A, x) + times(B, u) + times(E, d)
    return Motion(*(np.stack(rows, axis=1) for rows in (states, inputs, outputs)), r, mode)


def _jumping(lower: Any, upper: Any, runs: int, rng: np.random.Generator) -> np.ndarray:
    """Inside of an interval, or at one of its ends, as often."""
    draw = rng.uniform(lower, upper, runs)
    return np.where(rng.random(runs) < 0.5, draw, rng.choice([lower, upper], runs))


def _scheduled(switched: Switched, runs: int, steps: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Scheduling vectors that jump over the box in every other run and rest at a vertex in the rest, and the mode they mean."""
    box = np.array(list(switched.first.scheduling_box.values())).reshape(-1, 2)
    r = rng.uniform(box[:, 0], box[:, 1], (runs, steps, len(box)))
    r[::2] = box[np.arange(len(box)), rng.integers(0, 2, (runs, 1, len(box)))][::2]
    mode = np.zeros((runs, steps), dtype=int)
    if switched.signal:
        held = rng.integers(0, len(switched.modes), (runs, -(-steps // switched.dwell)))
        held[1::4] = held[1::4, :1]
        mode = np.repeat(held, switched.dwell, axis=1)[:, :steps]
        low, high = np.array(switched.ends[:-1]), np.array(switched.ends[1:])
        signal = rng.uniform(low[mode], high[mode])
        assert switched.signal not in switched.first.scheduling_names
        r = np.concatenate([r, signal[..., None]], axis=-1)
    return r, mode


def at_modes(
    switched: Switched, letter: str, mode: np.ndarray, r: np.ndarray, hidden: Mapping[str, np.ndarray] | None = None
) -> np.ndarray:
    """A matrix of the plant in every run; unmeasured parameters at their middle where none are given."""
    if hidden is None:
        hidden = {
            p.name: np.full(len(mode), 0.5 * (p.lower + p.upper)) for p in switched.first.parameters if not p.measured
        }
    return chosen([m.polynomial(letter) for m in switched.modes], switched, mode, r, hidden)


def chosen(
    matrices: Sequence[Polynomial],
    switched: Switched,
    mode: np.ndarray,
    r: np.ndarray,
    hidden: Mapping[str, np.ndarray] | None = None,
) -> np.ndarray:
    """One of the matrices in every run, that of its mode."""
    values = dict(zip(switched.first.scheduling_names, r.T, strict=False)) | dict(hidden or {})
    every = [np.broadcast_to(everywhere(M, values), (len(mode), *M.shape)) for M in matrices]
    return np.stack(every)[mode, np.arange(len(mode))]


def reported(observer: Observer, motion: Motion) -> Any:
    """Estimates of the observer along every run, first guess zero."""
    return _along(observer, jnp.zeros(motion.x.shape[-1]), *map(jnp.asarray, (motion.u, motion.y, motion.r)))


@eqx.filter_jit
def _along(observer: Observer, guess: jax.Array, *signals: jax.Array) -> Any:
    def one(*signals: jax.Array) -> Any:
        return jax.lax.scan(lambda state, now: observer.step(state, *now), observer.init(guess), signals)[1]

    return jax.vmap(one)(*signals)


def everywhere(matrix: Polynomial, values: dict[str, np.ndarray]) -> np.ndarray:
    """A matrix in every run."""
    total = np.zeros((1, *matrix.shape))
    for exponents, coefficient in matrix:
        weights = [values[n] ** k for n, k in zip(matrix.names, exponents, strict=True) if k]
        total = total + np.prod(weights, axis=0).reshape(-1, 1, 1) * np.asarray(coefficient)
    return total


def times(matrix: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Matrix times vector in every run."""
    return np.einsum("...ij,...j->...i", matrix, vectors)
