"""Zonotopic observers of plants that are not known exactly: sets hold every admissible run, and do so tightly."""

from itertools import product as choices
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from luenberger.algebra import Polynomial
from luenberger.core import BadInput, NotAccepted
from luenberger.observers.observer import Estimate
from luenberger.observers.zonotopic import (
    ZonotopicFilter,
    ZonotopicKalmanFilter,
    ZonotopicLuenberger,
    ZonotopicObserver,
)
from luenberger.observers.zonotopic_strips import ZonotopicStripFilter
from luenberger.sets import Zonotope
from luenberger.systems import Parameter, System

L = [[0.5], [0.2]]
OPTIONS: dict[str, Any] = {"initial_half_width": [0.5, 0.5], "count": 12}
RUNS, STEPS = 18, 80
DRIVES = ("random", "constant", "vertices")


def uncertain(width: float = 0.1, error: float = 0.05, **changes: Any) -> System:
    """Two states; a in A and B, e in E, both unmeasured; p measured with error; input measured with noise."""
    A = Polynomial(
        ("a", "p"),
        {
            (0, 0): np.array([[0.8, -0.3], [0.3, 0.7]]),
            (1, 0): np.array([[0.0, 1.0], [0.0, 0.5]]),
            (0, 1): np.array([[0.0, 0.2], [0.0, 0.0]]),
            (1, 1): np.array([[0.0, 0.0], [0.3, 0.0]]),
        },
    )
    options: dict[str, Any] = {
        "E": Polynomial.affine(np.array([[0.0], [1.0]]), e=np.array([[1.0], [0.0]])),
        "G": [[1.0, 0.0]],
        "N": [[0.0, 1.0]],
        "parameters": [
            Parameter("a", -width, width, measured=False),
            Parameter("p", -1.0, 1.0, error=error),
            Parameter("e", 0.0, 5 * width, measured=False),
        ],
        "dt": 0.1,
        "disturbance_bound": [0.05],
        "noise_bound": [0.05, 0.02],
    }
    return System.build(
        A, Polynomial.affine(np.array([[1.0], [0.5]]), a=np.array([[1.0], [0.5]])), [[1.0, 0.0]], **(options | changes)
    )


def observers(plant: System, **options: Any) -> list[ZonotopicObserver]:
    every = OPTIONS | options
    return [
        ZonotopicLuenberger(plant, L, **every),
        ZonotopicKalmanFilter(plant, **every),
        ZonotopicFilter(plant, **every),
        ZonotopicStripFilter(plant, [[0.6], [0.2]], **every),
    ]


def driven(plant: System, kind: str) -> tuple[jax.Array, ...]:
    """States, measured inputs, outputs and measured scheduling of `RUNS` runs within the bounds."""
    draw = np.random.default_rng(DRIVES.index(kind)).uniform(-1, 1, (RUNS, STEPS, 7))
    if kind == "constant":
        draw[:] = np.sign(draw[:, :1])
    elif kind == "vertices":
        draw = np.sign(draw)
    low, high = (np.array([p.interval[k] for p in plant.parameters]) for k in (0, 1))
    start = np.random.default_rng(9).uniform(-0.5, 0.5, (RUNS, 2))
    swing = np.sin(0.3 * np.arange(STEPS))

    def one(x: jax.Array, now: Any) -> tuple[jax.Array, Any]:
        s, u = now
        unknown = 0.5 * (low + high) + 0.5 * (high - low) * jnp.array([s[0], u, s[1]])
        values: dict[str, Any] = dict(zip(("a", "p", "e"), unknown, strict=True))
        A, B, C, E, G, N = (m({n: values[n] for n in m.names}) for m in (plant.polynomial(k) for k in "ABCEGN"))
        d, v = s[2:3] * np.array(plant.disturbance_bound), s[3:5] * np.array(plant.noise_bound)
        true = jnp.array([u + 0.5])
        measured = values["p"] + s[5] * plant.parameters[1].error
        return A @ x + B @ true + E @ d, (x, true + N @ v, C @ x + G @ v, measured[None])

    def whole(x0: jax.Array, s: jax.Array) -> Any:
        return jax.lax.scan(one, x0, (s, swing))[1]

    return jax.jit(jax.vmap(whole))(start, draw)


@eqx.filter_jit
def stepped(observer: ZonotopicObserver, start: Any, u: Any, y: Any, r: Any) -> tuple[Zonotope, Estimate]:
    return observer.step(observer.init(start), u, y, r)


@eqx.filter_jit
def run(observer: ZonotopicObserver, u: Any, y: Any, r: Any) -> Estimate:
    def advance(state: Zonotope, now: Any) -> tuple[Zonotope, Estimate]:
        return observer.step(state, *now)

    return jax.lax.scan(advance, observer.init(jnp.zeros(2)), (u, y, r))[1]


