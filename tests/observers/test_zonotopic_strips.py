"""Strip filters: sets hold every admissible run, one strip after another equals one gain, and what is left out is noticed."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from luenberger.algebra import Polynomial
from luenberger.core import BadInput, NotAccepted
from luenberger.observers.observer import Estimate
from luenberger.observers.zonotopic import ZonotopicFilter
from luenberger.observers.zonotopic_strips import ZonotopicStripFilter, together
from luenberger.sets import Zonotope
from luenberger.systems import Parameter, System

K = np.array([[0.5, 0.1], [0.2, 0.4]])
OPTIONS: dict[str, Any] = {"initial_half_width": [1.0, 2.0], "count": 12}


def plant(**changes: Any) -> System:
    """Two states, scheduled, two outputs that share a noise, and a measured input with noise of its own and theirs."""
    options: dict[str, Any] = {
        "E": [[0.0], [1.0]],
        "G": [[1.0, 0.3, 0.0], [0.2, -1.0, 0.0]],
        "N": [[0.2, 0.0, 1.0]],
        "parameters": [Parameter("p", -1.0, 1.0)],
        "dt": 0.1,
        "disturbance_bound": [0.05],
        "noise_bound": [0.1, 0.1, 0.02],
    }
    slope = {"p": np.array([[0.0, 0.2], [0.0, 0.0]])} if (options | changes)["parameters"] else {}
    A = Polynomial.affine(np.array([[0.9, -0.3], [0.3, 0.8]]), **slope)
    return System.build(A, [[1.0], [0.5]], [[1.0, 0.0], [0.5, 1.0]], [[0.2], [0.0]], **(options | changes))


def driven(system: System, steps: int, seed: int, vertices: bool) -> tuple[np.ndarray, ...]:
    """States, measured inputs, outputs and scheduling of a run within the bounds."""
    generator = np.random.default_rng(seed)

    def unit(size: int) -> np.ndarray:
        draw = generator.uniform(-1, 1, size)
        return np.sign(draw) if vertices else draw

    x, rows = unit(2) * [1.0, 2.0], []
    matrices = [system.polynomial(k) for k in "ABCDEGN"]
    for _ in range(steps):
        p, d, v = generator.uniform(-1, 1, 1), unit(1) * system.disturbance_bound, unit(3) * system.noise_bound
        A, B, C, D, E, G, N = (m({n: float(p[0]) for n in m.names}) for m in matrices)
        true = generator.normal(size=1)
        rows.append((x, true + N @ v, C @ x + D @ true + G @ v, p))
        x = A @ x + B @ true + E @ d
    return tuple(np.array(column) for column in zip(*rows, strict=True))


@eqx.filter_jit
def run(observer: ZonotopicStripFilter, u: Any, y: Any, r: Any) -> Estimate:
    def advance(state: Zonotope, now: Any) -> tuple[Zonotope, Estimate]:
        return observer.step(state, *now)

    return jax.lax.scan(advance, observer.init(jnp.zeros(2)), (u, y, r))[1]


def outside(observer: ZonotopicStripFilter, system: System, vertices: bool) -> float:
    """How far any state of ten runs of `system` leaves its box."""
    x, u, y, r = (np.stack(part) for part in zip(*(driven(system, 200, k, vertices) for k in range(10)), strict=True))
    box = eqx.filter_vmap(run, in_axes=(None, 0, 0, 0))(observer, u, y, r)
    return float(np.maximum(np.asarray(box.lower) - x, x - np.asarray(box.upper)).max())


@pytest.mark.parametrize("strips", ["together", "one by one"])
@pytest.mark.parametrize("vertices", [False, True])
def test_the_state_never_leaves_its_box(strips: Any, vertices: bool) -> None:
    # Rounding of the sums is the only slack.
    assert outside(ZonotopicStripFilter(plant(), K, strips=strips, **OPTIONS), plant(), vertices) <= 1e-12


def worst_vertices(system: System, steps: int, side: int, state: int) -> float:
    """How far the last error gets when every sample pushes it one way, from an exact start."""
    A, B, C, D, E, G, N = (np.asarray(system.at(k)) for k in "ABCDEGN")
    bound_d, bound_v = np.array([0.05]), np.array([0.1, 0.1, 0.02])
    cut = np.eye(2) - K @ C
    seen, late = (G - D @ N), A @ cut
    # e after the cut at step k = (I - K C) e_k - K seen v_k, with e_(k+1) = A cut e_k + E d - (B N + A K seen) v.
    x, c, row = np.zeros(2), np.zeros(2), side * np.eye(2)[state]
    weights = [row @ cut @ np.linalg.matrix_power(late, steps - 1 - k) for k in range(steps)]
    for weight in weights:
        v = bound_v * np.sign(-weight @ (B @ N + A @ K @ seen))
        y, u = C @ x + G @ v, N @ v
        c = A @ (c + K @ (y - C @ c - D @ u)) + B @ u
        x = A @ x + E @ (bound_d * np.sign(weight @ E))
    v = bound_v * np.sign(-row @ K @ seen)
    return float(row @ (x - c - K @ (C @ x + G @ v - C @ c - D @ N @ v)))


@pytest.mark.parametrize("state", [0, 1])
@pytest.mark.parametrize("side", [-1, 1])
def test_the_worst_vertices_reach_the_box_and_do_not_pass_it(state: int, side: int) -> None:
    system = plant(parameters=[])
    observer = ZonotopicStripFilter(system, K, initial_half_width=[0.0, 0.0], count=200)
    zero = np.zeros((31, 0))
    box = run(observer, np.zeros((31, 1)), np.zeros((31, 2)), zero)
    half = 0.5 * float(np.asarray(box.upper - box.lower)[-1, state])  # type: ignore[operator]
    # Two hundred generators hold thirty steps without reduction, so the set is exact: its face is met, not passed.
    assert worst_vertices(system, 30, side, state) == pytest.approx(half, rel=1e-12)


@pytest.mark.parametrize("spoil", ["noise_bound", "disturbance_bound"])
def test_a_bound_stated_too_small_is_broken_somewhere(spoil: str) -> None:
    small = plant(**{spoil: [0.3 * b for b in getattr(plant(), spoil)]})
    assert outside(ZonotopicStripFilter(small, K, **OPTIONS), plant(), True) > 1e-3


def test_a_dropped_generator_or_bounds_that_change_places_are_noticed() -> None:
    for wrong in ({"E": None, "disturbance_bound": None}, {"noise_bound": [0.02, 0.1, 0.1]}, {"N": None}):
        observer = ZonotopicStripFilter(plant(**wrong), K, **OPTIONS)
        assert outside(observer, plant(), True) > 1e-3, wrong


def test_one_strip_after_another_is_one_gain() -> None:
    C = np.array([[1.0, 0.0], [0.5, 1.0]])
    joined = np.asarray(together(K, C))
    steps = (np.eye(2) - K[:, 1:] @ C[1:]) @ (np.eye(2) - K[:, :1] @ C[:1])
    np.testing.assert_allclose(np.eye(2) - joined @ C, steps, atol=1e-15)
    # Order counts: the first strip sees everything, the last what is left.
    np.testing.assert_allclose(joined[:, 1], K[:, 1], atol=1e-15)
    _, u, y, r = driven(plant(), 50, 0, False)
    one = run(ZonotopicStripFilter(plant(), K, strips="one by one", **OPTIONS), u, y, r)
    two = run(ZonotopicStripFilter(plant(), joined, **OPTIONS), u, y, r)
    np.testing.assert_allclose(one.upper, two.upper, rtol=1e-12)  # type: ignore[arg-type]
    assert np.abs(np.asarray(one.upper) - run(ZonotopicStripFilter(plant(), K, **OPTIONS), u, y, r).upper).max() > 1e-3  # type: ignore[operator]


def test_with_the_gain_of_the_adaptive_filter_it_is_that_filter() -> None:
    # One step from one set: the segment-minimising gain, given, makes the same box.
    system = plant()
    G0 = np.diag([1.0, 2.0])
    C, D, G, N = (np.asarray(system.at(k, [0.0])) for k in "CDGN")
    seen = (G - D @ N) * [0.1, 0.1, 0.02]
    M = C @ G0
    gain = np.linalg.solve(M @ M.T + seen @ seen.T, M @ G0.T).T
    u, y, r = np.ones(1), np.ones(2), np.zeros(1)
    found = [
        o.step(o.init(jnp.zeros(2)), u, y, r)
        for o in (ZonotopicStripFilter(system, gain, **OPTIONS), ZonotopicFilter(system, **OPTIONS))
    ]
    np.testing.assert_allclose(found[0][1].upper, found[1][1].upper, rtol=1e-12)  # type: ignore[arg-type]
    np.testing.assert_allclose(found[0][0].generators, found[1][0].generators, atol=1e-12)


def test_the_gain_may_follow_the_scheduling_and_runs_in_float32() -> None:
    scheduled = Polynomial.affine(K, p=0.1 * K)
    observer = ZonotopicStripFilter(plant(), scheduled, **OPTIONS)
    assert outside(observer, plant(), True) <= 1e-12
    state, seen = observer.step(observer.init(jnp.zeros(2, jnp.float32)), np.zeros(1), np.zeros(2), np.zeros(1))
    assert state.generators.dtype == jnp.float32
    assert seen.x.dtype == jnp.float32


def test_options_that_do_not_fit_are_refused() -> None:
    with pytest.raises(BadInput, match=r"`strips` is"):
        ZonotopicStripFilter(plant(), K, strips="two", **OPTIONS)  # type: ignore[arg-type]
    with pytest.raises(BadInput):
        ZonotopicStripFilter(plant(), K[:, :1], **OPTIONS)
    with pytest.raises(NotAccepted, match="continuous"):
        ZonotopicStripFilter(plant(dt=None), K, **OPTIONS)
