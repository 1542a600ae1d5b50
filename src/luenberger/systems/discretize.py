"""From a continuous plant to a sampled one: as a `System` again, or as the one-step map that filters and replays run."""

from collections.abc import Callable
from itertools import product as tuples
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import scipy.linalg

from luenberger.algebra import Polynomial
from luenberger.core import BadInput, NotAccepted
from luenberger.core.checks import nearest
from luenberger.systems.exponential import HoldOrder, affine_hold, hold_order, product
from luenberger.systems.matrix import MatrixFunction, PlantMatrix
from luenberger.systems.system import System

METHODS = ("exact", "euler", "rk4")


def discretize(system: System, dt: float, method: str = "exact") -> System:
    """Return the plant sampled with step dt, inputs, scheduling and unknown inputs held over the step.

    "exact" is the zero-order hold of a plant with constant matrices. "rk4" is the degree-4 Taylor polynomial of it, which
    keeps scheduled matrices polynomial (the degree in the parameters grows fourfold). "euler" is first order and takes
    every plant. A nonlinearity f(H x, u) is held at its value at the sample under "exact" and "euler", so both are first
    order in f. Bounds, names, outputs and parameters are kept; rates stay per second.

    Assumes: dt None, i.e. dx = A x + B u + F f(H x, u) + E d.

    Args:
        system: continuous plant.
        dt: sample time [s].
        method: "exact", "euler" or "rk4".

    Raises:
        BadInput: dt not positive, or an unknown method.
        NotAccepted: the plant is already discrete, or the method does not apply; the message names one that does.
    """
    _check(system, dt, method)
    if system.dt is not None:
        raise NotAccepted(
            f"`{system.name}` is discrete already (dt = {system.dt:g} s); give a continuous plant (dt = None) or use it as it is."
        )
    if method == "exact":
        return _exact(system, dt)
    if method == "rk4" and system.nonlinearity is not None:
        raise NotAccepted(
            f'`{system.name}` has a nonlinearity, and four Runge-Kutta stages of it are not of the plant form; use method="euler" '
            'here, or `one_step(system, dt, method="rk4")` for the map alone.'
        )
    return _taylor(system, dt, 1 if method == "euler" else 4)


def one_step(system: System, dt: float, method: str = "rk4", substeps: int = 1) -> Callable[[Any, Any, Any], jax.Array]:
    """Return the map (x, u, r) -> x one sample later, with u and r held over the step.

    "rk4" suits every continuous plant; "exact" is the zero-order hold, with the exponential evaluated at run time where
    the matrices are scheduled, and f(H x, u) held over each sub-step (exponential Euler, first order in f); "euler" is
    first order. A discrete plant gives its own map, whatever the method. Unmeasured parameters sit at their midpoints.

    Args:
        system: plant.
        dt: sample time [s]; of a discrete plant its own.
        method: "rk4", "exact" or "euler".
        substeps: equal parts that the sample time is cut into.

    Returns:
        `HeldStep`: x (nx,), u (nu,), r (nr,) -> (nx,).

    Raises:
        BadInput: dt not positive or not that of the discrete plant, unknown method, substeps not a positive integer.
    """
    return HeldStep.of(system, dt, method, substeps)