def outside(observer: ZonotopicObserver, plant: System, kind: str) -> np.ndarray:
    """How far each run of `plant` leaves its box, (RUNS,)."""
    x, u, y, r = driven(plant, kind)
    box = eqx.filter_vmap(run, in_axes=(None, 0, 0, 0))(observer, u, y, r)
    return np.maximum(np.asarray(box.lower) - x, x - np.asarray(box.upper)).max(axis=(1, 2))


@pytest.mark.parametrize("which", range(4))
def test_the_state_never_leaves_its_box(which: int) -> None:
    # 54 runs; rounding of the sums is the only slack.
    plant = uncertain()
    for kind in DRIVES:
        assert np.all(outside(observers(plant)[which], plant, kind) <= 1e-12), kind


@pytest.mark.parametrize(
    "understated",
    [
        {"width": 0.05},
        {"error": 0.0},
        {"N": [[0.0, 0.0]]},
        {"disturbance_bound": [0.015]},
    ],
)
def test_what_is_stated_too_small_is_broken_somewhere(understated: dict[str, Any]) -> None:
    observer = ZonotopicLuenberger(uncertain(**understated), L, **OPTIONS)
    assert outside(observer, uncertain(), "constant").max() > 1e-3


def pushed_one_way(plant: System, gain: np.ndarray, row: np.ndarray, steps: int) -> tuple[np.ndarray, ...]:
    """A run whose unknowns all push row' (x - estimate) of the last sample one way, and its signals."""
    C = np.array([[1.0, 0.0]])
    loop = np.asarray(plant.at("A", [0.0])) - gain @ C
    x, center, rows = np.zeros(2), np.zeros(2), []
    at = {k: plant.polynomial(k) for k in "ABE"}
    for k in range(steps):
        weight = row @ np.linalg.matrix_power(loop, max(steps - 2 - k, 0))
        v = np.array([0.05, 0.02]) * np.sign(-weight @ np.hstack([gain, np.array([[1.0], [0.5]])]))
        true = np.array([1.0])
        ends = {}
        for a, e, d in choices((-0.02, 0.02), (0.0, 0.1), (-0.05, 0.05)):
            A, B, E = (m({n: {"a": a, "p": 0.0, "e": e}[n] for n in m.names}) for m in at.values())
            after = A @ x + B @ true + E @ [d]
            ends[float(weight @ after)] = after
        y, u = C @ x + v[:1], true + v[1:]
        rows.append((x, u, y, np.zeros(1)))
        center = np.asarray(plant.dynamics(0.0, center, u, [0.0])) + gain @ (y - C @ center)
        x = ends[max(ends)]
    return tuple(np.array(column) for column in zip(*rows, strict=True))


@pytest.mark.parametrize("state", [0, 1])
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_the_worst_run_nearly_reaches_the_box(state: int, side: float) -> None:
    plant = uncertain(width=0.02, error=0.0)
    observer = ZonotopicLuenberger(plant, L, initial_half_width=[0.0, 0.0], count=60)
    x, u, y, r = pushed_one_way(plant, np.array(L), side * np.eye(2)[state], 25)
    box = run(observer, u, y, r)
    low, high = (float(np.asarray(b)[-1, state]) for b in (box.lower, box.upper))
    depth = side * (x[-1, state] - 0.5 * (low + high)) / (0.5 * (high - low))
    # Each factor takes its largest value over the whole box of the state, which no single run sees at every sample.
    assert 0.9 < depth <= 1.0


def test_a_plant_known_exactly_has_no_factors_and_keeps_its_arrays() -> None:
    plain = uncertain(error=0.0).freeze(a=0.0, e=0.0)
    still = uncertain(width=0.0, error=0.0)
    _, u, y, r = (s[0] for s in driven(uncertain(), "random"))
    found = [ZonotopicFilter(p, **OPTIONS) for p in (plain, still)]
    assert all(o.factors.value is None for o in found)
    bounded = ZonotopicFilter(plain, state_bound=[0.1, 0.1], **OPTIONS)
    boxes = [np.asarray(run(o, u, y, r).upper) for o in (*found, bounded)]
    np.testing.assert_array_equal(boxes[0], boxes[1])
    np.testing.assert_array_equal(boxes[0], boxes[2])


