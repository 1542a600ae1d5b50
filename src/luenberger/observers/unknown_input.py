"""Guaranteed estimates of switched or scheduled plants whose unknown input is decoupled, not bounded.

In mode i, with the measured input u + N_u v and the uncertain factors |s_k| <= 1 of `systems.Uncertain`,

    x+ = A_i(r) x + B_i(r) u + E_i d + sum_k direction_k s_k row_k(r) [x; u; d],        y = C x + G v,
    xh+ = N xh + K y + P B_i u - H y+,    P = I + H C,    N = P A_i - K C,    P E_i = 0.

The noise v_k acts twice, through H y+ of the step before and through K y of this one. So what is carried along as a zonotope is
not e = x - xh but eb = e - H' G v, with H' of the mode before:

    eb+ = N eb + (N H' G - K G - P B N_u) v + sum_k (P direction_k) s_k row_k [x; u; d],      e = eb + H' G v.

The factors are bounded over the x of this very sample: the estimate, the set of its error, and the box trusted beforehand.
"""

from collections.abc import Callable, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from luenberger.algebra import Polynomial
from luenberger.core import BadInput
from luenberger.core.checks import finite_array, known_keys
from luenberger.observers.correction import checked_gain
from luenberger.observers.observer import Estimate, Observer
from luenberger.observers.plant import Fixed, sample_time, state_vector
from luenberger.observers.small_matrix import product
from luenberger.observers.uncertainty_bound import entry_bound, factor_bound, signal_box, split_entry_bound
from luenberger.observers.unknown_input_plant import (
    ModeAt,
    OpenMode,
    constant_part,
    mode_at,
    one_each,
    require_decoupled,
    require_form,
)
from luenberger.observers.zonotopic_plant import generator_count
from luenberger.sets import Interval, Zonotope, girard
from luenberger.systems.switched import Switched
from luenberger.systems.system import System

UNCERTAINTY = ("structured", "interval", "lemma")


class DecoupledState(eqx.Module):
    """What an unknown-input observer carries from sample to sample.

    Args:
        prediction: the estimate at this sample is prediction - decoupling y, shape (nx,).
        generators: zonotope about zero of the error less what this sample's noise does to it, shape (nx, count).
        decoupling: H of the mode that led here, zero at the start, shape (nx, ny).
    """

    prediction: jax.Array
    generators: jax.Array
    decoupling: jax.Array


