"""What a guaranteed estimator of a switched or scheduled plant was promised, watched along a drive.

What can be seen on the road is seen without the truth; what only a simulation or a reference sensor knows says so in its
`Assumption.needs_truth`. Three monitors are no assumptions themselves but prove that one is broken, without saying which:
`CONTRADICTIONS` names them. Leave them out before asking `explain` for causes.
"""

from collections.abc import Callable, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from luenberger.core import BadInput
from luenberger.core.checks import finite_array
from luenberger.observers.monitor import Assumption, Drive, box_excess
from luenberger.observers.observer import Estimate
from luenberger.observers.plant import Fixed
from luenberger.observers.set_consistency import (
    SetObserver,
    boxes_apart,
    current_set,
    dwell_start,
    dwell_step,
    factors_at,
    not_finite,
    output_disagreement,
    reading_excess,
    step_disagreement,
)
from luenberger.observers.set_log import SetLog
from luenberger.observers.unknown_input import DecoupledState, UnknownInputObserver
from luenberger.observers.zonotopic_plant import by_mode, factors_of
from luenberger.sets import Interval, Zonotope
from luenberger.systems.switched import Switched
from luenberger.systems.system import System

CONTRADICTIONS = ("outputs agree with the set", "set follows from the one before", "set meets the state bound")
# Excess below this, relative to the size of the bound, is rounding.
_ROUNDING = 1e-12

Add = Callable[..., None]
# (x, u, d, r, unmeasured parameters) at a sample -> x at the next.
NextState = Callable[[jax.Array, jax.Array, jax.Array, jax.Array, dict[str, jax.Array]], jax.Array]


def monitor_sets(
    system: System | Sequence[System] | Switched,
    drive: Drive,
    observer: SetObserver | None = None,
    x0: Any = None,
    *,
    true_input: Any = None,
    frozen: Sequence[float] | None = None,
    next_state: NextState | None = None,
    sampling_bound: Any = None,
) -> tuple[Assumption, ...]:
    """Watch every assumption of a guaranteed estimate that a drive says something of.

    Choose it for a log or a simulated run, with whatever of the truth there is; the one-sample excesses of `set_consistency` are
    for a running estimator. With `explain` it names the cause where a state left its bounds.

    An unknown-input observer with as many outputs as unknown inputs reproduces what it measures, so its outputs contradict
    nothing after the first sample. What is left on the road is `state_bound`, which its set must meet, and from one sample to the
    next a `disturbance_bound`, if the plant has one.

    Args:
        system: the plant with the bounds that were trusted, its modes, or a `Switched`.
        drive: measured and, where known, true signals; r and true_r in the order of `Switched.scheduling_names`. Measured signals
            may hold NaN: that is reported, and such a sample is not judged otherwise. `estimate` and `sectors` are not looked at.
        observer: the estimator, an `UnknownInputObserver` or a `ZonotopicObserver` of the plant; run again here to see its sets.
        x0: what it was started with.
        true_input: true input, shape (nt, nu); left out: from the measured one and the noise.
        frozen: value of the signal that selects the modes, e.g. of the speed, for which the plant of each mode was made; judged by
            `drive.true_r`.
        next_state: true state at the next sample from x, u, d, true scheduling and unmeasured parameters of this one, all held
            over the step; a JAX function. The scheduling holds the value of the mode where `frozen` tells it, so that a signal
            that moves within a mode does not pass for an error of sampling. Of unmeasured parameters it gets those in the drive; where
            one is missing, the plant may have any in its interval.
        sampling_bound: what of an error of sampling the plant covers by other means, shape (nx,); left out: nothing.

    Returns:
        one `Assumption` a bound. On the road: readings and estimate finite, ranges of the scheduling, limits of the modes, dwell,
        and the `CONTRADICTIONS`. With the truth: true scheduling, its mode and what is frozen there, unmeasured parameters,
        noise, errors of the inputs, disturbance, state bound, start and sampling.

    Raises:
        BadInput: signals of the wrong shape, true ones that are not finite, unknown names, an observer without `x0`, y, u or of
            another plant, or `next_state` without the true x, d and input.
    """
    plant = Switched.of(system)
    log = SetLog(plant, drive, true_input)
    found: list[Assumption] = []

    def add(name: str, excess: Any, unit: str = "", scale: float = 0.0, needs_truth: bool = False) -> None:
        # What cannot be judged, next to a reading that is not finite, is not broken.
        judged = np.nan_to_num(np.asarray(excess, float), nan=0.0, posinf=np.inf, neginf=-np.inf)
        found.append(Assumption(name, log.time, judged - _ROUNDING * abs(scale), unit, needs_truth))

    if log.read:
        add("readings finite", jax.vmap(lambda parts: not_finite(*parts))(log.read), "entries")
    _watch_scheduling(log, add)
    at = _frozen(plant, frozen)
    _watch_mode(log, at, add)
    _watch_unknowns(log, add)
    if observer is not None:
        _watch_observer(log, observer, x0, add)
    if next_state is not None:
        bound = np.zeros(plant.first.nx) if sampling_bound is None else finite_array("sampling_bound", sampling_bound)
        if bound.shape != (plant.first.nx,):
            raise BadInput(
                f"`sampling_bound` has shape {bound.shape}; ({plant.first.nx},) is needed, one for each state."
            )
        excess, size = _sampling(log, next_state, at)
        add("sampling", np.max(excess - bound, axis=-1), "", size, True)
    return tuple(found)


