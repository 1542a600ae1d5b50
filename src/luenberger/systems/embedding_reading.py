"""What the user gives of a plant: a function, its boxes, its outputs; checked and read."""

# pyright: reportUnknownMemberType=false, reportUnknownArgumentType=false
import inspect
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from luenberger.algebra.jaxpr import Trace, trace
from luenberger.core import BadInput
from luenberger.core.checks import finite_array, matrix
from luenberger.systems.embedding_split import AffineSplit

Box = tuple[np.ndarray, np.ndarray]


def state_box(domain: Any) -> Box:
    """Return a state box as two vectors.

    Args:
        domain: (lower, upper).

    Raises:
        BadInput: not two ends of one shape, not finite, inverted.
    """
    if not isinstance(domain, tuple | list) or len(domain) != 2:
        raise BadInput("`domain` needs two ends, (lower, upper), each with one number a state.")
    lower, upper = finite_array("domain lower", domain[0]), finite_array("domain upper", domain[1])
    if lower.ndim != 1 or lower.shape != upper.shape or not lower.size:
        raise BadInput(f"`domain` has shapes {lower.shape} and {upper.shape}; both need one shape (nx,).")
    if (lower > upper).any():
        k = int(np.argmax(lower > upper))
        raise BadInput(f"`domain` gives state {k} the interval [{lower[k]}, {upper[k]}]; lower <= upper is needed.")
    return lower, upper


def input_box(inputs: Any) -> tuple[int, Box | None]:
    """Return the number of inputs and their box, None where only the number is given.

    Args:
        inputs: a number, or (lower, upper).

    Raises:
        BadInput: negative, or ends that are not finite, inverted or of different shape.
    """
    if isinstance(inputs, int | np.integer):
        if inputs < 0:
            raise BadInput(f"`inputs` is {inputs}; a number >= 0 or a box (lower, upper) is needed.")
        return int(inputs), None
    if not isinstance(inputs, tuple | list) or len(inputs) != 2:
        raise BadInput("`inputs` needs to be a number or two ends, (lower, upper), each with one number an input.")
    lower, upper = finite_array("inputs lower", inputs[0]), finite_array("inputs upper", inputs[1])
    if lower.ndim != 1 or lower.shape != upper.shape or (lower > upper).any():
        raise BadInput(
            f"`inputs` has the ends {lower.tolist()} and {upper.tolist()}; two vectors (nu,), lower <= upper, are needed."
        )
    return len(lower), (lower, upper)


def called(function: Callable[..., Any], nu: int, name: str) -> Callable[[Any, Any], jax.Array]:
    """Return the function of (x, u), whatever it takes, with one array as its result.

    Args:
        function: of (x) or (x, u), to an array or a list of scalars.
        nu: number of inputs.
        name: how it is called in messages.

    Raises:
        BadInput: it does not take what the plant has.
    """
    try:
        parameters = list(inspect.signature(function).parameters.values())
    except (TypeError, ValueError):
        parameters = []
    positional = [p for p in parameters if p.kind in (p.POSITIONAL_ONLY, p.POSITIONAL_OR_KEYWORD)]
    required = sum(p.default is p.empty for p in positional)
    if required > 2 or (nu and len(positional) < 2 and not any(p.kind is p.VAR_POSITIONAL for p in parameters)):
        raise BadInput(
            f"`{name}` takes {len(positional)} arguments but the plant has {nu} inputs; write it as f(x, u), or f(x) for no input."
        )
    takes_input = len(positional) != 1

    def run(x: Any, u: Any) -> jax.Array:
        found = function(x, u) if takes_input else function(x)
        return jnp.stack([jnp.asarray(e) for e in found]) if isinstance(found, list | tuple) else jnp.asarray(found)

    return run


def read(function: Callable[..., Any], nx: int, nu: int, name: str, size: int | None) -> Trace:
    """Return a function of (x, u) as a list of scalar operations.

    Args:
        function: from `called`.
        nx: number of states.
        nu: number of inputs.
        name: how it is called in messages.
        size: wanted length of its result, None for any.

    Raises:
        BadInput: it cannot be read, or returns something else than one vector of that length.
    """
    found = trace(function, np.zeros(nx), np.zeros(nu))
    shape = found.outputs[0].shape
    if len(shape) != 1 or (size is not None and shape != (size,)):
        wanted = "ny" if size is None else str(size)
        raise BadInput(
            f"`{name}` returns shape {shape} for {nx} states and {nu} inputs; it needs to return shape ({wanted},)."
        )
    return found


def require_finite(function: Callable[..., Any], middle: np.ndarray, nu: int, box: Box | None) -> None:
    """Refuse a function that is not finite at the middle of the domain.

    Args:
        function: from `called`.
        middle: middle of the state box.
        nu: number of inputs.
        box: input box or None.

    Raises:
        BadInput: NaN or infinity; names the row.
    """
    u = np.zeros(nu) if box is None else 0.5 * (box[0] + box[1])
    value = np.asarray(function(jnp.asarray(middle), jnp.asarray(u)))
    if not np.isfinite(value).all():
        k = int(np.argmax(~np.isfinite(value)))
        raise BadInput(
            f"`function` gives {value[k]} in row {k} at the middle of the domain, x = {middle.tolist()}, u = {u.tolist()}; "
            "it needs finite values on the whole domain. Correct its constants, or move the domain or the input box."
        )


def output_matrices(outputs: Any, nx: int, nu: int) -> tuple[np.ndarray | None, np.ndarray | None]:
    """Return C and D, None where they are to be left to `System.build`.

    Args:
        outputs: C, a linear JAX function of (x) or (x, u), or None.
        nx: number of states.
        nu: number of inputs.

    Raises:
        BadInput: wrong shape, or a function that is not linear.
    """
    if outputs is None:
        return None, None
    if not callable(outputs):
        return matrix("outputs", outputs, None, nx, f"the plant has {nx} states"), None
    split = AffineSplit.of(read(called(outputs, nu, "outputs"), nx, nu, "outputs", None), nx)
    if split.atoms or split.c.any():
        rows = np.flatnonzero(split.weights.any(axis=1) | (split.c != 0))
        raise BadInput(
            f"Row {rows[0]} of `outputs` is not linear in x and u; only y = C x + D u can be embedded. Take a state that "
            "equals it, or subtract its constant from the measurement."
        )
    return split.A, split.B if nu else None
