"""A nonlinearity without a usable bound is refused; the bounds kept are sound."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from luenberger.core import BadInput
from luenberger.systems import Nonlinearity


def sine(z: Any, u: Any) -> jax.Array:
    return jnp.sin(z)


PICK = [[0.0, 1.0]]


def test_a_bound_is_needed() -> None:
    with pytest.raises(BadInput, match="neither `jacobian` nor `hull` nor `lipschitz` is given"):
        Nonlinearity.bounded(sine, PICK)


@pytest.mark.parametrize("lipschitz", [-1.0, np.nan, np.inf])
def test_a_lipschitz_constant_is_finite_and_not_negative(lipschitz: float) -> None:
    with pytest.raises(BadInput, match="a finite constant >= 0"):
        Nonlinearity.bounded(sine, PICK, lipschitz=lipschitz)


def test_an_inverted_jacobian_bound_is_located() -> None:
    with pytest.raises(BadInput, match=r"entry \(0, 1\) is \[2\.0, 1\.0\]"):
        Nonlinearity.bounded(sine, np.eye(2), jacobian=([[0.0, 2.0]], [[1.0, 1.0]]))


@pytest.mark.parametrize("jacobian", [([[-1.0, 0.0]], [[1.0, 1.0]]), ([[-1.0]], [[np.inf]]), ([-1.0], [1.0])])
def test_a_jacobian_bound_has_the_shape_of_the_jacobian(jacobian: tuple[Any, Any]) -> None:
    with pytest.raises(BadInput, match="jacobian"):
        Nonlinearity.bounded(sine, PICK, jacobian=jacobian)


@pytest.mark.parametrize(
    ("domain", "message"),
    [
        (([1.0, 0.0], [0.0, 1.0]), r"state 0 the interval \[1\.0, 0\.0\]"),
        (([0.0], [1.0]), r"`H` has 2 columns; both need \(2,\)"),
        (([0.0, np.nan], [1.0, 1.0]), "domain lower"),
    ],
)
def test_a_domain_is_a_state_box(domain: tuple[Any, Any], message: str) -> None:
    with pytest.raises(BadInput, match=message):
        Nonlinearity.bounded(sine, PICK, lipschitz=1.0, domain=domain)


def test_it_is_evaluated_on_the_selected_states() -> None:
    f = Nonlinearity.bounded(sine, PICK, lipschitz=1.0)
    np.testing.assert_allclose(f(np.array([9.0, 0.5]), np.zeros(0)), [np.sin(0.5)], rtol=1e-15)
    assert f.bound_status == "declared"


def test_a_scalar_result_becomes_a_vector() -> None:
    f = Nonlinearity.bounded(lambda z, u: z[0] * u[0], PICK, lipschitz=1.0)
    assert f(np.array([0.0, 2.0]), np.array([3.0])).tolist() == [6.0]


def test_it_runs_under_jit_and_vmap() -> None:
    f = Nonlinearity.bounded(sine, PICK, lipschitz=1.0)
    states = jnp.array([[0.0, 0.1], [0.0, 0.2]])
    found = eqx.filter_jit(jax.vmap(lambda x: f(x, jnp.zeros(0))))(states)
    np.testing.assert_allclose(found[:, 0], np.sin([0.1, 0.2]), rtol=1e-15)


def test_the_declared_constant_comes_before_the_box() -> None:
    f = Nonlinearity.bounded(sine, PICK, jacobian=([[-1.0]], [[1.0]]), lipschitz=0.5)
    assert f.lipschitz_bound == 0.5


@given(st.lists(st.floats(-2, 2), min_size=4, max_size=4), st.lists(st.floats(0, 1), min_size=4, max_size=4))
def test_the_norm_of_the_box_bounds_every_jacobian_inside(low: list[float], share: list[float]) -> None:
    lower = np.reshape(low, (2, 2))
    upper = lower + 1.5
    f = Nonlinearity.bounded(lambda z, u: z, np.eye(2), size=2, jacobian=(lower, upper))
    inside = lower + np.reshape(share, (2, 2)) * (upper - lower)
    assert np.linalg.norm(inside, 2) <= f.lipschitz_bound * (1 + 1e-12)


def test_enclosing_needs_single_states() -> None:
    with pytest.raises(BadInput, match="one 1 in each row"):
        Nonlinearity.enclosed(sine, [[1.0, 1.0]], ([0.0, 0.0], [1.0, 1.0]))
    with pytest.raises(BadInput, match="lower <= upper"):
        Nonlinearity.enclosed(sine, PICK, ([0.0, 2.0], [1.0, 1.0]))


def test_an_enclosed_jacobian_is_proved_and_contains_the_true_one() -> None:
    f = Nonlinearity.enclosed(lambda z, u: jnp.sin(z), PICK, ([-9.0, 0.1], [9.0, 1.0]))
    assert f.bound_status == "proved"
    lower, upper = f.jacobian_lower, f.jacobian_upper
    assert lower is not None
    assert upper is not None
    # cos falls on [0.1, 1.0]; the box may be a thousandth wider, never narrower.
    assert np.cos(1.0) - 1e-3 <= lower[0, 0] <= np.cos(1.0)
    assert np.cos(0.1) <= upper[0, 0] <= np.cos(0.1) + 1e-3


def test_a_hull_stands_for_the_box_around_it() -> None:
    vertices = np.array([[[0.0, -1.0]], [[2.0, 0.0]], [[-2.0, 0.0]]])
    f = Nonlinearity.bounded(lambda z, u: z[:1], np.eye(2), hull=vertices)
    assert f.jacobian_lower is not None
    np.testing.assert_array_equal(f.jacobian_lower, [[-2.0, -1.0]])
    np.testing.assert_array_equal(f.jacobian_upper, [[2.0, 0.0]])
    # The box reaches (2, -1), of norm sqrt 5; the hull only norm 2.
    assert f.lipschitz_bound == pytest.approx(2.0)
    assert f.boxed().lipschitz_bound == pytest.approx(5**0.5)


@pytest.mark.parametrize(
    ("hull", "jacobian"),
    [
        (np.zeros((0, 1, 2)), None),
        (np.zeros((3, 2, 2)), None),
        (np.zeros((1, 2)), None),
        (np.zeros((3, 1, 2)), ([[0.0, 0.0]], [[1.0, 1.0]])),
    ],
)
def test_a_hull_of_the_wrong_shape_or_beside_a_box_is_refused(hull: np.ndarray, jacobian: Any) -> None:
    with pytest.raises(BadInput, match="`hull` has shape"):
        Nonlinearity.bounded(sine, np.eye(2), hull=hull, jacobian=jacobian)
