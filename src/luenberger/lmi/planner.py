"""Which relaxation an inequality should have: the tightest one that is worth its cost, with the reason in words."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import prod

import numpy as np

from luenberger.algebra import Polynomial
from luenberger.lmi.multiplier import FullBlockMultiplier, StructuredMultiplier, lifted_bases
from luenberger.lmi.multiplier_lift import gram_freedom, pruned
from luenberger.lmi.relaxation import Bernstein, Box, Relaxation, Vertices
from luenberger.lmi.relaxed import Relaxed, side

# Curved parameters up to which a full block multiplier is worth a condition for every vertex.
FEW = 3


@dataclass(frozen=True)
class Plan:
    """A choice, what it costs and why.

    Args:
        relaxation: what replaces the box of the parameters that are not expanded.
        expanded: parameters that enter affinely and are replaced by the two ends of their intervals first.
        rows: number of rows of all matrices together.
        unknowns: number of unknowns that the relaxation brings along.
        effort: rough number of operations of one step of an interior-point solver.
        reason: the choice in words.
    """

    relaxation: Relaxation
    expanded: tuple[str, ...]
    rows: int
    unknowns: int
    effort: float
    reason: str

    def __str__(self) -> str:
        """The reason and the cost in one sentence."""
        return f"{self.reason} {self.rows} rows, {self.unknowns} further unknowns."


@dataclass(frozen=True)
class Planned:
    """Chooses among the relaxations for each inequality; every choice is sound.

    Parameters that enter affinely are replaced by the two ends of their intervals, which is exact. If none is left, these are
    the vertices. One curved parameter, of whatever degree: the structured multiplier, exact. Two or three, quadratic: the full
    block multiplier, the tightest. Four or more, or where that would be too large: the structured multiplier. Where that is too
    large as well: Bernstein coefficients. Higher degrees of several parameters: Bernstein coefficients on a subdivision.

    Args:
        limit: effort above which a multiplier gives way, see `Plan.effort`; the default is some seconds of solving.
        matrices: largest number of Bernstein coefficients that a subdivision may have.

    Example:
        >>> import numpy as np
        >>> from luenberger.algebra import Polynomial
        >>> curved = Polynomial(("s",), {(0,): np.eye(1), (2,): -2 * np.eye(1)})
        >>> str(Planned().plan(curved, {"s": (-1, 1)}))
        's is curved: structured multiplier, exact for one parameter. 3 rows, 1 further unknowns.'
    """

    limit: float = 3e9
    matrices: int = 500

    def plan(self, matrix: Polynomial, box: Box) -> Plan:
        """Return the choice for a symmetric matrix on a box, with its reason and cost.

        Args:
            matrix: symmetric polynomial with coefficients of any arithmetic.
            box: parameter name -> interval; one of no width counts as a number.
        """
        return self._plan(_moving(matrix, box), box, matrix.shape[0])

    def relaxed(self, matrix: Polynomial, box: Box) -> list[Relaxed]:
        """Return the conditions of the chosen relaxation; see `Relaxation`.

        Args:
            matrix: polynomial of numeric forms.
            box: parameter name -> interval.
        """
        moving = _moving(pruned(matrix), box)
        choice = self._plan(moving, box, side(next(iter(matrix.terms.values()))))
        if isinstance(choice.relaxation, Vertices | Bernstein):
            return choice.relaxation.relaxed(moving, box)
        kept = [n for n in moving.names if n not in choice.expanded]
        found: list[Relaxed] = []
        for piece in _ends(moving, box, choice.expanded):
            found += choice.relaxation.relaxed(piece.over(kept) if piece.names else piece, box)
        return found

    def _plan(self, matrix: Polynomial, box: Box, n: int) -> Plan:
        degree = {name: d for name, d in matrix.degree.items() if d}
        flat = tuple(name for name, d in degree.items() if d == 1)
        curved = {name: d for name, d in degree.items() if d > 1}
        if not curved:
            count = 2 ** len(flat)
            reason = "Affine in each parameter: vertices, exact." if flat else "Constant."
            return Plan(Vertices(), flat, count * n, 0, count * _cone(n), reason)
        names = tuple(curved)
        place = [matrix.names.index(name) for name in names]
        keys = dict.fromkeys(tuple(e[k] for k in place) for e, _ in matrix)
        rest = Polynomial(names, dict.fromkeys(keys, np.zeros((1, 1))))
        p, quadratic = len(names), max(map(sum, keys)) == 2
        plans: list[Plan] = []
        if quadratic and 1 < p <= FEW:
            plans.append(_full(rest, flat, n))
        if quadratic or p == 1:
            plans.append(_structured(rest, flat, n))
        for plan in plans:
            if plan.effort <= self.limit:
                return plan
        return self._coefficients(degree, n, plans)

    def _coefficients(self, degree: Mapping[str, int], n: int, dear: Sequence[Plan]) -> Plan:
        bent = sum(d > 1 for d in degree.values())
        whole = prod(d + 1 for d in degree.values())
        # Where a multiplier was too dear already, a subdivision would be dearer.
        parts = 1 if dear else next((k for k in (4, 3, 2) if k**bent * whole <= self.matrices), 1)
        count = parts**bent * whole
        if dear:
            why = f"A multiplier would need {dear[-1].rows} rows and {dear[-1].unknowns} further unknowns"
        else:
            why = f"Degrees {dict(degree)} in several parameters"
        reason = f"{why}: Bernstein coefficients, {parts} part{'s' * (parts > 1)} along each curved axis."
        return Plan(Bernstein(parts=parts), (), count * n, 0, count * _cone(n), reason)


def _full(rest: Polynomial, flat: tuple[str, ...], n: int) -> Plan:
    p, copies = len(rest.names), 2 ** len(flat)
    unknowns = (p + 1) * n * ((p + 1) * n + 1) // 2
    sizes = [(p + 1) * n, *[n] * (2**p + p)]
    reason = f"{', '.join(rest.names)} are curved: full block multiplier, quadratic in {p} parameters.{_first(flat)}"
    effort = copies * (sum(map(_cone, sizes)) + unknowns**3)
    return Plan(FullBlockMultiplier(), flat, copies * sum(sizes), copies * unknowns, effort, reason)


def _structured(rest: Polynomial, flat: tuple[str, ...], n: int) -> Plan:
    p, copies = len(rest.names), 2 ** len(flat)
    basis, inner = lifted_bases(rest)
    sides = [len(m) * n for m in inner]
    unknowns = sum(k * (k + 1) // 2 for k in sides) + gram_freedom(basis, n, skew=True)
    sizes = [len(basis) * n, *sides]
    why = "exact for one parameter" if p == 1 else f"quadratic in {p} parameters, cheaper than a full block"
    verb = "is" if p == 1 else "are"
    reason = f"{', '.join(rest.names)} {verb} curved: structured multiplier, {why}.{_first(flat)}"
    effort = copies * (sum(map(_cone, sizes)) + unknowns**3)
    return Plan(StructuredMultiplier(), flat, copies * sum(sizes), copies * unknowns, effort, reason)


def _first(flat: tuple[str, ...]) -> str:
    return f" {', '.join(flat)} by the ends of their intervals first." if flat else ""


def _cone(n: int) -> float:
    """Operations that a solver spends on factoring the dense block of one semidefinite cone, up to a constant."""
    return (n * (n + 1) / 2) ** 3


def _moving(matrix: Polynomial, box: Box) -> Polynomial:
    """The polynomial with parameters of no width replaced by their number."""
    fixed = {n: box[n][0] for n, d in matrix.degree.items() if d and n in box and box[n][0] == box[n][1]}
    return matrix.substitute(fixed) if fixed else matrix


def _ends(matrix: Polynomial, box: Box, names: tuple[str, ...]) -> list[Polynomial]:
    found = [matrix]
    for name in names:
        found = [piece.substitute({name: end}) for piece in found for end in box[name]]
    return found
