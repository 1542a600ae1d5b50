"""Row by row: a published conservatism table of Lyapunov matrices that depend on parameters."""

from collections.abc import Callable

import numpy as np

from luenberger.core import LuenbergerError
from luenberger.experiment.published.row import Row, judged
from luenberger.experiment.published.two_mass import PRINTED, bounded_real, gridded_norm
from luenberger.lmi import solve

# Four decimals are printed: half a unit of the last one.
HALF_DIGIT = 5.1e-5


def rows(progress: Callable[[Row], None] | None = None) -> list[Row]:
    """Return the table of the ROLMIP manual, section 7.2, beside what the Bernstein relaxation gives here.

    Args:
        progress: called with each row as soon as it is known.

    Raises:
        LuenbergerError: no solver found a point whose residual is small.
    """
    truth = gridded_norm()
    found: list[Row] = []
    for degree, printed in enumerate(PRINTED):
        solution = solve(bounded_real(degree))
        if solution is None:
            raise LuenbergerError(
                f"No solver found the bound for degree {degree}; install the extra solvers and try again."
            )
        bound = float(np.sqrt(solution.objective))
        found.append(
            judged(
                f"worst-case H-infinity norm, storage of degree {degree} in each parameter",
                "section 7.2",
                f"{printed:.4f}",
                f"{bound:.5f}",
                f"Bernstein coefficients on the box; a dense grid of parameters and frequencies gives {truth:.5f}, no bound may be below it",
                reproduced=abs(bound - printed) <= HALF_DIGIT and bound >= truth * (1 - 1e-6),
                deviation=abs(bound - printed),
            )
        )
        if progress is not None:
            progress(found[-1])
    return found
