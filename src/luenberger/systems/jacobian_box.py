"""The parameters an error system ranges over: scheduling, its error, the varying entries of a Jacobian; corners of a hull."""

from collections.abc import Callable

import numpy as np

from luenberger.algebra import Polynomial
from luenberger.core import NotAccepted
from luenberger.systems.matrix import PlantMatrix, polynomial
from luenberger.systems.system import System


def as_floats(value: PlantMatrix) -> Polynomial:
    """The lift of design code: polynomial form with float coefficients.

    Args:
        value: a matrix of the plant.
    """
    return polynomial("a plant matrix", value)


def error_box(system: System) -> dict[str, tuple[float, float]]:
    """Return name -> interval of the free parameters of the scheduling and every varying Jacobian entry of a plant.

    Args:
        system: plant.
    """
    error = system.measured_scheduling
    scheduling = dict(system.scheduling_box) if error is None else error.box
    f = system.nonlinearity
    if f is None or f.jacobian_lower is None or f.jacobian_upper is None:
        return scheduling
    lower, upper = f.jacobian_lower, f.jacobian_upper
    return scheduling | {_entry(i, j): (float(lower[i, j]), float(upper[i, j])) for i, j in _varying(lower, upper)}


def jacobian(system: System, lift: Callable[[PlantMatrix], Polynomial] = as_floats) -> Polynomial:
    """Return df/dz as a matrix polynomial in which every varying entry is a parameter of `error_box`.

    Args:
        system: plant whose nonlinearity has a Jacobian box.
        lift: arithmetic of the result.

    Raises:
        NotAccepted: no Jacobian box.
    """
    f = system.nonlinearity
    if f is None or f.jacobian_lower is None or f.jacobian_upper is None:
        raise NotAccepted(
            f"`{system.name}` has no Jacobian box; give `jacobian=(lower, upper)` to its nonlinearity or let `Nonlinearity.enclosed` prove one."
        )
    lower, upper = f.jacobian_lower, f.jacobian_upper
    slopes = {}
    for i, j in _varying(lower, upper):
        slopes[_entry(i, j)] = np.zeros(lower.shape)
        slopes[_entry(i, j)][i, j] = 1.0
    return lift(Polynomial.affine(np.where(lower == upper, lower, 0.0), **slopes))


def jacobian_corners(system: System) -> tuple[System, ...]:
    """Return one plant for each vertex of the Jacobian hull, its Jacobian fixed there; the plant itself where no hull is given.

    For a given storage matrix every inequality about the error is affine in the Jacobian, so it holds on the whole hull
    exactly where it holds at all of these.

    Args:
        system: plant.
    """
    f = system.nonlinearity
    if f is None or f.jacobian_vertices is None:
        return (system,)
    return tuple(system.replace(nonlinearity=f.at_jacobian(J)) for J in f.jacobian_vertices)


def _entry(i: int, j: int) -> str:
    return f"df{i + 1}_dz{j + 1}"


def _varying(lower: np.ndarray, upper: np.ndarray) -> list[tuple[int, int]]:
    return [(int(i), int(j)) for i, j in np.argwhere(lower < upper)]