def _watch_scheduling(log: SetLog, add: Add) -> None:
    read, true = log.measured["r"], log.true["true_r"]
    for k, name in enumerate(log.plant.first.scheduling_names):
        unit = log.plant.first.units.get(name, "")
        lower, upper, error, *factor = log.trusted(name)
        scale = float(np.abs([lower, upper]).max())
        if read is not None:
            ends = np.stack([f * end for f in factor for end in (lower, upper)])
            add(
                f"range of {name}",
                box_excess(read[:, k], ends.min(axis=0) - error, ends.max(axis=0) + error),
                unit,
                scale,
            )
        if true is not None:
            add(f"range of true {name}", box_excess(true[:, k], lower, upper), unit, scale, True)
        if read is not None and true is not None:
            add(
                f"error of {name}",
                reading_excess(true[:, k], read[:, k], error, (factor[0], factor[1])),
                unit,
                scale,
                True,
            )


def _watch_mode(log: SetLog, frozen: np.ndarray | None, add: Add) -> None:
    plant, read, true, mode = log.plant, log.measured["r"], log.true["true_r"], log.mode
    if len(plant.modes) == 1 or read is None or mode is None:
        return
    ends, k = np.array(plant.ends), plant.scheduling_names.index(plant.signal)
    scale = float(np.abs(ends).max())
    add(f"limits of {plant.signal}", box_excess(read[:, k], ends[0], ends[-1]), plant.unit, scale)
    start = dwell_start(mode[0], plant.dwell)
    early = jax.lax.scan(lambda carry, now: dwell_step(carry, now, plant.dwell), start, jnp.asarray(mode))[1]
    add("dwell", early, "samples")
    if true is None:
        return
    # Outside all limits the nearest mode holds, and the limits are watched above.
    lower, upper = np.array([-np.inf, *ends[1:-1]])[mode], np.array([*ends[1:-1], np.inf])[mode]
    add(f"mode of true {plant.signal}", box_excess(true[:, k], lower, upper), plant.unit, scale, True)
    if frozen is not None:
        add(f"{plant.signal} frozen in its mode", np.abs(true[:, k] - frozen[mode]), plant.unit, scale, True)


def _frozen(plant: Switched, frozen: Sequence[float] | None) -> np.ndarray | None:
    if frozen is None:
        return None
    values = finite_array("frozen", frozen)
    if not plant.signal or plant.signal in plant.first.scheduling_names or values.shape != (len(plant.modes),):
        raise BadInput(
            f"`frozen` is {values.tolist()} for `{plant.name}` with {len(plant.modes)} modes selected by `{plant.signal}`; it takes "
            "one value a mode, of a signal that does not schedule the modes themselves."
        )
    return values


