"""Ground floor: errors, outcomes, argument checks, signals and trajectories."""

from luenberger.core.errors import (
    BadInput,
    Infeasible,
    LuenbergerError,
    MissingExtra,
    NotAccepted,
    NotCertified,
    ReplayFailed,
)
from luenberger.core.outcome import Outcome
from luenberger.core.trajectory import Signal, Trajectory

__all__ = [
    "BadInput",
    "Infeasible",
    "LuenbergerError",
    "MissingExtra",
    "NotAccepted",
    "NotCertified",
    "Outcome",
    "ReplayFailed",
    "Signal",
    "Trajectory",
]
