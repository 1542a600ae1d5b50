"""LPV Luenberger observer by vertex (Bernstein) inequalities with one storage matrix, a decay rate and the smallest gain."""

from dataclasses import dataclass, field, replace
from typing import ClassVar, Literal

import cvxpy as cp
import numpy as np

from luenberger.algebra import Polynomial
from luenberger.certify import Claim
from luenberger.lmi import Bernstein, Block, Problem, Relaxation, infeasible, nearest_level, rounded_storage
from luenberger.lmi.storage import storage_value
from luenberger.methods.method import (
    NEGLIGIBLE,
    Candidate,
    gain_blocks,
    gain_bound,
    require_continuous,
    require_polynomial,
    scheduled_variable,
    smallest_gain,
    statistics,
)
from luenberger.methods.scheduled_storage import EPSILONS, Posed, posed, require_rates, smallest_moving
from luenberger.systems import System
from luenberger.systems.jacobian_box import as_floats, error_box, jacobian, jacobian_corners
from luenberger.systems.observability import require_detectable


@dataclass(frozen=True)
class PolytopicLuenberger:
    """LPV Luenberger design with a guaranteed decay and the smallest gain norm.

    Choose it when the plant is linear in the state with measured scheduling, or has a Jacobian box; not when the
    scheduling is measured with error (use a robust design).

    Assumes: e' = (A(r) - L(r) C(r) + F(r) J H) e with r in its box, arbitrarily fast, J in the Jacobian box.
    Certifies: e' P e falls at least like exp(-2 decay_rate t), and |L(r)| <= the reported bound; with storage "scheduled"
    P depends on r, and the claim rests on the rates of the scheduling.

    Args:
        decay_rate: wanted decay of the error norm [1/s], >= 0.
        schedule: "plant" gives L(r) the monomials of A and C, "constant" one gain for the whole box.
        storage: "constant" holds for arbitrarily fast scheduling; "scheduled" gives P the monomials of A whose rates are
            bounded (`Parameter.rate`, `rate_law`), and reaches decay rates that no constant P can show.
        relaxation: how polynomial inequalities become matrix inequalities; exact for multi-affine plants.

    Reference: Y. Wang, dissertation 2014, inequality (3.27), which alone is met by L = 0 on this plant and selects
    nothing; decay rate, P >= I and the gain bound [[P, Y], [Y', t I]] >= 0 are added here.

    Example:
        >>> import luenberger as lb
        >>> from luenberger.methods import PolytopicLuenberger
        >>> from luenberger.synthesize import synthesize
        >>> plant = lb.System.linear([[0, 1], [-1, -0.4]], C=[[1, 0]])
        >>> synthesize(plant, PolytopicLuenberger(decay_rate=1.0)).certificate.outcome.value
        'proved'
    """

    decay_rate: float = 0.0
    schedule: Literal["plant", "constant"] = "plant"
    storage: Literal["constant", "scheduled"] = "constant"
    relaxation: Relaxation = field(default_factory=Bernstein)

    references: ClassVar[tuple[str, ...]] = (
        "Y. Wang, dissertation, Auburn University, 2014, eq. (3.27)",
        "S. Boyd, L. El Ghaoui, E. Feron, V. Balakrishnan, Linear Matrix Inequalities in System and Control Theory, SIAM 1994",
    )

    def accept(self, system: System) -> None:
        """Refuse function matrices, hidden parameters, undetectable pairs and negative decay; see `Method`."""
        require_continuous(system)
        require_polynomial(system)
        require_detectable(system, self.decay_rate)
        if self.storage == "scheduled":
            require_rates(system)

    def design(self, system: System) -> Candidate:
        """Minimise the gain bound; see `Method`."""
        if self.storage == "scheduled":
            return self._moving(system)
        problem, Y = self._posed(system)
        found = smallest_gain(problem, lambda rate: replace(self, decay_rate=rate)._posed(system)[0], self.decay_rate)
        storage = rounded_storage(found.values["P"])
        gain = Y.map(lambda y: np.linalg.solve(found.values["P"], np.asarray(y.value)))

        def claims(rounded: Polynomial) -> list[Claim]:
            return [Claim("decay", self.decay_rate, storage), gain_bound(system, rounded)]

        return Candidate(gain, claims, statistics(found))

    def _moving(self, system: System) -> Candidate:
        like = [] if self.schedule == "constant" else [as_floats(system.A), as_floats(system.C)]

        def pose(rate: float, epsilon: float) -> Posed:
            return posed(system, rate, like, self.relaxation, epsilon)

        found = smallest_moving(lambda epsilon: pose(self.decay_rate, epsilon))
        if found is None:
            easy = smallest_moving(lambda epsilon: pose(0.0, epsilon))
            epsilon = EPSILONS[0] if easy is None else easy[0].epsilon
            nearest = nearest_level(lambda rate: pose(rate, epsilon).problem, 0.0, self.decay_rate, floor=NEGLIGIBLE)
            raise infeasible(pose(self.decay_rate, epsilon).problem, "decay_rate", self.decay_rate, "1/s", nearest)
        problem, solution = found
        storage = storage_value(problem.storage)

        def claims(rounded: Polynomial) -> list[Claim]:
            return [Claim("decay", self.decay_rate, storage), gain_bound(system, rounded)]

        return Candidate(problem.gain(), claims, statistics(solution))

    def _posed(self, system: System) -> tuple[Problem, Polynomial]:
        A, C = as_floats(system.A), as_floats(system.C)
        P = cp.Variable((system.nx, system.nx), symmetric=True, name="P")
        like = [] if self.schedule == "constant" else [A, C]
        Y, variables = scheduled_variable(system.nx, system.ny, like, system.scheduling_names, "Y")
        squared = cp.Variable(name="squared")
        blocks: list[Block] = []
        for corner in jacobian_corners(system):
            loop = A
            if corner.nonlinearity is not None:
                loop = A + as_floats(system.F) @ jacobian(corner) @ corner.nonlinearity.H
            drift = Polynomial.constant(P) @ loop - Y @ C
            decay = drift + drift.T + Polynomial.constant(2 * self.decay_rate * P)
            blocks.append(Block("decay", decay, error_box(corner), relaxation=self.relaxation))
        blocks += gain_blocks(P, Y, squared, system.scheduling_box)
        return Problem({"P": P, "squared": squared, **variables}, blocks, squared), Y
