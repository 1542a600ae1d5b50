"""Kalman filters against a plain textbook form, SciPy's Riccati solver, filterpy, and each other."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.linalg
from filterpy.kalman import ExtendedKalmanFilter as FilterpyExtended

from luenberger.core import NotAccepted
from luenberger.observers import ExtendedKalmanFilter, KalmanFilter, Observer, UnscentedKalmanFilter
from luenberger.systems import System
from luenberger.systems.discretize import discretize, one_step
from observers.plants import DT, car, drive, pendulum, two_mass

Run = tuple[np.ndarray, np.ndarray]


def tuning(plant: System) -> dict:
    """Full covariances, so that no test passes by a diagonal."""
    rng = np.random.default_rng(8)
    roots = [rng.normal(size=(n, n)) for n in (plant.nx, plant.ny, plant.nx)]
    Q, R, P = (0.1 * root @ root.T + 0.05 * np.eye(len(root)) for root in roots)
    return {"process_covariance": 0.01 * Q, "measurement_covariance": R, "initial_covariance": P}


def samples(plant: System, count: int = 200) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    log = drive(plant, count)
    return log.table(plant.inputs), log.table(plant.outputs), log.table(plant.scheduling_names)


@eqx.filter_jit
def scan(observer: Observer, state: object, record: object) -> object:
    return jax.lax.scan(lambda s, sample: observer.step(s, *sample), state, record)[1]


def run(observer: Observer, x0: np.ndarray, record: tuple[np.ndarray, ...]) -> Run:
    estimate = scan(observer, observer.init(x0), record)
    return np.asarray(estimate.x), np.asarray(estimate.covariance)


def textbook(
    plant: System,
    x: np.ndarray,
    record: tuple[np.ndarray, ...],
    process_covariance,
    measurement_covariance,
    initial_covariance,
) -> Run:
    """The filter as every first course prints it: gain by an inverse, covariance by (I - K C) P."""
    P, xs, Ps = initial_covariance, [], []
    for u, y, r in zip(*record, strict=True):
        A, B, C, D = (np.asarray(plant.at(letter, r)) for letter in "ABCD")
        seen = np.flatnonzero(~np.isnan(y))
        C, D, R = C[seen], D[seen], measurement_covariance[np.ix_(seen, seen)]
        K = P @ C.T @ np.linalg.inv(C @ P @ C.T + R)
        x = x + K @ (y[seen] - C @ x - D @ u)
        P = P - K @ C @ P
        xs.append(x)
        Ps.append(P)
        x = A @ x + B @ u
        P = A @ P @ A.T + process_covariance
    return np.array(xs), np.array(Ps)


PLANTS = {"two mass": discretize(two_mass(), DT), "car": discretize(car(), DT, "rk4")}


@pytest.mark.parametrize("name", PLANTS)
def test_equals_the_textbook_form(name: str) -> None:
    plant, record = PLANTS[name], samples(PLANTS[name])
    x0 = np.linspace(1.0, -1.0, plant.nx)
    found, expected = (
        run(KalmanFilter(plant, **tuning(plant)), x0, record),
        textbook(plant, x0, record, **tuning(plant)),
    )
    for value, known in zip(found, expected, strict=True):
        # Two forms that agree exactly without rounding; 200 contracting steps keep rounding near 1e-13.
        np.testing.assert_allclose(value, known, rtol=1e-9, atol=1e-11)


@pytest.mark.parametrize("name", PLANTS)
def test_missing_entries_correct_nothing(name: str) -> None:
    plant, (u, y, r) = PLANTS[name], samples(PLANTS[name])
    y = np.where(np.random.default_rng(0).random(y.shape) < 0.3, np.nan, y)
    x0 = np.ones(plant.nx)
    expected = textbook(plant, x0, (u, y, r), **tuning(plant))
    for kind in (KalmanFilter, ExtendedKalmanFilter, UnscentedKalmanFilter):
        for value, known in zip(run(kind(plant, **tuning(plant)), x0, (u, y, r)), expected, strict=True):
            np.testing.assert_allclose(value, known, rtol=1e-9, atol=1e-10)


@pytest.mark.parametrize(
    ("plant", "method"),
    [(PLANTS["two mass"], "rk4"), (two_mass(), "exact"), (car(), "exact"), (car(), "rk4")],
)
def test_three_filters_are_one_on_linear_plants(plant: System, method: str) -> None:
    record, x0 = samples(plant), np.linspace(1.0, -1.0, plant.nx)
    kinds = (KalmanFilter, ExtendedKalmanFilter, UnscentedKalmanFilter)
    linear, extended, unscented = (run(kind(plant, DT, method=method, **tuning(plant)), x0, record) for kind in kinds)
    for a, b, c in zip(linear, extended, unscented, strict=True):
        # Equal in exact arithmetic; different orders of operations leave a few hundred units in the last place.
        np.testing.assert_allclose(b, a, rtol=1e-9, atol=1e-11)
        np.testing.assert_allclose(c, a, rtol=1e-9, atol=1e-10)


def test_stationary_covariance_solves_the_riccati_equation() -> None:
    plant = PLANTS["two mass"]
    given = tuning(plant)
    A, C, Q, R = (
        np.asarray(plant.at("A")),
        np.asarray(plant.at("C")),
        given["process_covariance"],
        given["measurement_covariance"],
    )
    P = scipy.linalg.solve_discrete_are(A.T, C.T, Q, R)
    filtered = P - P @ C.T @ np.linalg.inv(C @ P @ C.T + R) @ C @ P
    _, covariance = run(KalmanFilter(plant, **given), np.zeros(4), samples(plant, 3000))
    # 3000 steps at a spectral radius below 0.99 leave e^-30 of the start; the solver keeps about ten digits.
    np.testing.assert_allclose(covariance[-1], filtered, rtol=1e-8)


def test_density_is_scaled_by_the_sample_time() -> None:
    given = tuning(two_mass())
    density = given.pop("process_covariance")
    a = KalmanFilter(two_mass(), DT, process_density=density, **given)
    b = KalmanFilter(two_mass(), DT, process_covariance=density * DT, **given)
    np.testing.assert_allclose(a.process_covariance, b.process_covariance, rtol=1e-15)


def test_extended_filter_equals_filterpy_with_jacobians_by_hand() -> None:
    def advance(x: jax.Array, u: jax.Array, r: jax.Array) -> jax.Array:
        return jnp.stack([x[0] + 0.05 * x[1], x[1] + 0.05 * (u[0] - 9.81 * jnp.sin(x[0]))])

    given = {
        "process_covariance": np.diag([1e-4, 2e-4]),
        "measurement_covariance": [[0.02]],
        "initial_covariance": np.diag([0.5, 0.2]),
    }
    observer = ExtendedKalmanFilter((advance, lambda x, u, r: jnp.sin(x[:1])), 0.05, states=("angle", "rate"), **given)
    u, y, r = np.sin(np.arange(100))[:, None], 0.5 * np.cos(0.1 * np.arange(100))[:, None], np.zeros((100, 0))
    found, covariance = run(observer, np.array([0.4, 0.0]), (u, y, r))
    other = FilterpyExtended(dim_x=2, dim_z=1)
    other.x, other.P, other.Q = np.array([0.4, 0.0]), given["initial_covariance"], given["process_covariance"]
    other.R = np.array(given["measurement_covariance"])
    for k in range(100):
        other.update(y[k], lambda x: np.array([[np.cos(x[0]), 0.0]]), lambda x: np.sin(x[:1]))
        # The same equations, Jacobians by hand against automatic ones: rounding only.
        np.testing.assert_allclose(found[k], other.x, rtol=1e-9, atol=1e-11)
        np.testing.assert_allclose(covariance[k], other.P, rtol=1e-9, atol=1e-11)
        x = other.x
        F = np.array([[1.0, 0.05], [-0.05 * 9.81 * np.cos(x[0]), 1.0]])
        other.x = np.array([x[0] + 0.05 * x[1], x[1] + 0.05 * (u[k, 0] - 9.81 * np.sin(x[0]))])
        other.P = F @ other.P @ F.T + other.Q
    assert observer.states == ("angle", "rate")


@pytest.mark.parametrize("kind", [ExtendedKalmanFilter, UnscentedKalmanFilter])
def test_a_system_and_its_two_functions_give_one_filter(kind: type) -> None:
    plant, given = pendulum(), tuning(pendulum())
    step = one_step(plant, DT, "rk4", substeps=2)
    by_system = kind(plant, DT, substeps=2, **given)
    by_functions = kind((step, lambda x, u, r: x[:1]), DT, **given)
    for a, b in zip(*(run(o, np.array([1.0, 0.0]), samples(plant)) for o in (by_system, by_functions)), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-10, atol=1e-12)


@pytest.mark.parametrize("kind", [ExtendedKalmanFilter, UnscentedKalmanFilter])
def test_nonlinear_filters_find_the_pendulum(kind: type) -> None:
    plant, rng = pendulum(), np.random.default_rng(1)
    step, x, xs, ys = eqx.filter_jit(one_step(plant, DT)), jnp.array([1.2, 0.0]), [], []
    us = np.sin(0.05 * np.arange(500))[:, None]
    for u in us:
        xs.append(np.asarray(x))
        ys.append(np.asarray(x[:1]) + 0.02 * rng.normal(size=1))
        x = step(x, u, jnp.zeros(0))
    given = {
        "measurement_covariance": [[4e-4]],
        "process_covariance": 1e-8 * np.eye(2),
        "initial_covariance": np.eye(2),
    }
    found, covariance = run(kind(plant, DT, **given), np.array([0.3, 1.0]), (us, np.array(ys), np.zeros((500, 0))))
    error = (found - np.array(xs))[100:]
    deviation = np.sqrt(np.diagonal(covariance[100:], axis1=1, axis2=2))
    # Below the raw noise of 0.02, and within five standard deviations of what the filter says of itself.
    assert np.sqrt((error[:, 0] ** 2).mean()) < 0.01
    assert (np.abs(error) < 5 * deviation).all()


@pytest.mark.parametrize("kind", [KalmanFilter, ExtendedKalmanFilter, UnscentedKalmanFilter])
def test_batches_of_tunings_and_guesses_share_one_trace(kind: type) -> None:
    plant, record, given = car(), samples(car(), 20), tuning(car())
    traces = []

    @eqx.filter_jit
    def last(observer: Observer, x0: jax.Array) -> jax.Array:
        traces.append(1)
        return scan(observer, observer.init(x0), record).x[-1]

    noises = [0.01, 0.1, 1.0]
    observers = [kind(plant, DT, **(given | {"measurement_covariance": [[n]]})) for n in noises]
    singles = [last(observer, jnp.ones(2)) for observer in observers]
    assert len(traces) == 1
    stacked = jax.tree.map(lambda *leaves: jnp.stack(leaves), *observers)
    # Vectorised code may fuse multiplications and additions differently.
    np.testing.assert_allclose(eqx.filter_vmap(last, in_axes=(0, None))(stacked, jnp.ones(2)), singles, rtol=1e-11)
    guesses = jnp.array([[1.0, 1.0], [0.0, 0.5]])
    by_guess = eqx.filter_vmap(last, in_axes=(None, 0))(observers[0], guesses)
    np.testing.assert_allclose(by_guess, [last(observers[0], g) for g in guesses], rtol=1e-11)
    assert not np.allclose(singles[0], singles[2])


@pytest.mark.parametrize("kind", [KalmanFilter, ExtendedKalmanFilter, UnscentedKalmanFilter])
@pytest.mark.parametrize("plant", [car(), two_mass()])
def test_a_float32_guess_makes_a_finite_float32_run(kind: type, plant: System) -> None:
    observer, record = kind(plant, DT, **tuning(plant)), samples(plant, 400)
    x0 = np.ones(plant.nx)
    single = scan(observer, observer.init(x0.astype(np.float32)), record)
    double = scan(observer, observer.init(x0), record)
    assert single.x.dtype == single.covariance.dtype == jnp.float32
    # Seven digits, an innovation gain of order one and 400 contracting steps.
    np.testing.assert_allclose(single.x, double.x, atol=2e-3)
    np.testing.assert_allclose(single.covariance, double.covariance, atol=2e-3)


def test_covariances_stay_symmetric_and_positive_under_extreme_tuning() -> None:
    plant = PLANTS["two mass"]
    given = {
        "process_covariance": 1e-12 * np.eye(4),
        "measurement_covariance": np.diag([1e-10, 1e4]),
        "initial_covariance": np.diag([1e8, 0.0, 1e8, 1.0]),
    }
    _, covariance = run(KalmanFilter(plant, **given), np.zeros(4), samples(plant, 2000))
    assert np.array_equal(covariance, covariance.transpose(0, 2, 1))
    smallest = np.linalg.eigvalsh(covariance)[:, 0]
    # Joseph form: negative only by rounding of the largest entry met, 1e8.
    assert (smallest >= -1e-15 * np.abs(covariance).max(axis=(1, 2))).all()


def test_a_nonlinear_plant_is_sent_to_the_extended_filter() -> None:
    with pytest.raises(NotAccepted, match=r"`pendulum` has a nonlinearity; use `ExtendedKalmanFilter`"):
        KalmanFilter(pendulum(), DT, **tuning(pendulum()))


def test_no_library_factorisation_is_called() -> None:
    observer = UnscentedKalmanFilter(two_mass(), DT, **tuning(two_mass()))
    u, y, r = (part[0] for part in samples(two_mass()))
    text = str(jax.make_jaxpr(observer.step)(observer.init(np.zeros(4)), u, y, r))
    assert "cholesky" not in text
    assert "triangular_solve" not in text
