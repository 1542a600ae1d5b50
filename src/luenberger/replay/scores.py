"""Numbers that rank estimates against a truth: error, settling, consistency, width, computing time."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float
from rich.markup import escape
from rich.table import Table
from scipy.stats import chi2, norm

from luenberger.core import BadInput, Trajectory
from luenberger.replay.replay import Replay

CONFIDENCE = 0.95
Vector = Float[np.ndarray, "nt"]


@dataclass(frozen=True)
class Score:
    """One estimated state of one observer.

    Args:
        observer: name.
        state: name of the estimated state.
        unit: its unit.
        samples: number of samples compared; those without truth are left out.
        rmse: root mean square error [unit].
        max_error: largest absolute error [unit].
        settling_time: time after which the error stays below the fraction of its first value [s]; None if never.
        coverage: share of samples with the truth inside [lower, upper], or within the 95 % interval of the covariance;
            None where the observer gives neither.
        mean_width: mean width of that interval [unit], or None.
        nees: normalised error squared e' P^-1 e of the compared states together, averaged over the samples; its
            expectation is the number of compared states. None without covariance.
        nees_interval: 95 % interval of that average for a consistent filter whose errors are independent from sample to
            sample; errors of a filter are not, so the true interval is wider.
        ellipse_coverage: share of samples with the truth inside the 95 % ellipsoid of the compared states, or None.
        seconds_per_step: computing time [s], or None where not measured.
    """

    observer: str
    state: str
    unit: str
    samples: int
    rmse: float
    max_error: float
    settling_time: float | None
    coverage: float | None = None
    mean_width: float | None = None
    nees: float | None = None
    nees_interval: tuple[float, float] | None = None
    ellipse_coverage: float | None = None
    seconds_per_step: float | None = None


def scores(
    replay: Replay,
    truth: Mapping[str, str] | None = None,
    *,
    reference: Trajectory | None = None,
    settling_fraction: float = 0.05,
    start: float | None = None,
    stop: float | None = None,
) -> list[Score]:
    """Score every observer of a replay against true channels.

    Args:
        replay: estimates.
        truth: state name -> channel with its truth; default: every state that is also a channel. NaN marks no truth.
        reference: trajectory with the true channels, at the times of the replay; default the replayed one.
        settling_fraction: share of the first error that counts as settled.
        start: first time scored [s]; default all.
        stop: time at which scoring ends [s], left out itself; default all.

    Returns:
        One row for each observer and compared state.

    Raises:
        BadInput: no state to compare, unknown channels, times that differ, or no sample with a truth.
    """
    reference = replay.trajectory if reference is None else reference
    if not np.array_equal(reference.time, replay.time):
        raise BadInput(
            f"`reference` has {len(reference)} samples that are not at the times of the replay ({replay.time.size} samples); resample it."
        )
    window = (replay.time >= (-np.inf if start is None else start)) & (replay.time < (np.inf if stop is None else stop))
    if truth is not None and (lost := [s for s in truth if not any(s in states for states in replay.states.values())]):
        known = sorted({state for states in replay.states.values() for state in states})
        raise BadInput(f"`truth` names the states {lost}, which no observer estimates; they estimate {known}.")
    rows: list[Score] = []
    for name in replay.estimates:
        names = {s: s for s in replay.states[name] if s in reference} if truth is None else truth
        pairs = [(k, s, names[s]) for k, s in enumerate(replay.states[name]) if s in names]
        if pairs:
            rows += _rows(replay, name, pairs, reference, window, settling_fraction)
    if not rows:
        raise BadInput("No estimated state has a truth to compare with; give `truth={'state': 'channel'}`.")
    return rows


def score_table(rows: Sequence[Score], title: str = "Scores") -> Table:
    """Return the rows as a table for the terminal.

    Args:
        rows: what `scores` returned.
        title: heading.
    """
    table = Table(title=title)
    heads = (
        "observer",
        "state",
        "RMSE",
        "max error",
        "settling [s]",
        "coverage",
        "mean width",
        "NEES (95 % interval)",
        "µs a step",
    )
    for k, head in enumerate(heads):
        # Square brackets are markup unless escaped.
        table.add_column(escape(head), justify="left" if k < 2 else "right")
    for row in rows:
        interval = "" if row.nees_interval is None else f" ({row.nees_interval[0]:.3g} to {row.nees_interval[1]:.3g})"
        table.add_row(
            escape(row.observer),
            escape(f"{row.state} [{row.unit}]" if row.unit else row.state),
            f"{row.rmse:.4g}",
            f"{row.max_error:.4g}",
            "never" if row.settling_time is None else f"{row.settling_time:.3g}",
            _optional(row.coverage, ".1%"),
            _optional(row.mean_width, ".4g"),
            _optional(row.nees, ".3g") + interval,
            _optional(None if row.seconds_per_step is None else row.seconds_per_step * 1e6, ".3g"),
        )
    return table


def settling_time(time: Vector, error: Vector, fraction: float) -> float | None:
    """Return the time from the first sample after which |error| stays below a fraction of its first value [s].

    Args:
        time: sample times [s].
        error: error at them.
        fraction: share of the first error.

    Returns:
        0 for an error that is zero throughout; None where the last sample is still above.
    """
    outside = np.flatnonzero(np.abs(error) > fraction * abs(error[0]))
    if outside.size == 0:
        return 0.0
    last = int(outside[-1])
    return None if last == error.size - 1 else float(time[last + 1] - time[0])


def normalised_error_squared(error: Float[np.ndarray, "nt nx"], covariance: Float[np.ndarray, "nt nx nx"]) -> Vector:
    """Return e' P^-1 e at every sample; infinite where P is singular and the error is not covered by it.

    Args:
        error: estimation error.
        covariance: what the filter says of it.
    """
    values, vectors = np.linalg.eigh(covariance)
    parts = np.einsum("kij,ki->kj", vectors, error) ** 2
    floor = values[:, -1:] * error.shape[1] * np.finfo(float).eps
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(values > floor, parts / values, np.where(parts > floor, np.inf, 0.0))
    return ratio.sum(axis=1)


def _rows(
    replay: Replay,
    name: str,
    pairs: list[tuple[int, str, str]],
    reference: Trajectory,
    window: np.ndarray,
    fraction: float,
) -> list[Score]:
    estimate, index = replay[name], [k for k, _, _ in pairs]
    true = reference.table([channel for _, _, channel in pairs])
    keep = window & np.isfinite(true).all(axis=1)
    if not keep.any():
        raise BadInput(
            f"No sample of `{name}` has a truth between `start` and `stop`; check the times and the NaN in the true channels."
        )
    error = (np.asarray(estimate.x)[:, index] - true)[keep]
    time, count = replay.time[keep], int(keep.sum())
    joint = _joint(estimate.covariance, error, keep, index)
    seconds = None if replay.seconds_per_step is None else replay.seconds_per_step[name]
    rows = []
    for column, (k, state, channel) in enumerate(pairs):
        e = error[:, column]
        coverage, width = _interval(estimate, k, true[keep, column], keep)
        rows.append(
            Score(
                observer=name,
                state=state,
                unit=reference[channel].unit,
                samples=count,
                rmse=float(np.sqrt(np.mean(e**2))),
                max_error=float(np.abs(e).max()),
                settling_time=settling_time(time, e, fraction),
                coverage=coverage,
                mean_width=width,
                seconds_per_step=seconds,
                **joint,
            )
        )
    return rows


def _interval(estimate: Any, k: int, true: np.ndarray, keep: np.ndarray) -> tuple[float | None, float | None]:
    if estimate.lower is not None and estimate.upper is not None:
        lower, upper = np.asarray(estimate.lower)[keep, k], np.asarray(estimate.upper)[keep, k]
    elif estimate.covariance is not None:
        half = norm.ppf(0.5 + CONFIDENCE / 2) * np.sqrt(np.asarray(estimate.covariance)[keep, k, k])
        middle = np.asarray(estimate.x)[keep, k]
        lower, upper = middle - half, middle + half
    else:
        return None, None
    return float(np.mean((lower <= true) & (true <= upper))), float(np.mean(upper - lower))


def _joint(covariance: Any, error: np.ndarray, keep: np.ndarray, index: list[int]) -> dict[str, Any]:
    if covariance is None:
        return {}
    squared = normalised_error_squared(error, np.asarray(covariance)[keep][:, index][:, :, index])
    count, size = error.shape
    ends = chi2.ppf([(1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2], count * size) / count
    return {
        "nees": float(squared.mean()),
        "nees_interval": (float(ends[0]), float(ends[1])),
        "ellipse_coverage": float(np.mean(squared <= chi2.ppf(CONFIDENCE, size))),
    }


def _optional(value: float | None, form: str) -> str:
    return "" if value is None else format(value, form)
