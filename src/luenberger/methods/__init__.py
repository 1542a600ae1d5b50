"""One published design per file."""

from luenberger.methods.extended_luenberger import ExtendedLuenberger
from luenberger.methods.full_block import FullBlockLuenberger
from luenberger.methods.interval import IntervalLuenberger
from luenberger.methods.interval_width import IntervalWidth
from luenberger.methods.kalman_gain import KalmanGain
from luenberger.methods.lipschitz_algorithm import AlgorithmReport, MarginTable, lipschitz_algorithm
from luenberger.methods.lipschitz_bracket import EpsilonBracket, MarginBracket, largest_epsilon, margin_bracket
from luenberger.methods.lipschitz_disturbance import LipschitzDisturbance
from luenberger.methods.lipschitz_gain import disturbance_bound, disturbance_gain, least_disturbance_gain
from luenberger.methods.lipschitz_margin import margin_at, quadratic_storage, stability_margin, thau_bound
from luenberger.methods.lipschitz_pareto import LipschitzPareto
from luenberger.methods.lipschitz_riccati import LipschitzRiccati
from luenberger.methods.method import Candidate, Method, SwitchedCandidate, SwitchedMethod
from luenberger.methods.polytopic import PolytopicLuenberger
from luenberger.methods.printed_two_dof import PrintedTwoDof
from luenberger.methods.robust_bound import gamma_star
from luenberger.methods.robust_luenberger import RobustLuenberger
from luenberger.methods.structured_lipschitz import StructuredLipschitz
from luenberger.methods.two_dof import TwoDofLuenberger
from luenberger.methods.unknown_input import UnknownInputGain
from luenberger.methods.unstructured import UnstructuredObserver
from luenberger.methods.zonotopic_energy import HInfinityGain, SegmentGain
from luenberger.methods.zonotopic_radius import PRadiusGain
from luenberger.methods.zonotopic_width import SteadyWidth

METHODS: dict[str, type[Method] | type[SwitchedMethod]] = {
    method.__name__: method
    for method in (
        PolytopicLuenberger,
        StructuredLipschitz,
        LipschitzRiccati,
        LipschitzPareto,
        LipschitzDisturbance,
        KalmanGain,
        RobustLuenberger,
        UnstructuredObserver,
        IntervalLuenberger,
        IntervalWidth,
        ExtendedLuenberger,
        TwoDofLuenberger,
        FullBlockLuenberger,
        PrintedTwoDof,
        SteadyWidth,
        SegmentGain,
        HInfinityGain,
        PRadiusGain,
        UnknownInputGain,
    )
}

__all__ = [
    "METHODS",
    "AlgorithmReport",
    "Candidate",
    "EpsilonBracket",
    "ExtendedLuenberger",
    "FullBlockLuenberger",
    "HInfinityGain",
    "IntervalLuenberger",
    "IntervalWidth",
    "KalmanGain",
    "LipschitzDisturbance",
    "LipschitzPareto",
    "LipschitzRiccati",
    "MarginBracket",
    "MarginTable",
    "Method",
    "PRadiusGain",
    "PolytopicLuenberger",
    "PrintedTwoDof",
    "RobustLuenberger",
    "SegmentGain",
    "SteadyWidth",
    "StructuredLipschitz",
    "SwitchedCandidate",
    "SwitchedMethod",
    "TwoDofLuenberger",
    "UnknownInputGain",
    "UnstructuredObserver",
    "disturbance_bound",
    "disturbance_gain",
    "gamma_star",
    "largest_epsilon",
    "least_disturbance_gain",
    "lipschitz_algorithm",
    "margin_at",
    "margin_bracket",
    "quadratic_storage",
    "stability_margin",
    "thau_bound",
]
