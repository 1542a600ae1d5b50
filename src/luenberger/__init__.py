"""State observers designed by convex optimisation, proved on the continuum, replayed on real logs, shipped as code.

Nouns live here, with `embed`, which makes one from a function; other verbs are imported from their rooms, e.g.
``from luenberger.synthesize import synthesize``.
"""

import jax

# Must precede every other import of the package: arrays made before would be float32.
jax.config.update("jax_enable_x64", True)

from luenberger.algebra import Polynomial  # noqa: E402
from luenberger.core import Outcome, Signal, Trajectory  # noqa: E402
from luenberger.systems import MatrixFunction, Nonlinearity, Parameter, Switched, System, embed  # noqa: E402

__version__ = "0.1.0"

__all__ = [
    "MatrixFunction",
    "Nonlinearity",
    "Outcome",
    "Parameter",
    "Polynomial",
    "Signal",
    "Switched",
    "System",
    "Trajectory",
    "embed",
]
