"""The interval observer against vertices enumerated by hand, against SciPy, as running code, and on a published manoeuvre."""

from itertools import product
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.linalg

from luenberger.algebra import Polynomial
from luenberger.core import BadInput, NotAccepted
from luenberger.observers.interval import IntervalObserver
from luenberger.systems import MatrixFunction, Nonlinearity, Parameter, SchedulingError, System
from luenberger.systems.discretize import discretize
from luenberger.vehicle import slip_angle_plant, wang_car

SPEED, ACCELERATION = (15 / 3.6, 150 / 3.6), (-8.0, 4.0)
STIFFNESS = ((60e3, 90e3), (35e3, 65e3))
NOISE, OFFSET = (1e-3, 0.02, 5e-3), (30.0, 40.0)
SCALE = ((-0.1, 0.1), (-0.2, 0.15))
# Keeps order at every vertex: entries s (k Cr + 7) and s (k Cf + 9) off the diagonal, k = -7.98e-5.
GAIN = Polynomial(("inverse_speed",), {(1,): np.array([[7.0], [-9.0]])})
U, Y, R = np.array([0.03, -0.2, 0.4]), np.array([0.004]), np.array([0.06, -3.0])
BOUNDS = np.array([[-0.03, 0.01], [0.02, 0.035]])
FLIP = np.diag([1.0, -1.0])


def car(**options: Any) -> System:
    return slip_angle_plant(wang_car, SPEED, ACCELERATION, stiffness=STIFFNESS, **options)


def drift_by_hand(plant: System, L: np.ndarray, T: np.ndarray, z: np.ndarray, sign: float, read: np.ndarray) -> Any:
    """The largest (sign 1) or smallest drift, every vertex of stiffness and scheduling error one after the other."""
    Ti = np.linalg.inv(T)
    s, a = read
    factors = [1.0], [1.0]
    if plant.measured_scheduling is not None:
        (e1, E1), (e2, E2) = SCALE
        factors = [1 + e1, 1 + E1], [1 / (1 + e2), 1 / (1 + E2)]
    values, slacks = [], []
    for f, g, Cf, Cr in product(*factors, *STIFFNESS):
        true = {
            "inverse_speed": s * f,
            "acceleration": np.clip(a * g, *ACCELERATION),
            "front_stiffness": Cf,
            "rear_stiffness": Cr,
        }
        true["inverse_speed"] = np.clip(true["inverse_speed"], 1 / SPEED[1], 1 / SPEED[0])
        A, B, C, D, E, G, N = (np.asarray(plant.polynomial(letter)(true)) for letter in "ABCDEGN")
        values.append(T @ A @ Ti @ z + T @ B @ U - T @ L @ (C @ Ti @ z + D @ U - Y))
        slack = [np.zeros((2, 1))]
        if plant.noise_bound is not None:
            slack.append(np.abs(T @ B @ N + T @ L @ (G - D @ N)) * plant.noise_bound)
        if plant.disturbance_bound is not None:
            slack.append(np.abs(T @ E) * plant.disturbance_bound)
        slacks.append(np.concatenate(slack, axis=1))
    return sign * (sign * np.array(values)).max(axis=0) + sign * np.max(slacks, axis=0).sum(axis=1)


