"""H2 and L2 inequalities of an error that the decision variables enter affinely, in a scaled form with a free size.

For e' = Ae e + Be w, z = W e and a storage P = Ps / size the two statements |z| <= level |w| are, with reach = size level^2,

    L2:  [he(Ps Ae) + size W'W, Ps Be; *, -reach I] < 0
    H2:  [he(Ps Ae), Ps Be; *, -size I] < 0,  [Ps, size W'; size W, Z] > 0,  trace Z < reach.

With size = 1 the level is minimised; with the level fixed the size is free, Ps >= I fixes the scale, and the gain norm can be
minimised by the same block as everywhere else.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import cvxpy as cp
import numpy as np

from luenberger.algebra import Polynomial, symmetric
from luenberger.certify import Claim
from luenberger.core import NotAccepted
from luenberger.lmi import Bernstein, Block, Problem, Relaxation, centre, rounded_storage, solve
from luenberger.systems import System
from luenberger.systems.error_system import ErrorSystem, Form
from luenberger.systems.jacobian_box import error_box
from luenberger.systems.matrix import PlantMatrix

Norm = Literal["h2", "l2"]


@dataclass(frozen=True)
class Affine:
    """Error matrices as functions of the gain: Ae = A - L CA and Be = B - L CB, L taken at the measured scheduling.

    Args:
        A: (nx, nx).
        B: (nx, nw).
        CA: (ny, nx).
        CB: (ny, nw).
        box: free parameter -> interval.
    """

    A: Polynomial
    B: Polynomial
    CA: Polynomial
    CB: Polynomial
    box: Mapping[str, tuple[float, float]]

    @staticmethod
    def of(system: System, inputs: str, form: Form) -> "Affine":
        """Read the slopes off error systems with unit gains, so that no formula is written twice.

        Args:
            system: plant.
            inputs: channels of w joined by "+".
            form: which signal a scheduling error multiplies.
        """
        nx, ny = system.nx, system.ny
        open_loop = ErrorSystem.of(system, Polynomial.constant(np.zeros((nx, ny))), form=form)
        A, B = open_loop.A, open_loop.joined(inputs)
        CA, CB = Polynomial.constant(np.zeros((ny, nx))), Polynomial.constant(np.zeros((ny, B.shape[1])))
        for j in range(ny):
            unit = np.zeros((nx, ny))
            unit[0, j] = 1.0
            pick = unit.T
            error = ErrorSystem.of(system, Polynomial.constant(unit), form=form)
            CA = CA + pick @ (A - error.A)
            CB = CB + pick @ (B - error.joined(inputs))
        return Affine(A, B, CA, CB, open_loop.box)

    def seen_from(self, T: np.ndarray) -> "Affine":
        """Return the matrices of z, e = T z, whose gain is T^-1 L.

        Args:
            T: coordinates, (nx, nx).
        """
        back = np.linalg.inv(T)
        return Affine(back @ self.A @ T, back @ self.B, self.CA @ T, self.CB, self.box)

    def shrunk(self, factor: float) -> np.ndarray:
        """Return symmetric coordinates T in which what the outputs show is measured in units of 1 / factor.

        A large gain makes that part of the error fast and small; without a unit of its own it drowns the rest.

        Args:
            factor: positive number.
        """
        rows = np.vstack([np.asarray(c) for _, c in self.CA])
        left, sizes, _ = np.linalg.svd(rows.T)
        seen = left[:, : int(np.sum(sizes > 1e-9 * sizes[0]))]
        if seen.shape[1] == rows.shape[1]:
            return np.eye(rows.shape[1])
        return np.eye(rows.shape[1]) - (1 - 1 / factor) * (seen @ seen.T)


def at_measured(system: System, matrix: PlantMatrix) -> Polynomial:
    """Return a polynomial of the scheduling with the measured scheduling put in.

    Args:
        system: plant.
        matrix: polynomial over scheduling names, with coefficients of any arithmetic.

    Raises:
        NotAccepted: a function on the domain.
    """
    if not isinstance(matrix, Polynomial):
        raise NotAccepted(f"A matrix of `{system.name}` is a function on the domain; this needs polynomials.")
    error = system.measured_scheduling
    return matrix if error is None else matrix.compose(error.measured)


def norm_blocks(
    norm: Norm,
    P: cp.Variable,
    PA: Polynomial,
    PB: Polynomial,
    weight: np.ndarray,
    size: Any,
    reach: Any,
    box: Mapping[str, tuple[float, float]],
    relaxation: Relaxation,
) -> tuple[list[Block], dict[str, cp.Variable]]:
    """Return the blocks of the module's formula and the variable Z where there is one.

    Args:
        norm: which norm.
        P: scaled storage Ps.
        PA: Ps Ae.
        PB: Ps Be.
        weight: W, shape (nz, nx).
        size: scalar.
        reach: scalar, size times squared level.
        box: free parameter -> interval.
        relaxation: how the box is replaced by finitely many inequalities.
    """
    nz, nw = weight.shape[0], PB.shape[1]
    constant = Polynomial.constant
    if norm == "l2":
        corner = PA + PA.T + constant(size * (weight.T @ weight))
        matrix = symmetric([[corner, PB], [constant(-reach * np.eye(nw))]])
        return [Block("l2_gain", matrix, box, relaxation=relaxation)], {}
    Z = cp.Variable((nz, nz), symmetric=True, name="Z")
    wide = symmetric([[constant(P), constant(size * weight.T)], [constant(Z)]])
    matrix = symmetric([[PA + PA.T, PB], [constant(-size * np.eye(nw))]])
    blocks = [
        Block("h2_gain", matrix, box, relaxation=relaxation),
        Block("trace", -wide),
        Block("level", constant(trace_of(Z) - reach * np.eye(1))),
    ]
    return blocks, {"Z": Z}


def trace_of(Z: cp.Variable) -> Any:
    """Return the trace as a 1 x 1 expression made of products, which are read without asking for gradients.

    Args:
        Z: square matrix.
    """
    unit = np.eye(Z.shape[0])
    return sum((unit[[k]] @ Z @ unit[:, [k]] for k in range(1, Z.shape[0])), start=unit[[0]] @ Z @ unit[:, [0]])


def norm_claim(
    norm: Norm, values: Mapping[str, np.ndarray], size: float, level: float, weight: np.ndarray, inputs: str, form: Form
) -> Claim:
    """Return the claim with its witnesses undone from the scaled form.

    Args:
        norm: which norm.
        values: solved "P" and, for H2, "Z".
        size: solved size.
        level: the level.
        weight: W.
        inputs: channels of w.
        form: which signal a scheduling error multiplies.
    """
    if norm == "l2":
        return Claim("l2_gain", level, rounded_storage(values["P"] / size), None, weight, inputs, form)
    # The claim states B B' against the level and bounds trace Z by it: both sides of (3.41) scaled by the level.
    P, Z = rounded_storage(values["P"] * (level / size)), rounded_storage(values["Z"] / (size * level))
    return Claim("h2_gain", level, P, None, weight, inputs, form, Z)


@dataclass(frozen=True)
class GivenGain:
    """A gain that is fixed, with what its level is asked for.

    Args:
        system: plant.
        gain: L(r).
        norm: which norm.
        inputs: channels of w.
        form: which signal a scheduling error multiplies.
        model: what the observer copies; None for the plant itself.
        weight: W, shape (nz, nx), None for the identity.
        coordinates: T of e = T z, in which the problem is posed; a large gain needs them for its numbers to fit.
    """

    system: System
    gain: Polynomial
    norm: Norm
    inputs: str = "scheduling"
    form: Form = "plant"
    model: System | None = None
    weight: np.ndarray | None = None
    coordinates: np.ndarray | None = None

    def level(self) -> float | None:
        """Return the smallest level with a constant storage, or None."""
        found = solve(self._posed())
        return None if found is None or found.objective <= 0 else float(np.sqrt(found.objective))

    def claim(self, back_off: float = 0.02) -> Claim | None:
        """Return a claim with witnesses that leave room for a proof, or None.

        Args:
            back_off: part of the squared level that is given away.
        """
        found = centre(self._posed(), back_off=back_off)
        if found is None:
            return None
        back = np.linalg.inv(self._transform())
        values = {**found.values, "P": back.T @ found.values["P"] @ back}
        # The centre lies strictly inside, so that the level itself may be rounded up by its last digits.
        level = float(np.sqrt(found.values["reach"])) * (1 + 1e-9)
        return norm_claim(self.norm, values, 1.0, level, self._weight(), self.inputs, self.form)

    def _transform(self) -> np.ndarray:
        return np.eye(self.system.nx) if self.coordinates is None else self.coordinates

    def _weight(self) -> np.ndarray:
        return np.eye(self.system.nx) if self.weight is None else self.weight

    def _posed(self) -> Problem:
        T, nx = self._transform(), self.system.nx
        back = np.linalg.inv(T)
        error = ErrorSystem.of(self.system, self.gain, model=self.model, form=self.form)
        P, reach = cp.Variable((nx, nx), symmetric=True, name="P"), cp.Variable(name="reach")
        PA = Polynomial.constant(P) @ (back @ error.A @ T)
        PB = Polynomial.constant(P) @ (back @ error.joined(self.inputs))
        box = error_box(self.system)
        blocks, more = norm_blocks(self.norm, P, PA, PB, self._weight() @ T, 1.0, reach, box, Bernstein())
        blocks.append(Block("storage", Polynomial.constant(-P)))
        return Problem({"P": P, "reach": reach, **more}, blocks, reach)
