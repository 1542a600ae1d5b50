"""Run observers over one trajectory in one compiled scan."""

import time as clock
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import equinox as eqx
import jax
import numpy as np

from luenberger.core import BadInput, ReplayFailed, Signal, Trajectory
from luenberger.core.checks import nearest
from luenberger.observers import Estimate, Observer
from luenberger.replay.channels import Channels, Samples, by_name, channels_of, samples_of

REPEATS = 3


@dataclass(frozen=True, eq=False)
class Replay:
    """Estimates of every observer at every sample.

    Args:
        time: sample times [s], shape (nt,).
        estimates: observer name -> Estimate whose arrays have a leading axis of nt samples.
        states: observer name -> names of the estimated states.
        channels: observer name -> channels it read.
        trajectory: what was replayed.
        seconds_per_step: observer name -> computing time of one step [s], or None where it was not measured.
    """

    time: np.ndarray
    estimates: dict[str, Estimate]
    states: dict[str, tuple[str, ...]]
    channels: dict[str, Channels]
    trajectory: Trajectory
    seconds_per_step: dict[str, float] | None = None

    def __getitem__(self, name: str) -> Estimate:
        if name not in self.estimates:
            raise BadInput(f"The replay has no observer `{name}`.{nearest(name, self.estimates)}")
        return self.estimates[name]

    def trajectory_of(self, name: str) -> Trajectory:
        """Return the estimate of one observer as a trajectory: states, and where known their deviation and bounds.

        Channels are named for the states, with "_deviation" (one standard deviation), "_lower" and "_upper" appended;
        units are those of channels of the same name in the replayed trajectory.

        Args:
            name: of the observer.

        Raises:
            BadInput: unknown observer.
        """
        estimate = self[name]
        parts: dict[str, Any] = {"": estimate.x, "_lower": estimate.lower, "_upper": estimate.upper}
        if estimate.covariance is not None:
            parts["_deviation"] = np.sqrt(np.diagonal(np.asarray(estimate.covariance), axis1=1, axis2=2))
        signals = []
        for k, state in enumerate(self.states[name]):
            unit = self.trajectory[state].unit if state in self.trajectory else ""
            for suffix, values in parts.items():
                if values is not None:
                    signals.append(Signal(state + suffix, unit, np.asarray(values)[:, k], f"estimate of {name}"))
        return Trajectory(self.time, signals, name, f"replay of {self.trajectory.name}")

    def outputs(self, name: str, function: Callable[[Any, Any, Any], Any], names: Sequence[str] = ()) -> Trajectory:
        """Return functions of the estimate, e.g. a sideslip angle or a tyre force.

        Args:
            name: of the observer.
            function: JAX function (x, u, r) -> z, shape (nz,).
            names: of the nz channels; default z1, z2, ...

        Raises:
            BadInput: unknown observer, or a wrong number of names.
        """
        estimate, channels = self[name], self.channels[name]
        u, r = self.trajectory.table(channels.inputs), self.trajectory.table(channels.scheduling)
        z = np.asarray(jax.vmap(function)(estimate.x, u, r)).reshape(self.time.size, -1)
        labels = tuple(names) or tuple(f"z{k + 1}" for k in range(z.shape[1]))
        if len(labels) != z.shape[1]:
            raise BadInput(f"`function` returns {z.shape[1]} values but `names` has {len(labels)}; both need to agree.")
        signals = [Signal(label, "", z[:, k], f"from the estimate of {name}") for k, label in enumerate(labels)]
        return Trajectory(self.time, signals, name, f"replay of {self.trajectory.name}")


