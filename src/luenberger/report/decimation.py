"""Fewer points for a curve on a screen, without losing a peak."""

import numpy as np

from luenberger.core import BadInput

LIMIT = 4000


def decimated(time: np.ndarray, values: np.ndarray, limit: int = LIMIT) -> tuple[np.ndarray, np.ndarray]:
    """Return at most `limit` points of a curve: of every stretch its lowest and its highest sample, in order of time.

    The first and the last sample stay. A stretch without any finite sample stays as one gap; shorter gaps close.

    Args:
        time: sample times, shape (nt,).
        values: samples, shape (nt,); NaN marks a missing one.
        limit: most points returned, at least 4.

    Raises:
        BadInput: shapes that differ, or a limit below 4.
    """
    if time.shape != values.shape or time.ndim != 1:
        raise BadInput(f"`time` has shape {time.shape}, `values` {values.shape}; both need one shape (nt,).")
    if limit < 4:
        raise BadInput(f"`limit` is {limit}; at least 4 points are needed to keep the ends and two extremes.")
    if time.size <= limit:
        return time, values
    inner = np.arange(1, time.size - 1)
    stretches = (limit - 2) // 2
    width = -(-inner.size // stretches)
    # The last stretch is filled up with its own last sample, which changes neither extreme.
    filled = np.concatenate([inner, np.full(-inner.size % width, inner[-1])]).reshape(-1, width)
    samples = values[filled]
    lowest = np.where(np.isnan(samples), np.inf, samples).argmin(axis=1)
    highest = np.where(np.isnan(samples), -np.inf, samples).argmax(axis=1)
    row = np.arange(filled.shape[0])
    kept = np.unique(np.concatenate([[0], filled[row, lowest], filled[row, highest], [time.size - 1]]))
    return time[kept], values[kept]
