"""What a guaranteed estimator can contradict by itself, one sample at a time: sets and readings that do not fit together.

Every function returns an excess, positive where the assumptions behind the sets cannot all hold, in the unit of what is watched.
Rounding is taken off, so zero is never a false alarm. All of it is plain JAX and runs inside a scan beside `Observer.step`.
"""

from typing import Any

import jax
import jax.numpy as jnp

from luenberger.observers.monitor import box_excess
from luenberger.observers.small_matrix import product
from luenberger.observers.uncertainty_bound import factor_bound
from luenberger.observers.unknown_input import DecoupledState, UnknownInputObserver
from luenberger.observers.zonotopic import ZonotopicObserver
from luenberger.observers.zonotopic_plant import Factors, by_mode, factors_of, matrices
from luenberger.sets import Interval, Zonotope
from luenberger.systems.switched import Switched
from luenberger.systems.system import System

SetObserver = UnknownInputObserver | ZonotopicObserver
# Differences below this many roundings of their parts are rounding: sums along a few dozen generators and states.
_ROUNDINGS = 4096.0


def not_finite(*signals: Any) -> jax.Array:
    """Return how many entries of the signals are not finite numbers.

    Args:
        signals: arrays of one sample.
    """
    return sum((jnp.sum(~jnp.isfinite(jnp.asarray(s))).astype(float) for s in signals), jnp.asarray(0.0))


def boxes_apart(box: Interval, other: Interval) -> jax.Array:
    """Return how far two boxes lie apart, the largest over the states; negative where they meet.

    Args:
        box: bounds of shape (..., nx).
        other: bounds of shape (..., nx); infinite where there is none.
    """
    return jnp.max(jnp.maximum(box.lower - other.upper, other.lower - box.upper), axis=-1)


def reading_excess(true: Any, read: Any, error: Any, factor: tuple[Any, Any]) -> jax.Array:
    """Return by how much a reading leaves {scale true + offset}, scale in an interval and |offset| <= error; needs the truth.

    Args:
        true: true value, any shape.
        read: measured value.
        error: largest offset.
        factor: interval of the scale.
    """
    ends = [end * jnp.asarray(true) for end in factor]
    return box_excess(read, jnp.minimum(*ends) - error, jnp.maximum(*ends) + error)


def dwell_start(mode: Any, dwell: int) -> tuple[jax.Array, jax.Array]:
    """Return the first carry of `dwell_step`; the mode is taken to have lasted long enough.

    Args:
        mode: number of the mode at the first sample.
        dwell: least number of samples between two switches.
    """
    return jnp.asarray(mode, int), jnp.asarray(dwell, int)


def dwell_step(carry: tuple[Any, Any], mode: Any, dwell: int) -> tuple[tuple[jax.Array, jax.Array], jax.Array]:
    """Return the next carry, and by how many samples this one switches too early; zero where it does not switch.

    Args:
        carry: mode of the sample before, and how many samples it has lasted, counted up to `dwell`.
        mode: number of the mode at this sample.
        dwell: least number of samples between two switches.
    """
    last, lasted = (jnp.asarray(part, int) for part in carry)
    now = jnp.asarray(mode, int)
    switched = now != last
    excess = jnp.where(switched, jnp.maximum(dwell - lasted, 0), 0).astype(float)
    return (now, jnp.where(switched, 1, jnp.minimum(lasted + 1, dwell))), excess


def current_set(observer: SetObserver, state: Any, y: Any, r: Any) -> Zonotope:
    """Return the zonotope that holds x at this sample: of an unknown-input observer with y used, of a zonotopic one as predicted.

    Args:
        observer: estimator.
        state: its state before the step of this sample.
        y: measured output, shape (ny,).
        r: measured scheduling, shape (nr,).
    """
    if not isinstance(state, DecoupledState):
        return state
    dtype = state.prediction.dtype
    G = matrices(observer.plant.value, jnp.asarray(r, dtype))["G"]
    late = product(state.decoupling, G) * _noise(observer, dtype)
    center = state.prediction - product(state.decoupling, jnp.asarray(y, dtype))
    return Zonotope(center, jnp.concatenate([state.generators, late], axis=1))


