"""Guaranteed estimates of discrete plants with bounded disturbance and noise: the error is carried along as a zonotope.

    x+ = A(r) x + B(r) u + E(r) d,  |d| <= disturbance_bound        y = C(r) x + D(r) u + G v,  |v| <= noise_bound

with u measured as u + N v. With a gain L the error e = x - xh of the copy of the plant obeys

    e+ = (A - L C) e + E d - (B N + L (G - D N)) v,

so it stays in a zonotope whose generators are mapped, joined by those of d and v, and reduced to a fixed number. The set is
exact but for that reduction, whatever the gain; the gain only decides how wide it is. What of A, B and E nobody knows adds one
generator for each cause, as long as it can be for the states in the set of that sample, so the width follows the drive. That is
an induction: the state in its set now bounds the push now, hence the state at the next sample.
"""

from abc import abstractmethod
from collections.abc import Callable, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from luenberger.algebra import Polynomial
from luenberger.core import BadInput
from luenberger.core.checks import finite_array
from luenberger.observers.observer import Estimate, Observer
from luenberger.observers.plant import Fixed, sample_time
from luenberger.observers.small_matrix import product, solve_positive, symmetrised
from luenberger.observers.zonotopic_plant import (
    Factors,
    bounded,
    checked_gains,
    factors_of,
    gain_at,
    generator_count,
    matrices,
    pushed,
    require_noise,
)
from luenberger.sets import Interval, Zonotope, girard
from luenberger.systems.switched import Switched
from luenberger.systems.system import System

Reduction = Callable[[jax.Array, int], jax.Array]


