"""Inequalities as data, relaxations over a box, solving, and reasons when nothing is found."""

from luenberger.lmi.cross_check import CrossCheck, cross_check
from luenberger.lmi.largest_value import largest_value
from luenberger.lmi.multiplier import FullBlockMultiplier, StructuredMultiplier
from luenberger.lmi.planner import Plan, Planned
from luenberger.lmi.problem import SOLVERS, Block, Problem, Solution, solve
from luenberger.lmi.recipe import centre, charged_block, infeasible, nearest_level
from luenberger.lmi.relaxation import Bernstein, Grid, Relaxation, Vertices
from luenberger.lmi.storage import decay_storage, l2_storage, rounded_storage

__all__ = [
    "SOLVERS",
    "Bernstein",
    "Block",
    "CrossCheck",
    "FullBlockMultiplier",
    "Grid",
    "Plan",
    "Planned",
    "Problem",
    "Relaxation",
    "Solution",
    "StructuredMultiplier",
    "Vertices",
    "centre",
    "charged_block",
    "cross_check",
    "decay_storage",
    "infeasible",
    "l2_storage",
    "largest_value",
    "nearest_level",
    "rounded_storage",
    "solve",
]
