"""The copy of the plant driven by the output error: what most design methods hand out."""

import math
from collections.abc import Callable, Mapping
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from luenberger.algebra import Polynomial
from luenberger.core import BadInput
from luenberger.core.checks import finite_array, nearest
from luenberger.observers.observer import Estimate, Observer
from luenberger.observers.plant import Fixed, sample_time, state_vector
from luenberger.systems.discretize import forcing, largest_norm, runge_kutta, values_on
from luenberger.systems.exponential import HoldOrder, affine_hold, hold_order, product
from luenberger.systems.matrix import MatrixFunction, PlantMatrix
from luenberger.systems.system import System

# A sub-step of half the fastest time constant is well inside the stability region (|h s| < 2.78) and costs an error of
# 3e-4 of the start value over that time constant.
LARGEST_STEP = 0.5
MOST_SUBSTEPS = 50


class CorrectionObserver(Observer):
    """Copy of the plant plus gain times output error.

        dxh = A(r) xh + B(r) u + F(r) f(H xh, u) + L(r) (y - C(r) xh - D(r) u)          (xh+ for a discrete plant)

    Choose it to run any fixed or scheduled gain. The estimate reported at sample k is the state predicted for t_k: it has
    used y up to t_(k-1), since over the step from t_k the samples u_k, y_k, r_k are held.

    A continuous plant is advanced over the step by "rk4" with `substeps` parts, or by "exact", the exponential of the
    linear closed loop A(r) - L(r) C(r) evaluated in plain operations; "exact" is meant for fast gains, where Runge-Kutta
    would need many parts, and holds f(H xh, u) at its value at the sample (exponential Euler, first order in f).
    Unmeasured parameters sit at their midpoints. Sub-steps and the order of the exponential are chosen for the gain given
    here and the declared scheduling box; r far outside it, or a much larger gain put in later, needs a new observer.

    Args:
        system: plant, continuous or discrete.
        gain: L(r), shape (nx, ny): nested numbers or `Polynomial` in the scheduling parameters.
        dt: sample time [s]; needed for a continuous plant, that of the plant for a discrete one.
        method: "rk4" or "exact"; a discrete plant uses its own map.
        substeps: parts of the step under "rk4"; None asks `substeps_needed`.
        clip_scheduling: clip r into the declared box before use.

    Raises:
        BadInput: gain of the wrong shape or with unknown parameters, dt missing or wrong, unknown method, or a closed
            loop too fast for Runge-Kutta at this sample time.
    """

    gain: Polynomial
    dt: float = eqx.field(static=True)
    plant: Fixed[System] = eqx.field(static=True)
    method: str = eqx.field(static=True)
    substeps: int = eqx.field(static=True)
    order: HoldOrder = eqx.field(static=True)
    clip_scheduling: bool = eqx.field(static=True)

    def __init__(
        self,
        system: System,
        gain: Any,
        dt: float | None = None,
        *,
        method: str = "rk4",
        substeps: int | None = None,
        clip_scheduling: bool = False,
    ):
        self.dt = sample_time(system, dt)
        if method not in ("rk4", "exact"):
            raise BadInput(f"`method` is `{method}`.{nearest(method, ['rk4', 'exact'])}")
        if substeps is not None and substeps < 1:
            raise BadInput(f"`substeps` is {substeps}; at least one sub-step is needed.")
        system = system.freeze(**system.uncertainty)
        self.gain = checked_gain(system, gain)
        self.plant = Fixed(system)
        self.method = "map" if system.dt is not None else method
        self.substeps, self.order = 1, HoldOrder(0, 0)
        self.clip_scheduling = clip_scheduling
        if self.method == "rk4":
            self.substeps = _affordable(system, self.gain, self.dt, self._fed) if substeps is None else substeps
        elif self.method == "exact":
            loop = closed_loop(system, self.gain)
            self.order = hold_order(self.dt * largest_norm(loop, system.scheduling_box))

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the estimated states."""
        return self.plant.value.states

    @property
    def reads(self) -> System:
        """The plant whose signals it reads."""
        return self.plant.value

    @property
    def _fed(self) -> Polynomial | None:
        """Gain of the output error in the argument of f, or None where f is taken at the estimate."""
        return None

    def init(self, x0: Any) -> jax.Array:
        """Return the start state: the first guess itself.

        Args:
            x0: first guess, shape (nx,); float32 here makes the whole run float32.
        """
        return state_vector(x0, self.plant.value.nx)

    def step(self, state: Any, u: Any, y: Any, r: Any) -> tuple[jax.Array, Estimate]:
        """Advance by one sample; see `Observer.step`."""
        plant = self.plant.cast(state.dtype)
        u, y, r = (jnp.asarray(signal, state.dtype) for signal in (u, y, r))
        if self.clip_scheduling and plant.nr:
            lower, upper = np.array(list(plant.scheduling_box.values()), state.dtype).T
            r = jnp.clip(r, lower, upper)
        values = {name: r[k] for k, name in enumerate(plant.scheduling_names)}
        L = _at(self.gain, values, state.dtype)
        L2 = None if self._fed is None else _at(self._fed, values, state.dtype)
        A, C = plant.at("A", r), plant.at("C", r)
        if plant.nu:
            y = y - product(plant.at("D", r), u)

        def rest(x: Any) -> jax.Array:
            return forcing(plant, x if L2 is None else x + product(L2, y - product(C, x)), u, r)

        def slope(x: Any) -> jax.Array:
            return product(A, x) + rest(x) + product(L, y - product(C, x))

        x = state
        if self.method == "map":
            x = slope(x)
        elif self.method == "exact":
            x = affine_hold(A - product(L, C), rest(x) + product(L, y), x, self.dt, self.order)
        else:
            for _ in range(self.substeps):
                x = runge_kutta(slope, x, self.dt / self.substeps)
        return x, Estimate(state)


def substeps_needed(
    system: System, gain: Any, dt: float, limit: float = LARGEST_STEP, argument_gain: Any = None
) -> int:
    """Return the smallest number of Runge-Kutta parts with |h s| <= limit for every closed-loop eigenvalue s met.

    The eigenvalues of A(r) - L(r) C(r) + F(r) J H (I - L2(r) C(r)) are taken at the ends and the middle of every scheduling
    interval, with the Jacobian J at the lower end, the middle and the upper end of its box, or at the vertices of its hull;
    a Lipschitz bound adds its norm instead. That is a rule for choosing a step, not a proof.

    Args:
        system: continuous plant.
        gain: L(r), shape (nx, ny).
        dt: sample time [s].
        limit: largest |h s|; RK4 is stable on the real axis up to 2.78 and on the imaginary axis up to 2.82.
        argument_gain: L2(r), shape (nx, ny), of an observer with two degrees of freedom; None for zero.

    Raises:
        BadInput: gain of the wrong shape or with unknown parameters.
    """
    system = system.freeze(**system.uncertainty)
    fed = None if argument_gain is None else checked_gain(system, argument_gain, "argument_gain")
    fastest, margin = _fastest(system, checked_gain(system, gain), fed)
    return max(1, math.ceil(dt * (fastest + margin) / limit * (1 - 1e-12)))


def closed_loop(system: System, gain: Polynomial) -> PlantMatrix:
    """Return A(r) - L(r) C(r).

    Args:
        system: plant without unmeasured parameters.
        gain: L(r), shape (nx, ny).
    """
    return _combined(lambda A, L, C: A - L @ C, (system.nx, system.nx), system.A, gain, system.C)


def checked_gain(system: System, gain: Any, name: str = "gain") -> Polynomial:
    """Return a gain as a polynomial with finite coefficients of shape (nx, ny) in the scheduling parameters.

    Args:
        system: plant.
        gain: nested numbers or `Polynomial`.
        name: what the gain is called in messages.

    Raises:
        BadInput: wrong shape, entries that are not finite, or parameters that the plant does not measure.
    """
    L = gain.map(lambda c: finite_array(name, c)) if isinstance(gain, Polynomial) else finite_array(name, gain)
    if tuple(L.shape) != (system.nx, system.ny):
        raise BadInput(
            f"`{name}` has shape {tuple(L.shape)} but `{system.name}` has {system.nx} states and {system.ny} outputs; "
            f"`{name}` needs shape ({system.nx}, {system.ny})."
        )
    L = Polynomial.constant(L)
    if unknown := [n for n in L.names if n not in system.scheduling_names]:
        raise BadInput(
            f"`{name}` depends on {unknown}, which `{system.name}` does not measure; it may depend on {list(system.scheduling_names)}."
        )
    return L


def _at(gain: Polynomial, values: Mapping[str, Any], dtype: Any) -> jax.Array:
    return jnp.asarray(gain.map(lambda c: jnp.asarray(c, dtype))(values))


def _fastest(system: System, gain: Polynomial, fed: Polynomial | None) -> tuple[float, float]:
    """Largest closed-loop |eigenvalue| [1/s] over the box, and what a Lipschitz nonlinearity may add to it."""
    loop, f, margin, nx = closed_loop(system, gain), system.nonlinearity, 0.0, system.nx
    loops: list[PlantMatrix] = [loop]
    if f is not None:
        # What of the error reaches the argument of f: H (I - L2 C).
        seen: PlantMatrix = Polynomial.constant(np.asarray(f.H))
        if fed is not None:
            seen = _combined(lambda H, L2, C: H - H @ L2 @ C, seen.shape, seen, fed, system.C)
        if f.jacobian_lower is not None and f.jacobian_upper is not None:
            ends = (f.jacobian_lower, 0.5 * (f.jacobian_lower + f.jacobian_upper), f.jacobian_upper)
            slopes = ends if f.jacobian_vertices is None else tuple(f.jacobian_vertices)
            loops = [_combined(lambda M, F, S, J=J: M + F @ J @ S, (nx, nx), loop, system.F, seen) for J in slopes]
        else:
            box = system.scheduling_box
            margin = f.lipschitz_bound * largest_norm(seen, box) * largest_norm(system.F, box)
    values = [M for loop in loops for M in values_on(loop, system.scheduling_box, 3)]
    return max(float(np.abs(np.linalg.eigvals(M)).max()) for M in values), margin


def _combined(function: Callable[..., Any], shape: tuple[int, int], *matrices: PlantMatrix) -> PlantMatrix:
    """Apply matrix algebra to polynomials where all are, else to the values of functions on the domain."""
    if all(isinstance(m, Polynomial) for m in matrices):
        return function(*matrices)
    names = tuple(dict.fromkeys(name for m in matrices for name in m.names))
    return MatrixFunction(lambda values: function(*(jnp.asarray(m(values)) for m in matrices)), names, shape)


def _affordable(system: System, gain: Polynomial, dt: float, fed: Polynomial | None) -> int:
    count = substeps_needed(system, gain, dt, argument_gain=fed)
    if count > MOST_SUBSTEPS:
        raise BadInput(
            f"The fastest closed-loop mode, {count * LARGEST_STEP / dt:.3g} 1/s, needs {count} Runge-Kutta sub-steps in dt = {dt:g} s; "
            f'at most {MOST_SUBSTEPS} are taken. Use method="exact", a smaller `dt` or a slower gain, or set `substeps` yourself.'
        )
    return count
