"""Zonotopic observers: sets hold every admissible run, and stored boxes of another implementation are met."""

import json
from collections.abc import Callable
from pathlib import Path
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
from luenberger.sets import Zonotope, combastel, girard, pca
from luenberger.systems import Parameter, System

STORED = Path(__file__).parents[3] / "shared" / "data" / "guaranteed-estimation"
needs_stored = pytest.mark.skipif(not STORED.exists(), reason="the stored benchmark problems are not redistributed")


def turning(**changes: Any) -> System:
    """Two states, scheduled, with a disturbance, noisy output and noisy measured input (the same noise in both)."""
    A = Polynomial.affine(np.array([[0.9, -0.3], [0.3, 0.8]]), p=np.array([[0.0, 0.2], [0.0, 0.0]]))
    options: dict[str, Any] = {
        "E": [[0.0], [1.0]],
        "G": [[1.0, 0.0]],
        "N": [[0.5, 1.0]],
        "parameters": [Parameter("p", -1.0, 1.0)],
        "dt": 0.1,
        "disturbance_bound": [0.05],
        "noise_bound": [0.1, 0.02],
    }
    return System.build(A, [[1.0], [0.5]], [[1.0, 0.0]], [[0.2]], **(options | changes))


def observers(plant: System, count: int = 12) -> list[ZonotopicObserver]:
    options: dict[str, Any] = {"initial_half_width": [1.0, 2.0], "count": count}
    return [
        ZonotopicLuenberger(plant, [[0.6], [0.4]], **options),
        ZonotopicKalmanFilter(plant, **options),
        ZonotopicFilter(plant, **options),
        ZonotopicKalmanFilter(plant, reduction=pca, **options),
        ZonotopicFilter(plant, reduction=combastel, **options),
    ]


def driven(plant: System, steps: int, seed: int, vertices: bool) -> tuple[np.ndarray, ...]:
    """States, measured inputs, outputs and scheduling of a run within the bounds."""
    generator = np.random.default_rng(seed)

    def unit(*shape: int) -> np.ndarray:
        draw = generator.uniform(-1, 1, shape)
        return np.sign(draw) if vertices else draw

    x, rows = unit(2) * [1.0, 2.0], []
    matrices = [plant.polynomial(k) for k in "ABCDEGN"]
    for _ in range(steps):
        p, d, v = generator.uniform(-1, 1, 1), unit(1) * plant.disturbance_bound, unit(2) * plant.noise_bound
        A, B, C, D, E, G, N = (m({n: float(p[0]) for n in m.names}) for m in matrices)
        true = generator.normal(size=1)
        rows.append((x, true + N @ v, C @ x + D @ true + G @ v, p))
        x = A @ x + B @ true + E @ d
    return tuple(np.array(column) for column in zip(*rows, strict=True))


@eqx.filter_jit
def run(observer: ZonotopicObserver, u: Any, y: Any, r: Any, start: Any = (0.0, 0.0)) -> Estimate:
    def advance(state: Zonotope, now: Any) -> tuple[Zonotope, Estimate]:
        return observer.step(state, *now)

    return jax.lax.scan(advance, observer.init(jnp.asarray(start)), (u, y, r))[1]


def runs(observer: ZonotopicObserver, plant: System, vertices: bool) -> tuple[np.ndarray, Estimate]:
    """States and boxes of ten runs in one batch."""
    x, u, y, r = (np.stack(part) for part in zip(*(driven(plant, 200, k, vertices) for k in range(10)), strict=True))
    return x, eqx.filter_vmap(run, in_axes=(None, 0, 0, 0))(observer, u, y, r)


@pytest.mark.parametrize("kind", range(5))
@pytest.mark.parametrize("vertices", [False, True])
def test_the_state_never_leaves_its_box(kind: int, vertices: bool) -> None:
    plant = turning()
    observer = observers(plant)[kind]
    x, box = runs(observer, plant, vertices)
    # Rounding of the sums is the only slack.
    assert np.all(x >= np.asarray(box.lower) - 1e-12)
    assert np.all(x <= np.asarray(box.upper) + 1e-12)


@pytest.mark.parametrize("spoil", ["noise_bound", "disturbance_bound"])
def test_a_bound_stated_too_small_is_broken_somewhere(spoil: str) -> None:
    # The law above would see a generator that is left out: here one is shrunk.
    plant = turning()
    shrunk = turning(**{spoil: [0.3 * b for b in getattr(plant, spoil)]})
    x, box = runs(observers(shrunk)[0], plant, True)
    assert np.any((x < np.asarray(box.lower)) | (x > np.asarray(box.upper)))