class HeldStep(eqx.Module):
    """The map of `one_step` with its settings; `system` is the sampled plant where one could be formed beforehand."""

    system: System
    dt: float = eqx.field(static=True)
    method: str = eqx.field(static=True)
    substeps: int = eqx.field(static=True)
    order: HoldOrder = eqx.field(static=True)

    @staticmethod
    def of(system: System, dt: float, method: str = "rk4", substeps: int = 1) -> "HeldStep":
        """Build the map; see `one_step`."""
        _check(system, dt, method)
        if system.uncertainty:
            system = system.freeze(**system.uncertainty)
        if substeps < 1:
            raise BadInput(f"`substeps` is {substeps}; at least one sub-step is needed.")
        if system.dt is not None:
            if abs(system.dt - dt) > 1e-12 * dt:
                raise BadInput(
                    f"`dt` is {dt:g} s but `{system.name}` is a discrete plant with dt = {system.dt:g} s; give its own step, "
                    "or discretise the continuous plant again."
                )
            return HeldStep(system, dt, "map", 1, HoldOrder(0, 0))
        constant = not varying(system)
        linear = system.nonlinearity is None
        if constant and (linear or method != "rk4"):
            parts = 1 if linear and method == "exact" else substeps
            return HeldStep(discretize(system, dt / parts, method), dt, "map", parts, HoldOrder(0, 0))
        order = HoldOrder(0, 0)
        if method == "exact":
            order = hold_order(dt / substeps * largest_norm(system.A, system.scheduling_box))
        return HeldStep(system, dt, method, substeps, order)

    def __call__(self, x: Any, u: Any, r: Any) -> jax.Array:
        """Return the state one sample later."""
        h = self.dt / self.substeps
        for _ in range(self.substeps):
            x = self._part(x, u, r, h)
        return x

    def _part(self, x: Any, u: Any, r: Any, h: float) -> jax.Array:
        if self.method == "map":
            return derivative(self.system, x, u, r)
        if self.method == "exact":
            return affine_hold(self.system.at("A", r), forcing(self.system, x, u, r), x, h, self.order)
        if self.method == "euler":
            return x + derivative(self.system, x, u, r) * h
        return runge_kutta(lambda z: derivative(self.system, z, u, r), x, h)


def runge_kutta(slope: Callable[[Any], jax.Array], x: Any, h: float) -> jax.Array:
    """Return one classical Runge-Kutta step of x' = slope(x).

    Args:
        slope: right-hand side, inputs held.
        x: state, shape (nx,).
        h: step [s].
    """
    k1 = slope(x)
    k2 = slope(x + k1 * (h / 2))
    k3 = slope(x + k2 * (h / 2))
    k4 = slope(x + k3 * h)
    return x + (k1 + k2 * 2 + k3 * 2 + k4) * (h / 6)


def derivative(system: System, x: Any, u: Any, r: Any) -> jax.Array:
    """Return what `System.dynamics` returns, with products that fuse in a compiled loop.

    Args:
        system: plant.
        x: state, shape (nx,).
    """
    return product(system.at("A", r), x) + forcing(system, x, u, r)


def forcing(system: System, x: Any, u: Any, r: Any) -> jax.Array:
    """Return B(r) u + F(r) f(H x, u), shape (nx,): all of the right-hand side but A x.

    Args:
        system: plant.
    """
    total = jnp.zeros_like(x)
    if system.nu:
        total = total + product(system.at("B", r), u)
    if system.nonlinearity is not None:
        total = total + product(system.at("F", r), system.nonlinearity(x, u))
    return total


def varying(system: System) -> tuple[str, ...]:
    """Return the letters of the dynamics matrices that depend on a parameter.

    Args:
        system: plant.
    """
    return tuple(letter for letter in "ABEF" if any(_degrees(getattr(system, letter)).values()))


def values_on(matrix: PlantMatrix, box: dict[str, tuple[float, float]], count: int) -> list[np.ndarray]:
    """Return a matrix on a grid of its parameter box, ends included.

    Args:
        matrix: polynomial or function of parameters in the box.
        box: name -> interval.
        count: points an axis.
    """
    axes = [np.linspace(*box[name], count) for name in matrix.names]
    return [np.asarray(matrix(dict(zip(matrix.names, point, strict=True)))) for point in tuples(*axes)]


def largest_norm(matrix: PlantMatrix, box: dict[str, tuple[float, float]]) -> float:
    """Return a bound on the norm of a matrix over a box.

    For a polynomial the Bernstein coefficients bound it; for a function on the domain five points an axis are taken and
    the largest doubled, which costs one more squaring and is no proof. A square matrix is balanced first, i.e. the norm
    is taken in units of the states that make it small.

    Args:
        matrix: polynomial or function of parameters in the box.
        box: name -> interval.
    """
    if isinstance(matrix, Polynomial):
        used = {name: box[name] for name in matrix.names}
        values, factor = [np.asarray(c, dtype=float) for c in matrix.bernstein(used).values()], 1.0
    else:
        values, factor = values_on(matrix, box, 5), 2.0
    if values[0].shape[0] == values[0].shape[1]:
        scale = scipy.linalg.matrix_balance(sum(abs(v) for v in values), permute=False, separate=True)[1][0]
        values = [v * scale / scale[:, None] for v in values]
    return factor * min(max(float(np.linalg.norm(v, kind)) for v in values) for kind in (1, 2, np.inf))


