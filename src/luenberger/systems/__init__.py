"""Plants: matrices over a scheduling domain, nonlinearity, and the bounds we trust."""

from luenberger.systems.embedding import Embedding, embed
from luenberger.systems.held_box import discretize_enclosed
from luenberger.systems.jacobian_hull import prove_hull, proved_hull
from luenberger.systems.matrix import MatrixFunction
from luenberger.systems.nonlinearity import Nonlinearity
from luenberger.systems.parameter import Parameter
from luenberger.systems.scheduling_error import SchedulingError
from luenberger.systems.switched import Switched
from luenberger.systems.system import System
from luenberger.systems.uncertainty import Uncertain

__all__ = [
    "Embedding",
    "MatrixFunction",
    "Nonlinearity",
    "Parameter",
    "SchedulingError",
    "Switched",
    "System",
    "Uncertain",
    "discretize_enclosed",
    "embed",
    "prove_hull",
    "proved_hull",
]
