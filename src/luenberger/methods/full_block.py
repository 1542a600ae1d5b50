"""Extended Luenberger observer by a full-block multiplier: the vertices of the Jacobian set constrain the multiplier alone."""

from dataclasses import dataclass
from itertools import product
from typing import ClassVar

import cvxpy as cp
import numpy as np

from luenberger.algebra import Polynomial, symmetric
from luenberger.core import NotAccepted
from luenberger.lmi import Block
from luenberger.methods.dissipative_design import DissipativeDesign, Variables
from luenberger.methods.supply import Supply, entering, open_loop
from luenberger.systems import System
from luenberger.systems.jacobian_box import as_floats, error_box, jacobian


@dataclass(frozen=True)
class FullBlockLuenberger(DissipativeDesign):
    """Observer of a nonlinear plant whose Jacobian set enters through a multiplier instead of through its vertices.

    Choose it where scheduling and Jacobian both have many vertices: the large inequality is stated at the vertices of the
    scheduling alone, and small ones, of the size of z, at those of the Jacobian set. It finds what `ExtendedLuenberger` finds;
    with few vertices that one is quicker.

    Assumes: e' = (A - L C) e + F w + E d - L (G - D N) v - B N v, w = J H e, J in the Jacobian box or hull; with
        [I; J]' M(r) [I; J] <= 0 at the vertices of J, and on their hull, since M22 > 0 follows from the first of
        [he(P A - Y C) + S, P F, P Be; *, 0, 0; *, *, -reach I] - [H 0 0; 0 I 0]' M(r) [H 0 0; 0 I 0] < 0.
        Written about the middle Jc of the box, A + F Jc H and J - Jc in the places of A and J.
    Certifies: e' P e falls at least like exp(-2 decay_rate t); |L(r)| <= the reported bound; for goal "l2"
        |W e|_2 <= level |w|_2 from zero initial error. The proof is by the vertices; M is not stored.

    Args:
        decay_rate: wanted decay of the error norm [1/s], >= 0.
        goal: "gain" looks for the smallest gain norm; "l2" for the smallest L2 gain from `inputs` to `weight` e and, within
            one percent of it (ten where numbers give out), for the smallest gain norm.
        inputs: "disturbance", "noise" or "both", for goal "l2".
        weight: W, rows over the states; left out: the identity.
        gain_limit: bound of |L| that is kept; left out: none.
        schedule: "plant" gives L(r) the monomials of A and C, "constant" one gain for the whole box.

    Reference: Y. Wang, dissertation 2014, Lemma 17 with (5.19), M a decision variable in the place of the fixed matrix (5.12),
        which is no valid multiplier where a row of the Jacobian varies in two entries; C. W. Scherer, LPV control and full
        block multipliers, Automatica 37, 2001, for the full-block multiplier.

    Example:
        >>> import jax.numpy as jnp
        >>> import luenberger as lb
        >>> from luenberger.methods.full_block import FullBlockLuenberger
        >>> from luenberger.synthesize import synthesize
        >>> f = lb.Nonlinearity.bounded(lambda z, u: jnp.sin(z), [[1, 0]], jacobian=([[-1]], [[1]]))
        >>> plant = lb.System.nonlinear([[0, 1], [0, -1]], C=[[1, 0]], F=[[0], [1]], nonlinearity=f)
        >>> synthesize(plant, FullBlockLuenberger(decay_rate=1.0)).certificate.outcome.value
        'proved'
    """

    references: ClassVar[tuple[str, ...]] = (
        "C. W. Scherer, LPV control and full block multipliers, Automatica 37, 2001",
        "Y. Wang, dissertation, Auburn University, 2014, Lemma 17, eq. (5.19)",
    )

    def accept(self, system: System) -> None:
        """Refuse plants and options outside the theorem; see `Method`."""
        if system.nonlinearity is None:
            raise NotAccepted(
                f"`{system.name}` has no nonlinearity for a multiplier to speak of; use `ExtendedLuenberger`."
            )
        super().accept(system)

    def dissipates(self, system: System, P: Polynomial, Y: Polynomial, supply: Supply) -> tuple[list[Block], Variables]:
        """Return the inequality of the class with a multiplier of its own, and the conditions on that multiplier.

        Args:
            system: accepted plant.
            P: storage variable.
            Y: P L.
            supply: S, inputs and reach.
        """
        assert system.nonlinearity is not None
        vertices = jacobian_matrices(system)
        middle = 0.5 * (np.max(vertices, axis=0) + np.min(vertices, axis=0))
        # In these units of w every row of J - Jc has entries up to one.
        unit = np.max([np.abs(J - middle).max(axis=1) for J in vertices], axis=0)
        unit = np.where(unit > 0, unit, 1.0)
        F, H = as_floats(system.F) @ np.diag(unit), np.asarray(system.nonlinearity.H)
        (nf, nz), box = middle.shape, system.scheduling_box
        M, variables = _multiplier(system, nz + nf, f"M_{supply.name}")
        drift = P @ (as_floats(system.A) + as_floats(system.F) @ middle @ H) - Y @ as_floats(system.C)
        rows = [
            [drift + drift.T + Polynomial.constant(supply.square), P @ F],
            [Polynomial.constant(np.zeros((nf, nf)))],
        ]
        if supply.inputs:
            B = entering(system, open_loop(system), P, Y, supply)
            rows[0].append(B)
            rows[1].append(Polynomial.constant(np.zeros((nf, B.shape[1]))))
            rows.append([Polynomial.constant(-supply.reach * np.eye(B.shape[1]))])
        whole = symmetric(rows)
        pick = np.zeros((nz + nf, whole.shape[0]))
        pick[:nz, : system.nx], pick[nz:, system.nx : system.nx + nf] = H, np.eye(nf)
        blocks = [Block(supply.name, whole - pick.T @ M @ pick, box)]
        for J in vertices:
            graph = np.vstack([np.eye(nz), (J - middle) / unit[:, None]])
            blocks.append(Block("multiplier", graph.T @ M @ graph, box))
        return blocks, variables


def jacobian_matrices(system: System) -> list[np.ndarray]:
    """Return the vertices of the Jacobian set, each of shape (nf, nz).

    Args:
        system: plant with a Jacobian box or hull.
    """
    f = system.nonlinearity
    if f is not None and f.jacobian_vertices is not None:
        return list(f.jacobian_vertices)
    slope, box = jacobian(system), error_box(system)
    ends = product(*(box[n] for n in slope.names))
    return [np.asarray(slope(dict(zip(slope.names, point, strict=True)))) for point in ends]


def _multiplier(system: System, size: int, name: str) -> tuple[Polynomial, Variables]:
    """M(r) with every product of scheduling parameters up to their degree in A, C, F, so that it costs nothing over vertices."""
    names = system.scheduling_names
    shown = [as_floats(m).degree for m in (system.A, system.C, system.F)]
    degrees = [max([d.get(n, 0) for d in shown]) for n in names]
    terms = {
        e: cp.Variable((size, size), symmetric=True, name=f"{name}{''.join(map(str, e))}")
        for e in product(*(range(d + 1) for d in degrees))
    }
    return Polynomial(names, terms), {v.name(): v for v in terms.values()}
