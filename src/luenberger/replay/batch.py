"""Many replays at once: tunings, first guesses or noise draws along one batch axis."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from luenberger.core import BadInput, Trajectory
from luenberger.observers import Estimate, Observer
from luenberger.replay.channels import Channels, Samples, samples_of
from luenberger.replay.replay import joint_scan, refuse_divergence, state_names


@dataclass(frozen=True, eq=False)
class ReplayBatch:
    """Estimates of a batch of runs.

    Args:
        time: sample times [s], shape (nt,).
        estimate: arrays with leading axes (nb, nt).
        states: names of the estimated states.
    """

    time: np.ndarray
    estimate: Estimate
    states: tuple[str, ...]

    def errors(self, truth: Any) -> np.ndarray:
        """Return the estimates less the truth, shape (nb, nt, nx).

        Args:
            truth: true states, shape (nt, nx), or (nb, nt, nx) where the runs have truths of their own.
        """
        return np.asarray(self.estimate.x) - np.asarray(truth)


def replay_batch(
    observers: Observer | Sequence[Observer],
    trajectories: Trajectory | Sequence[Trajectory],
    channels: Channels,
    x0: Any,
    *,
    missing_outputs: bool = False,
) -> ReplayBatch:
    """Run a batch of replays in one compiled, vectorised scan, e.g. for Monte Carlo or to tune.

    What is given once is shared by all runs; what is given as a sequence needs one entry a run.

    Args:
        observers: one, or nb observers that differ in their arrays only (gains, covariances).
        trajectories: one, or nb of equal times (noise draws, say).
        channels: what is u, y and r.
        x0: first guess (nx,), or (nb, nx).
        missing_outputs: let NaN in output channels reach the observers.

    Returns:
        ReplayBatch with nb runs; one run where everything is given once.

    Raises:
        BadInput: lengths that differ, observers of different structure, times that differ, and what `replay` refuses.
        ReplayFailed: an estimate is not finite; the run is named.
    """
    group = [observers] if isinstance(observers, Observer) else list(observers)
    drives = [trajectories] if isinstance(trajectories, Trajectory) else list(trajectories)
    guesses = np.atleast_2d(np.asarray(x0))
    sizes = {"observers": len(group), "trajectories": len(drives), "x0": len(guesses)}
    runs = max(sizes.values())
    if any(size not in (1, runs) for size in sizes.values()):
        raise BadInput(f"The batch has {sizes}; each needs one entry, or one for each of the {runs} runs.")
    _same_times(drives)
    samples = [samples_of(f"run {k}", group[0], drive, channels, missing_outputs) for k, drive in enumerate(drives)]
    _same_structure(group)
    starts = [o.init(guess) for o, guess in _pairs(group, guesses)]
    (observer, start, record), axes = zip(*map(_one_or_stacked, (group, starts, samples)), strict=True)
    if runs == 1:
        estimate = jax.tree.map(lambda leaf: leaf[None], joint_scan((observer,), (start,), (record,))[0])
    else:
        estimate = _batched(runs, axes, observer, start, record)
    for k in range(runs):
        refuse_divergence(f"run {k}", jax.tree.map(lambda leaf, k=k: leaf[k], estimate), drives[0].time)
    return ReplayBatch(drives[0].time, estimate, state_names(group[0], estimate.x.shape[2]))


@eqx.filter_jit
def _batched(runs: int, axes: tuple[int | None, ...], observer: Any, start: Any, samples: Samples) -> Estimate:
    def run(one: Any, begin: Any, record: Any) -> Estimate:
        return joint_scan((one,), (begin,), (record,))[0]

    over = tuple(None if axis is None else eqx.if_array(axis) for axis in axes)
    return eqx.filter_vmap(run, in_axes=over, axis_size=runs)(observer, start, samples)


def _same_structure(group: list[Observer]) -> None:
    structures = [jax.tree.structure(observer) for observer in group]
    for k, structure in enumerate(structures):
        if structure != structures[0]:
            raise BadInput(
                f"Observer {k} of the batch differs from the first in more than its arrays (another plant, method or "
                "sample time, or functions built twice); build all from one plant and one set of functions."
            )


def _one_or_stacked(items: list[Any]) -> tuple[Any, int | None]:
    """Return what all runs share with no axis, or the stack with its batch axis."""
    return (items[0], None) if len(items) == 1 else (jax.tree.map(_stacked_leaf, *items), 0)


def _stacked_leaf(*leaves: Any) -> Any:
    if isinstance(leaves[0], jax.Array | np.ndarray | float):
        return jnp.stack([jnp.asarray(leaf) for leaf in leaves])
    if any(leaf != leaves[0] for leaf in leaves):
        raise BadInput(
            f"The observers of the batch hold {sorted({repr(leaf) for leaf in leaves})}; they may differ in their arrays only."
        )
    return leaves[0]


def _pairs(group: list[Observer], guesses: np.ndarray) -> list[tuple[Observer, np.ndarray]]:
    count = max(len(group), len(guesses))
    return [(group[k % len(group)], guesses[k % len(guesses)]) for k in range(count)]


def _same_times(drives: list[Trajectory]) -> None:
    for k, drive in enumerate(drives):
        if drive.time.shape != drives[0].time.shape or not np.array_equal(drive.time, drives[0].time):
            raise BadInput(
                f"Trajectory {k} of the batch has {len(drive)} samples that are not at the times of the first ({len(drives[0])} samples); "
                "resample all to one grid."
            )