def output_disagreement(observer: SetObserver, state: Any, u: Any, y: Any, r: Any) -> jax.Array:
    """Return by how much this output contradicts the set carried along and the noise bound, the largest over the outputs.

        |y - C c - D u| <= |C generators| + |G - D N| noise_bound

    Choose it on the road: an excess proves that an assumption is broken, no excess proves nothing. A zonotopic observer is judged
    by its prediction, before y is used. An unknown-input observer has used y already. With as many unknown inputs as outputs its
    estimate then reproduces y whatever happened, so but for the first sample the excess is zero and says nothing; with more
    outputs than unknown inputs the rest of them is judged.

    Args:
        observer: estimator.
        state: its state before the step of this sample.
        u: measured input, shape (nu,).
        y: measured output, shape (ny,).
        r: measured scheduling, shape (nr,).
    """
    dtype = (state.prediction if isinstance(state, DecoupledState) else state.center).dtype
    u, y, r = (jnp.asarray(signal, dtype) for signal in (u, y, r))
    at = matrices(observer.plant.value, r)
    seen = at["G"] - product(at["D"], at["N"])
    size = jnp.abs(y)
    if isinstance(state, DecoupledState):
        reproduced = product(at["C"], state.decoupling)
        center = state.prediction - product(state.decoupling, y)
        seen = seen + product(reproduced, at["G"])
        size = size + product(jnp.abs(at["C"]), jnp.abs(state.prediction)) + product(jnp.abs(reproduced), jnp.abs(y))
    else:
        center = state.center
    shown = product(at["C"], center) + product(at["D"], u)
    half = jnp.abs(product(at["C"], state.generators)).sum(axis=1) + product(jnp.abs(seen), _noise(observer, dtype))
    size = size + product(jnp.abs(at["C"]), jnp.abs(center)) + product(jnp.abs(at["D"]), jnp.abs(u)) + half
    return jnp.max(jnp.abs(y - shown) - half - _ROUNDINGS * jnp.finfo(dtype).eps * size)


def step_disagreement(observer: UnknownInputObserver, before: Zonotope, now: Zonotope, u: Any, r: Any) -> jax.Array:
    """Return by how much the plant cannot have come from the set of one sample to the set of the next.

    Both sets hold the state as long as all assumptions do, so what the plant makes of the first must meet the second. With a
    `disturbance_bound` that is asked of every state. An unknown input without a bound explains every motion along E, so only P x
    with P E = 0 is asked for; where the estimate reproduces all outputs that cannot fail, and a bound that is generous, but
    a bound, tells more.

    Args:
        observer: estimator.
        before: its `current_set` at sample k.
        now: its `current_set` at sample k + 1.
        u: measured input at k, shape (nu,).
        r: measured scheduling at k, shape (nr,).
    """
    plant, dtype = observer.plant.value, before.center.dtype
    u, r = jnp.asarray(u, dtype), jnp.asarray(r, dtype)
    at, noise, eye = matrices(plant, r), _noise(observer, dtype), jnp.eye(before.center.shape[0], dtype=dtype)
    given = plant.first.disturbance_bound
    bound = jnp.asarray(given or [0.0] * plant.first.nd, dtype)
    decoupling = by_mode(plant, r, lambda k, s: observer.decoupling[k])
    onto = eye + product(decoupling, at["C"]) if given is None and plant.first.nd else eye
    columns = [product(at["A"], before.generators), product(at["B"], at["N"]) * noise, now.generators]
    if given is not None:
        columns.append(at["E"] * bound)
    factors = factors_of(plant)
    if factors is not None:
        directions, rows = factors_at(plant, factors, r)
        where = within_bound(before.interval(), observer.state_bound)
        push = factor_bound(rows, where, u, product(jnp.abs(at["N"]), noise), bound)
        columns.append(directions * push)
    half = jnp.abs(product(onto, jnp.concatenate(columns, axis=1))).sum(axis=1)
    parts = [product(at["A"], before.center), product(at["B"], u), -now.center]
    size = product(jnp.abs(onto), sum((jnp.abs(part) for part in parts), jnp.zeros_like(before.center))) + half
    gap = jnp.abs(product(onto, sum(parts, jnp.zeros_like(before.center))))
    return jnp.max(gap - half - _ROUNDINGS * jnp.finfo(dtype).eps * size)


def factors_at(plant: System | Switched, factors: Factors, r: Any) -> tuple[jax.Array, jax.Array]:
    """Return directions (nx, nk) and rows (nk, nx + nu + nd) of the uncertain factors at a sample.

    Args:
        plant: plant, or plant with modes.
        factors: from `zonotopic_plant.factors_of`.
        r: measured scheduling, with the signal that selects the mode.
    """
    names = Switched.of(plant).first.scheduling_names
    rows = by_mode(plant, r, lambda k, s: factors[k][1](dict(zip(names, s, strict=True))))
    return by_mode(plant, r, lambda k, s: factors[k][0]), rows


def within_bound(box: Interval, state_bound: Any) -> Interval:
    """Return the part of a box inside |x| <= bound, and the box itself where there is none.

    Args:
        box: bounds of shape (nx,).
        state_bound: shape (nx,), infinite where there is no bound, or None.
    """
    if state_bound is None:
        return box
    bound = jnp.asarray(state_bound, box.lower.dtype)
    both = box.intersection(Interval(-bound, bound))
    meets = both.lower <= both.upper
    return Interval(jnp.where(meets, both.lower, box.lower), jnp.where(meets, both.upper, box.upper))


def _noise(observer: SetObserver, dtype: Any) -> jax.Array:
    return jnp.asarray(Switched.of(observer.plant.value).first.noise_bound, dtype)