def _watch_unknowns(log: SetLog, add: Add) -> None:
    first, x = log.plant.first, log.true["x"]
    for name, values in log.uncertainty.items():
        lower, upper, *_ = log.trusted(name)
        add(
            f"range of {name}",
            box_excess(values, lower, upper),
            first.units.get(name, ""),
            float(np.abs(upper).max()),
            True,
        )
    d = log.true["disturbance"]
    for k, limit in enumerate(first.disturbance_bound or ()):
        if d is not None:
            add(f"disturbance {k + 1}", np.abs(d[:, k]) - limit, "", limit, True)
    if first.noise_bound is None or log.at is None:
        return
    noise, at = log.true["noise"], log.at
    if noise is not None:
        touched = np.any(np.concatenate([at["G"], at["N"]], axis=1), axis=0)
        names = np.array([*first.outputs, *first.inputs])
        for k, limit in enumerate(first.noise_bound):
            add(f"noise {k + 1} ({', '.join(names[touched[:, k]])})", np.abs(noise[:, k]) - limit, "", limit, True)
        return
    u, y, true = log.measured["u"], log.measured["y"], log.input
    if u is not None and true is not None and np.any(at["N"]):
        _watch_readings(u - true, np.abs(at["N"]) @ first.noise_bound, first.inputs, "error of", first, add)
    if y is not None and x is not None and true is not None:
        shown = np.einsum("kij,kj->ki", at["C"], x) + np.einsum("kij,kj->ki", at["D"], true)
        _watch_readings(y - shown, np.abs(at["G"]) @ first.noise_bound, first.outputs, "noise of", first, add)


def _watch_readings(
    off: np.ndarray, bound: np.ndarray, names: Sequence[str], word: str, first: System, add: Add
) -> None:
    for k, name in enumerate(names):
        # What is off is itself a difference, so its rounding is that of what was read.
        add(f"{word} {name}", np.abs(off[:, k]) - bound[:, k], first.units.get(name, ""), 1.0, True)


def _watch_observer(log: SetLog, observer: SetObserver, x0: Any, add: Add) -> None:
    first = log.plant.first
    y, u = log.measured["y"], log.measured["u"]
    if observer.states != first.states or x0 is None or y is None or u is None or log.r is None:
        raise BadInput(
            f"The observer of {list(observer.states)} is run again on `{log.plant.name}` with states {list(first.states)}; that needs "
            "the same states, `x0`, and u, y and r of the drive."
        )
    start = observer.init(x0)
    found = _rerun(observer, start, *(jnp.asarray(log.measured[n]) for n in ("u", "y", "r")))
    add("estimate finite", found["finite"], "entries")
    add("outputs agree with the set", found["output"])
    if isinstance(observer, UnknownInputObserver):
        add("set follows from the one before", found["step"])
    x, bound = log.true["x"], observer.state_bound
    if bound is not None and np.isfinite(bound).any():
        add("set meets the state bound", found["bound"], "", float(bound[np.isfinite(bound)].max()))
        for k, name in enumerate(first.states):
            if x is not None and np.isfinite(bound[k]):
                unit = first.units.get(name, "")
                add(f"state bound of {name}", np.abs(x[:, k]) - bound[k], unit, float(bound[k]), True)
    if x is not None:
        excess = np.zeros(log.count)
        excess[0] = _start_excess(Zonotope(*_parts(start)), x[0])
        add("state inside at the start", excess, "", float(np.abs(x[0]).max()), True)


@eqx.filter_jit
def _rerun(observer: SetObserver, start: Any, u: jax.Array, y: jax.Array, r: jax.Array) -> dict[str, jax.Array]:
    """Excesses of every sample of a run."""
    bound = None if observer.state_bound is None else jnp.asarray(observer.state_bound)

    def one(state: Any, sample: Any) -> tuple[Any, tuple[Zonotope, dict[str, jax.Array]]]:
        u, y, r = sample
        after, estimate = observer.step(state, u, y, r)
        box = Interval(*_ends(estimate))
        found = {"finite": not_finite(estimate.x, box.lower, box.upper)}
        found["output"] = output_disagreement(observer, state, u, y, r)
        if bound is not None:
            found["bound"] = boxes_apart(box, Interval(-bound, bound))
        return after, (current_set(observer, state, y, r), found)

    _, (sets, found) = jax.lax.scan(one, start, (u, y, r))
    if isinstance(observer, UnknownInputObserver):
        before, now = (jax.tree.map(lambda a, w=which: a[w], sets) for which in (slice(None, -1), slice(1, None)))
        gap = jax.vmap(lambda *pair: step_disagreement(observer, *pair))(before, now, u[:-1], r[:-1])
        found["step"] = jnp.concatenate([jnp.zeros(1), gap])
    return found