def _exact(system: System, dt: float) -> System:
    letters = varying(system)
    if letters:
        names = sorted({n for letter in letters for n in getattr(system, letter).names})
        raise NotAccepted(
            f"The exact hold needs constant matrices, but {', '.join(f'`{k}`' for k in letters)} of `{system.name}` depend on {names}; "
            f'use method="{"rk4" if system.nonlinearity is None else "euler"}", freeze the plant, or use '
            '`one_step(system, dt, method="exact")`, which evaluates the exponential at run time.'
        )
    A, B, F, E = (_constant(getattr(system, letter)) for letter in "ABFE")
    columns = np.concatenate([B, F, E], axis=1)
    n = system.nx
    augmented = np.zeros((n + columns.shape[1],) * 2)
    augmented[:n, :n], augmented[:n, n:] = A * dt, columns * dt
    held = scipy.linalg.expm(augmented)[:n]
    first, second = n + system.nu, n + system.nu + F.shape[1]
    changes = {"A": held[:, :n], "B": held[:, n:first], "F": held[:, first:second], "E": held[:, second:]}
    return _sampled(system, changes, dt)


def _taylor(system: System, dt: float, degree: int) -> System:
    """Sample with the Taylor polynomial of the given degree in dt A."""
    eye = np.eye(system.nx)

    def phi(A: Any) -> Any:
        total = Polynomial.constant(eye) if isinstance(A, Polynomial) else jnp.asarray(eye)
        for k in range(degree, 1, -1):
            total = eye + A @ total * (dt / k)
        return total

    changes: dict[str, Any] = {"A": _combined(lambda A: eye + A @ phi(A) * dt, system.A)}
    for letter in "BEF":
        changes[letter] = _combined(lambda X, A: phi(A) @ X * dt, getattr(system, letter), system.A)
    return _sampled(system, changes, dt)


def _sampled(system: System, changes: dict[str, Any], dt: float) -> System:
    if system.nonlinearity is None:
        changes.pop("F")
    return system.replace(**changes, dt=dt)


def _combined(function: Callable[..., Any], *matrices: PlantMatrix) -> PlantMatrix:
    """Apply matrix algebra to polynomials where all are, else to the values of functions on the domain."""
    if all(isinstance(m, Polynomial) for m in matrices):
        return _pruned(function(*matrices))
    names = tuple(dict.fromkeys(name for m in matrices for name in m.names))
    shape = (matrices[-1].shape[0], matrices[0].shape[1])
    return MatrixFunction(lambda values: function(*(jnp.asarray(m(values)) for m in matrices)), names, shape)


def _pruned(matrix: Polynomial) -> Polynomial:
    """Drop the terms that products of sparse coefficients made zero."""
    kept = {e: c for e, c in matrix.terms.items() if not any(e) or np.any(c)}
    return Polynomial(matrix.names, kept or matrix.terms)


def _degrees(matrix: PlantMatrix) -> dict[str, int]:
    if isinstance(matrix, Polynomial):
        return {n: max((e[k] for e, c in matrix if np.any(c)), default=0) for k, n in enumerate(matrix.names)}
    return dict.fromkeys(matrix.names, 1)


def _constant(matrix: PlantMatrix) -> np.ndarray:
    assert isinstance(matrix, Polynomial)
    return np.asarray(matrix(dict.fromkeys(matrix.names, 0.0)))


def _check(system: System, dt: float, method: str) -> None:
    if not (np.isfinite(dt) and dt > 0):
        raise BadInput(f"`dt` is {dt}; a positive step in seconds is needed.")
    if method not in METHODS:
        raise BadInput(f"`method` is `{method}` for `{system.name}`.{nearest(method, METHODS)}")
