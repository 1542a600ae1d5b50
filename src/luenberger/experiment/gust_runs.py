"""Many runs of a drive, and guaranteed estimates along them: how wide they are and how often they are left."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from luenberger.algebra import Polynomial
from luenberger.experiment.gust_drive import Choices, Drive
from luenberger.observers.observer import Estimate, Observer
from luenberger.systems import Switched, System
from luenberger.systems.decoupled_error import DecoupledError
from luenberger.systems.uncertainty import Uncertain

ROUNDING = 1e-9
# Every so many samples the noise of some adversaries turns to where it acts at once.
_DROPPED = 5
# Name -> what of the recursion is on: how uncertainty is bounded, noise reused, the estimate used to bound the state.
VARIANTS: dict[str, tuple[str, bool, bool]] = {
    "c0": ("lemma", False, False),
    "c1": ("interval", False, False),
    "c2": ("structured", False, False),
    "c3": ("structured", True, False),
    "c4": ("structured", True, True),
}
WORDS = {
    "c0": "corrected, Lemma 1",
    "c1": "exact interval product",
    "c2": "structured uncertainty",
    "c3": "noise used once",
    "c4": "state bounded by the estimate",
}


@dataclass(frozen=True, eq=False)
class Cars:
    """Many runs of one drive.

    Args:
        states: lateral speed [m/s] and yaw rate [rad/s], (runs, nt, 2).
        outputs: measured yaw rate [rad/s], (runs, nt, 1).
        steering: measured steering angle [rad], (runs, nt, 1).
    """

    states: np.ndarray
    outputs: np.ndarray
    steering: np.ndarray


@dataclass(frozen=True, eq=False)
class Enclosure:
    """Bounds of the states of many runs, each array of shape (runs, nt, nx).

    Args:
        estimate: point estimate.
        lower: lower bounds.
        upper: upper bounds.
    """

    estimate: np.ndarray
    lower: np.ndarray
    upper: np.ndarray

    @property
    def width(self) -> float:
        """Mean width of the bounds of the lateral speed [m/s]."""
        return float((self.upper - self.lower)[..., 0].mean())

    def left(self, states: np.ndarray) -> np.ndarray:
        """Return for each run whether a state ever leaves its bounds, (runs,).

        Args:
            states: true states, (runs, nt, nx).
        """
        outside = (states < self.lower - ROUNDING) | (states > self.upper + ROUNDING)
        return np.asarray(outside.any(axis=(1, 2)))

    def reach(self, states: np.ndarray) -> float:
        """Return the largest share of the half width that an error of the lateral speed takes.

        Args:
            states: true states, (runs, nt, nx).
        """
        middle, half = 0.5 * (self.lower + self.upper)[..., 0], 0.5 * (self.upper - self.lower)[..., 0]
        return float((np.abs(states[..., 0] - middle) / half)[:, 1:].max())


def enclosed(observer: Observer, runs: Cars, schedule: np.ndarray) -> Enclosure:
    """Run an observer over many runs at once.

    Args:
        observer: with bounds.
        runs: inputs and outputs.
        schedule: scheduling vector of every sample, (nt, nr).
    """
    found = estimates(observer, runs, schedule)
    return Enclosure(np.asarray(found.x), np.asarray(found.lower), np.asarray(found.upper))


def estimates(observer: Observer, runs: Cars, schedule: np.ndarray) -> Estimate:
    """Run any observer over many runs at once; its estimates have leading axes of runs and samples.

    Args:
        observer: of lateral speed and yaw rate.
        runs: inputs and outputs.
        schedule: scheduling vector of every sample, (nt, nr).
    """
    start = observer.init(np.zeros(runs.states.shape[2]))
    return _scanned(observer, start, runs.steering, runs.outputs, jnp.asarray(schedule))


@eqx.filter_jit
def _scanned(observer: Observer, start: Any, u: Any, y: Any, r: Any) -> Estimate:
    def one(inputs: Any, outputs: Any) -> Estimate:
        def advance(state: Any, now: Any) -> tuple[Any, Estimate]:
            return observer.step(state, *now)

        return jax.lax.scan(advance, start, (inputs, outputs, r))[1]

    return jax.vmap(one)(jnp.asarray(u), jnp.asarray(y))


def driven(
    plant: Switched,
    gains: Sequence[Polynomial],
    decoupling: Sequence[Polynomial],
    road: Drive,
    schedule: np.ndarray,
    unknown: Choices,
    start: float,
) -> Cars:
    """Run cars that are exactly what the plant says, whatever its stiffness and noise do within their bounds.

    Adversaries push the error of the lateral speed of the given unknown-input observer their way at every sample.

    Args:
        plant: of `wind_plant`, sampled, its speed read without error.
        gains: K of every mode.
        decoupling: H of every mode.
        road: what driver and wind do.
        schedule: scheduling vector of every sample, (nt, nr).
        unknown: what is unknown on every run.
        start: half width of the first state.
    """
    errors = [DecoupledError.of(m, K, H) for m, K, H in zip(plant.modes, gains, decoupling, strict=True)]
    bound = np.asarray(plant.first.noise_bound)
    x, states, outputs, steering = start * unknown.start, [], [], []
    for k in range(len(road.time)):
        mode, r = int(plant.mode(schedule[k])), np.asarray(plant.within(schedule[k]))
        error = errors[mode]
        s, v = _unknown(error, plant.modes[mode], r, unknown, k, x, float(road.steering[k]))
        v = v * bound
        states.append(x)
        outputs.append(x[:, 1:] + v[:, :1])
        steering.append(np.full((len(x), 1), road.steering[k]))
        x = _advanced(error.uncertain, r, x, float(road.steering[k]) - v[:, 1], float(road.gust[k]), s)
    return Cars(*(np.stack(signal, axis=1) for signal in (states, outputs, steering)))


def _unknown(
    error: DecoupledError, mode: System, r: np.ndarray, unknown: Choices, k: int, x: np.ndarray, u: float
) -> tuple[np.ndarray, np.ndarray]:
    """Uncertain factors and noise of all runs at a sample, in units of their bounds."""
    s, v = unknown.stiffness[k][:, : error.uncertain.nk].copy(), unknown.noise[k].copy()
    pushing = unknown.adversary != 0
    way = unknown.adversary[pushing, None]
    at = dict(zip(mode.scheduling_names, r, strict=True))
    value = {n: np.asarray(p({m: at[m] for m in p.names}), dtype=float) for n, p in error.inputs.items()}
    if s.shape[1]:
        signals = np.column_stack([x, np.full(len(x), u), np.zeros(len(x))])[pushing]
        s[pushing] = way * np.sign((signals @ _rows(error.uncertain, at).T) * value["uncertainty"][0])
    now, kept = np.sign(value["next noise"][0]), np.sign(value["reused noise"][0])
    drops = unknown.drops[pushing, None] & (k % _DROPPED == _DROPPED - 1)
    v[pushing] = way * np.where(drops & (now != 0), now, kept)
    return s, v


def _advanced(
    uncertain: Uncertain, r: np.ndarray, x: np.ndarray, u: np.ndarray, gust: float, s: np.ndarray
) -> np.ndarray:
    nominal = uncertain.nominal
    A, B, E = (np.asarray(nominal.at(letter, r), dtype=float) for letter in "ABE")
    after = x @ A.T + u[:, None] * B[:, 0] + gust * E[:, 0]
    if not s.shape[1]:
        return after
    signals = np.column_stack([x, u, np.full(len(x), gust)])
    rows = _rows(uncertain, dict(zip(nominal.scheduling_names, r, strict=True)))
    return after + ((signals @ rows.T) * s) @ uncertain.directions.T


def _rows(uncertain: Uncertain, at: Mapping[str, float]) -> np.ndarray:
    return np.asarray(uncertain.rows({n: at[n] for n in uncertain.rows.names}), dtype=float)
