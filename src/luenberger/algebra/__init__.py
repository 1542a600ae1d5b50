"""Matrix polynomials, outward-rounded arithmetic, and the reader of JAX functions in other arithmetics."""

from luenberger.algebra.polynomial import Polynomial, block, symmetric

__all__ = ["Polynomial", "block", "symmetric"]
