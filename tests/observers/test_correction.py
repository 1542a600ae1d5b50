"""The correction observer against its definition, against SciPy, and as running code."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.linalg

from luenberger.algebra import Polynomial
from luenberger.core import BadInput
from luenberger.observers import CorrectionObserver, substeps_needed
from luenberger.systems import Nonlinearity, Parameter, System
from luenberger.systems.discretize import discretize
from observers.plants import DT, car, car_by_function, pendulum, two_mass

GAIN = np.array([[6.0, 0.5], [0.3, 7.0], [20.0, 5.0], [4.0, 15.0]])
CAR_GAIN = Polynomial.affine([[0.5], [10.0]], vx=[[0.02], [0.1]])
U, Y, R = np.array([0.3]), np.array([0.2]), np.array([20.0, 0.05])


def closed_loop_step(
    plant: System, L: np.ndarray, x: np.ndarray, u: np.ndarray, y: np.ndarray, r: object, dt: float
) -> np.ndarray:
    """Exact hold of the closed loop, by SciPy."""
    A, B, C, D = (np.asarray(plant.at(k, r)) for k in "ABCD")
    b = B @ u + L @ (y - D @ u)
    n = plant.nx
    whole = scipy.linalg.expm(np.block([[(A - L @ C) * dt, b[:, None] * dt], [np.zeros((1, n + 1))]]))
    return whole[:n, :n] @ x + whole[:n, n]


def test_discrete_step_is_the_definition() -> None:
    plant = discretize(two_mass(), DT)
    observer = CorrectionObserver(plant, 0.1 * GAIN)
    rng = np.random.default_rng(0)
    x, u, y = rng.normal(size=4), rng.normal(size=1), rng.normal(size=2)
    A, B, C, D = (np.asarray(plant.at(k)) for k in "ABCD")
    after, estimate = observer.step(observer.init(x), u, y, np.zeros(0))
    # The same sums in another order.
    np.testing.assert_allclose(after, A @ x + B @ u + 0.1 * GAIN @ (y - C @ x - D @ u), rtol=1e-13)
    assert np.array_equal(estimate.x, x)
    assert estimate.covariance is None


@pytest.mark.parametrize("dt", [0.02, 2.0])
def test_exact_hold_equals_scipy(dt: float) -> None:
    for plant, gain, r, y in ((two_mass(), GAIN, np.zeros(0), np.array([0.2, -0.4])), (car(), CAR_GAIN, R, Y)):
        observer = CorrectionObserver(plant, gain, dt, method="exact")
        L = gain({"vx": R[0]}) if isinstance(gain, Polynomial) else gain
        x = np.linspace(1.0, -1.0, plant.nx)
        after, _ = observer.step(observer.init(x), U, y, r)
        # |dt (A - L C)| reaches 120: seven squarings of rounding errors.
        np.testing.assert_allclose(after, closed_loop_step(plant, L, x, U, y, r, dt), rtol=1e-10, atol=1e-11)


def test_runge_kutta_tends_to_the_exact_hold() -> None:
    plant, x = two_mass(), np.array([1.0, -1.0, 0.5, 0.2])
    y = np.array([0.2, -0.4])
    exact = closed_loop_step(plant, GAIN, x, U, y, (), DT)
    errors = []
    for substeps in (4, 8):
        observer = CorrectionObserver(plant, GAIN, DT, substeps=substeps)
        errors.append(np.abs(np.asarray(observer.step(observer.init(x), U, y, np.zeros(0))[0]) - exact).max())
    # Order four.
    assert 12 < errors[0] / errors[1] < 20


def test_nonlinear_plant_is_integrated_with_its_nonlinearity() -> None:
    plant, L, x, y = pendulum(), np.array([[4.0], [8.0]]), np.array([1.0, -0.5]), np.array([0.7])

    def slope(z: np.ndarray) -> np.ndarray:
        return np.array([z[1], -0.3 * z[1] - 9.81 * np.sin(z[0]) + U[0]]) + L[:, 0] * (y[0] - z[0])

    z = x
    for _ in range(20_000):
        middle = z + slope(z) * (DT / 40_000)
        z = z + slope(middle) * (DT / 20_000)
    rk4 = CorrectionObserver(plant, L, DT, substeps=8)
    # RK4 at h = 2.5 ms with a time scale of 0.2 s: error near 1e-10 of the state.
    np.testing.assert_allclose(rk4.step(rk4.init(x), U, y, np.zeros(0))[0], z, rtol=1e-9)
    held = CorrectionObserver(plant, L, DT, method="exact")
    # f held over the step: second-order local error, about |df| dt^2 / 2 = 2e-3.
    np.testing.assert_allclose(held.step(held.init(x), U, y, np.zeros(0))[0], z, atol=3e-3)


def test_error_of_a_perfect_copy_stays_zero_and_converges_otherwise() -> None:
    plant = discretize(two_mass(), DT)
    observer = CorrectionObserver(plant, gain_of(plant))
    x, state = jnp.array([1.0, -1.0, 0.0, 0.5]), observer.init(np.zeros(4))
    for k in range(400):
        u = jnp.array([np.sin(0.1 * k)])
        state, estimate = observer.step(state, u, plant.output(0.0, x, u), np.zeros(0))
        x = plant.dynamics(0.0, x, u)
    assert float(jnp.abs(estimate.x - x).max()) < 0.1
    state = observer.init(x)
    after, _ = observer.step(state, u, plant.output(0.0, x, u), np.zeros(0))
    # A perfect copy makes no innovation beyond rounding.
    np.testing.assert_allclose(after, plant.dynamics(0.0, x, u), rtol=1e-13, atol=1e-14)


def gain_of(plant: System) -> np.ndarray:
    A, C = np.asarray(plant.at("A")), np.asarray(plant.at("C"))
    P = scipy.linalg.solve_discrete_are(A.T, C.T, 1e-3 * np.eye(4), 1e-2 * np.eye(2))
    return A @ P @ C.T @ np.linalg.inv(C @ P @ C.T + 1e-2 * np.eye(2))


def test_matrices_as_functions_give_the_same_step() -> None:
    a = CorrectionObserver(car(), [[0.5], [10.0]], DT, substeps=2)
    b = CorrectionObserver(car_by_function(), [[0.5], [10.0]], DT, substeps=2)
    x = np.array([0.3, 0.1])
    np.testing.assert_allclose(a.step(x := a.init(x), U, Y, R)[0], b.step(x, U, Y, R[:1])[0], rtol=1e-12)
    exact = CorrectionObserver(car_by_function(), [[0.5], [10.0]], 0.5, method="exact")
    L = np.array([[0.5], [10.0]])
    expected = closed_loop_step(car(), L, np.asarray(x), U, Y, R, 0.5)
    np.testing.assert_allclose(exact.step(x, U, Y, R[:1])[0], expected, rtol=1e-10)


def test_clipping_holds_the_scheduling_in_its_box() -> None:
    clipped = CorrectionObserver(car(), CAR_GAIN, DT, clip_scheduling=True)
    free = CorrectionObserver(car(), CAR_GAIN, DT)
    x, far, edge = clipped.init(np.array([0.3, 0.1])), np.array([80.0, 0.01]), np.array([50.0, 0.02])
    assert np.array_equal(clipped.step(x, U, Y, far)[0], clipped.step(x, U, Y, edge)[0])
    assert not np.allclose(free.step(x, U, Y, far)[0], free.step(x, U, Y, edge)[0])


def test_unmeasured_parameters_sit_at_their_midpoints() -> None:
    A = Polynomial.affine([[-1.0]], stiff=[[-1.0]])
    plant = System.lpv(A, parameters=[Parameter("stiff", 0.0, 4.0, measured=False)])
    observer = CorrectionObserver(plant, [[2.0]], 0.1, method="exact")
    after, _ = observer.step(observer.init([1.0]), np.zeros(0), np.zeros(1), np.zeros(0))
    assert float(after[0]) == pytest.approx(np.exp(-0.5), rel=1e-15)


def test_substeps_cover_the_fastest_mode_of_the_box() -> None:
    plant = System.lpv(Polynomial.affine([[0.0]], p=[[-1.0]]), None, [[1.0]], parameters=[Parameter("p", 1.0, 30.0)])
    # Fastest mode 30 + 10 = 40 1/s, h = limit / 40.
    assert substeps_needed(plant, [[10.0]], 0.1) == 8
    assert substeps_needed(plant, [[10.0]], 0.1, limit=2.0) == 2
    assert substeps_needed(plant, [[0.0]], 0.001) == 1
    assert CorrectionObserver(plant, [[10.0]], 0.1).substeps == 8
    for p in (1.0, 15.0, 30.0):
        observer = CorrectionObserver(plant, [[10.0]], 0.1)
        after, _ = observer.step(observer.init([1.0]), np.zeros(0), np.zeros(1), np.array([p]))
        # At most half a time constant a sub-step: 0.5^5 / 5! of the start, 4.3e-4 of what is left; eight of them.
        assert float(after[0]) == pytest.approx(np.exp(-(p + 10) * 0.1), rel=8 * 4.3e-4)


def test_substeps_count_the_nonlinearity() -> None:
    L = [[0.0], [0.0]]
    # Pendulum: sqrt(9.81) = 3.13 rad/s hanging, growth at most sqrt(9.81) upright; |s| at most 3.29 with the drag.
    assert substeps_needed(pendulum(), L, 1.0) == 7
    sine = Nonlinearity.bounded(lambda z, u: jnp.sin(z), [[1.0, 0.0]], lipschitz=1.0)
    plant = pendulum().replace(nonlinearity=sine)
    # |s| <= 0.3 of the linear part, and 9.81 of the Lipschitz bound.
    assert substeps_needed(plant, L, 1.0) == 21


def test_a_loop_too_fast_for_runge_kutta_is_refused_with_the_way_out() -> None:
    with pytest.raises(BadInput, match=r'needs \d+ Runge-Kutta sub-steps in dt = 0.02 s; at most 50.*method="exact"'):
        CorrectionObserver(car(), [[0.0], [1e5]], DT)
    observer = CorrectionObserver(car(), [[0.0], [1e5]], DT, method="exact")
    after, _ = observer.step(observer.init(np.zeros(2)), np.zeros(1), Y, R)
    assert float(after[1]) == pytest.approx(Y[0], abs=1e-3)


@pytest.mark.parametrize(
    ("gain", "message"),
    [
        (
            np.ones((2, 2)),
            r"`gain` has shape \(2, 2\) but `car` has 2 states and 1 outputs; `gain` needs shape \(2, 1\)",
        ),
        ([[np.nan], [1.0]], "`gain` holds nan"),
        (
            Polynomial.affine([[0.0], [0.0]], speed=[[1.0], [1.0]]),
            r"`gain` depends on \['speed'\], which `car` does not measure",
        ),
    ],
)
def test_wrong_gains_are_refused(gain: object, message: str) -> None:
    with pytest.raises(BadInput, match=message):
        CorrectionObserver(car(), gain, DT)


def test_wrong_options_are_refused() -> None:
    with pytest.raises(BadInput, match="`method` is `euler`"):
        CorrectionObserver(car(), CAR_GAIN, DT, method="euler")
    with pytest.raises(BadInput, match="at least one sub-step"):
        CorrectionObserver(car(), CAR_GAIN, DT, substeps=0)
    with pytest.raises(BadInput, match=r"`x0` has shape \(3,\)"):
        CorrectionObserver(car(), CAR_GAIN, DT).init(np.zeros(3))


@pytest.mark.parametrize("method", ["rk4", "exact"])
def test_runs_under_jit_vmap_and_in_float32_without_retracing(method: str) -> None:
    traces = []

    @eqx.filter_jit
    def step(observer: CorrectionObserver, state: jax.Array) -> jax.Array:
        traces.append(1)
        return observer.step(state, jnp.asarray(U), jnp.asarray(Y), jnp.asarray(R))[0]

    gains = [CAR_GAIN * scale for scale in (0.5, 1.0, 2.0)]
    observers = [CorrectionObserver(car(), gain, DT, method=method, substeps=2) for gain in gains]
    if method == "exact":
        # The Taylor degree follows the gain; one structure needs one degree.
        observers = [eqx.tree_at(lambda o: o.gain, observers[2], gain) for gain in gains]
    singles = [step(observer, jnp.array([0.3, 0.1])) for observer in observers]
    assert len(traces) == 1
    stacked = jax.tree.map(lambda *leaves: jnp.stack(leaves), *observers)
    batch = eqx.filter_vmap(step, in_axes=(0, None))(stacked, jnp.array([0.3, 0.1]))
    # Vectorised code may fuse multiplications and additions differently.
    np.testing.assert_allclose(batch, singles, rtol=1e-13)
    single = step(observers[0], jnp.array([0.3, 0.1], jnp.float32))
    assert single.dtype == jnp.float32
    np.testing.assert_allclose(single, singles[0], rtol=1e-5)
