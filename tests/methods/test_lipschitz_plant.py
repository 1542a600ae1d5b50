"""Lipschitz plants in chosen coordinates."""

import jax.numpy as jnp
import numpy as np
import pytest

from lipschitz_plants import POINT_THREE, integrator, pendulum
from luenberger.algebra import Polynomial
from luenberger.core import BadInput, NotAccepted
from luenberger.methods.lipschitz_plant import (
    LumpedPlant,
    as_tuples,
    require_epsilon,
    require_lipschitz,
    require_weight,
    transform_matrix,
)
from luenberger.systems import Parameter, System


def test_lipschitz_constant_bounds_the_transformed_nonlinearity() -> None:
    plant = pendulum(2.0)
    T = np.array([[1.0, 0.2], [-0.3, 0.5]])
    lumped = LumpedPlant.of(plant, T)
    generator = np.random.default_rng(0)
    F, f = np.asarray(plant.at("F")), plant.nonlinearity
    assert f is not None
    for z in generator.uniform(-3, 3, (200, 2, 2)):
        ends = [T @ F @ np.asarray(f(jnp.asarray(np.linalg.solve(T, part)), jnp.zeros(1))) for part in z]
        assert np.linalg.norm(ends[0] - ends[1]) <= lumped.lipschitz * np.linalg.norm(z[0] - z[1]) * (1 + 1e-12)
    assert LumpedPlant.of(plant, POINT_THREE).lipschitz == pytest.approx(0.6, rel=1e-14)


def test_matrices_are_similar_to_the_plant() -> None:
    plant = pendulum(disturbed=True)
    lumped = LumpedPlant.of(plant, [[1.0, 0.2], [-0.3, 0.5]])
    np.testing.assert_allclose(lumped.T_inverse @ lumped.A @ lumped.T, plant.at("A"), atol=1e-15)
    np.testing.assert_allclose(lumped.C @ lumped.T, plant.at("C"), atol=1e-15)
    np.testing.assert_allclose(lumped.T_inverse @ lumped.E, plant.at("E"), atol=1e-15)
    L = np.array([[1.0], [2.0]])
    loop = lumped.T @ (np.asarray(plant.at("A")) - L @ np.asarray(plant.at("C"))) @ lumped.T_inverse
    np.testing.assert_allclose(lumped.loop(L), loop, atol=1e-15)


def test_gain_is_the_same_in_any_coordinates_for_the_same_storage() -> None:
    # V = e' P e fixes L = P^-1 C' / (2 epsilon) whatever coordinates P is written in.
    plant = pendulum()
    P = np.array([[2.0, 0.3], [0.3, 1.0]])
    plain = LumpedPlant.of(plant).gain(P, 0.5)
    lumped = LumpedPlant.of(plant, [[1.0, 0.2], [-0.3, 0.5]])
    there = lumped.T_inverse.T @ P @ lumped.T_inverse
    np.testing.assert_allclose(lumped.gain(there, 0.5), plain, rtol=1e-13)


def test_weights() -> None:
    lumped = LumpedPlant.of(pendulum(), POINT_THREE)
    np.testing.assert_array_equal(lumped.weight("transformed"), np.eye(2))
    np.testing.assert_allclose(lumped.weight("original"), np.diag([1.0, 1 / 0.09]), rtol=1e-14)


def test_transform_forms() -> None:
    np.testing.assert_array_equal(transform_matrix(None, 2), np.eye(2))
    np.testing.assert_array_equal(transform_matrix((1, 2), 2), np.diag([1.0, 2.0]))
    assert as_tuples(np.diag([1.0, 2.0])) == ((1.0, 0.0), (0.0, 2.0))
    assert as_tuples([1, 2]) == (1.0, 2.0)
    assert as_tuples(None) is None
    with pytest.raises(BadInput, match=r"condition number .*below 1e12"):
        transform_matrix([[1.0, 1.0], [1.0, 1.0]], 2)
    with pytest.raises(BadInput, match=r"`transform` has shape \(3, 3\) but the system has 2 states"):
        transform_matrix((1.0, 1.0, 1.0), 2)
    with pytest.raises(BadInput, match="finite"):
        transform_matrix((1.0, np.nan), 2)


def test_refusals() -> None:
    moving = System.lpv(Polynomial.affine([[0.0]], r=[[1.0]]), C=[[1.0]], parameters=[Parameter("r", 0.0, 1.0)])
    with pytest.raises(NotAccepted, match="constant matrices"):
        LumpedPlant.of(moving)
    with pytest.raises(NotAccepted, match="discrete"):
        LumpedPlant.of(System.linear([[0.5]], dt=0.1))
    with pytest.raises(NotAccepted, match="no nonlinearity"):
        require_lipschitz(integrator())
    for bad in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(BadInput, match="positive finite"):
            require_epsilon(bad)
    for bad in (0.0, 1.0, 2.0, np.nan):
        with pytest.raises(BadInput, match="strictly between 0 and 1"):
            require_weight("delta", bad)
    with pytest.raises(BadInput, match=r"`gain` has shape \(1, 2\)"):
        LumpedPlant.of(pendulum()).loop([[1.0, 2.0]])