class ZonotopicObserver(Observer):
    """What all set-valued observers of a linear, scheduled or switched plant share.

    `Estimate.x` is the center of the set, `lower` and `upper` its box. The state is a `Zonotope` with a fixed number of
    generators, so a run compiles once. Unmeasured parameters, and scheduling measured with error, widen the set by what they
    can do to the states in it.

    Assumes: the initial state lies in the initial set, |d| and |v| within their bounds and the parameters within theirs at every
        sample, whether they stay or move; the mode known; the state within `state_bound` where that is given.

    Args:
        system: discrete plant, linear or scheduled, with `noise_bound`, and `disturbance_bound` where it has an E; or a `Switched`
            plant.
        initial_half_width: half widths of the box around the first guess that holds the initial state, shape (nx,).
        count: generators kept, at least nx; left out: 20, and at least five times nx.
        reduction: `girard` (default), `combastel` or `pca`.
        state_bound: half widths of a box about zero that the state is known never to leave, shape (nx,), infinite where there is
            none. It only bounds what uncertain factors can do; without uncertainty it changes nothing.

    Raises:
        NotAccepted: a continuous plant, a nonlinearity, or outputs or noise that depend on what nobody knows exactly.
        BadInput: missing bounds, half widths that are negative or of the wrong length, or `count` below nx.
    """

    dt: float = eqx.field(static=True)
    plant: Fixed[System | Switched] = eqx.field(static=True)
    factors: Fixed[Factors | None] = eqx.field(static=True)
    initial_half_width: np.ndarray
    state_bound: np.ndarray | None
    count: int = eqx.field(static=True)
    reduction: Reduction = eqx.field(static=True)

    def __init__(
        self,
        system: System | Switched | Sequence[System],
        *,
        initial_half_width: Any,
        count: int | None = None,
        reduction: Reduction = girard,
        state_bound: Any = None,
    ):
        plant = bounded(system)
        first = Switched.of(plant).first
        half = finite_array("initial_half_width", initial_half_width)
        if half.shape != (first.nx,) or (half < 0).any():
            raise BadInput(
                f"`initial_half_width` is {half.tolist()}; {first.nx} numbers >= 0 are needed, one for each state."
            )
        limit = None if state_bound is None else np.asarray(state_bound, dtype=float)
        if limit is not None and (limit.shape != (first.nx,) or not (limit >= 0).all()):
            raise BadInput(
                f"`state_bound` is {limit.tolist()}; {first.nx} numbers >= 0 are needed, one for each state."
            )
        if not callable(reduction):
            raise BadInput(
                f"`reduction` is {reduction!r}; a function is needed: `girard`, `combastel` or `pca` of `luenberger.sets`."
            )
        self.dt = sample_time(first, None)
        self.plant = Fixed(plant)
        self.factors = Fixed(factors_of(plant))
        self.initial_half_width = half
        self.state_bound = limit
        self.count = generator_count(count, first.nx)
        self.reduction = reduction

    @property
    def first(self) -> System:
        """The plant, or its first mode, for all that the modes share."""
        return Switched.of(self.plant.value).first

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the estimated states."""
        return self.first.states

    @property
    def reads(self) -> System | Switched:
        """The plant whose signals it reads."""
        return self.plant.value

    def init(self, x0: Any) -> Zonotope:
        """Return the start set: the first guess with the initial half widths, or a zonotope as given.

        Args:
            x0: first guess, shape (nx,), or a `Zonotope` with at most `count` generators.

        Raises:
            BadInput: wrong dimension, or too many generators.
        """
        nx = self.first.nx
        if not isinstance(x0, Zonotope):
            x = jnp.asarray(x0)
            x0 = Zonotope(x, jnp.diag(jnp.asarray(self.initial_half_width, x.dtype)))
        G = x0.generators
        if x0.center.shape != (nx,) or G.shape[0] != nx or G.shape[1] > self.count:
            raise BadInput(
                f"The start set has a center of shape {x0.center.shape} and generators of shape {G.shape}; ({nx},) and "
                f"({nx}, at most {self.count}) are needed."
            )
        return Zonotope(x0.center, jnp.pad(G, ((0, 0), (0, self.count - G.shape[1]))))

    def step(self, state: Zonotope, u: Any, y: Any, r: Any) -> tuple[Zonotope, Estimate]:
        """Advance by one sample; see `Observer.step`."""
        dtype = state.center.dtype
        plant = self.plant.cast(dtype)
        u, y, r = (jnp.asarray(signal, dtype) for signal in (u, y, r))
        at = matrices(plant, r)
        noise = jnp.asarray(self.first.noise_bound, dtype)
        seen = (at["G"] - product(at["D"], at["N"])) * noise
        innovation = y - product(at["C"], state.center) - product(at["D"], u)
        L, shown = self._gain(state, innovation, at, seen, r)
        box = shown.interval()
        center = product(at["A"], state.center) + product(at["B"], u) + product(L, innovation)
        columns = [
            product(at["A"] - product(L, at["C"]), state.generators),
            at["E"] * jnp.asarray(self.first.disturbance_bound or (), dtype),
            -product(at["B"], at["N"]) * noise - product(L, seen),
        ]
        factors = self.factors.cast(dtype)
        if factors is not None:
            where = self._within(box, state.interval())
            columns.append(pushed(plant, factors, r, where, u, product(jnp.abs(at["N"]), noise)))
        wide = Zonotope(center, jnp.concatenate(columns, axis=1))
        return wide.reduce(self.count, self.reduction), Estimate(shown.center, lower=box.lower, upper=box.upper)

    def _within(self, box: Interval, predicted: Interval) -> Interval:
        """Where the state is at this sample: in both boxes, and in the one that it never leaves."""
        found = box.intersection(predicted)
        if self.state_bound is not None:
            limit = jnp.asarray(self.state_bound, found.lower.dtype)
            found = found.intersection(Interval(-limit, limit))
        # Boxes that do not meet tell of a broken assumption or of rounding; nothing may be concluded from them.
        meets = found.lower <= found.upper
        return Interval(jnp.where(meets, found.lower, box.lower), jnp.where(meets, found.upper, box.upper))

    @abstractmethod
    def _gain(
        self, state: Zonotope, innovation: jax.Array, at: dict[str, jax.Array], seen: jax.Array, r: jax.Array
    ) -> tuple[jax.Array, Zonotope]:
        """Return the gain L of the predictor and the set to report; `seen` holds the generators of the noise in y."""


class ZonotopicLuenberger(ZonotopicObserver):
    """Predictor with a gain that is given; the set at sample k has used y up to t_(k-1).

    Choose it for a gain designed beforehand (CORA's classes Nom-G and Hinf-G are this with their own gains): the arithmetic
    is least, and with few kept generators the closed loop A - L C should be fast.

    Args:
        system: see `ZonotopicObserver`.
        gain: L(r), shape (nx, ny): nested numbers or `Polynomial` in the scheduling parameters; with modes a sequence of them.
        initial_half_width: see `ZonotopicObserver`.
        count: see `ZonotopicObserver`.
        reduction: see `ZonotopicObserver`.
        state_bound: see `ZonotopicObserver`.

    Raises:
        BadInput: gain of the wrong shape or with unknown parameters; see `ZonotopicObserver`.

    Reference: C. Combastel, Zonotopes and Kalman observers, Automatica 55 (2015) 265-273, section 3.
    """

    gain: Polynomial | tuple[Polynomial, ...]

    def __init__(
        self,
        system: System | Switched | Sequence[System],
        gain: Any,
        *,
        initial_half_width: Any,
        count: int | None = None,
        reduction: Reduction = girard,
        state_bound: Any = None,
    ):
        super().__init__(
            system, initial_half_width=initial_half_width, count=count, reduction=reduction, state_bound=state_bound
        )
        self.gain = checked_gains(self.plant.value, gain)

    def _gain(
        self, state: Zonotope, innovation: jax.Array, at: dict[str, jax.Array], seen: jax.Array, r: jax.Array
    ) -> tuple[jax.Array, Zonotope]:
        return gain_at(self.plant.value, self.gain, r), state


class ZonotopicKalmanFilter(ZonotopicObserver):
    """Zonotopic Kalman filter, predictor form: at each sample the gain that makes the next set smallest in Frobenius norm.

    Choose it where a guaranteed box is wanted without a design: the gain follows set and scheduling by itself. The set at
    sample k has used y up to t_(k-1); where y_k may be used too, take `ZonotopicFilter`. CORA calls it FRad-C.

        L = A P C' (C P C' + V V')^-1,   P = G G' of the set carried along, V the generators of the noise in y

    Noise of measured inputs is carried along exactly but does not enter the choice of L.

    Raises:
        NotAccepted: see `ZonotopicObserver`.
        BadInput: see `ZonotopicObserver`; or an output without noise, for which the gain need not exist.

    Reference: C. Combastel, Zonotopes and Kalman observers: gain optimality under distinct uncertainty paradigms and robust
        convergence, Automatica 55 (2015) 265-273, theorem 5.
    """

    def __init__(
        self,
        system: System | Switched | Sequence[System],
        *,
        initial_half_width: Any,
        count: int | None = None,
        reduction: Reduction = girard,
        state_bound: Any = None,
    ):
        super().__init__(
            system, initial_half_width=initial_half_width, count=count, reduction=reduction, state_bound=state_bound
        )
        require_noise(self.plant.value)

    def _gain(
        self, state: Zonotope, innovation: jax.Array, at: dict[str, jax.Array], seen: jax.Array, r: jax.Array
    ) -> tuple[jax.Array, Zonotope]:
        return product(at["A"], _kalman(state.generators, at["C"], seen)), state


class ZonotopicFilter(ZonotopicObserver):
    """The same with the current measurement: the set at sample k has used y_k. CORA calls it FRad-A.

    Choose it wherever the estimate may wait for y_k: the reported set is the predicted one cut by the strip that y_k allows,
    bounded by the zonotope of least Frobenius norm. What is carried along is the set of `ZonotopicKalmanFilter`.

    Raises:
        NotAccepted: see `ZonotopicObserver`.
        BadInput: see `ZonotopicObserver`; or an output without noise, for which the gain need not exist.

    Reference: T. Alamo, J. Bravo, E. Camacho, Guaranteed state estimation by zonotopes, Automatica 41 (2005) 1035-1043,
        section 6 (segment minimisation), with the gain of C. Combastel, Automatica 55 (2015) 265-273.
    """

    def __init__(
        self,
        system: System | Switched | Sequence[System],
        *,
        initial_half_width: Any,
        count: int | None = None,
        reduction: Reduction = girard,
        state_bound: Any = None,
    ):
        super().__init__(
            system, initial_half_width=initial_half_width, count=count, reduction=reduction, state_bound=state_bound
        )
        require_noise(self.plant.value)

    def _gain(
        self, state: Zonotope, innovation: jax.Array, at: dict[str, jax.Array], seen: jax.Array, r: jax.Array
    ) -> tuple[jax.Array, Zonotope]:
        K = _kalman(state.generators, at["C"], seen)
        cut = state.generators - product(K, product(at["C"], state.generators))
        generators = jnp.concatenate([cut, -product(K, seen)], axis=1)
        return product(at["A"], K), Zonotope(state.center + product(K, innovation), generators)


def _kalman(G: jax.Array, C: jax.Array, seen: jax.Array) -> jax.Array:
    """K = P C' (C P C' + V V')^-1 with P = G G'."""
    mapped = product(C, G)
    innovation = symmetrised(product(mapped, mapped.T) + product(seen, seen.T))
    return solve_positive(innovation, product(mapped, G.T)).T
