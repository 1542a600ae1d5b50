"""The default Lipschitz design: the nonlinearity enters through its channel, the gain is free and as small as possible."""

from dataclasses import dataclass, replace
from typing import ClassVar

import cvxpy as cp
import numpy as np

from luenberger.algebra import Polynomial, symmetric
from luenberger.certify import Claim
from luenberger.core import NotAccepted
from luenberger.lmi import Block, Problem, l2_storage, rounded_storage
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
from luenberger.systems.jacobian_box import as_floats
from luenberger.systems.observability import require_detectable


@dataclass(frozen=True)
class StructuredLipschitz:
    """Lipschitz observer that uses where the nonlinearity acts (F) and what it depends on (H).

    Choose it for any plant with one Lipschitz nonlinearity: no coordinate change is needed and it is far less
    conservative than designs that spread the constant over all states. With several channels of very different size,
    scale them or use a multiplier a channel.

    Assumes: e' = (A - L C) e + F phi, |phi| <= g |H e|, g the Lipschitz bound of the plant; A, C, F may be scheduled.
    Certifies: e' P e falls at least like exp(-2 decay_rate t); |L(r)| <= the reported bound; where the plant has an unknown
    input d, also an L2 gain from d to e.

    Args:
        decay_rate: wanted decay of the error norm [1/s], >= 0.

    Reference: bounded-channel form of B. Song, J. K. Hedrick, ACC 2011, Theorem 3, with free Y = P L in place of
    L = P^-1 C' / (2 eps), the multiplier on the channel, and the gain bound P >= I, [[P, Y], [Y', t I]] >= 0.

    Example:
        >>> import jax.numpy as jnp
        >>> import luenberger as lb
        >>> from luenberger.methods import StructuredLipschitz
        >>> from luenberger.synthesize import synthesize
        >>> sine = lb.Nonlinearity.bounded(lambda z, u: -jnp.sin(z), [[1, 0]], lipschitz=1.0)
        >>> pendulum = lb.System.nonlinear([[0, 1], [0, -0.1]], C=[[1, 0]], F=[[0], [1]], nonlinearity=sine)
        >>> synthesize(pendulum, StructuredLipschitz(decay_rate=1.0)).certificate.outcome.value
        'proved'
    """

    decay_rate: float = 0.0

    references: ClassVar[tuple[str, ...]] = (
        "B. Song, J. K. Hedrick, Nonlinear Observer Design for Lipschitz Nonlinear Systems, American Control Conference 2011",
    )

    def accept(self, system: System) -> None:
        """Refuse plants without a nonlinearity, function matrices, undetectable pairs; see `Method`."""
        if system.nonlinearity is None:
            raise NotAccepted(f"`{system.name}` has no nonlinearity; use `PolytopicLuenberger`.")
        require_continuous(system)
        require_polynomial(system)
        require_detectable(system, self.decay_rate)

    def design(self, system: System) -> Candidate:
        """Minimise the gain bound; see `Method`."""
        problem, Y = self._posed(system)
        found = smallest_gain(problem, lambda rate: replace(self, decay_rate=rate)._posed(system)[0], self.decay_rate)
        storage = rounded_storage(found.values["P"])
        gain = Y.map(lambda y: np.linalg.solve(found.values["P"], np.asarray(y.value)))
        multiplier = float(found.values["s"])

        def claims(rounded: Polynomial) -> list[Claim]:
            made = [Claim("decay", self.decay_rate, storage, multiplier), gain_bound(system, rounded)]
            eye = np.eye(system.nx)
            if system.nd and (level := l2_storage(system, rounded, eye, "disturbance")) is not None:
                made.append(Claim("l2_gain", level[0], level[1], level[2], eye, "disturbance"))
            return made

        return Candidate(gain, claims, statistics(found))

    def _posed(self, system: System) -> tuple[Problem, Polynomial]:
        assert system.nonlinearity is not None
        A, C, F = as_floats(system.A), as_floats(system.C), as_floats(system.F)
        H, g = system.nonlinearity.H, system.nonlinearity.lipschitz_bound
        P = cp.Variable((system.nx, system.nx), symmetric=True, name="P")
        s, squared = cp.Variable(nonneg=True, name="s"), cp.Variable(name="squared")
        Y, variables = scheduled_variable(system.nx, system.ny, [A, C], system.scheduling_names, "Y")
        drift = Polynomial.constant(P) @ A - Y @ C
        corner = drift + drift.T + Polynomial.constant(2 * self.decay_rate * P + s * g**2 * (H.T @ H))
        decay = symmetric([[corner, Polynomial.constant(P) @ F], [Polynomial.constant(-s * np.eye(F.shape[1]))]])
        blocks = [Block("decay", decay, system.scheduling_box), *gain_blocks(P, Y, squared, system.scheduling_box)]
        return Problem({"P": P, "s": s, "squared": squared, **variables}, blocks, squared), Y
