"""The smallest bound that a relaxation proves for the largest eigenvalue of a parameter-dependent matrix on a box."""

from collections.abc import Mapping, Sequence

import cvxpy as cp
import numpy as np

from luenberger.algebra import Polynomial
from luenberger.lmi.problem import Block, Problem, solve
from luenberger.lmi.relaxation import Relaxation


def largest_value(
    matrices: Sequence[Polynomial], box: Mapping[str, tuple[float, float]], relaxation: Relaxation
) -> np.ndarray | None:
    """Return t with  F(r) <= t I  for all r in the box, the smallest the relaxation proves, for each matrix; None without.

    Choose it to compare relaxations, or to see how much one gives away; a design poses blocks of its own. The bound is read
    from the multipliers that were found and not from the solver's objective, so it holds to rounding however inaccurate the
    solver was. All matrices are solved together: it is one problem with a sum for an objective.

    Args:
        matrices: symmetric polynomials with numbers for coefficients.
        box: parameter name -> interval.
        relaxation: how the box is replaced by finitely many matrices.

    Returns:
        shape (number of matrices,).
    """
    levels = [cp.Variable(name=f"level{k}") for k in range(len(matrices))]
    blocks = [
        Block(f"bound{k}", F - Polynomial.constant(t * np.eye(F.shape[0])), box, relaxation=relaxation)
        for k, (F, t) in enumerate(zip(matrices, levels, strict=True))
    ]
    variables = {t.name(): t for t in levels}
    found = solve(Problem(variables, blocks, sum(levels[1:], start=levels[0])))
    if found is None:
        return None
    return np.array(
        [float(found.values[t.name()]) - found.margins[b.name] for t, b in zip(levels, blocks, strict=True)]
    )
