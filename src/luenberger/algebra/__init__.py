"""Matrix polynomials, outward-rounded arithmetic, and the reader of JAX functions in other arithmetics."""

from luenberger.algebra.block_matrix import block, symmetric
from luenberger.algebra.polynomial import Polynomial

__all__ = ["Polynomial", "block", "symmetric"]
