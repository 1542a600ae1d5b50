"""State observers designed by convex optimisation, proved on the continuum, replayed on real logs, shipped as code."""

import jax

jax.config.update("jax_enable_x64", True)

__version__ = "0.1.0"
