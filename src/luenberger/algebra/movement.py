"""JAX primitives that only move data, carried out on object arrays.

The everyday ones are NumPy calls. Any other is replayed: the very same primitive is bound on arrays of places, and the
elements are then picked by place, so that its meaning is JAX's own.
"""

# pyright: reportUnknownLambdaType=false, reportUnknownArgumentType=false, reportUnknownMemberType=false
# pyright: reportUnknownVariableType=false
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from luenberger.core import BadInput

Parameters = Mapping[str, Any]

# Which operands are addresses; all others are data.
MOVEMENTS: Mapping[str, slice] = {
    **dict.fromkeys(("broadcast_in_dim", "reshape", "transpose", "slice", "squeeze", "expand_dims"), slice(0, 0)),
    **dict.fromkeys(("concatenate", "stack", "unstack", "split", "tile"), slice(0, 0)),
    **dict.fromkeys(("pad", "rev", "copy", "copy_p"), slice(0, 0)),
    "gather": slice(1, 2),
    "scatter": slice(1, 2),
    "dynamic_slice": slice(1, None),
    "dynamic_update_slice": slice(2, None),
    "select_n": slice(0, 1),
}


def moved(equation: Any, operands: list[Any]) -> list[np.ndarray]:
    """Return the outputs of a data-movement equation.

    Args:
        equation: of a jaxpr, with a primitive named in `MOVEMENTS`.
        operands: arrays, known ones numeric and others object arrays.

    Raises:
        BadInput: an address depends on the arguments.
    """
    name, parameters = equation.primitive.name, equation.params
    addresses = range(len(operands))[MOVEMENTS[name]]
    for k in addresses:
        _need_known_address(name, operands[k])
    try:
        found = _SHORTCUTS[name](parameters, *operands)
    except KeyError:
        # No short way, or a JAX that names the parameters otherwise.
        return replayed(equation, operands)
    return found if isinstance(found, list) else [found]


def replayed(equation: Any, operands: list[Any]) -> list[np.ndarray]:
    """Return the outputs of a data-movement equation by binding its primitive on arrays of places.

    Args:
        operands: the operands, index arrays for those that are moved.
    """
    primitive, parameters = equation.primitive, dict(equation.params)
    addresses = range(len(operands))[MOVEMENTS[primitive.name]]
    pool: list[Any] = []
    places: list[Any] = []
    for k, operand in enumerate(operands):
        if k in addresses:
            places.append(operand)
            continue
        # Places are doubles because the primitive was traced for doubles; NaN marks what is filled in from outside.
        places.append(np.arange(len(pool), len(pool) + operand.size, dtype=np.float64).reshape(operand.shape))
        pool.extend(operand.astype(object).flat)
    fill = parameters.get("fill_value")
    if fill is not None:
        parameters["fill_value"] = np.nan
    pool.append(np.nan if fill is None else fill)
    elements = np.empty(len(pool), dtype=object)
    elements[:] = pool
    found = primitive.bind(*places, **parameters)
    found = [np.asarray(f) for f in (found if primitive.multiple_results else [found])]
    return [elements[np.where(np.isnan(f), len(pool) - 1, f).astype(int)] for f in found]


def additions(equation: Any, operands: list[Any]) -> np.ndarray:
    """Return the 0-1 matrix (updates, targets) that says which update of a scatter-add lands on which target.

    Args:
        equation: the equation of the jaxpr.
        operands: its operands.
    """
    target, indices, updates = operands
    _need_known_address("scatter-add", indices)
    rows: list[np.ndarray] = []
    for k in range(updates.size):
        one = np.zeros(updates.size)
        one[k] = 1.0
        landed = equation.primitive.bind(np.zeros(target.shape), indices, one.reshape(updates.shape), **equation.params)
        rows.append(np.asarray(landed).ravel() != 0)
    return np.array(rows).reshape(updates.size, target.size)


def _need_known_address(name: str, address: np.ndarray) -> None:
    if address.dtype == object:
        raise BadInput(
            f"The function uses `{name}` with an index that depends on its arguments; an index needs to be known when "
            "the function is read. Write a table look-up as a sum of ramps or with `jnp.where`."
        )


def _broadcast(parameters: Parameters, x: np.ndarray) -> np.ndarray:
    shape = [1] * len(parameters["shape"])
    for size, axis in zip(x.shape, parameters["broadcast_dimensions"], strict=True):
        shape[axis] = size
    return np.broadcast_to(x.reshape(shape), parameters["shape"])


def _slice(parameters: Parameters, x: np.ndarray) -> np.ndarray:
    strides = parameters["strides"] or (1,) * x.ndim
    return x[(*map(slice, parameters["start_indices"], parameters["limit_indices"], strides), ...)]


def _split(parameters: Parameters, x: np.ndarray) -> list[np.ndarray]:
    return np.split(x, np.cumsum(parameters["sizes"])[:-1], axis=parameters["axis"])


def _select(parameters: Parameters, which: np.ndarray, *cases: np.ndarray) -> np.ndarray:
    # NumPy hands out a single element where an array without axes is meant.
    return np.asarray(np.choose(np.broadcast_to(which, cases[0].shape).astype(int), cases))


_SHORTCUTS: Mapping[str, Callable[..., np.ndarray | list[np.ndarray]]] = {
    "broadcast_in_dim": _broadcast,
    "reshape": lambda parameters, x: x.reshape(parameters["new_sizes"]),
    "transpose": lambda parameters, x: x.transpose(parameters["permutation"]),
    "slice": _slice,
    "squeeze": lambda parameters, x: np.squeeze(x, tuple(parameters["dimensions"])),
    "expand_dims": lambda parameters, x: np.expand_dims(x, tuple(parameters["dimensions"])),
    "concatenate": lambda parameters, *xs: np.concatenate(xs, axis=parameters["dimension"]),
    "stack": lambda parameters, *xs: np.stack(xs, axis=parameters["axis"]),
    "rev": lambda parameters, x: np.flip(x, parameters["dimensions"]),
    "copy": lambda parameters, x: x,
    "copy_p": lambda parameters, x: x,
    "split": _split,
    "select_n": _select,
}
