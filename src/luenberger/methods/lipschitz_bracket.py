"""Proved lower and upper bounds on stability margins and on the largest epsilon, in exact rational arithmetic."""

from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np

from luenberger.core import BadInput, Infeasible, NotCertified
from luenberger.methods.hamiltonian import positive_solution
from luenberger.methods.lipschitz_inequality import LumpedInequality
from luenberger.methods.lipschitz_margin import squared_margin, storage_at
from luenberger.methods.lipschitz_plant import LumpedPlant, Transform, require_epsilon
from luenberger.systems import System


@dataclass(frozen=True)
class MarginBracket:
    """Proved bounds on the square of a margin.

    Args:
        lower: every Lipschitz constant g with g^2 <= lower is tolerated.
        upper: no P shows stability for a Lipschitz constant g with g^2 > upper.
    """

    lower: Fraction
    upper: Fraction

    @property
    def alpha(self) -> tuple[float, float]:
        """The bounds on the margin itself, rounded to doubles."""
        return float(self.lower) ** 0.5, float(self.upper) ** 0.5


@dataclass(frozen=True)
class EpsilonBracket:
    """Proved bounds on the largest epsilon at which a plant has a gain of the Riccati form.

    Args:
        feasible: an epsilon for which a P is proved; smaller ones share it.
        infeasible: an epsilon for which no P exists, proved; None where every epsilon up to `ceiling` is feasible.
    """

    feasible: float
    infeasible: float | None


def margin_bracket(
    system: System, *, epsilon: float | None = None, gain: Any = None, transform: Transform = None
) -> MarginBracket:
    """Prove bounds on a stability margin: of a given gain, or of the best Riccati gain at a given epsilon.

    Choose it where `stability_margin` or `margin_at` decides something: both are floating point. The bounds are usually
    a relative 1e-6 apart.

    Certifies: lower <= alpha^2 <= upper, alpha of eq. (13) for a gain, of eq. (24) for an epsilon, for the plant whose
    matrices, transform, gain and epsilon are exactly the given doubles.

    Args:
        system: continuous plant with constant matrices; its Lipschitz constant is not used.
        epsilon: weight of the outputs; give it or `gain`.
        gain: L, shape (nx, ny); give it or `epsilon`.
        transform: T or its diagonal.

    Raises:
        BadInput: both or neither of `epsilon` and `gain`.
        Infeasible: the margin is zero.
        NotCertified: rounding spoiled every proposed proof (badly scaled states).

    Reference: dual of B. Song, J. K. Hedrick, ACC 2011, (13) and (24).

    Example:
        >>> import luenberger as lb
        >>> from luenberger.methods.lipschitz_bracket import margin_bracket
        >>> low, high = margin_bracket(lb.System.linear([[0.0]], C=[[1.0]]), epsilon=0.25).alpha
        >>> 1.999 < low < 2.0 < high < 2.001
        True
    """
    if (epsilon is None) == (gain is None):
        raise BadInput("`margin_bracket` needs either `epsilon` or `gain`; give exactly one of them.")
    if epsilon is not None:
        require_epsilon(epsilon)
    found = LumpedInequality.of(system, transform, gain, epsilon)
    best = squared_margin(found.A, found.K)
    if best <= 0:
        raise Infeasible(
            "The margin is zero: no P > 0 exists even without a nonlinearity. Choose a stabilising gain or a smaller epsilon."
        )
    lower = upper = None
    for width in (1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3):
        P = positive_solution(found.A, np.eye(len(found.A)), best * (1 - width) * np.eye(len(found.A)) - found.K)
        if P is None:
            continue
        if lower is None and found.tolerates(P, Fraction(best * (1 - 2 * width))):
            lower = Fraction(best * (1 - 2 * width))
        if upper is None:
            bounds = (found.refuted_above(*found.proposed_dual(P)), found.refuted_by_frequency(best * (1 + width)))
            upper = min((b for b in bounds if b is not None), default=None)
        if lower is not None and upper is not None:
            return MarginBracket(lower, upper)
    raise NotCertified(
        f"The margin {best**0.5:.6g} could not be bracketed by a proof; scale the states with `transform`."
    )


