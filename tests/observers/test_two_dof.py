"""The observer with two degrees of freedom against its definition, against its special cases, and as running code."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from luenberger.algebra import Polynomial
from luenberger.core import BadInput, NotAccepted
from luenberger.observers import CorrectionObserver, substeps_needed
from luenberger.observers.two_dof import TwoDofObserver
from luenberger.systems import MatrixFunction, Nonlinearity, Parameter, System
from luenberger.systems.discretize import discretize
from observers.plants import DT, car, pendulum
from van_der_pol_plants import ARGUMENT_GAIN, TWO_GAIN, motions, on_the_limit_cycle, van_der_pol

U, Y, NONE = np.array([0.3]), np.array([0.7]), np.zeros(0)
START = np.array([1.0, -0.5])


def scheduled_pendulum(by_function: bool = False) -> System:
    """Pendulum with scheduled stiffness, a feedthrough in the angle sensor, and f of a sum of the states."""
    A = Polynomial.affine([[0.0, 1.0], [0.0, -0.3]], p=[[0.0, 0.0], [-1.0, 0.0]])
    constant, slope = (np.asarray(c) for c in A.terms.values())
    function = MatrixFunction(lambda v: constant + v["p"] * slope, ("p",), (2, 2))
    sine = Nonlinearity.bounded(lambda z, u: jnp.sin(z + u), [[1.0, 0.5]], jacobian=([[-1.0]], [[1.0]]))
    return System.lpv(
        function if by_function else A,
        [[0.0], [1.0]],
        [[1.0, 0.0]],
        [[0.2]],
        F=[[0.0], [-4.0]],
        nonlinearity=sine,
        parameters=[Parameter("p", 1.0, 4.0)],
        name="scheduled pendulum",
    )


GAIN = Polynomial.affine([[4.0], [8.0]], p=[[0.5], [-1.0]])
INTO_F = Polynomial.affine([[0.9], [0.4]], p=[[0.02], [0.1]])
R = np.array([2.5])


def slope_by_hand(x: np.ndarray) -> np.ndarray:
    p, u = R[0], U[0]
    e = Y[0] - x[0] - 0.2 * u
    zeta = x + np.array([0.9 + 0.02 * p, 0.4 + 0.1 * p]) * e
    f = np.sin(zeta[0] + 0.5 * zeta[1] + u)
    return np.array([x[1] + (4 + 0.5 * p) * e, -p * x[0] - 0.3 * x[1] + u - 4 * f + (8 - p) * e])


def test_the_output_error_enters_the_argument_and_the_derivative() -> None:
    z = START
    for _ in range(20_000):
        z = z + slope_by_hand(z + slope_by_hand(z) * (DT / 40_000)) * (DT / 20_000)
    observer = TwoDofObserver(scheduled_pendulum(), GAIN, INTO_F, DT, substeps=8)
    after, estimate = observer.step(observer.init(START), U, Y, R)
    # RK4 at 2.5 ms with rates near 6 1/s: error near 1e-10.
    np.testing.assert_allclose(after, z, rtol=1e-9)
    assert np.array_equal(estimate.x, START)
    held = TwoDofObserver(scheduled_pendulum(), GAIN, INTO_F, DT, method="exact")
    # f held over the step: error |F df/dt| dt^2 / 2 = 4 * 6 * 2e-4.
    np.testing.assert_allclose(held.step(held.init(START), U, Y, R)[0], z, atol=5e-3)


def test_discrete_step_is_the_definition() -> None:
    plant = discretize(scheduled_pendulum(), DT, "euler")
    observer = TwoDofObserver(plant, GAIN * DT, INTO_F)
    # The Euler map of the closed loop is x + dt slope; the same sums in another order.
    expected = START + DT * slope_by_hand(START)
    np.testing.assert_allclose(observer.step(observer.init(START), U, Y, R)[0], expected, rtol=1e-13)


@pytest.mark.parametrize("method", ["rk4", "exact", "map"])
def test_without_argument_gain_it_is_the_correction_observer(method: str) -> None:
    plant, options = scheduled_pendulum(), {"method": method}
    if method == "map":
        plant, options = discretize(plant, DT, "euler"), {}
    plain = CorrectionObserver(plant, GAIN, DT, **options)
    two = TwoDofObserver(plant, GAIN, np.zeros((2, 1)), DT, **options)
    assert (two.substeps, two.order) == (plain.substeps, plain.order)
    a, b = plain.init(START), two.init(START)
    for k in range(50):
        u, y = np.array([np.sin(k)]), np.array([np.cos(k)])
        a, b = plain.step(a, u, y, R)[0], two.step(b, u, y, R)[0]
        assert np.array_equal(a, b)


def test_a_measured_argument_needs_no_estimate() -> None:
    # H picks the measured angle and L2 = 1 there: f sees y whatever the estimate says.
    plant = pendulum()
    observer = TwoDofObserver(plant, [[4.0], [8.0]], [[1.0], [0.0]], DT, method="exact")
    by_output = System.linear(plant.at("A"), [[0.0, 0.0], [1.0, -9.81]], [[1.0, 0.0]])
    linear = CorrectionObserver(by_output, [[4.0], [8.0]], DT, method="exact")
    a, _ = observer.step(observer.init(START), U, Y, NONE)
    b, _ = linear.step(linear.init(START), np.array([U[0], np.sin(Y[0])]), Y, NONE)
    np.testing.assert_allclose(a, b, rtol=1e-13)


def test_converges_on_the_oscillator() -> None:
    plant, x = van_der_pol(), jnp.asarray(on_the_limit_cycle(1)[0])
    truth = motions(plant, TWO_GAIN, ARGUMENT_GAIN, x[None], np.zeros((1, 2)), 0.01, 3000)[0][0]
    last = {}
    for name, L, L2 in (("two", TWO_GAIN, ARGUMENT_GAIN), ("none", np.zeros((2, 1)), np.zeros((2, 1)))):
        observer = TwoDofObserver(plant, L, L2, 0.01)
        start = observer.init(x + jnp.array([0.4, 0.4]))
        scan = jax.lax.scan(lambda s, x, o=observer: o.step(s, NONE, x[:1], NONE), start, truth)
        last[name] = np.abs(np.asarray(scan[1].x) - truth)[2000:].max()
    # A decay of 0.5 1/s leaves 2e-5 after 20 s; y held for 10 ms while x1 moves at up to 2.7 1/s is 0.027 late.
    assert last["two"] < 0.05
    # Without any correction the phase on the limit cycle is never made up for.
    assert last["none"] > 0.2


def test_functions_on_the_domain_give_the_same_step() -> None:
    a = TwoDofObserver(scheduled_pendulum(), GAIN, INTO_F, DT)
    b = TwoDofObserver(scheduled_pendulum(by_function=True), GAIN, INTO_F, DT)
    assert a.substeps == b.substeps
    x = a.init(START)
    np.testing.assert_allclose(a.step(x, U, Y, R)[0], b.step(x, U, Y, R)[0], rtol=1e-12)


def test_clipping_holds_the_scheduling_in_its_box() -> None:
    observer = TwoDofObserver(scheduled_pendulum(), GAIN, INTO_F, DT, clip_scheduling=True)
    x = observer.init(START)
    assert np.array_equal(observer.step(x, U, Y, np.array([9.0]))[0], observer.step(x, U, Y, np.array([4.0]))[0])


def test_substeps_count_what_reaches_the_argument() -> None:
    # f = g z of the measured state alone: with L2 = 1 the slope of 30 1/s never closes a loop.
    line = Nonlinearity.bounded(lambda z, u: 30 * z, [[1.0]], jacobian=([[-30.0]], [[-30.0]]))
    plant = System.nonlinear([[0.0]], None, [[1.0]], F=[[1.0]], nonlinearity=line)
    assert substeps_needed(plant, [[10.0]], 0.1) == 8  # 40 1/s at 0.5 a sub-step
    assert substeps_needed(plant, [[10.0]], 0.1, argument_gain=[[1.0]]) == 2
    assert TwoDofObserver(plant, [[10.0]], [[0.5]], 0.1).substeps == 5
    bound = plant.replace(nonlinearity=Nonlinearity.bounded(lambda z, u: 30 * z, [[1.0]], lipschitz=30.0))
    assert substeps_needed(bound, [[10.0]], 0.1, argument_gain=[[0.5]]) == 5
    # A hull spares the corners of its box: (0, 0) and (-30, -30) of a sum, not (-30, 0).
    hull = Nonlinearity.bounded(lambda z, u: -30 * z[:1], np.eye(2), hull=[[[0.0, 0.0]], [[-30.0, -30.0]]])
    both = System.nonlinear(np.zeros((2, 2)), None, [[1.0, 0.0]], F=[[0.0], [1.0]], nonlinearity=hull)
    fastest = np.abs(np.linalg.eigvals([[0.0, 0.0], [-30.0, -30.0]])).max()
    assert substeps_needed(both, np.zeros((2, 1)), 1.0) == round(fastest / 0.5)


@pytest.mark.parametrize(
    ("gain", "message"),
    [
        (np.ones((1, 2)), r"`argument_gain` has shape \(1, 2\) but `pendulum` has 2 states"),
        ([[np.inf], [1.0]], "`argument_gain` holds inf"),
        (Polynomial.affine([[0.0], [0.0]], v=[[1.0], [0.0]]), r"`argument_gain` depends on \['v'\]"),
    ],
)
def test_wrong_argument_gains_are_refused(gain: object, message: str) -> None:
    with pytest.raises(BadInput, match=message):
        TwoDofObserver(pendulum(), [[4.0], [8.0]], gain, DT)


def test_a_linear_plant_has_no_argument() -> None:
    with pytest.raises(NotAccepted, match="`car` has no nonlinearity whose argument"):
        TwoDofObserver(car(), [[0.5], [10.0]], [[1.0], [0.0]], DT)


@pytest.mark.parametrize("method", ["rk4", "exact"])
def test_runs_under_jit_vmap_and_in_float32_without_retracing(method: str) -> None:
    traces = []

    @eqx.filter_jit
    def step(observer: TwoDofObserver, state: jax.Array) -> jax.Array:
        traces.append(1)
        return observer.step(state, jnp.asarray(U), jnp.asarray(Y), jnp.asarray(R))[0]

    first = TwoDofObserver(scheduled_pendulum(), GAIN, INTO_F, DT, method=method)
    observers = [eqx.tree_at(lambda o: o.argument_gain, first, INTO_F * scale) for scale in (0.5, 1.0, 2.0)]
    singles = [step(observer, jnp.asarray(START)) for observer in observers]
    assert len(traces) == 1
    assert not np.allclose(singles[0], singles[2])
    stacked = jax.tree.map(lambda *leaves: jnp.stack(leaves), *observers)
    batch = eqx.filter_vmap(step, in_axes=(0, None))(stacked, jnp.asarray(START))
    # Vectorised code may fuse multiplications and additions differently.
    np.testing.assert_allclose(batch, singles, rtol=1e-13)
    single = step(observers[0], jnp.asarray(START, jnp.float32))
    assert single.dtype == jnp.float32
    np.testing.assert_allclose(single, singles[0], rtol=1e-5)


def test_the_step_holds_no_factorisation() -> None:
    observer = TwoDofObserver(scheduled_pendulum(), GAIN, INTO_F, DT, method="exact")
    program = jax.make_jaxpr(lambda x: observer.step(x, U, Y, R)[0])(jnp.asarray(START))
    kernels = {"lu", "cholesky", "triangular_solve", "custom_call", "eigh", "qr"}
    assert not kernels & {equation.primitive.name for equation in program.eqns}
