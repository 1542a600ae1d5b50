"""Reads a JAX function once and evaluates it in any scalar arithmetic: balls, floats, C expressions.

`jax.make_jaxpr` is walked on object arrays of graph elements: data-movement primitives move elements, arithmetic ones
add operations to the graph, and whatever does not depend on the arguments is computed on the spot (such a
subexpression means the double that it evaluates to). What remains is a straight list of scalar operations.
"""

# pyright: reportUnknownVariableType=false, reportUnknownMemberType=false, reportUnknownArgumentType=false
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import jax
import numpy as np

from luenberger.algebra.arithmetic import BALL, FLOAT, Arithmetic
from luenberger.algebra.endpoint import OutsideDomain
from luenberger.algebra.graph import Graph, Operation, pruned, run
from luenberger.algebra.reader import Reader
from luenberger.core import BadInput

__all__ = ["BALL", "FLOAT", "Arithmetic", "Trace", "evaluate", "trace"]


@dataclass(frozen=True, eq=False)
class Trace:
    """A JAX function as a list of scalar operations; made by `trace`, called with any arithmetic.

    Args:
        operations: in order; each refers to earlier ones by index.
        shapes: shape of each argument leaf; inputs are numbered through all leaves in C order.
        outputs: for each output leaf an integer array of indices into `operations`.
        argument_tree: tree structure of the arguments.
        output_tree: tree structure of the result.
        handmade: names of derivative rules that were written by hand (custom_jvp, custom_vjp, stop_gradient): JAX trusts
            them when it differentiates the function.
    """

    operations: tuple[Operation, ...]
    shapes: tuple[tuple[int, ...], ...]
    outputs: tuple[np.ndarray, ...]
    argument_tree: Any
    output_tree: Any
    handmade: frozenset[str]

    def __call__(self, *arguments: Any, arithmetic: Arithmetic) -> Any:
        """Evaluate the function.

        Args:
            arguments: as the function takes them; every leaf an array of scalars of the arithmetic.
            arithmetic: `BALL`, `FLOAT`, or one of your own.

        Returns:
            the function's result; every leaf an object array of scalars.

        Raises:
            BadInput: arguments of another structure or shape than traced.
            OutsideDomain: an operation that the result needs is not defined there.
            NotAccepted: the arithmetic lacks an operation.
        """
        leaves, tree = jax.tree_util.tree_flatten(arguments)
        arrays = [np.asarray(leaf, dtype=object) for leaf in leaves]
        if tree != self.argument_tree or tuple(a.shape for a in arrays) != self.shapes:
            raise BadInput(
                f"The arguments have leaf shapes {[a.shape for a in arrays]}, but the function was traced for "
                f"{list(self.shapes)}; give the same structure or trace it again."
            )
        values = self.run([x for a in arrays for x in a.flat], arithmetic)
        results: list[np.ndarray] = []
        for places in self.outputs:
            out = np.empty(places.shape, dtype=object)
            for index, k in np.ndenumerate(places):
                if isinstance(values[k], OutsideDomain):
                    raise values[k]
                out[index] = values[k]
            results.append(out)
        return jax.tree_util.tree_unflatten(self.output_tree, results)

    def run(self, scalars: list[Any], arithmetic: Arithmetic) -> list[Any]:
        """Return the value of every operation, `OutsideDomain` errors included, for a flat list of inputs."""
        return run(self.operations, scalars, arithmetic)


def trace(function: Callable[..., Any], *arguments: Any) -> Trace:
    """Read a JAX function for arguments of given shapes.

    Use it to evaluate one function many times; `evaluate` is the short form for once.

    Args:
        function: pure JAX function of float64 arrays; loops need a known length, indices need to be known.
        arguments: pytrees whose leaves have the wanted shapes (arrays of anything, `jax.ShapeDtypeStruct`).

    Raises:
        BadInput: a primitive without a meaning for scalars, a branch or index that depends on the arguments in Python.
    """
    leaves, tree = jax.tree_util.tree_flatten(arguments)
    shapes = tuple(tuple(np.shape(leaf)) for leaf in leaves)
    likes = jax.tree_util.tree_unflatten(tree, [jax.ShapeDtypeStruct(shape, np.float64) for shape in shapes])
    try:
        closed, shape_of_result = jax.make_jaxpr(function, return_shape=True)(*likes)
    except (jax.errors.ConcretizationTypeError, jax.errors.TracerArrayConversionError) as cause:
        raise BadInput(
            "The function uses the value of an argument in Python (if, float(), NumPy); it needs to be pure JAX: use "
            f"`jnp.where` and `jnp` functions. JAX says: {str(cause).splitlines()[0]}"
        ) from cause
    graph = Graph()
    inputs: list[Any] = []
    for shape in shapes:
        array = np.empty(shape, dtype=object)
        for index in np.ndindex(shape):
            array[index] = graph.input()
        inputs.append(array)
    reader = Reader(graph)
    # What is known beforehand is computed on the spot; NaN and infinity may arise there silently, as they do in JAX.
    with np.errstate(all="ignore"):
        found = [np.asarray(f, dtype=object) for f in reader.read(closed.jaxpr, closed.consts, inputs)]
    operations, kept = pruned(graph.operations, [graph.lift(e).index for f in found for e in f.flat])
    ends = np.cumsum([0, *(f.size for f in found)])
    outputs = tuple(
        np.array(kept[a:b], dtype=int).reshape(f.shape) for a, b, f in zip(ends, ends[1:], found, strict=False)
    )
    output_tree = jax.tree_util.tree_structure(shape_of_result)
    return Trace(tuple(operations), shapes, outputs, tree, output_tree, frozenset(reader.handmade))


def evaluate(function: Callable[..., Any], *arguments: Any, arithmetic: Arithmetic) -> Any:
    """Evaluate a JAX function once in another arithmetic; see `trace` and `Trace` for arguments and errors.

    Args:
        function: pure JAX function of float64 arrays.
        arguments: pytrees of object arrays of scalars of the arithmetic.
        arithmetic: `BALL`, `FLOAT`, or one of your own.
    """
    return trace(function, *arguments)(*arguments, arithmetic=arithmetic)
