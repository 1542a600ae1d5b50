"""Products and exponentials of small matrices in plain array operations, so that they fuse, differentiate and export.

LAPACK calls and matrix products are separate kernels inside a compiled loop; for a handful of states starting a kernel
costs more than the arithmetic. Everything here is multiplications and sums of arrays of static shape.
"""

import math
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from luenberger.core import BadInput

# Beyond this norm the alternating terms of a Taylor series lose digits to cancellation, so the step is halved instead.
LARGEST_UNSCALED_NORM = 1.0


class HoldOrder(NamedTuple):
    """How the exponential is evaluated: Taylor degree on a step halved `squarings` times."""

    degree: int
    squarings: int


def product(A: Any, B: Any) -> jax.Array:
    """Return A @ B as a multiplication and a sum, which XLA fuses with its neighbours.

    Args:
        A: matrix, shape (n, m).
        B: matrix (m, k) or vector (m,).
    """
    return jnp.sum(A * B, axis=-1) if B.ndim == 1 else jnp.sum(A[:, :, None] * B[None, :, :], axis=1)


def hold_order(norm: float) -> HoldOrder:
    """Return the cheapest Taylor degree and number of squarings whose truncation is below double precision.

    The function approximated is phi(Z) = (e^Z - 1)/Z, whose first neglected term is |Z|^q / (q + 1)!.

    Args:
        norm: bound on |dt M| over every M that will occur, in any induced norm.

    Raises:
        BadInput: the bound is not finite.
    """
    if not math.isfinite(norm):
        raise BadInput(f"The matrix of the held system has norm {norm} a step; a finite norm is needed.")
    fewest = max(0, math.ceil(math.log2(norm / LARGEST_UNSCALED_NORM))) if norm > LARGEST_UNSCALED_NORM else 0
    if fewest == 0:
        return HoldOrder(_degree(norm), 0)
    orders = [HoldOrder(_degree(norm / 2.0**s), s) for s in range(fewest, fewest + 6)]
    return min(orders, key=sum)


def affine_hold(M: Any, b: Any, x: Any, dt: float, order: HoldOrder) -> jax.Array:
    """Return the solution at time dt of x' = M x + b started at x, with M and b constant over the step.

    Without squarings the series acts on vectors only; otherwise e^(M h) of the halved step is formed and squared back.

    Args:
        M: state matrix, shape (nx, nx).
        b: constant right-hand side, shape (nx,).
        x: start, shape (nx,).
        dt: step [s].
        order: from `hold_order` with a norm bound that covers dt M.

    Reference: N. Higham, Functions of Matrices (2008), sections 10.3 and 10.7.4 (scaling and squaring, phi functions).
    """
    if order.squarings == 0:
        slope = product(M, x) + b
        total = slope
        for k in range(order.degree, 1, -1):
            total = slope + product(M, total) * (dt / k)
        return x + total * dt
    h = dt / 2.0**order.squarings
    eye = jnp.eye(M.shape[0], dtype=M.dtype)
    phi = eye
    for k in range(order.degree, 1, -1):
        phi = eye + product(M, phi) * (h / k)
    transition = eye + product(M, phi) * h
    offset = product(phi, b) * h
    for _ in range(order.squarings):
        offset = offset + product(transition, offset)
        transition = product(transition, transition)
    return product(transition, x) + offset


def _degree(norm: float) -> int:
    degree = 1
    while norm**degree / math.factorial(degree + 1) > 2.0**-53:
        degree += 1
    return degree