class UnknownInputObserver(Observer):
    """Switched or scheduled unknown-input observer with a zonotope around its error.

        xh+ = N xh + K y + P B u - H y+,    P = I + H C,    N = P A - K C,    P E = 0

    Choose it where an unknown input has no useful bound and the outputs feel it one step later, e.g. a side wind on a car whose
    yaw rate is measured. Where a bound on the unknown input is known and small, a zonotopic filter is narrower. Several modes have
    a gain each; one scheduled mode has K(r), and N(r) is formed at run time. `Estimate.x` at sample k has used y_k; `lower` and
    `upper` are the box of the set around it.

    The last three options take parts of the recursion away, for comparison: ("lemma", False, False) is the published recursion
    with its signs mended, the defaults are the narrowest.

    Assumes: the initial state within `initial_half_width` of the first guess; noise within `noise_bound`; unmeasured parameters
        and scheduling errors within their bounds, as fast as they like; |x| <= `state_bound` where that is given; the mode known;
        d arbitrary, or within `disturbance_bound` where E is uncertain.

    Args:
        system: discrete plant, its modes, or a `Switched`; C and E constant within a mode, C the same in all, D = 0, `noise_bound` given.
        gains: K of every mode, each (nx, ny): nested numbers or `Polynomial` in the scheduling parameters. One matrix or polynomial
            is taken for all modes.
        decoupling: H of every mode, each (nx, ny) and constant; one is taken for all modes.
        initial_half_width: half widths of the box around the first guess that holds the initial state, shape (nx,).
        state_bound: |x| <= bound trusted at all times, shape (nx,), infinite where there is none; left out: none.
        count: generators kept; left out: 20, and at least five times nx.
        reduction: `girard` (default), `combastel` or `pca`.
        uncertainty: "structured" keeps the directions of the uncertain factors; "interval" bounds each entry of what they do by an
            interval product, "lemma" by the wider one of `split_entry_bound`.
        reuse_noise: False counts the noise of a sample twice, as if its two effects had nothing in common.
        closed_loop: False bounds the uncertain factors over the whole `state_bound`, not over the set of this sample.

    Raises:
        NotAccepted: a continuous plant, D, a nonlinearity, E or C that vary within a mode, C that differs between modes; see `Uncertain`.
        BadInput: no `noise_bound`, gains or decoupling matrices of wrong number or shape, P E far from zero without a
            `disturbance_bound`, negative widths, `count` below nx, unknown `uncertainty`, closed_loop=False without a finite
            `state_bound`.

    Reference: S. Ifqir, V. Puig, D. Ichalal, N. Ait-Oufroukh, S. Mammar, Set-membership switched observers based on interval
        characterization of the estimation error, IFAC World Congress 2020, equations 8-11 and 31-37. (34) has its bounds
        exchanged and adds (H - K) V to both; (36) leaves out the centre of the uncertainty and the error of the measured input.
    """

    dt: float = eqx.field(static=True)
    plant: Fixed[Switched] = eqx.field(static=True)
    modes: Fixed[tuple[OpenMode, ...]] = eqx.field(static=True)
    gains: tuple[Polynomial, ...]
    decoupling: tuple[np.ndarray, ...]
    initial_half_width: np.ndarray
    state_bound: np.ndarray
    count: int = eqx.field(static=True)
    reduction: Callable[[jax.Array, int], jax.Array] = eqx.field(static=True)
    uncertainty: str = eqx.field(static=True)
    reuse_noise: bool = eqx.field(static=True)
    closed_loop: bool = eqx.field(static=True)

    def __init__(
        self,
        system: System | Sequence[System] | Switched,
        gains: Any,
        decoupling: Any,
        *,
        initial_half_width: Any,
        state_bound: Any = None,
        count: int | None = None,
        reduction: Callable[[jax.Array, int], jax.Array] = girard,
        uncertainty: str = "structured",
        reuse_noise: bool = True,
        closed_loop: bool = True,
    ):
        plant = Switched.of(system)
        for mode in plant.modes:
            require_form(mode, plant.first)
        modes = tuple(OpenMode.of(mode) for mode in plant.modes)
        nx = plant.first.nx
        self.dt = sample_time(plant.first, None)
        self.plant = Fixed(plant)
        self.modes = Fixed(modes)
        self.gains = tuple(
            checked_gain(m, K, "gains") for m, K in zip(plant.modes, one_each("gains", gains, plant), strict=True)
        )
        matrices = zip(plant.modes, one_each("decoupling", decoupling, plant), strict=True)
        self.decoupling = tuple(constant_part("decoupling", checked_gain(m, H, "decoupling")) for m, H in matrices)
        for mode, H in zip(modes, self.decoupling, strict=True):
            require_decoupled(plant.first, mode, H)
        self.initial_half_width = _widths(
            "initial_half_width", finite_array("initial_half_width", initial_half_width), nx
        )
        bound = np.full(nx, np.inf) if state_bound is None else np.asarray(state_bound, dtype=float)
        self.state_bound = _widths("state_bound", bound, nx)
        self.count = generator_count(count, nx)
        known_keys("`uncertainty`", [uncertainty], UNCERTAINTY)
        if not closed_loop and not np.isfinite(self.state_bound).all():
            raise BadInput(
                f"`state_bound` is {self.state_bound.tolist()}; closed_loop=False bounds the uncertainty over that box alone, so give "
                f"{nx} finite numbers."
            )
        self.reduction = reduction
        self.uncertainty = uncertainty
        self.reuse_noise = reuse_noise
        self.closed_loop = closed_loop

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the estimated states."""
        return self.plant.value.first.states

    @property
    def reads(self) -> Switched:
        """The plant whose signals it reads."""
        return self.plant.value

    def init(self, x0: Any) -> DecoupledState:
        """Return the start state: the first guess with the initial half widths, or a zonotope that holds the initial state.

        Args:
            x0: first guess, shape (nx,), or a `Zonotope` with at most `count` generators; float32 makes the run float32.

        Raises:
            BadInput: wrong dimension, or too many generators.
        """
        first = self.plant.value.first
        start = x0.center if isinstance(x0, Zonotope) else x0
        x = state_vector(start, first.nx)
        G = x0.generators if isinstance(x0, Zonotope) else jnp.diag(jnp.asarray(self.initial_half_width, x.dtype))
        if G.shape[0] != first.nx or G.shape[1] > self.count:
            raise BadInput(
                f"The start set has generators of shape {G.shape}; ({first.nx}, at most {self.count}) is needed."
            )
        padded = jnp.pad(jnp.asarray(G, x.dtype), ((0, 0), (0, self.count - G.shape[1])))
        return DecoupledState(x, padded, jnp.zeros((first.nx, first.ny), x.dtype))

    def step(self, state: DecoupledState, u: Any, y: Any, r: Any) -> tuple[DecoupledState, Estimate]:
        """Advance by one sample; see `Observer.step`. r is in the order of `Switched.scheduling_names`."""
        dtype = state.prediction.dtype
        u, y, r = (jnp.asarray(signal, dtype) for signal in (u, y, r))
        modes = self.modes.cast(dtype)
        m, C = mode_at(self.plant.value, modes, self.gains, self.decoupling, r), modes[0].C
        x = state.prediction - product(state.decoupling, y)
        noise = jnp.asarray(self.plant.value.first.noise_bound, dtype)
        late = product(state.decoupling, m.G) * noise
        hull = Zonotope(x, jnp.concatenate([state.generators, late], axis=1)).interval()

        P = jnp.eye(x.shape[0], dtype=dtype) + product(m.H, C)
        N = product(P, m.A) - product(m.K, C)
        generators = jnp.concatenate(
            [
                product(N, state.generators),
                *self._noise(N, P, m, late, noise),
                *self._unknown(P, m, self._used_box(hull), u, noise),
            ],
            axis=1,
        )
        prediction = product(N, x) + product(m.K, y) + product(product(P, m.B), u)
        after = DecoupledState(prediction, self.reduction(generators, self.count), m.H)
        return after, Estimate(x, lower=hull.lower, upper=hull.upper)

    def _used_box(self, hull: Interval) -> Interval:
        """The box over which the uncertain factors are bounded; where the hull misses the trusted box, the hull."""
        bound = jnp.asarray(self.state_bound, hull.lower.dtype)
        if not self.closed_loop:
            return Interval(-bound, bound)
        both = hull.intersection(Interval(-bound, bound))
        missed = both.lower > both.upper
        return Interval(jnp.where(missed, hull.lower, both.lower), jnp.where(missed, hull.upper, both.upper))

    def _noise(self, N: jax.Array, P: jax.Array, m: ModeAt, late: jax.Array, noise: jax.Array) -> list[jax.Array]:
        """Generators of the noise of this sample, as error of this step's y and u and, in `late`, of the step before."""
        carried = product(N, late)
        now = -(product(m.K, m.G) + product(product(P, m.B), m.N)) * noise
        return [carried + now] if self.reuse_noise else [carried, now]

    def _unknown(self, P: jax.Array, m: ModeAt, x: Interval, u: jax.Array, noise: jax.Array) -> list[jax.Array]:
        """Generators of the uncertain factors, and of what of d rounding or a gain that does not decouple lets in."""
        first = self.plant.value.first
        bound = jnp.asarray(first.disturbance_bound or [0.0] * first.nd, u.dtype)
        input_error = product(jnp.abs(m.N), noise)
        let_in = [product(P, m.E) * bound] if first.disturbance_bound is not None else []
        if self.uncertainty == "structured":
            return [product(P, m.directions) * factor_bound(m.rows, x, u, input_error, bound), *let_in]
        entries = entry_bound if self.uncertainty == "interval" else split_entry_bound
        delta = entries(m.directions, m.rows, signal_box(x, u, input_error, bound))
        return [jnp.diag(product(jnp.abs(P), delta)), *let_in]


def _widths(name: str, value: np.ndarray, nx: int) -> np.ndarray:
    if value.shape != (nx,) or not (value >= 0).all():
        raise BadInput(f"`{name}` is {value.tolist()}; {nx} numbers >= 0 are needed, one for each state.")
    return value