MIXED = np.array([[1.0, 0.5], [-0.2, 2.0]])
CASES: dict[str, tuple[np.ndarray, dict[str, Any]]] = {
    "stiffness": (np.eye(2), {}),
    "slack in signs": (FLIP, {"noise": NOISE, "force_offset": OFFSET}),
    "scheduling": (np.eye(2), {"scale_error": SCALE}),
    "constraint": (FLIP, {"scale_error": SCALE, "noise": NOISE, "output": "slip_constraint"}),
    "all of it mixed": (
        MIXED,
        {"scale_error": SCALE, "noise": NOISE, "force_offset": OFFSET, "output": "slip_constraint"},
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_slope_is_the_extreme_over_all_vertices(case: str) -> None:
    T, options = CASES[case]
    plant, dt = car(**options), 1e-7
    observer = IntervalObserver(plant, GAIN, dt, transform=T)
    start = observer.init(BOUNDS)
    after, _ = observer.step(start, U, Y, R)
    L = np.asarray(GAIN({"inverse_speed": R[0]}))
    for k, sign in enumerate((-1.0, 1.0)):
        expected = drift_by_hand(plant, L, T, np.asarray(start)[k], sign, R)
        # One short step: the slope changes by dt times 60 1/s, rounding adds 1e-17 / dt.
        np.testing.assert_allclose((after[k] - start[k]) / dt, expected, rtol=2e-5, atol=1e-8)


def test_without_anything_unknown_both_bounds_are_the_plant() -> None:
    stiffness = ((70e3, 70e3), (50e3, 50e3))
    plant = slip_angle_plant(wang_car, SPEED, ACCELERATION, stiffness=stiffness)
    dt, x = 0.01, np.array([0.02, 0.01])
    observer = IntervalObserver(plant, np.zeros((2, 1)), dt)
    after, estimate = observer.step(observer.init(np.stack([x, x])), U, Y, R)
    A, B = (np.asarray(plant.at(letter, R)) for letter in "AB")
    held = scipy.linalg.expm(np.block([[A * dt, (B @ U * dt)[:, None]], [np.zeros((1, 3))]]))
    true = held[:2, :2] @ x + held[:2, 2]
    assert np.array_equal(estimate.lower, x)
    assert np.array_equal(estimate.upper, x)
    assert np.all(after[0] <= true)
    assert np.all(true <= after[1])
    # Apart by twice what the series leaves out: (h |A|)^4 / 120 of the motion in a step.
    np.testing.assert_allclose(after[1], after[0], atol=1e-5)


def test_estimate_in_other_coordinates_is_turned_back() -> None:
    plant = car()
    observer = IntervalObserver(plant, np.zeros((2, 1)), 0.01, transform=FLIP)
    start = observer.init(BOUNDS)
    np.testing.assert_array_equal(start, [[-0.03, -0.035], [0.02, -0.01]])
    _, estimate = observer.step(start, U, Y, R)
    np.testing.assert_array_equal(np.stack([estimate.lower, estimate.upper]), BOUNDS)
    np.testing.assert_allclose(estimate.x, BOUNDS.mean(axis=0))
    mixed = IntervalObserver(plant, np.zeros((2, 1)), 0.01, transform=MIXED)
    _, wider = mixed.step(mixed.init(BOUNDS), U, Y, R)
    # Two changes of coordinates can only widen.
    assert np.all(np.asarray(wider.lower) <= BOUNDS[0])
    assert np.all(np.asarray(wider.upper) >= BOUNDS[1])


def test_start_from_a_guess() -> None:
    observer = IntervalObserver(car(), GAIN, 0.01, initial_half_width=[0.06, 0.05])
    np.testing.assert_allclose(observer.init([0.01, 0.02]), [[-0.05, -0.03], [0.07, 0.07]], atol=1e-15)
    assert observer.states == ("front_slip", "rear_slip")


def held_truth(plant: System, x: np.ndarray, values: dict[str, float], u: np.ndarray, dt: float) -> np.ndarray:
    A, B = (np.asarray(plant.polynomial(letter)(values)) for letter in "AB")
    b = B @ u
    n = len(x)
    held = scipy.linalg.expm(np.block([[A * dt, b[:, None] * dt], [np.zeros((1, n + 1))]]))
    return held[:n, :n] @ x + held[:n, n]


@pytest.mark.parametrize(("size", "dt"), [(1.0, 0.01), (1.0, 0.05), (15.0, 0.01)])
def test_slow_sampling_of_the_output_costs_no_containment(size: float, dt: float) -> None:
    plant = car()
    observer = IntervalObserver(plant, GAIN * size, dt)
    step = jax.jit(lambda *a: observer.step(*a))
    rng = np.random.default_rng(0)
    x = np.array([0.02, 0.015])
    state, widths = observer.init(np.stack([x, x])), []
    for k in range(150):
        stiffness = {
            n: rng.choice(ends) for n, ends in zip(("front_stiffness", "rear_stiffness"), STIFFNESS, strict=True)
        }
        # The wheel is turned to and fro, so that the output moves by as much as it can between samples.
        u = np.array([0.05, 1.5, 0.3]) * np.sign(np.sin(0.3 * k))
        state, estimate = step(state, u, x[:1] - x[1:], R)
        # Rounding of numbers near 0.1.
        assert np.all(np.asarray(estimate.lower) <= x + 1e-15)
        assert np.all(x <= np.asarray(estimate.upper) + 1e-15)
        widths.append(np.asarray(estimate.upper - estimate.lower))
        x = held_truth(plant, x, {"inverse_speed": R[0], "acceleration": R[1], **stiffness}, u, dt)
    # The enclosure stays one: it does not grow without bound.
    assert np.max(widths) < 0.2


def test_outputs_that_read_the_scheduling_with_error() -> None:
    box = [Parameter("p", 0.5, 1.5, factor=(0.9, 1.1)), Parameter("q", -0.3, 0.3, measured=False)]
    A = Polynomial(
        ("p", "q"),
        {(0, 0): np.diag([-2.0, -3.0]), (1, 0): np.array([[0.0, 1.0], [0.0, 0.0]]), (0, 1): np.diag([1.0, 0.0])},
    )
    C = Polynomial(("p",), {(0,): np.array([[1.0, 0.0]]), (1,): np.array([[0.0, -0.2]])})
    plant = System.lpv(A, [[1.0], [1.0]], C, parameters=box)
    observer = IntervalObserver(plant, [[3.0], [-0.5]], 0.05)
    step = jax.jit(lambda *a: observer.step(*a))
    rng = np.random.default_rng(1)
    x = np.array([0.3, -0.2])
    state = observer.init(np.stack([x - 0.01, x + 0.01]))
    for k in range(200):
        p, q, f = rng.choice([0.5, 1.5]), rng.choice([-0.3, 0.3]), rng.choice([0.9, 1.1])
        u = np.array([np.sign(np.sin(0.2 * k))])
        state, estimate = step(state, u, np.asarray(C({"p": p})) @ x, np.array([f * p]))
        assert np.all(np.asarray(estimate.lower) <= x + 1e-14)
        assert np.all(x <= np.asarray(estimate.upper) + 1e-14)
        x = held_truth(plant, x, {"p": p, "q": q}, u, 0.05)


def test_switches_leave_terms_out() -> None:
    plant = car(noise=NOISE, force_offset=OFFSET, scale_error=SCALE)

    def width(**switches: bool) -> np.ndarray:
        observer = IntervalObserver(plant, GAIN, 0.01, **switches)
        after, _ = observer.step(observer.init(BOUNDS), U, Y, R)
        return np.asarray(after[1] - after[0])

    full = width()
    for switch in ("with_noise", "with_offset", "with_scheduling_error"):
        assert np.all(width(**{switch: False}) < full)
    bare = width(with_noise=False, with_offset=False, with_scheduling_error=False)
    plain = IntervalObserver(car(), GAIN, 0.01)
    after, _ = plain.step(plain.init(BOUNDS), U, Y, R)
    # Left out is as if never declared, but for the range of readings that sets the remainder bound.
    np.testing.assert_allclose(bare, after[1] - after[0], rtol=1e-4)


def test_clipping_keeps_the_readings_in_their_range() -> None:
    plant = car(scale_error=SCALE)
    clipped = IntervalObserver(plant, GAIN, 0.01, clip_scheduling=True)
    far, edge = np.array([0.9, -50.0]), np.array([1.0 / SPEED[0] / 0.9, -8.0 * 1.15])
    x = clipped.init(BOUNDS)
    np.testing.assert_array_equal(clipped.step(x, U, Y, far)[0], clipped.step(x, U, Y, edge)[0])


def test_single_precision_stays_single_and_close() -> None:
    observer = IntervalObserver(car(noise=NOISE, scale_error=SCALE), GAIN, 0.01)

    def run(dtype: Any) -> np.ndarray:
        start = observer.init(jnp.asarray(BOUNDS, dtype))
        last, estimates = jax.lax.scan(lambda s, _: observer.step(s, U, Y, R), start, None, length=100)
        assert last.dtype == dtype
        assert estimates.lower.dtype == dtype
        return np.asarray(last)

    # A contracting loop: single rounding times a few hundred operations.
    np.testing.assert_allclose(run(jnp.float32), run(jnp.float64), atol=1e-5)


def test_vmap_is_a_loop_and_jit_traces_once() -> None:
    observer, traces = IntervalObserver(car(noise=NOISE), GAIN, 0.01), []

    def step(state: Any, u: Any) -> Any:
        traces.append(1)
        return observer.step(state, u, Y, R)[0]

    starts = jnp.asarray(BOUNDS) + 0.01 * jnp.arange(3.0)[:, None, None]
    inputs = jnp.asarray(U) * jnp.arange(3.0)[:, None]
    jitted = jax.jit(jax.vmap(step))
    batch = jitted(starts, inputs)
    jitted(starts + 1, inputs)
    assert len(traces) == 1
    loop = jnp.stack([step(x, u) for x, u in zip(starts, inputs, strict=True)])
    np.testing.assert_allclose(batch, loop, rtol=1e-12, atol=1e-15)


def test_finer_substeps_change_little() -> None:
    coarse, fine = (IntervalObserver(car(noise=NOISE), GAIN, 0.01, substeps=n) for n in (1, 8))
    a, b = (np.asarray(o.step(o.init(BOUNDS), U, Y, R)[0]) for o in (coarse, fine))
    np.testing.assert_allclose(a, b, atol=2e-5)
    assert np.asarray(fine.remainder).max() < 1e-3 * np.asarray(coarse.remainder).max()


def double_lane_change() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Slip angles, inputs, outputs and scheduling of a linear car braked from 78 to 23 km/h while it changes lanes twice."""
    t = 1e-3 * np.arange(10_001)

    def signals(t: float) -> tuple[float, float, float, float]:
        c = np.clip((t - 1) / 8, 0.0, 1.0)
        v = (78 + 0.5 * (23 - 78) * (1 - np.cos(np.pi * c))) / 3.6
        a = 0.5 * (23 - 78) / 3.6 * np.pi / 8 * np.sin(np.pi * c)
        delta = rate = 0.0
        for A, t0 in ((0.022, 0.5), (-0.045, 4.0)):
            w = 2 * np.pi * (t - t0) / 2.5
            if 0 <= w <= 2 * np.pi:
                delta += A * 0.7698 * (np.sin(w) - 0.5 * np.sin(2 * w))
                rate += A * 0.7698 * 2 * np.pi / 2.5 * (np.cos(w) - np.cos(2 * w))
        return v, a, delta, rate

    m, Iz, a, b = 800.0, 1152.0, 0.948, 1.422

    def slips(t: float, x: np.ndarray) -> np.ndarray:
        v, _, delta, _ = signals(t)
        return np.array([delta - (x[0] + a * x[1]) / v, -(x[0] - b * x[1]) / v])

    def slope(t: float, x: np.ndarray) -> np.ndarray:
        Ff, Fr = np.array([76500.0, 51000.0]) * slips(t, x)
        return np.array([(Ff + Fr) / m - signals(t)[0] * x[1], (a * Ff - b * Fr) / Iz])

    x, h, truth = np.zeros(2), 1e-3, []
    for now in t:
        truth.append([*slips(now, x), x[1]])
        k1 = slope(now, x)
        k2 = slope(now + h / 2, x + h / 2 * k1)
        k3 = slope(now + h / 2, x + h / 2 * k2)
        x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + slope(now + h, x + h * k3))
    truth = np.array(truth)
    v, acceleration, delta, rate = np.array([signals(now) for now in t]).T
    u = np.stack([delta, rate, truth[:, 2]], axis=1)
    return truth[:, :2], u, truth[:, :1] - truth[:, 1:2], np.stack([1 / v, acceleration], axis=1)


def test_width_on_the_published_manoeuvre() -> None:
    x, u, y, r = double_lane_change()
    plant = slip_angle_plant(wang_car, SPEED, (-8.0, 8.0), stiffness=STIFFNESS)
    observer = IntervalObserver(plant, np.zeros((2, 1)), 1e-3, transform=FLIP, initial_half_width=[0.06, 0.06])
    start = observer.init([0.05, -0.03])
    _, estimate = jax.jit(lambda s, *a: jax.lax.scan(lambda s, z: observer.step(s, *z), s, a))(
        start, u[1000:], y[1000:], r[1000:]
    )
    lower, upper = np.asarray(estimate.lower), np.asarray(estimate.upper)
    assert np.all(lower <= x[1000:] + 1e-6)
    assert np.all(x[1000:] <= upper + 1e-6)
    # Mean width over 2 to 10 s with no correction; the reference run differs in how the inputs are held.
    np.testing.assert_allclose(1e3 * (upper - lower)[1000:].mean(axis=0), [2.19, 3.47], rtol=0.05)


def test_refusals() -> None:
    plant = car(noise=NOISE)
    with pytest.raises(NotAccepted, match="noise_bound"):
        IntervalObserver(plant.replace(noise_bound=None), GAIN, 0.01)
    IntervalObserver(plant.replace(noise_bound=None), GAIN, 0.01, with_noise=False)
    with pytest.raises(NotAccepted, match="disturbance_bound"):
        IntervalObserver(car(force_offset=OFFSET).replace(disturbance_bound=None), GAIN, 0.01)
    with pytest.raises(NotAccepted, match="discrete"):
        IntervalObserver(discretize(car(), 0.01, "euler"), GAIN)
    one = [Parameter("q", 0.0, 1.0, measured=False)]
    bent = System.lpv(Polynomial(("q",), {(0,): [[-1.0]], (2,): [[0.2]]}), [[1.0]], parameters=one)
    with pytest.raises(NotAccepted, match=r"power above one of \['q'\]"):
        IntervalObserver(bent, [[1.0]], 0.01)
    function = System.lpv(MatrixFunction(lambda v: jnp.array([[-v["q"]]]), ("q",), (1, 1)), parameters=one)
    with pytest.raises(NotAccepted):
        IntervalObserver(function, [[1.0]], 0.01)
    pendulum = Nonlinearity.bounded(lambda z, u: jnp.sin(z), [[1.0]], size=1, jacobian=([[-1.0]], [[1.0]]))
    with pytest.raises(NotAccepted, match="nonlinearity"):
        IntervalObserver(System.nonlinear([[-1.0]], F=[[1.0]], nonlinearity=pendulum), [[1.0]], 0.01)
    name = Polynomial(("p",), {(1,): np.ones((1, 1))})
    error = SchedulingError({"p": name}, {"p": name}, {"p": (0.0, 1.0)})
    declared = System.lpv(
        Polynomial.affine([[-1.0]], p=[[0.1]]), parameters=[Parameter("p", 0.0, 1.0)], scheduling_error=error
    )
    with pytest.raises(NotAccepted, match="declared as a map"):
        IntervalObserver(declared, [[1.0]], 0.01)


def test_bad_input() -> None:
    for options in (
        {"transform": np.ones((2, 2))},
        {"transform": np.eye(3)},
        {"initial_half_width": [0.1]},
        {"initial_half_width": [-0.1, 0.1]},
    ):
        with pytest.raises(BadInput):
            IntervalObserver(car(), GAIN, 0.01, **options)
    with pytest.raises(BadInput, match="shape"):
        IntervalObserver(car(), [[1.0]], 0.01)
    with pytest.raises(BadInput, match="to keep the order"):
        IntervalObserver(car(), GAIN, 0.05, substeps=1)
    with pytest.raises(BadInput, match="sub-steps"):
        IntervalObserver(car(), GAIN * 1000, 0.1)
    observer = IntervalObserver(car(), GAIN, 0.01)
    for start in ([0.1, 0.2], np.zeros((3, 2)), [[0.1, 0.0], [0.0, 0.1]]):
        with pytest.raises(BadInput):
            observer.init(start)