def test_what_is_known_of_e_at_run_time_is_no_factor() -> None:
    # E = p is read at run time, so d enters once, whatever else is uncertain.
    E = Polynomial.affine(np.zeros((2, 1)), p=np.array([[1.0], [0.0]]))
    parameters = [Parameter("a", -0.1, 0.1, measured=False), Parameter("p", -1.0, 1.0)]
    widths = []
    for bound in (0.0, 5.0):
        plant = uncertain(E=E, parameters=parameters, disturbance_bound=[bound])
        observer = ZonotopicLuenberger(plant, L, **OPTIONS)
        after = stepped(observer, jnp.zeros(2), np.zeros(1), np.zeros(1), np.full(1, 0.5))[0]
        widths.append(np.asarray(after.interval().radius))
    np.testing.assert_allclose(widths[1] - widths[0], [0.5 * 5.0, 0.0], atol=1e-13)


def test_factors_act_on_the_true_input() -> None:
    # Measured 1.0 to 0.02 may be 1.02: what a does to B is as if 1.02 were measured exactly; B N v comes on top.
    still, start = np.zeros(1), Zonotope.of([0.0, 0.0], np.zeros((2, 2)))
    radii = []
    for error, u in ((0.02, 1.0), (0.0, 1.02)):
        observer = ZonotopicLuenberger(uncertain(noise_bound=[0.05, error]), L, **OPTIONS)
        radii.append(np.asarray(stepped(observer, start, np.array([u]), still, still)[0].interval().radius))
    np.testing.assert_allclose(radii[0] - radii[1], [0.02 * 1.0, 0.02 * 0.5], atol=1e-14)


def test_the_box_that_is_never_left_bounds_the_factors() -> None:
    plant = uncertain(width=0.3, error=0.1)
    free, held = (ZonotopicKalmanFilter(plant, state_bound=b, **OPTIONS) for b in (None, [np.inf, 0.3]))
    start = Zonotope.of([0.0, 0.0], np.diag([0.5, 3.0]))
    still = np.zeros(1)
    first, second = (stepped(o, start, still, still, still)[0].interval().radius for o in (free, held))
    # a moves x1 by 0.3 |x2|: 0.9 without the bound, 0.09 with it; p moves it by 0.1 * 0.2 |x2|.
    np.testing.assert_allclose(first[0] - second[0], (0.3 + 0.1 * 0.2) * (3.0 - 0.3), rtol=1e-12)


def test_a_state_outside_the_box_it_never_leaves_concludes_nothing() -> None:
    plant = uncertain()
    free, held = (ZonotopicKalmanFilter(plant, state_bound=b, **OPTIONS) for b in (None, [0.1, 0.1]))
    far = jnp.array([3.0, -4.0])
    still = np.zeros(1)
    without, beside = (stepped(o, far, still, np.array([3.0]), still)[0] for o in (free, held))
    np.testing.assert_array_equal(np.asarray(without.generators), np.asarray(beside.generators))


def test_the_current_output_bounds_the_factors_of_a_filter() -> None:
    # a moves both states by x2 only; an output that shows x2 leaves little of it.
    plant = uncertain().replace(C=[[0.0, 1.0]])
    start = Zonotope.of([0.0, 0.0], np.diag([0.0, 3.0]))
    still = np.zeros(1)
    widths = []
    for observer in (ZonotopicKalmanFilter(plant, **OPTIONS), ZonotopicFilter(plant, **OPTIONS)):
        widths.append(stepped(observer, start, still, still, still)[0].interval().radius[0])
    assert widths[1] < widths[0] - 0.1 * 2.5


def test_outputs_that_depend_on_what_nobody_knows_are_refused() -> None:
    seen = Polynomial.affine(np.array([[1.0, 0.0]]), a=np.array([[0.0, 1.0]]))
    with pytest.raises(NotAccepted, match="`C` of `plant` depends on"):
        ZonotopicKalmanFilter(uncertain().replace(C=seen), **OPTIONS)
    read = Polynomial.affine(np.array([[1.0, 0.0]]), p=np.array([[0.0, 1.0]]))
    with pytest.raises(NotAccepted, match="`C` of `plant` depends on"):
        ZonotopicKalmanFilter(uncertain().replace(C=read), **OPTIONS)
    with pytest.raises(BadInput, match="a guarantee needs bounds"):
        ZonotopicKalmanFilter(uncertain(disturbance_bound=None), **OPTIONS)


@pytest.mark.parametrize("wrong", [[1.0], [1.0, -1.0], [1.0, np.nan]])
def test_a_state_bound_that_is_none_is_refused(wrong: list[float]) -> None:
    with pytest.raises(BadInput, match="`state_bound`"):
        ZonotopicKalmanFilter(uncertain(), state_bound=wrong, **OPTIONS)


def test_it_runs_in_float32() -> None:
    for observer in observers(uncertain(), state_bound=[5.0, np.inf]):
        state, seen = stepped(observer, jnp.zeros(2, jnp.float32), np.ones(1), np.zeros(1), np.zeros(1))
        assert state.generators.dtype == jnp.float32
        assert seen.x.dtype == jnp.float32
