"""The nonlinear channels of a split plant, their arguments, and the proved box around their slopes."""

# pyright: reportUnknownMemberType=false, reportUnknownArgumentType=false
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from luenberger.core import BadInput
from luenberger.systems.embedding_jacobian import JacobianMap, argument_box
from luenberger.systems.embedding_split import AffineSplit
from luenberger.systems.embedding_structure import JacobianStructure
from luenberger.systems.nonlinearity import Nonlinearity

Box = tuple[np.ndarray, np.ndarray]


def bounded_channels(
    split: AffineSplit,
    channels: tuple[np.ndarray, np.ndarray],
    domain: Box,
    inputs: tuple[int, Box | None],
    tolerance: float,
) -> tuple[Nonlinearity, np.ndarray, Box]:
    """Return the channels with their Jacobian box, the slopes (nf, nx) that move to A, and the input box that was used.

    Args:
        split: the plant.
        channels: atom weights and constants of the channels, from `AffineSplit.channels`.
        domain: state box.
        inputs: number of inputs, and their box or None.
        tolerance: wanted relative overestimation of the Jacobian box.

    Raises:
        BadInput: a slope depends on an input without bounds, or the Jacobian is not known to be bounded.
    """
    weights, constants = channels
    nu, box = inputs
    middle = 0.5 * (domain[0] + domain[1])
    u = np.zeros(nu) if box is None else 0.5 * (box[0] + box[1])
    H = split.arguments(weights)
    nz = len(H)
    free = split.function(weights, constants, H, middle, np.zeros((len(constants), nz)))
    structure = JacobianStructure.of(free, H @ middle, u)
    values = np.where(structure.is_constant, structure.values, 0.0)
    # Arguments whose slopes are constant leave f; their share is in `values` as a whole.
    kept = [j for j in range(nz) if not structure.is_constant[:, j].all()] or [0]
    f = _narrowed(split.function(weights, constants, H, middle, values), kept, H @ middle)
    needed = sorted(s - nz for s in structure.arguments() if s >= nz)
    if needed and box is None:
        raise BadInput(
            f"A slope of `function` depends on input {needed[0] + 1} of {nu}, and `inputs` = {nu} gives it no bounds; "
            "give `inputs` as a box (lower, upper), each with one number an input."
        )
    used = (
        (u, u) if box is None else tuple(np.array([end[k] if k in needed else u[k] for k in range(nu)]) for end in box)
    )
    try:
        found = JacobianMap.of(f, argument_box(H[kept], domain), (used[0], used[1]), tolerance)
    except BadInput as cause:
        raise BadInput(f"The Jacobian of `function` is not known to be bounded on `domain`. {cause}") from cause
    constant = structure.is_constant[:, kept]
    jacobian = np.where(constant, 0.0, found.lower), np.where(constant, 0.0, found.upper)
    bounded = Nonlinearity.bounded(f, H[kept], size=len(constants), jacobian=jacobian, domain=domain)
    return replace(bounded, bound_status=found.status), values @ H, (used[0], used[1])


def _narrowed(
    phi: Callable[[Any, Any], jax.Array], kept: list[int], middle: np.ndarray
) -> Callable[[Any, Any], jax.Array]:
    """The same function of fewer arguments, the others at their middle, on which nothing depends any more."""
    if len(kept) == len(middle):
        return phi
    entry = {j: k for k, j in enumerate(kept)}

    def narrowed(z: Any, u: Any) -> jax.Array:
        whole = [z[entry[j]] if j in entry else 0.0 * z[0] + float(middle[j]) for j in range(len(middle))]
        return phi(jnp.stack(whole), u)

    return narrowed