def largest_epsilon(
    system: System,
    lipschitz: float | None = None,
    transform: Transform = None,
    *,
    width: float = 1e-6,
    ceiling: float = 1e6,
) -> EpsilonBracket:
    """Prove a bracket of the largest epsilon at which a gain of the Riccati form exists for a Lipschitz constant.

    Choose it instead of a grid: a grid says only which of its points are feasible, and a misread index is not noticed.

    Certifies: at `feasible` a P satisfies (19), at `infeasible` none does; both in rational arithmetic.

    Args:
        system: continuous plant with constant matrices.
        lipschitz: constant in the coordinates z = T x; default that of the plant.
        transform: T or its diagonal.
        width: wanted relative width of the bracket.
        ceiling: largest epsilon to look at.

    Raises:
        Infeasible: no epsilon down to 1e-8 admits the Lipschitz constant.
        NotCertified: no proof was found at the ends.

    Reference: B. Song, J. K. Hedrick, ACC 2011, Theorem 4, (24).

    Example:
        >>> import luenberger as lb
        >>> from luenberger.methods.lipschitz_bracket import largest_epsilon
        >>> found = largest_epsilon(lb.System.linear([[0.0]], C=[[1.0]]), lipschitz=2.0)
        >>> found.feasible < 0.25 < found.infeasible
        True
    """
    plant = LumpedPlant.of(system, transform)
    g = plant.lipschitz if lipschitz is None else lipschitz
    plant = replace(plant, lipschitz=g)
    good, bad = epsilon_interval(plant, ceiling)
    squared = Fraction(g) ** 2
    while bad is not None and bad - good > width / 4 * bad:
        middle = (good * bad) ** 0.5
        good, bad = (middle, bad) if storage_at(plant, middle) is not None else (good, middle)
    feasible = next(
        (e for k in range(12) if _feasible(system, transform, e := good * (1 - width / 4 * 2**k), squared)), None
    )
    infeasible = None
    if bad is not None:
        infeasible = next(
            (e for k in range(12) if _infeasible(system, transform, e := bad * (1 + width / 4 * 2**k), squared)), None
        )
    if feasible is None or (bad is not None and infeasible is None):
        raise NotCertified(
            f"The largest epsilon lies near {good:.6g}, but a proof is missing; scale the states with `transform`."
        )
    return EpsilonBracket(feasible, infeasible)


def epsilon_interval(plant: LumpedPlant, ceiling: float = 1e6) -> tuple[float, float | None]:
    """Return a feasible epsilon and ten times it or less that is not (None where `ceiling` is feasible); floating point.

    Args:
        plant: plant with the Lipschitz constant.
        ceiling: largest epsilon to look at.

    Raises:
        Infeasible: no epsilon down to 1e-8 is feasible.
    """
    ladder = np.geomspace(ceiling, 1e-8, 1 + round(np.log10(ceiling) + 8))
    for k, epsilon in enumerate(ladder):
        if storage_at(plant, float(epsilon)) is not None:
            return float(epsilon), (float(ladder[k - 1]) if k else None)
    raise Infeasible(
        f"No epsilon down to 1e-08 admits the Lipschitz constant {plant.lipschitz:.6g} in these coordinates. Choose another "
        "`transform` (a diagonal one that shrinks the states where the nonlinearity acts), or `StructuredLipschitz`.",
        "stability",
    )


def _feasible(system: System, transform: Transform, epsilon: float, squared: Fraction) -> bool:
    found = LumpedInequality.of(system, transform, None, epsilon)
    eye = np.eye(len(found.A))
    # A P of a slightly larger constant leaves room for rounding.
    proposals = (
        positive_solution(found.A, eye, float(squared) * (1 + more) * eye - found.K) for more in (1e-7, 1e-9, 1e-5)
    )
    return any(P is not None and found.tolerates(P, squared) for P in proposals)


def _infeasible(system: System, transform: Transform, epsilon: float, squared: Fraction) -> bool:
    try:
        return margin_bracket(system, epsilon=epsilon, transform=transform).upper < squared
    except (Infeasible, NotCertified):
        return False
