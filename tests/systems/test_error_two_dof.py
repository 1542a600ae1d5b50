"""The error of an observer whose output error also corrects the argument of f, against the two vector fields themselves."""

import jax.numpy as jnp
import numpy as np
import pytest

from catalogue import oscillator
from luenberger.algebra import Polynomial
from luenberger.core import BadInput, NotAccepted
from luenberger.systems import Nonlinearity, Parameter, System
from luenberger.systems.error_system import ErrorSystem
from luenberger.systems.jacobian_box import error_box, jacobian_corners

generator = np.random.default_rng(4)
J = generator.normal(size=(2, 2))


def scheduled(**bound: object) -> System:
    """Three states, one scheduling parameter, f linear so that its Jacobian is J everywhere; sensors and inputs noisy."""
    f = Nonlinearity.bounded(lambda z, u: jnp.asarray(J) @ z, [[1.0, 0, 0], [0, 0.5, 1.0]], size=2, **bound)  # type: ignore[arg-type]
    draw = generator.normal
    return System.lpv(
        Polynomial.affine(draw(size=(3, 3)), p=draw(size=(3, 3))),
        draw(size=(3, 2)),
        draw(size=(1, 3)),
        draw(size=(1, 2)),
        F=Polynomial.affine(draw(size=(3, 2)), p=draw(size=(3, 2))),
        G=draw(size=(1, 2)),
        N=draw(size=(2, 2)),
        nonlinearity=f,
        parameters=[Parameter("p", -1.0, 2.0)],
    )


def test_error_and_noise_of_the_two_vector_fields() -> None:
    plant = scheduled(jacobian=(J, J))
    L, L2 = (Polynomial.affine(generator.normal(size=(3, 1)), p=generator.normal(size=(3, 1))) for _ in range(2))
    error = ErrorSystem.of(plant, L, argument_gain=L2)
    for _ in range(5):
        p, x, xhat = generator.uniform(-1, 2), generator.normal(size=3), generator.normal(size=3)
        u, v = generator.normal(size=2), generator.normal(size=2)
        A, B, C, D, F, G, N = (np.asarray(plant.at(k, [p])) for k in "ABCDFGN")
        read = u + N @ v
        seen = C @ x + D @ u + G @ v - C @ xhat - D @ read
        zeta = xhat + L2({"p": p}) @ seen
        H = np.asarray(plant.nonlinearity.H)  # type: ignore[union-attr]
        moved = A @ x + B @ u + F @ J @ H @ x
        copied = A @ xhat + B @ read + F @ J @ H @ zeta + L({"p": p}) @ seen
        ours = error.A({"p": p}) @ (x - xhat) + error.noise({"p": p}) @ v
        np.testing.assert_allclose(ours, moved - copied, atol=1e-12)


def test_zero_argument_gain_changes_nothing() -> None:
    plant = scheduled(jacobian=(J - 1.0, J + 1.0))
    L = Polynomial.constant(generator.normal(size=(3, 1)))
    one, two = ErrorSystem.of(plant, L), ErrorSystem.of(plant, L, argument_gain=Polynomial.constant(np.zeros((3, 1))))
    point = {n: generator.uniform(*ends) for n, ends in error_box(plant).items()}
    for ours, theirs in ((one.A, two.A), (one.noise, two.noise)):
        np.testing.assert_allclose(
            ours({n: point[n] for n in ours.names}), theirs({n: point[n] for n in theirs.names}), atol=1e-14
        )


def test_noise_inside_a_norm_bounded_channel_has_no_direction() -> None:
    plant = scheduled(lipschitz=3.0)
    L = Polynomial.constant(np.ones((3, 1)))
    error = ErrorSystem.of(plant, L, argument_gain=L)
    assert error.H is not None
    C = np.asarray(plant.at("C", [0.0]))
    np.testing.assert_allclose(error.H({}), plant.nonlinearity.H @ (np.eye(3) - np.ones((3, 1)) @ C), atol=1e-14)  # type: ignore[union-attr]
    with pytest.raises(BadInput, match="no input"):
        error.joined("noise")


def test_an_argument_gain_needs_a_nonlinearity_and_the_shape_of_a_gain() -> None:
    L = Polynomial.constant(np.zeros((2, 1)))
    with pytest.raises(NotAccepted, match="no nonlinearity"):
        ErrorSystem.of(oscillator(), L, argument_gain=L)
    plant = scheduled(jacobian=(J, J))
    with pytest.raises(BadInput, match="shape"):
        ErrorSystem.of(plant, Polynomial.constant(np.zeros((3, 1))), argument_gain=L)


def test_a_hull_has_one_plant_a_vertex() -> None:
    vertices = J + np.array([np.zeros((2, 2)), np.diag([1.0, 0.0]), np.diag([0.0, 2.0])])
    plant = scheduled(hull=vertices)
    corners = jacobian_corners(plant)
    assert len(corners) == 3
    for corner, vertex in zip(corners, vertices, strict=True):
        assert set(error_box(corner)) == {"p"}
        np.testing.assert_array_equal(corner.nonlinearity.jacobian_lower, vertex)  # type: ignore[union-attr]
    assert {"df1_dz1", "df2_dz2"} <= set(error_box(plant))
    boxed = plant.replace(nonlinearity=plant.nonlinearity.boxed())  # type: ignore[union-attr]
    assert jacobian_corners(boxed) == (boxed,)