def replay(
    observers: Mapping[str, Observer],
    trajectory: Trajectory,
    channels: Channels | Mapping[str, Channels],
    x0: Any,
    *,
    timing: bool = False,
    missing_outputs: bool = False,
) -> Replay:
    """Run observers side by side over a simulated or recorded trajectory, in one compiled scan.

    Args:
        observers: name -> observer; all of the trajectory's sample time.
        trajectory: uniform samples without gaps.
        channels: what is u, y and r: one for all, or observer name -> channels.
        x0: first guess (nx,): one for all, or observer name -> guess.
        timing: measure seconds per step too, each observer alone: the best of three runs of its own compiled scan.
        missing_outputs: let NaN in output channels reach the observers; the Kalman filters skip such entries.

    Raises:
        BadInput: no observer, missing channels, NaN/Inf, steps that are not the observer's dt, unknown names.
        ReplayFailed: an estimate is not finite; observer and first bad sample are named.
    """
    if not isinstance(observers, Mapping):
        raise BadInput(
            f"`observers` is a `{type(observers).__name__}`; a mapping from name to observer is needed, e.g. {{'ours': observer}}."
        )
    if not observers:
        raise BadInput("`observers` is empty; give at least one, e.g. {'kalman': KalmanFilter(...)}.")
    chosen = channels_of(observers, channels)
    guesses = by_name("x0", observers, x0) if isinstance(x0, Mapping) else dict.fromkeys(observers, x0)
    samples = {n: samples_of(n, o, trajectory, chosen[n], missing_outputs) for n, o in observers.items()}
    starts = {name: observer.init(guesses[name]) for name, observer in observers.items()}
    joint = joint_scan(tuple(observers.values()), tuple(starts.values()), tuple(samples.values()))
    estimates = dict(zip(observers, joint, strict=True))
    for name, estimate in estimates.items():
        refuse_divergence(name, estimate, trajectory.time)
    seconds = None
    if timing:
        seconds = {n: seconds_per_step(o, starts[n], samples[n]) for n, o in observers.items()}
    states = {name: state_names(observer, estimates[name].x.shape[1]) for name, observer in observers.items()}
    return Replay(trajectory.time, estimates, states, chosen, trajectory, seconds)


@eqx.filter_jit
def joint_scan(
    observers: tuple[Observer, ...], starts: tuple[Any, ...], samples: tuple[Samples, ...]
) -> tuple[Estimate, ...]:
    """Run the steps of all observers in one scan; compiled once for each structure, not for each tuning.

    Args:
        observers: what runs.
        starts: their start states.
        samples: their (u, y, r).
    """

    def advance(states: Any, sample: Any) -> tuple[Any, Any]:
        pairs = [o.step(s, *x) for o, s, x in zip(observers, states, sample, strict=True)]
        return tuple(state for state, _ in pairs), tuple(estimate for _, estimate in pairs)

    return jax.lax.scan(advance, starts, samples)[1]


def seconds_per_step(observer: Observer, start: Any, samples: Samples) -> float:
    """Return the computing time of one step inside a compiled scan [s]: the best of three runs after a warm-up.

    Args:
        observer: what runs.
        start: its start state.
        samples: its (u, y, r).
    """
    arguments = ((observer,), (start,), (jax.device_put(samples),))
    jax.block_until_ready(joint_scan(*arguments))
    best = np.inf
    for _ in range(REPEATS):
        begin = clock.perf_counter()
        jax.block_until_ready(joint_scan(*arguments))
        best = min(best, clock.perf_counter() - begin)
    return float(best / samples[0].shape[0])


def state_names(observer: Observer, nx: int) -> tuple[str, ...]:
    """Return the state names that an observer knows, or x1, x2, ...

    Args:
        observer: one with or without the attribute `states`.
        nx: number of states.
    """
    known = tuple(getattr(observer, "states", ()))
    return known if len(known) == nx else tuple(f"x{k + 1}" for k in range(nx))


def refuse_divergence(name: str, estimate: Estimate, time: np.ndarray) -> None:
    """Raise where an estimate left the finite numbers; an infinite guaranteed bound is allowed, a NaN never.

    Args:
        name: of the observer.
        estimate: arrays with a leading axis of samples.
        time: sample times [s].

    Raises:
        ReplayFailed: names the observer, the first bad sample and its time.
    """
    numbers = [part for part in (estimate.x, estimate.covariance) if part is not None]
    bounds = [part for part in (estimate.lower, estimate.upper) if part is not None]
    good = [np.isfinite(np.asarray(part)).reshape(time.size, -1) for part in numbers]
    good += [~np.isnan(np.asarray(part)).reshape(time.size, -1) for part in bounds]
    bad = ~np.concatenate(good, axis=1).all(axis=1)
    if bad.any():
        k = int(bad.argmax())
        last = (
            f" The last finite estimate is {np.array2string(np.asarray(estimate.x)[k - 1], precision=4)}." if k else ""
        )
        raise ReplayFailed(
            f"`{name}` gives an estimate that is not finite at sample {k} (t = {time[k]:g} s).{last} Check its gain or covariances, "
            "its sample time and the units of its channels."
        )
