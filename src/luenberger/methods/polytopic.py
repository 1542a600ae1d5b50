"""LPV Luenberger observer by vertex (Bernstein) inequalities with one storage matrix, a decay rate and the smallest gain."""

from dataclasses import dataclass, field, replace
from typing import ClassVar, Literal

import cvxpy as cp
import numpy as np

from luenberger.algebra import Polynomial
from luenberger.certify import Claim
from luenberger.lmi import Bernstein, Block, Problem, Relaxation, rounded_storage
from luenberger.methods.method import (
    Candidate,
    gain_blocks,
    gain_bound,
    require_continuous,
    require_polynomial,
    scheduled_variable,
    smallest_gain,
    statistics,
)
from luenberger.systems import System
from luenberger.systems.jacobian_box import as_floats, error_box, jacobian
from luenberger.systems.observability import require_detectable


@dataclass(frozen=True)
class PolytopicLuenberger:
    """LPV Luenberger design with a guaranteed decay and the smallest gain norm.

    Choose it when the plant is linear in the state with measured scheduling, or has a Jacobian box; not when the
    scheduling is measured with error (use a robust design).

    Assumes: e' = (A(r) - L(r) C(r) + F(r) J H) e with r in its box, arbitrarily fast, J in the Jacobian box.
    Certifies: e' P e falls at least like exp(-2 decay_rate t), and |L(r)| <= the reported bound.

    Args:
        decay_rate: wanted decay of the error norm [1/s], >= 0.
        schedule: "plant" gives L(r) the monomials of A and C, "constant" one gain for the whole box.
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
    relaxation: Relaxation = field(default_factory=Bernstein)

    references: ClassVar[tuple[str, ...]] = (
        "Y. Wang, dissertation, University of California, Berkeley, 2014, eq. (3.27)",
        "S. Boyd, L. El Ghaoui, E. Feron, V. Balakrishnan, Linear Matrix Inequalities in System and Control Theory, SIAM 1994",
    )

    def accept(self, system: System) -> None:
        """Refuse function matrices, hidden parameters, undetectable pairs and negative decay; see `Method`."""
        require_continuous(system)
        require_polynomial(system)
        require_detectable(system, self.decay_rate)

    def design(self, system: System) -> Candidate:
        """Minimise the gain bound; see `Method`."""
        problem, Y = self._posed(system)
        found = smallest_gain(problem, lambda rate: replace(self, decay_rate=rate)._posed(system)[0], self.decay_rate)
        storage = rounded_storage(found.values["P"])
        gain = Y.map(lambda y: np.linalg.solve(found.values["P"], np.asarray(y.value)))

        def claims(rounded: Polynomial) -> list[Claim]:
            return [Claim("decay", self.decay_rate, storage), gain_bound(rounded, system.scheduling_box)]

        return Candidate(gain, claims, statistics(found))

    def _posed(self, system: System) -> tuple[Problem, Polynomial]:
        A, C = as_floats(system.A), as_floats(system.C)
        box = error_box(system)
        P = cp.Variable((system.nx, system.nx), symmetric=True, name="P")
        like = [] if self.schedule == "constant" else [A, C]
        Y, variables = scheduled_variable(system.nx, system.ny, like, system.scheduling_names, "Y")
        if system.nonlinearity is not None:
            A = A + as_floats(system.F) @ jacobian(system) @ system.nonlinearity.H
        squared = cp.Variable(name="squared")
        drift = Polynomial.constant(P) @ A - Y @ C
        decay = drift + drift.T + Polynomial.constant(2 * self.decay_rate * P)
        blocks = [Block("decay", decay, box, relaxation=self.relaxation), *gain_blocks(P, Y, squared, box)]
        return Problem({"P": P, "squared": squared, **variables}, blocks, squared), Y
