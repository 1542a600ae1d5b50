"""Which entries of a Jacobian vary, and with what: read off the operations of first and second derivatives."""

# pyright: reportUnknownMemberType=false, reportUnknownArgumentType=false
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import jax
import numpy as np

from luenberger.algebra.arithmetic import BallArithmetic
from luenberger.algebra.ball import Ball
from luenberger.algebra.graph import Operation
from luenberger.algebra.jaxpr import Trace, trace
from luenberger.systems.embedding_split import ancestors

# Their derivative is zero wherever it exists, so a second derivative of zero says nothing.
_STEPS = frozenset(("select", "sign", "floor", "ceil", "rem"))


@dataclass(frozen=True, eq=False)
class JacobianStructure:
    """What df/dz of a function f(z, u) depends on, proved from its operations.

    Args:
        depends: for every entry (k, j) the numbers of the arguments that it depends on, z first, then u.
        values: the value of every entry that depends on nothing and is a double, NaN elsewhere, shape (nf, nz).
        reads: numbers of the arguments that f itself depends on.
    """

    depends: tuple[tuple[frozenset[int], ...], ...]
    values: np.ndarray
    reads: frozenset[int]

    @staticmethod
    def of(function: Callable[[Any, Any], jax.Array], z: np.ndarray, u: np.ndarray) -> "JacobianStructure":
        """Read the derivatives of a function.

        Args:
            function: JAX function of (z, u) to one vector.
            z: an argument at which entries that do not vary are evaluated, (nz,).
            u: inputs there, (nu,).
        """
        nz = len(z)

        def whole(w: Any) -> jax.Array:
            return function(w[:nz], w[nz:])

        def slope(w: Any) -> jax.Array:
            return jax.jacfwd(whole)(w)[:, :nz]

        point = np.concatenate([z, u])
        first, second = trace(slope, point), trace(jax.jacfwd(slope), point)
        places, bends = first.outputs[0], second.outputs[0]
        reads, stepping = ancestors(first.operations), _stepping(first.operations)
        depends = tuple(
            tuple(
                frozenset(s for s in reads[place] if stepping[place] or not _is_zero(second, int(bends[k, j, s])))
                for j, place in enumerate(row)
            )
            for k, row in enumerate(places)
        )
        values = np.full(places.shape, np.nan)
        balls = first.run([Ball.exact(x) for x in point], BallArithmetic())
        for (k, j), place in np.ndenumerate(places):
            value = balls[place]
            if not depends[k][j] and isinstance(value, Ball) and value.lower == value.upper:
                values[k, j] = value.lower
        own = trace(whole, point)
        found = ancestors(own.operations)
        return JacobianStructure(depends, values, frozenset(s for place in own.outputs[0] for s in found[place]))

    @property
    def is_constant(self) -> np.ndarray:
        """True for the entries that are one known double, shape (nf, nz)."""
        return np.isfinite(self.values)

    def arguments(self) -> frozenset[int]:
        """Numbers of the arguments that some entry depends on."""
        return frozenset[int]().union(*(entry for row in self.depends for entry in row))


def _is_zero(function: Trace, place: int) -> bool:
    operation = function.operations[place]
    return operation.name == "constant" and operation.static[0] == 0.0


def _stepping(operations: tuple[Operation, ...]) -> list[bool]:
    found: list[bool] = []
    for operation in operations:
        found.append(operation.name in _STEPS or any(found[k] for k in operation.operands))
    return found
