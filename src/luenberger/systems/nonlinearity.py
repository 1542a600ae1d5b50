"""The nonlinear part f(H x, u) of a plant with the bounds we trust on it."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any, Literal

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from luenberger.algebra.enclosure import enclose_jacobian
from luenberger.core import BadInput
from luenberger.core.checks import finite_array, matrix


class Nonlinearity(eqx.Module):
    """A JAX function f: (z, u) -> (nf,) with z = H x, and a bound on its Jacobian with respect to z.

    Exactly what a method may use is the bound; f itself is what simulation and observers run.

    Args:
        function: JAX function of z, shape (nz,), and u, shape (nu,).
        H: selection of the states that enter, shape (nz, nx).
        size: nf, the number of outputs of `function`.
        jacobian_lower: entrywise lower bound on df/dz, shape (nf, nz), or None.
        jacobian_upper: entrywise upper bound on df/dz, shape (nf, nz), or None.
        lipschitz: constant g with |f(z1) - f(z2)| <= g |z1 - z2| (Euclidean norms), or None.
        domain: states for which the bounds hold, (lower, upper) each (nx,), or None for all states.
        bound_status: "declared" by the user or "proved" by ball arithmetic from `function`.
        jacobian_vertices: matrices whose convex hull contains df/dz, shape (nk, nf, nz), or None; the entrywise bounds
            are then the box around them.
        is_clipped: True where `function` is continued beyond the domain with slopes inside the bounds, see `clipped`.

    Raises:
        BadInput: no bound at all, shapes that differ, inverted or non-finite bounds.
    """

    function: Callable[..., jax.Array] = eqx.field(static=True)
    H: np.ndarray
    size: int = eqx.field(static=True)
    jacobian_lower: np.ndarray | None = None
    jacobian_upper: np.ndarray | None = None
    lipschitz: float | None = None
    domain: tuple[np.ndarray, np.ndarray] | None = None
    bound_status: Literal["declared", "proved"] = eqx.field(static=True, default="declared")
    jacobian_vertices: np.ndarray | None = None
    is_clipped: bool = eqx.field(static=True, default=False)

    @staticmethod
    def bounded(
        function: Callable[..., jax.Array],
        H: Any,
        *,
        size: int = 1,
        jacobian: tuple[Any, Any] | None = None,
        lipschitz: float | None = None,
        domain: tuple[Any, Any] | None = None,
        hull: Any = None,
    ) -> "Nonlinearity":
        """Build a nonlinearity from bounds the user vouches for; see the class.

        Args:
            function: JAX function of (z, u).
            H: selection of the states that enter, shape (nz, nx).
            size: nf.
            jacobian: entrywise bounds (lower, upper) on df/dz, each (nf, nz).
            lipschitz: Lipschitz constant.
            domain: state box (lower, upper) where the bounds hold; None for all states.
            hull: matrices, shape (nk, nf, nz), whose convex hull contains df/dz; in place of `jacobian`.

        Raises:
            BadInput: no bound at all, shapes that differ, inverted or non-finite bounds.
        """
        H = matrix("H", H)
        vertices = None
        if hull is not None:
            vertices = finite_array("hull", hull)
            if (
                jacobian is not None
                or vertices.ndim != 3
                or vertices.shape[1:] != (size, H.shape[0])
                or not len(vertices)
            ):
                raise BadInput(
                    f"`hull` has shape {vertices.shape}; it needs shape (nk, {size}, {H.shape[0]}) and stands in place of `jacobian`."
                )
            jacobian = vertices.min(axis=0), vertices.max(axis=0)
        if jacobian is None and lipschitz is None:
            raise BadInput(
                "The nonlinearity has no bound: neither `jacobian` nor `hull` nor `lipschitz` is given. Give one, or let "
                "`Nonlinearity.enclosed(function, H, domain)` prove a Jacobian box over a state box."
            )
        lower = upper = None
        if jacobian is not None:
            because = f"the nonlinearity has {size} outputs of {H.shape[0]} arguments"
            lower = matrix("jacobian lower bound", jacobian[0], size, H.shape[0], because)
            upper = matrix("jacobian upper bound", jacobian[1], size, H.shape[0], because)
            if (lower > upper).any():
                i, j = np.argwhere(lower > upper)[0]
                raise BadInput(
                    f"The Jacobian bound of entry ({i}, {j}) is [{lower[i, j]}, {upper[i, j]}]; lower <= upper is needed."
                )
        if lipschitz is not None and not (np.isfinite(lipschitz) and lipschitz >= 0):
            raise BadInput(f"`lipschitz` is {lipschitz}; a finite constant >= 0 is needed.")
        box = None if domain is None else _state_box(domain, H.shape[1])
        return Nonlinearity(function, H, size, lower, upper, lipschitz, box, jacobian_vertices=vertices)

    @staticmethod
    def enclosed(
        function: Callable[..., jax.Array], H: Any, domain: tuple[Any, Any], *, tolerance: float = 1e-3
    ) -> "Nonlinearity":
        """Prove a Jacobian box of `function` over a state box by ball arithmetic and subdivision.

        Args:
            function: JAX function of (z, u) with z = H x; its Jacobian is bounded with u absent (zero length).
            H: selection of the states that enter, shape (nz, nx); each row picks one state.
            domain: state box (lower, upper), each (nx,).
            tolerance: wanted relative overestimation of the box.

        Raises:
            BadInput: H does not pick single states, the box is inverted, or the function cannot be read.
        """
        H = matrix("H", H)
        lower, upper = _state_box(domain, H.shape[1])
        if not ((H == 0) | (H == 1)).all() or (H.sum(axis=1) != 1).any():
            raise BadInput("`H` needs one 1 in each row, zeros elsewhere, so that the state box is a box of H x.")
        found = enclose_jacobian(
            lambda z: jnp.atleast_1d(function(z, jnp.zeros(0))), H @ lower, H @ upper, tolerance=tolerance
        )
        # Jumps and hand-written derivative rules leave assumptions: then the box is no proof about difference quotients.
        status = "declared" if found.assumptions else "proved"
        return Nonlinearity(function, H, found.lower.shape[0], found.lower, found.upper, None, (lower, upper), status)

    def at_jacobian(self, J: np.ndarray) -> "Nonlinearity":
        """Return the nonlinearity with its Jacobian set shrunk to one matrix: a corner of an inequality, not a plant to run.

        Args:
            J: df/dz, shape (nf, nz).
        """
        return replace(self, jacobian_lower=J, jacobian_upper=J, jacobian_vertices=None)

    def clipped(self) -> "Nonlinearity":
        """Return f continued beyond its domain, so that an observer may leave it and only the plant must stay inside.

        Outside, f(clip(z)) + K (z - clip(z)), K the middle of the Jacobian box: the same function inside, and slopes in the
        box everywhere, since clipping only replaces columns of the Jacobian by columns of K.

        Raises:
            BadInput: no domain, no Jacobian box, a hull (columns of K may leave it), or H that mixes states.
        """
        f, H = self.function, np.asarray(self.H)
        if self.domain is None or self.jacobian_lower is None or self.jacobian_upper is None:
            raise BadInput(
                "`clipped` needs a `domain` to clip to and a Jacobian box for the slopes outside; give both."
            )
        if self.jacobian_vertices is not None:
            raise BadInput("A hull need not hold the slopes of a clipped function; use `Nonlinearity.boxed()` first.")
        if not ((H == 0) | (H == 1)).all() or (H.sum(axis=1) != 1).any():
            raise BadInput(
                "`H` needs one 1 in each row, zeros elsewhere, so that clipping states clips their arguments."
            )
        lower, upper = H @ self.domain[0], H @ self.domain[1]
        K = 0.5 * (self.jacobian_lower + self.jacobian_upper)

        def continued(z: Any, u: Any) -> jax.Array:
            inside = jnp.clip(z, lower.astype(z.dtype), upper.astype(z.dtype))
            # Multiply and sum: small products of this form cost least in a scan and can be read by `algebra.jaxpr`.
            return jnp.atleast_1d(f(inside, u)) + (K.astype(z.dtype) * (z - inside)).sum(axis=1)

        return replace(self, function=continued, is_clipped=True)

    def boxed(self) -> "Nonlinearity":
        """Return the same nonlinearity with the box around its Jacobian hull in place of the hull."""
        return replace(self, jacobian_vertices=None)

    def __call__(self, x: Any, u: Any) -> jax.Array:
        """Return f(H x, u), shape (nf,)."""
        return jnp.atleast_1d(self.function(jnp.asarray(self.H) @ x, u))

    @property
    def lipschitz_bound(self) -> float:
        """A constant g with |f(z1) - f(z2)| <= g |z1 - z2|: the declared one, or the norm of the Jacobian box."""
        if self.lipschitz is not None:
            return float(self.lipschitz)
        if self.jacobian_vertices is not None:
            return max(float(np.linalg.norm(J, 2)) for J in self.jacobian_vertices)
        assert self.jacobian_lower is not None
        assert self.jacobian_upper is not None
        return float(np.linalg.norm(np.maximum(abs(self.jacobian_lower), abs(self.jacobian_upper)), 2))


def _state_box(domain: tuple[Any, Any], nx: int) -> tuple[np.ndarray, np.ndarray]:
    lower, upper = finite_array("domain lower", domain[0]), finite_array("domain upper", domain[1])
    if lower.shape != (nx,) or upper.shape != (nx,):
        raise BadInput(
            f"`domain` has shapes {lower.shape} and {upper.shape} but `H` has {nx} columns; both need ({nx},)."
        )
    if (lower > upper).any():
        k = int(np.argmax(lower > upper))
        raise BadInput(f"`domain` gives state {k} the interval [{lower[k]}, {upper[k]}]; lower <= upper is needed.")
    return lower, upper
