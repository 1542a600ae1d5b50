"""Extended Luenberger observer by the vertices of scheduling box and Jacobian set, for the smallest gain or L2 gain."""

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from luenberger.algebra import Polynomial, symmetric
from luenberger.core.checks import matrix
from luenberger.lmi import Bernstein, Block, Relaxation
from luenberger.methods.dissipative_design import DissipativeDesign, Variables
from luenberger.methods.supply import Supply, entering, open_loop
from luenberger.systems import System
from luenberger.systems.jacobian_box import as_floats, error_box, jacobian_corners


@dataclass(frozen=True)
class ExtendedLuenberger(DissipativeDesign):
    """Observer of a nonlinear plant with measured scheduling, designed at the vertices of all it may meet.

    Choose it first for a plant with a Jacobian box or hull: nothing is lost but what one common P loses. Not where the
    Jacobian has so many varying entries that its vertices are too many (use a multiplier), nor where a gain in the argument
    of f has to be found (`argument_gain` is fixed here; `TwoDofLuenberger` finds one).

    Assumes: e' = (A - L C + F J H (I - L2 C)) e + E d - (L + F J H L2)(G - D N) v - B N v, r in its box, J in the Jacobian
        box or in the hull of the given matrices, both arbitrarily fast.
    Certifies: e' P e falls at least like exp(-2 decay_rate t); |L(r)| <= the reported bound; for goal "l2"
        |W e|_2 <= level |w|_2 from zero initial error.

    Args:
        decay_rate: wanted decay of the error norm [1/s], >= 0.
        goal: "gain" looks for the smallest gain norm; "l2" for the smallest L2 gain from `inputs` to `weight` e and, within
            one percent of it (ten where numbers give out), for the smallest gain norm.
        inputs: "disturbance", "noise" or "both", for goal "l2".
        weight: W, rows over the states; left out: the identity.
        gain_limit: bound of |L| that is kept; left out: none.
        schedule: "plant" gives L(r) the monomials of A and C, "constant" one gain for the whole box.
        argument_gain: fixed L2, shape (nx, ny), of xhat + L2 (y - C xhat - D u) in the argument of f; left out: zero.
        relaxation: how polynomial inequalities become matrix inequalities; exact for multi-affine plants.

    Reference: Y. Wang, dissertation 2014, (5.2) and (5.4), with the differential mean value theorem in the place of Lemma 15,
        which holds only where each row of the Jacobian varies in one entry; A. Zemouche, M. Boutayeb, G. I. Bara 2008, for
        the vertices. The limit bounds the gain that is injected, P >= p I and [[P, Y], [Y', limit^2 p I]] >= 0 with p free,
        in the place of (5.33) to (5.36), whose scale is given beforehand.

    Example:
        >>> import jax.numpy as jnp
        >>> import luenberger as lb
        >>> from luenberger.methods.extended_luenberger import ExtendedLuenberger
        >>> from luenberger.synthesize import synthesize
        >>> f = lb.Nonlinearity.bounded(lambda z, u: jnp.sin(z), [[1, 0]], jacobian=([[-1]], [[1]]))
        >>> plant = lb.System.nonlinear([[0, 1], [0, -1]], C=[[1, 0]], F=[[0], [1]], E=[[0], [1]], nonlinearity=f)
        >>> synthesize(plant, ExtendedLuenberger(goal="l2", gain_limit=5.0)).certificate.outcome.value
        'proved'
    """

    argument_gain: tuple[tuple[float, ...], ...] | None = None
    relaxation: Relaxation = field(default_factory=Bernstein)

    references: ClassVar[tuple[str, ...]] = (
        "Y. Wang, dissertation, Auburn University, 2014, eqs. (5.2) and (5.4)",
        "A. Zemouche, M. Boutayeb, G. I. Bara, Observers for a class of Lipschitz systems with extension to H-infinity "
        "performance analysis, Systems and Control Letters 57, 2008",
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.argument_gain is not None:
            object.__setattr__(self, "argument_gain", tuple(tuple(map(float, row)) for row in self.argument_gain))

    def accept(self, system: System) -> None:
        """Refuse plants and options outside the theorem; see `Method`."""
        super().accept(system)
        if self.argument_gain is not None:
            because = f"the system has {system.nx} states and {system.ny} outputs"
            open_loop(
                system,
                Polynomial.constant(matrix("argument_gain", self.argument_gain, system.nx, system.ny, because)),
            )

    def second_gain(self) -> np.ndarray | None:
        """Return the fixed L2, or None."""
        return None if self.argument_gain is None else np.array(self.argument_gain)

    def dissipates(self, system: System, P: Polynomial, Y: Polynomial, supply: Supply) -> tuple[list[Block], Variables]:
        """Return [he(P (A + F J H (I - L2 C)) - Y C) + S, P Be; *, -reach I] < 0 for every corner of the Jacobian set.

        Args:
            system: accepted plant.
            P: storage variable.
            Y: P L.
            supply: S, inputs and reach.
        """
        L2 = self.second_gain()
        blocks: list[Block] = []
        for corner in jacobian_corners(system):
            error = open_loop(corner, None if L2 is None else Polynomial.constant(L2))
            drift = P @ error.A - Y @ as_floats(system.C)
            rows = [[drift + drift.T + Polynomial.constant(supply.square)]]
            if supply.inputs:
                rows[0].append(entering(system, error, P, Y, supply))
                rows.append([Polynomial.constant(-supply.reach * np.eye(rows[0][1].shape[1]))])
            blocks.append(Block(supply.name, symmetric(rows), error_box(corner), relaxation=self.relaxation))
        return blocks, {}
