"""What runs: two pure functions, `init` and `step`, for every observer and every baseline."""

from luenberger.observers.anchor import AlgebraicEstimate, zero_estimate
from luenberger.observers.correction import CorrectionObserver, substeps_needed
from luenberger.observers.gaussian import Belief
from luenberger.observers.interval import IntervalObserver
from luenberger.observers.kalman import ExtendedKalmanFilter, KalmanFilter
from luenberger.observers.monitor import Assumption, Drive, Sector, Violation, explain, monitor
from luenberger.observers.monitor_sets import CONTRADICTIONS, monitor_sets
from luenberger.observers.observer import Estimate, Observer
from luenberger.observers.two_dof import TwoDofObserver
from luenberger.observers.unknown_input import UnknownInputObserver
from luenberger.observers.unscented import UnscentedKalmanFilter
from luenberger.observers.zonotopic import (
    ZonotopicFilter,
    ZonotopicKalmanFilter,
    ZonotopicLuenberger,
    ZonotopicObserver,
)
from luenberger.observers.zonotopic_strips import ZonotopicStripFilter, together

__all__ = [
    "CONTRADICTIONS",
    "AlgebraicEstimate",
    "Assumption",
    "Belief",
    "CorrectionObserver",
    "Drive",
    "Estimate",
    "ExtendedKalmanFilter",
    "IntervalObserver",
    "KalmanFilter",
    "Observer",
    "Sector",
    "TwoDofObserver",
    "UnknownInputObserver",
    "UnscentedKalmanFilter",
    "Violation",
    "ZonotopicFilter",
    "ZonotopicKalmanFilter",
    "ZonotopicLuenberger",
    "ZonotopicObserver",
    "ZonotopicStripFilter",
    "explain",
    "monitor",
    "monitor_sets",
    "substeps_needed",
    "together",
    "zero_estimate",
]
