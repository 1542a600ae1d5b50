"""ROLMIP manual, section 7.2: three rows of a published conservatism table, and the number of inequalities."""

import numpy as np
import pytest

from luenberger.experiment.published.two_mass import PRINTED, bounded_real, gridded_norm
from luenberger.lmi import solve
from luenberger.lmi.problem import expand

# Obtained with Bernstein coefficients; five digits are printed there, solvers agree to 1e-5 relative.
OBTAINED = (2.84294, 1.05398, 1.01079)


@pytest.mark.parametrize(("degree", "count"), [(0, 9), (1, 35), (2, 91)])
def test_row(degree: int, count: int) -> None:
    problem = bounded_real(degree)
    assert sum(map(len, expand(problem).values())) == count
    found = solve(problem)
    assert found is not None
    bound = np.sqrt(found.objective)
    assert bound == pytest.approx(OBTAINED[degree], rel=1e-5)
    # Four decimals are printed; half a unit of the last one.
    assert bound == pytest.approx(PRINTED[degree], abs=5.1e-5)
    assert bound >= gridded_norm() * (1 - 1e-6)


def test_truth_on_a_grid() -> None:
    # The worst case sits at the corner and at the resonance; 400 frequencies miss its top by less than 1e-4.
    assert gridded_norm() == pytest.approx(1.01079, abs=2e-4)
