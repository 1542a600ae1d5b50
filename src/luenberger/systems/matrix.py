"""The three forms a plant matrix may take: constant, polynomial in named parameters, function on the domain."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from luenberger.algebra import Polynomial
from luenberger.core import BadInput, NotAccepted
from luenberger.core.checks import finite_array


class MatrixFunction(eqx.Module):
    """A matrix given as a JAX function on the parameter domain, for dependence that is not polynomial.

    Args:
        function: takes a mapping name -> scalar, returns an array of shape `shape`.
        names: the parameters it reads.
        shape: (rows, columns).
    """

    function: Callable[[Mapping[str, Any]], Any] = eqx.field(static=True)
    names: tuple[str, ...] = eqx.field(static=True)
    shape: tuple[int, int] = eqx.field(static=True)

    def __call__(self, values: Mapping[str, Any]) -> Any:
        """Return the matrix at a point."""
        return jnp.asarray(self.function({n: values[n] for n in self.names}))


PlantMatrix = Polynomial | MatrixFunction


def plant_matrix(name: str, value: Any, rows: int, columns: int, known: Sequence[str], because: str) -> PlantMatrix:
    """Check one matrix of a plant and lift constants to polynomials.

    Args:
        name: what the matrix is called in messages.
        value: nested numbers, `Polynomial` or `MatrixFunction`; None is the zero matrix.
        rows: wanted number of rows.
        columns: wanted number of columns.
        known: names of the parameters of the plant.
        because: where the wanted shape comes from.

    Raises:
        BadInput: wrong shape, a coefficient that is not finite, a function that returns another shape than it declares, or an
            unknown parameter.
    """
    if value is None:
        value = np.zeros((rows, columns))
    if not isinstance(value, Polynomial | MatrixFunction):
        value = Polynomial.constant(finite_array(name, value))
    elif isinstance(value, Polynomial):
        value = value.map(lambda c: finite_array(name, c))
    elif (made := jax.eval_shape(value, dict.fromkeys(value.names, 0.0)).shape) != tuple(value.shape):
        raise BadInput(f"The function of `{name}` returns shape {made} but declares {value.shape}; both need to agree.")
    if tuple(value.shape) != (rows, columns):
        raise BadInput(
            f"`{name}` has shape {tuple(value.shape)} but {because}; `{name}` needs shape ({rows}, {columns})."
        )
    if unknown := [n for n in value.names if n not in known]:
        raise BadInput(
            f"`{name}` depends on {unknown}, which the plant does not declare; add a `Parameter` with its interval."
        )
    return value


def polynomial(name: str, value: PlantMatrix) -> Polynomial:
    """Return a plant matrix as a polynomial, refusing function form by name.

    Args:
        value: the matrix.

    Raises:
        NotAccepted: the matrix is a function on the domain.
    """
    if isinstance(value, Polynomial):
        return value
    raise NotAccepted(
        f"`{name}` is given as a function of {value.names}; this method needs polynomial matrices. Use a grid method."
    )