def test_input_noise_is_counted_once_with_its_sign() -> None:
    # u enters y through D and x through B with one noise; two separate generators would be wider.
    plant = turning(E=None, disturbance_bound=None)
    observer = observers(plant)[0]
    state, _ = observer.step(observer.init(jnp.zeros(2)), np.zeros(1), np.zeros(1), np.zeros(1))
    B, D, G, N = (np.asarray(plant.at(k, [0.0])) for k in "BDGN")
    L, v = np.array([[0.6], [0.4]]), np.diag([0.1, 0.02])
    expected = np.abs((B @ N + L @ (G - D @ N)) @ v).sum(axis=1)
    loop = np.abs((np.asarray(plant.at("A", [0.0])) - L @ [[1.0, 0.0]]) @ np.diag([1.0, 2.0])).sum(axis=1)
    np.testing.assert_allclose(np.abs(np.asarray(state.generators)).sum(axis=1), expected + loop, rtol=1e-12)


def test_the_current_measurement_narrows_the_box() -> None:
    plant = turning()
    _, u, y, r = driven(plant, 100, 0, False)
    now, before = (run(observers(plant)[k], u, y, r) for k in (2, 1))
    # The gain is best for all generators together, so a single state may lose.
    widths = [float(np.asarray(e.upper - e.lower)[20:].mean()) for e in (now, before)]  # type: ignore[operator]
    assert widths[0] < 0.9 * widths[1]


@needs_stored
@pytest.mark.parametrize("name", ["academic2d", "vehicle2d"])
def test_stored_boxes_of_the_kalman_filter(name: str) -> None:
    data = json.loads((STORED / f"{name}.json").read_text())
    (_, W), (_, V), (c0, R0) = (map(np.array, data[k]) for k in ("W", "V", "R0"))
    plant = System.build(
        data["A"], data["B"], data["C"], E=W, G=V, dt=data["dt"],
        disturbance_bound=[1.0] * W.shape[1], noise_bound=[1.0] * V.shape[1],
    )  # fmt: skip
    count = int(data["zonotope_order"]) * 2
    filtered = ZonotopicKalmanFilter(plant, initial_half_width=[0.0, 0.0], count=count, reduction=pca)
    u, y = np.array(data["u"]).T, np.array(data["y"]).T
    state, seen = filtered.init(Zonotope.of(c0[:, 0], R0)), None
    step = eqx.filter_jit(filtered.step)
    for k in range(len(y)):
        state, seen = step(state, u[k], y[k], np.zeros(0))
    assert seen is not None
    stored = np.array(data["final_box"]["FRad-C"])
    # Sixteen digits are stored; sums over 200 generators round differently in the last three.
    np.testing.assert_allclose(np.stack([np.asarray(seen.lower), np.asarray(seen.upper)]), stored, rtol=0, atol=1e-12)


def test_runs_in_float32_and_under_vmap() -> None:
    plant = turning()
    _, u, y, r = driven(plant, 30, 0, False)
    observer = observers(plant)[1]
    single = run(observer, u, y, r, jnp.zeros(2, jnp.float32))
    assert single.x.dtype == jnp.float32
    many = jax.vmap(lambda x0: run(observer, u, y, r, x0))(jnp.zeros((3, 2)))
    np.testing.assert_allclose(many.upper[2], run(observer, u, y, r).upper, rtol=1e-12)  # type: ignore[index]
    np.testing.assert_allclose(single.upper, many.upper[0], rtol=1e-3)  # type: ignore[index,arg-type]


@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        ({"dt": None}, NotAccepted, "continuous"),
        ({"noise_bound": None}, BadInput, "a guarantee needs bounds"),
        ({"disturbance_bound": None}, BadInput, "a guarantee needs bounds"),
        ({"noise_bound": [0.0, 0.02]}, BadInput, "noise in every output"),
    ],
)
def test_plants_without_a_guarantee_are_refused(changes: dict[str, Any], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        ZonotopicKalmanFilter(turning(**changes), initial_half_width=[1.0, 2.0], count=8)


@pytest.mark.parametrize(
    "wrong",
    [
        lambda p: ZonotopicKalmanFilter(p, initial_half_width=[1.0], count=8),
        lambda p: ZonotopicKalmanFilter(p, initial_half_width=[1.0, -1.0], count=8),
        lambda p: ZonotopicKalmanFilter(p, initial_half_width=[1.0, 1.0], count=1, reduction=girard),
        lambda p: ZonotopicLuenberger(p, [[1.0]], initial_half_width=[1.0, 1.0], count=8),
        lambda p: observers(p)[0].init(jnp.zeros(3)),
        lambda p: observers(p)[0].init(Zonotope.of([0.0, 0.0], np.ones((2, 13)))),
    ],
)
def test_options_that_do_not_fit_are_refused(wrong: Callable[[System], Any]) -> None:
    with pytest.raises(BadInput):
        wrong(turning())