def _sampling(log: SetLog, next_state: NextState, frozen: np.ndarray | None) -> tuple[np.ndarray, float]:
    """By how much each true next state leaves what the plant makes of this one, (nt, nx), and the size of the states."""
    plant, first = log.plant, log.plant.first
    x, d = log.true["x"], np.zeros((log.count, 0)) if not first.nd else log.true["disturbance"]
    if x is None or d is None or log.input is None or log.best_r is None or log.mode is None:
        raise BadInput(
            "`next_state` is compared with the plant at the true x, d and input; give them, and r, in the drive."
        )
    r = np.array(log.best_r)
    if frozen is not None:
        r[:, -1] = frozen[log.mode]
    unmeasured = [p.name for p in first.parameters if not p.measured]
    exact = all(p.is_exact or not p.measured for m in plant.modes for p in m.parameters)
    known = set(unmeasured) == set(log.uncertainty) and (exact or log.true["true_r"] is not None)
    # The mode is the one that was measured, whatever the true scheduling within it.
    chosen = np.array(log.best_r)
    if plant.signal and log.r is not None and plant.signal not in first.scheduling_names:
        chosen[:, -1] = log.r[:, -1]
    signals = tuple(jnp.asarray(s) for s in (x, log.input, d, r, chosen))
    q = {n: jnp.asarray(v) for n, v in log.uncertainty.items()}
    off, size = _residual(Fixed((plant, factors_of(plant))), next_state, known, signals, q)
    return np.asarray(off), float(size.max())


@eqx.filter_jit
def _residual(
    held: Fixed[tuple[Switched, Any]], next_state: NextState, known: bool, signals: Any, q: dict[str, jax.Array]
) -> tuple[jax.Array, jax.Array]:
    """How far true next states lie from what the plant makes of x, u, d, and how large they are."""
    plant, factors = held.value

    def one(sample: Any, q: dict[str, Any]) -> tuple[jax.Array, jax.Array]:
        x, u, d, r, chosen = sample

        def at(letter: str) -> jax.Array:
            def value(k: int, s: Any) -> Any:
                mode = plant.modes[k]
                middle = mode.uncertainty | (q if known else {})
                return getattr(mode, letter)(middle | dict(zip(mode.scheduling_names, s, strict=True)))

            return by_mode(plant, chosen, value)

        true = next_state(x, u, d, r, q)
        off = jnp.abs(true - at("A") @ x - at("B") @ u - at("E") @ d)
        if factors is not None and not known:
            directions, rows = factors_at(plant, factors, chosen)
            off = off - jnp.abs(directions) @ jnp.abs(rows @ jnp.concatenate([x, u, d]))
        return off, jnp.max(jnp.abs(true))

    return jax.vmap(one)(signals, q)


def _start_excess(start: Zonotope, x: np.ndarray) -> float:
    """How far x lies outside a start set; inside its box but not inside, in shares of its largest half width."""
    box = start.interval()
    outside = float(jnp.max(box_excess(x, box.lower, box.upper)))
    if outside > 0 or np.count_nonzero(start.generators) <= start.dimension:
        return outside
    depth = start.depth(x)
    return max(outside, (depth - 1.0) * float(box.radius.max())) if depth > 1.0 + 1e-9 else outside


def _parts(state: Any) -> tuple[jax.Array, jax.Array]:
    return (state.prediction if isinstance(state, DecoupledState) else state.center), state.generators


def _ends(estimate: Estimate) -> tuple[jax.Array, jax.Array]:
    assert estimate.lower is not None
    assert estimate.upper is not None
    return estimate.lower, estimate.upper
