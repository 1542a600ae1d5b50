"""Sampled plants against SciPy, against each other, and the refusals that say which method applies."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.integrate
import scipy.linalg
import scipy.signal

from luenberger.algebra import Polynomial
from luenberger.core import BadInput, NotAccepted
from luenberger.systems import MatrixFunction, Parameter, System
from luenberger.systems.discretize import derivative, discretize, largest_norm, one_step, varying
from observers.plants import car, car_by_function, pendulum, two_mass

DT = 0.02
R = np.array([20.0, 0.05])


def at(system: System, letter: str, r: object = ()) -> np.ndarray:
    return np.asarray(system.at(letter, r))


def test_exact_hold_equals_scipy() -> None:
    plant = two_mass()
    sampled = discretize(plant, DT)
    A, B, C, D, _ = scipy.signal.cont2discrete([at(plant, k) for k in "ABCD"], DT, method="zoh")
    for letter, value in zip("ABCD", (A, B, C, D), strict=True):
        # Both are SciPy's expm of matrices that differ by the E column only.
        np.testing.assert_allclose(at(sampled, letter), value, atol=1e-14)
    E = scipy.signal.cont2discrete([at(plant, "A"), at(plant, "E"), at(plant, "C"), np.zeros((2, 1))], DT)[1]
    np.testing.assert_allclose(at(sampled, "E"), E, atol=1e-14)
    assert sampled.dt == DT
    assert sampled.states == plant.states


def test_exact_hold_of_the_nonlinear_column_is_the_integral_of_the_exponential() -> None:
    plant = pendulum()
    sampled = discretize(plant, DT, "exact")
    A, F, s = at(plant, "A"), at(plant, "F"), np.linspace(0.0, DT, 201)
    # Simpson over 200 parts of a smooth integrand: far below 1e-13.
    from_integral = scipy.integrate.simpson(scipy.linalg.expm(A * s[:, None, None]) @ F, x=s, axis=0)
    np.testing.assert_allclose(at(sampled, "F"), from_integral, atol=1e-13)
    assert sampled.nonlinearity is plant.nonlinearity


def test_euler_keeps_the_form_of_every_plant() -> None:
    for plant, r in ((car(), R), (pendulum(), ()), (car_by_function(), R[:1]), (two_mass(), ())):
        sampled = discretize(plant, DT, "euler")
        np.testing.assert_allclose(at(sampled, "A", r), np.eye(plant.nx) + DT * at(plant, "A", r), rtol=1e-15)
        for letter in "BEF":
            np.testing.assert_allclose(at(sampled, letter, r), DT * at(plant, letter, r), rtol=1e-15)
        for letter in "CDG":
            assert np.array_equal(at(sampled, letter, r), at(plant, letter, r))


def test_rk4_of_a_scheduled_plant_is_the_taylor_polynomial_of_the_exponential() -> None:
    plant = car()
    sampled = discretize(plant, DT, "rk4")
    assert isinstance(sampled.A, Polynomial)
    hA = DT * at(plant, "A", R)
    powers = [np.linalg.matrix_power(hA, k) for k in range(5)]
    # Products of five matrices of norm below one: rounding only.
    np.testing.assert_allclose(
        at(sampled, "A", R), sum(p / f for p, f in zip(powers, (1, 1, 2, 6, 24), strict=True)), atol=1e-14
    )
    phi = sum(p / f for p, f in zip(powers, (1, 2, 6, 24), strict=False))
    np.testing.assert_allclose(at(sampled, "B", R), DT * phi @ at(plant, "B", R), atol=1e-14)


def test_rk4_degree_drops_terms_that_vanish() -> None:
    nilpotent = Polynomial.affine([[0.0, 0.0], [0.0, 0.0]], p=[[0.0, 1.0], [0.0, 0.0]])
    plant = System.lpv(nilpotent, [[0.0], [1.0]], parameters=[Parameter("p", 1.0, 2.0)])
    assert discretize(plant, DT, "rk4").A.degree == {"p": 1}


@pytest.mark.parametrize(("plant", "r"), [(two_mass(), ()), (car(), R), (car_by_function(), R[:1])])
def test_rk4_map_of_a_linear_plant_is_the_rk4_system(plant: System, r: object) -> None:
    rng = np.random.default_rng(3)
    x, u = rng.normal(size=plant.nx), rng.normal(size=plant.nu)
    system = discretize(plant, DT, "rk4")
    # Horner against four stages: the same polynomial in another order of operations.
    np.testing.assert_allclose(one_step(plant, DT)(x, u, r), system.dynamics(0.0, x, u, r), rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(one_step(system, DT)(x, u, r), system.dynamics(0.0, x, u, r), rtol=1e-13, atol=1e-15)


def test_rk4_error_falls_with_the_fourth_power_of_the_step() -> None:
    plant, x, u = pendulum(), jnp.array([1.0, 0.5]), jnp.array([0.2])
    fine = one_step(plant, 0.4, "rk4", substeps=512)(x, u, ())
    errors = [float(jnp.abs(one_step(plant, 0.4, "rk4", substeps=s)(x, u, ()) - fine).max()) for s in (4, 8)]
    # Order four: halving the step divides the error by 16, up to the next order.
    assert 12 < errors[0] / errors[1] < 20


def test_first_order_maps_converge_to_the_same_state() -> None:
    plant, x, u = pendulum(), jnp.array([1.0, 0.5]), jnp.array([0.2])
    fine = one_step(plant, 0.4, "rk4", substeps=64)(x, u, ())
    for method in ("euler", "exact"):
        errors = [float(jnp.abs(one_step(plant, 0.4, method, substeps=s)(x, u, ()) - fine).max()) for s in (16, 32)]
        # Order one: halving the step halves the error, up to the next order.
        assert 1.7 < errors[0] / errors[1] < 2.3


@pytest.mark.parametrize(("plant", "r"), [(two_mass(), ()), (car(), R), (car_by_function(), R[:1])])
@pytest.mark.parametrize("dt", [0.02, 1.5])
def test_exact_map_equals_scipy(plant: System, r: object, dt: float) -> None:
    rng = np.random.default_rng(4)
    x, u = rng.normal(size=plant.nx), rng.normal(size=plant.nu)
    A, B = at(plant, "A", r), at(plant, "B", r)
    held = scipy.linalg.expm(np.block([[A * dt, B * dt], [np.zeros((1, plant.nx + 1))]]))[: plant.nx]
    # |dt A| reaches 60: six squarings of rounding errors.
    np.testing.assert_allclose(one_step(plant, dt, "exact")(x, u, r), held @ np.r_[x, u], rtol=1e-11, atol=1e-12)


def test_maps_use_the_middle_of_what_is_not_measured() -> None:
    A = Polynomial.affine([[-1.0]], stiff=[[-1.0]])
    plant = System.lpv(A, parameters=[Parameter("stiff", 0.0, 4.0, measured=False)])
    assert one_step(plant, 0.1, "exact")(jnp.ones(1), jnp.zeros(0), ())[0] == pytest.approx(np.exp(-0.3), rel=1e-15)


def test_derivative_is_the_dynamics() -> None:
    rng = np.random.default_rng(5)
    for plant, r in ((two_mass(), ()), (car(), R), (pendulum(), ())):
        x, u = rng.normal(size=plant.nx), rng.normal(size=plant.nu)
        np.testing.assert_allclose(derivative(plant, x, u, r), plant.dynamics(0.0, x, u, r), rtol=1e-13)


def test_maps_run_under_jit_vmap_and_differentiation() -> None:
    step = one_step(car(), DT, "exact")
    xs = jnp.asarray(np.random.default_rng(0).normal(size=(5, 2)))
    u, r = jnp.array([0.1]), jnp.asarray(R)
    batch = jax.jit(jax.vmap(step, in_axes=(0, None, None)))(xs, u, r)
    np.testing.assert_allclose(batch, [step(x, u, r) for x in xs], rtol=1e-13)
    jacobian = jax.jacfwd(step)(xs[0], u, r)
    np.testing.assert_allclose(jacobian, scipy.linalg.expm(DT * at(car(), "A", R)), atol=1e-13)


def test_norm_bound_covers_the_box() -> None:
    plant = car()
    bound = largest_norm(plant.A, plant.scheduling_box)
    for vx in np.linspace(10, 50, 9):
        A = at(plant, "A", (vx, 1 / vx))
        # Balancing scales the states, so the bound holds for the spectral radius, which no scaling changes.
        assert np.abs(np.linalg.eigvals(A)).max() <= bound
    assert (
        largest_norm(car_by_function().A, {"vx": (10.0, 50.0)})
        >= np.abs(np.linalg.eigvals(at(plant, "A", (10, 0.1)))).max()
    )


def test_refusals_name_the_method_that_applies() -> None:
    with pytest.raises(NotAccepted, match=r"`A` of `car` depend on \['inverse_vx', 'vx'\].*method=\"rk4\""):
        discretize(car(), DT)
    with pytest.raises(NotAccepted, match='use method="euler"'):
        discretize(pendulum(), DT, "rk4")
    with pytest.raises(NotAccepted, match="discrete already"):
        discretize(discretize(two_mass(), DT), DT)
    with pytest.raises(BadInput, match=r"`dt` is -1.*positive step"):
        discretize(two_mass(), -1.0)
    with pytest.raises(BadInput, match="Did you mean `rk4`"):
        one_step(two_mass(), DT, "rk45")  # pyright: ignore[reportArgumentType]
    with pytest.raises(BadInput, match="at least one sub-step"):
        one_step(two_mass(), DT, substeps=0)
    with pytest.raises(BadInput, match=r"`dt` is 0.01 s but `two mass` is a discrete plant with dt = 0.02 s"):
        one_step(discretize(two_mass(), DT), 0.01)


def test_exact_refusal_of_a_nonlinear_scheduled_plant_offers_euler() -> None:
    plant = pendulum().replace(
        A=Polynomial.affine([[0.0, 1.0], [0.0, 0.0]], drag=[[0.0, 0.0], [0.0, -1.0]]),
        parameters=[Parameter("drag", 0.1, 0.5)],
    )
    with pytest.raises(NotAccepted, match='method="euler"'):
        discretize(plant, DT)


def test_a_parameter_with_zero_coefficient_does_not_vary() -> None:
    A = Polynomial(("p",), {(0,): np.array([[-1.0]]), (1,): np.array([[0.0]])})
    plant = System.lpv(A, [[1.0]], parameters=[Parameter("p", 0.0, 1.0)])
    assert varying(plant) == ()
    assert at(discretize(plant, 0.1), "A", (0.3,))[0, 0] == pytest.approx(np.exp(-0.1), rel=1e-15)


def test_function_matrices_stay_functions() -> None:
    assert isinstance(discretize(car_by_function(), DT, "rk4").A, MatrixFunction)
