"""Fewer points, no lost peak."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from luenberger.core import BadInput
from luenberger.report.decimation import decimated


@given(st.integers(4, 60), st.integers(5, 3000), st.integers(0, 10))
def test_extremes_and_ends_survive(limit: int, count: int, seed: int) -> None:
    time = np.arange(count, dtype=float)
    values = np.random.default_rng(seed).normal(size=count)
    t, v = decimated(time, values, limit)
    assert t.size <= max(limit, count if count <= limit else limit)
    assert np.all(np.diff(t) > 0)
    assert v.max() == values.max()
    assert v.min() == values.min()
    assert (t[0], t[-1]) == (0.0, count - 1.0)


def test_short_curves_stay() -> None:
    t, v = decimated(np.arange(10.0), np.ones(10), 20)
    assert t.size == v.size == 10
    with pytest.raises(BadInput, match="limit"):
        decimated(np.arange(10.0), np.ones(10), 3)
    with pytest.raises(BadInput, match="shape"):
        decimated(np.arange(10.0), np.ones(9), 20)
