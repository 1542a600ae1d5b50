"""The step that ships: an observer whose scheduling is held inside the proved domain, with flags that say which assumption broke.

Code, golden vectors and replays of exported observers all run this one function.
"""

from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from luenberger.certify import Certificate
from luenberger.core import BadInput
from luenberger.core.checks import finite_array
from luenberger.export.signals import Signals
from luenberger.observers import Estimate, Observer
from luenberger.observers.gaussian import GaussianFilter
from luenberger.observers.plant import state_vector
from luenberger.systems import Parameter, Switched, System

# Flag -> what it says. Their order is the order of the bits of the status word.
FLAGS = {
    "not_finite": "an input or the result was not finite; the input's last finite value was used, or the state kept",
    "scheduling_range": "a scheduling signal left its proved interval and was clipped",
    "scheduling_rate": "a scheduling signal moved faster than the proved rate",
    "residual": "an output differs from its estimate by more than the stated bound",
    "nonlinearity_domain": "the estimate left the domain on which the nonlinearity was bounded",
    "bounds_crossed": "a lower bound lies above its upper bound: some assumed bound is wrong",
}


class GuardedState(eqx.Module):
    """State of a guarded observer.

    Args:
        observer: state of the observer.
        u: last finite inputs, shape (nu,).
        y: last finite outputs, shape (ny,).
        r: last finite scheduling signals, clipped, shape (nr,).
        started: 0 before the first sample, 1 after.
    """

    observer: Any
    u: jax.Array
    y: jax.Array
    r: jax.Array
    started: jax.Array


