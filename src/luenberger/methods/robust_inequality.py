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
from luenberger.lmi import Bernstein, Block, Problem, Relaxation, rounded_storage, solve
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
    one, constant = np.eye(1), Polynomial.constant
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
        Block("level", constant((cp.trace(Z) - reach) * one)),
    ]
    return blocks, {"Z": Z}


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


def given_level(
    system: System,
    gain: Polynomial,
    norm: Norm,
    inputs: str,
    form: Form,
    *,
    model: System | None = None,
    weight: np.ndarray | None = None,
    coordinates: np.ndarray | None = None,
    solvers: tuple[str, ...] | None = None,
) -> float | None:
    """Return the smallest level that a gain which is already fixed has with a constant storage, or None.

    Args:
        system: plant.
        gain: L(r).
        norm: which norm.
        inputs: channels of w.
        form: which signal a scheduling error multiplies.
        model: what the observer copies; None for the plant itself.
        weight: W, default the identity.
        coordinates: T of e = T z, in which the problem is posed; a large gain needs them for its numbers to fit.
        solvers: names to try in order.
    """
    nx = system.nx
    T = np.eye(nx) if coordinates is None else coordinates
    error = ErrorSystem.of(system, gain, model=model, form=form)
    P, reach = cp.Variable((nx, nx), symmetric=True, name="P"), cp.Variable(name="reach")
    A, B = np.linalg.inv(T) @ error.A @ T, np.linalg.inv(T) @ error.joined(inputs)
    W = (np.eye(nx) if weight is None else weight) @ T
    blocks, more = norm_blocks(
        norm, P, Polynomial.constant(P) @ A, Polynomial.constant(P) @ B, W, 1.0, reach, error_box(system), Bernstein()
    )
    blocks.append(Block("storage", Polynomial.constant(-P)))
    found = solve(Problem({"P": P, "reach": reach, **more}, blocks, reach), solvers=solvers)
    return None if found is None or found.objective <= 0 else float(np.sqrt(found.objective))
