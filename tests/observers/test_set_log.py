"""Logs as the monitors of guaranteed estimators read them."""

import numpy as np
import pytest

from luenberger.observers.monitor import Drive
from luenberger.observers.monitor_sets import monitor_sets
from luenberger.observers.set_log import SetLog
from luenberger.systems import Parameter, Switched, System


def test_a_log_holds_what_was_read_last_and_knows_the_bounds_of_its_mode() -> None:
    first, second = (
        System.lpv(
            [[0.5]], G=[[1.0, 0.0]], N=np.zeros((0, 2)), noise_bound=[0.1, 0.2], dt=0.1,
            parameters=[Parameter("p", low, low + 1.0, error=0.1 * (1 + low))],
        )
        for low in (0.0, 2.0)
    )  # fmt: skip
    r = np.array([[np.nan, 0.0], [1.0, 0.0], [np.nan, 1.0], [2.5, 1.0]])
    log = SetLog(Switched.of([first, second]), Drive(np.arange(4.0), r=r))
    assert log.r is not None
    np.testing.assert_array_equal(log.r[:, 0], [1.0, 1.0, 1.0, 2.5])
    np.testing.assert_array_equal(log.mode, [0, 0, 1, 1])
    np.testing.assert_allclose(log.trusted("p")[:3], [[0, 0, 2, 2], [1, 1, 3, 3], [0.1, 0.1, 0.3, 0.3]])
    blind = SetLog(Switched.of([first, second]), Drive(np.arange(4.0)))
    np.testing.assert_allclose(blind.trusted("p")[:, 0], [0.0, 3.0, 0.3, 1.0, 1.0])
    found = {a.name: a for a in monitor_sets([first, second], Drive(np.arange(4.0), r=r))}
    # 1 lies below [2, 3] by more than it may be misread, but it was not read then.
    assert found["range of p"].held.all()
    r[2, 0] = 1.0
    assert {a.name: a for a in monitor_sets([first, second], Drive(np.arange(4.0), r=r))}[
        "range of p"
    ].worst == pytest.approx(0.7)