class Guarded(eqx.Module):
    """An observer with its assumptions watched, and with inputs that cannot poison its state.

    What is not finite is replaced by the last finite value of that signal (zero, or the middle of its interval, before there was one);
    filters that mask missing outputs get them masked. A step whose result is not finite keeps the state. Finite inputs inside the
    scheduling box pass untouched, so the guarded step is the observer's own.

    Args:
        observer: what runs.
        signals: names and units.
        ranges: (lower, upper) of every scheduling signal, shape (nr, 2).
        rates: largest |change| a second of every scheduling signal, infinite where none was assumed, shape (nr,).
        residual_bound: largest |y - C xh - D u| that noise and proved error explain, shape (ny,); None where nobody knows.
        system: plant that gives C, D and the domain of the nonlinearity; None for filters of functions.
    """

    observer: Observer
    signals: Signals = eqx.field(static=True)
    ranges: tuple[tuple[float, float], ...] = eqx.field(static=True)
    rates: tuple[float, ...] = eqx.field(static=True)
    residual_bound: tuple[float, ...] | None = eqx.field(static=True)
    system: System | None = None

    @staticmethod
    def of(
        observer: Observer,
        system: System | Switched | None = None,
        *,
        signals: Signals | None = None,
        certificate: Certificate | None = None,
        residual_bound: Any = None,
    ) -> "Guarded":
        """Watch an observer of a plant.

        Args:
            observer: what runs.
            system: its plant; None for filters of functions.
            signals: names and units; left out: those of the plant.
            certificate: what was proved; a steady box gives the bound of the residual.
            residual_bound: bound of the residual, shape (ny,), where it is known otherwise.

        Raises:
            BadInput: neither plant nor signals, or a bound of the wrong length.
        """
        if signals is None:
            if system is None:
                raise BadInput("Neither `system` nor `signals` is given; an export needs the names of its signals.")
            signals = Signals.of(system)
        plant = system.first if isinstance(system, Switched) else system
        parameters = [] if plant is None else [p for p in plant.parameters if p.measured]
        ranges = [_readable(p) for p in parameters]
        rates = [np.inf if p.rate is None else float(p.rate) for p in parameters]
        if isinstance(system, Switched) and len(system.scheduling_names) > len(ranges):
            ranges.append((system.ends[0], system.ends[-1]))
            rates.append(np.inf)
        single = None if isinstance(system, Switched) else system
        bound = _residual_bound(single, certificate) if residual_bound is None else residual_bound
        if bound is not None:
            bound = finite_array("residual_bound", bound)
            if bound.shape != (len(signals.outputs),) or (bound < 0).any():
                raise BadInput(f"`residual_bound` is {bound.tolist()}; {len(signals.outputs)} numbers >= 0 are needed.")
        known = None if bound is None else tuple(bound.tolist())
        return Guarded(observer, signals, tuple(ranges), tuple(rates), known, single)

    @property
    def flags(self) -> tuple[str, ...]:
        """Names of the flags that can rise here, in the order of the bits."""
        f = None if self.system is None else self.system.nonlinearity
        can = {
            "not_finite": True,
            "scheduling_range": bool(self.ranges),
            "scheduling_rate": any(np.isfinite(self.rates)),
            "residual": self.residual_bound is not None and self.system is not None,
            "nonlinearity_domain": f is not None and f.domain is not None,
            "bounds_crossed": self._encloses(),
        }
        return tuple(name for name in FLAGS if can[name])

    def init(self, x0: Any) -> GuardedState:
        """Return the start state from a first guess.

        Args:
            x0: first guess, shape (nx,).
        """
        inner = self.observer.init(x0)
        dtype = state_vector(x0, len(self.signals.states)).dtype
        middles = [0.5 * (a + b) for a, b in self.ranges]
        middle = jnp.asarray([*middles, *[0.0] * (len(self.signals.scheduling) - len(middles))], dtype)
        u, y = (jnp.zeros(len(names), dtype) for names in (self.signals.inputs, self.signals.outputs))
        return GuardedState(inner, u, y, middle, jnp.zeros((), dtype))

    def step(self, state: GuardedState, u: Any, y: Any, r: Any) -> tuple[GuardedState, Estimate, dict[str, jax.Array]]:
        """Advance by one sample and say which assumptions it contradicts.

        Args:
            state: from `init` or the step before.
            u: inputs, shape (nu,).
            y: outputs, shape (ny,).
            r: scheduling signals, shape (nr,).
        """
        dtype = state.started.dtype
        u, y, r = (jnp.asarray(signal, dtype) for signal in (u, y, r))
        held = [jnp.where(jnp.isfinite(new), new, old) for new, old in ((u, state.u), (y, state.y), (r, state.r))]
        lost = ~jnp.all(jnp.isfinite(jnp.concatenate([u, y, r])))
        masked = jnp.where(jnp.isfinite(y), y, jnp.nan) if isinstance(self.observer, GaussianFilter) else held[1]
        u, clipped, raised = held[0], held[2], {}
        if self.ranges:
            lower, upper = np.array(self.ranges, dtype).T
            clipped = jnp.clip(held[2], lower, upper)
            raised["scheduling_range"] = jnp.any(clipped != held[2])
            limit = np.array(self.rates, dtype) * self.observer.dt * (1 + 1e-6)
            fast = [jnp.abs(clipped[k] - state.r[k]) > v for k, v in enumerate(limit) if np.isfinite(v)]
            if fast:
                raised["scheduling_rate"] = jnp.any(jnp.stack(fast)) & (state.started > 0)
        inner, estimate = self.observer.step(state.observer, u, masked, clipped)
        shown = [*jax.tree.leaves(inner), estimate.x]
        fine = jnp.all(jnp.stack([jnp.all(jnp.isfinite(leaf)) for leaf in shown]))
        inner = jax.tree.map(lambda new, old: jnp.where(fine, new, old), inner, state.observer)
        raised["not_finite"] = lost | ~fine
        raised |= self._watched(estimate, u, masked, clipped)
        following = GuardedState(inner, u, held[1], clipped, jnp.ones((), dtype))
        return following, estimate, {name: raised[name] for name in self.flags}

    def _watched(self, estimate: Estimate, u: Any, y: Any, r: Any) -> dict[str, jax.Array]:
        raised: dict[str, jax.Array] = {}
        system = self.system
        if system is not None and self.residual_bound is not None:
            expected = system.output(0.0, estimate.x, u, r)
            raised["residual"] = jnp.any(jnp.abs(y - expected) > np.array(self.residual_bound, y.dtype))
        f = None if system is None else system.nonlinearity
        if f is not None and f.domain is not None:
            lower, upper = (np.asarray(end, y.dtype) for end in f.domain)
            raised["nonlinearity_domain"] = jnp.any((estimate.x < lower) | (estimate.x > upper))
        if estimate.lower is not None and estimate.upper is not None:
            raised["bounds_crossed"] = jnp.any(estimate.lower > estimate.upper)
        return raised

    def _encloses(self) -> bool:
        s = self.signals
        shapes = (np.zeros(len(s.inputs)), np.zeros(len(s.outputs)), np.zeros(len(s.scheduling)))
        _, estimate = jax.eval_shape(
            lambda x: self.observer.step(self.observer.init(x), *shapes), np.zeros(len(s.states))
        )
        return estimate.lower is not None and estimate.upper is not None


def _readable(p: Parameter) -> tuple[float, float]:
    """What can be read of a scheduling parameter inside its interval."""
    ends = [end * factor for end in p.interval for factor in p.factor]
    return float(min(ends) - p.error), float(max(ends) + p.error)


def _residual_bound(system: System | None, certificate: Certificate | None) -> Sequence[float] | None:
    """|C| w + |G - D N| vbar from a proved steady box w, or None."""
    if system is None or certificate is None or system.noise_bound is None or not system.is_lti:
        return None
    proved = [p.claim for p in certificate.proofs if p.claim.kind == "steady_box" and p.outcome.value == "proved"]
    if not proved or proved[0].vector is None:
        return None
    at = {k: np.asarray(system.at(k)) for k in "CDGN"}
    noise = np.abs(at["G"] - at["D"] @ at["N"]) @ np.asarray(system.noise_bound)
    return (np.abs(at["C"]) @ np.asarray(proved[0].vector) + noise).tolist()
