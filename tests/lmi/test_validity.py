"""Largest invariant ellipsoids inside strips, against those that can be written down."""

from dataclasses import replace
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

from luenberger.algebra import Polynomial
from luenberger.certify import Claim
from luenberger.certify.validity import domain_verdict
from luenberger.core import BadInput, Outcome
from luenberger.lmi.validity import validity_storage
from luenberger.systems import Nonlinearity, Parameter, System
from luenberger.systems.discretize import discretize

SQUARE = ([-2.0, -2.0], [2.0, 2.0])
KEPT = np.array([0.5, 1.0])
ZERO = Polynomial.constant(np.zeros((2, 1)))


def plant(rate: float = 2.0, **bound: object) -> System:
    """Two states that decay alone; f reads both."""
    chosen = bound or {"jacobian": (-np.eye(2), np.eye(2))}
    f = Nonlinearity.bounded(lambda z, u: jnp.sin(z), np.eye(2), size=2, domain=SQUARE, **chosen)  # type: ignore[arg-type]
    return System.nonlinear(-rate * np.eye(2), None, [[1.0, 0.0]], F=np.eye(2), nonlinearity=f)


def proved(
    system: System, found: tuple[np.ndarray, float, float] | None, kept: np.ndarray, **gains: Polynomial
) -> bool:
    assert found is not None
    claim = Claim("domain", found[1], found[0], multiplier=found[2], state_bound=kept)
    return domain_verdict(system, ZERO, claim, **gains)[1].outcome is Outcome.PROVED


def semi_axes(found: tuple[np.ndarray, float, float] | None) -> np.ndarray:
    assert found is not None
    return np.sqrt(found[1] / np.linalg.eigvalsh(found[0]))[::-1]


def test_a_decoupled_error_fills_the_strips() -> None:
    found = validity_storage(plant(), ZERO, KEPT)
    assert proved(plant(), found, KEPT)
    # One percent of the mean axis is given away for a margin, a millionth of the level for rounding.
    assert 0.5 * 0.989 <= np.sqrt(np.prod(semi_axes(found))) / np.sqrt(0.5 * 1.0) * 0.5 <= 0.5
    np.testing.assert_allclose(semi_axes(found), [0.5, 1.0], rtol=0.05)


def test_the_ball_is_measured_in_units_of_the_strips() -> None:
    found = validity_storage(plant(), ZERO, KEPT, objective="ball")
    np.testing.assert_allclose(semi_axes(found), [0.5, 1.0], rtol=0.02)
    assert proved(plant(), found, KEPT)


def test_coupling_limits_the_set() -> None:
    # e1' = -e1 + 8 e2, e2' = -e2: on |e1| <= m1 the second error may start at most at e1max e / 8 of it, far below m2.
    base = plant(rate=1.0, jacobian=(np.zeros((2, 2)), np.zeros((2, 2))))
    shear = base.replace(A=[[-1.0, 8.0], [0.0, -1.0]])
    found = validity_storage(shear, ZERO, KEPT)
    assert proved(shear, found, KEPT)
    assert found is not None
    reach = np.sqrt(found[1] * np.diag(np.linalg.inv(found[0])))
    assert reach[0] == pytest.approx(0.5, rel=0.05)
    # An invariant ellipse with Q11 = m1^2: Q11 - 8 Q12 > 0 and 4 (Q11 - 8 Q12) Q22 > (8 Q22 - 2 Q12)^2 leave Q22 < Q11 / 16.
    assert reach[1] <= reach[0] / 4 * (1 + 1e-9)


@pytest.mark.parametrize("objective", ["volume", "ball"])
@pytest.mark.parametrize("nx", [1, 3])
def test_any_number_of_states(nx: int, objective: Any) -> None:
    f = Nonlinearity.bounded(
        lambda z, u: jnp.sin(z),
        np.eye(nx),
        size=nx,
        jacobian=(-np.eye(nx), np.eye(nx)),
        domain=(-np.ones(nx), np.ones(nx)),
    )
    system = System.nonlinear(-2 * np.eye(nx), None, np.eye(1, nx), F=np.eye(nx), nonlinearity=f)
    kept = np.linspace(0.2, 0.6, nx)
    found = validity_storage(system, Polynomial.constant(np.zeros((nx, 1))), kept, objective=objective)
    assert np.prod(semi_axes(found)) == pytest.approx(np.prod(kept), rel=0.07)


def test_the_argument_gain_shapes_its_own_strip() -> None:
    L2 = Polynomial.constant(np.array([[0.0], [2.0]]))
    quick = plant(rate=4.0)
    found = validity_storage(quick, ZERO, np.array([1.0, 1.0]), argument_gain=L2)
    assert proved(quick, found, np.array([1.0, 1.0]), argument_gain=L2)
    assert found is not None
    h = np.array([-2.0, 1.0])
    assert np.sqrt(found[1] * h @ np.linalg.solve(found[0], h)) == pytest.approx(1.0, rel=0.05)
    assert not proved(quick, validity_storage(quick, ZERO, np.ones(2)), np.ones(2), argument_gain=L2)


def test_scheduling_and_hull_corners_are_all_held() -> None:
    A = Polynomial.affine([[-2.0, 0.0], [0.0, -2.0]], p=[[0.0, 1.5], [0.0, 0.0]])
    corners = [np.diag([1.0, -1.0]), np.diag([-1.0, 1.0]), np.diag([0.5, 0.5])]
    f = Nonlinearity.bounded(lambda z, u: z, np.eye(2), size=2, hull=corners, domain=SQUARE)
    moving = System.lpv(
        A, None, [[1.0, 0.0]], F=np.eye(2), nonlinearity=f, parameters=[Parameter("p", -1.0, 1.0)], name="moving"
    )
    found = validity_storage(moving, ZERO, KEPT)
    assert proved(moving, found, KEPT)
    still = moving.replace(A=Polynomial.affine([[-2.0, 0.0], [0.0, -2.0]], p=np.zeros((2, 2))))
    assert np.prod(semi_axes(found)) < np.prod(semi_axes(validity_storage(still, ZERO, KEPT)))


def test_lipschitz_bounds_give_their_multiplier() -> None:
    ball = plant(lipschitz=1.0)
    found = validity_storage(ball, ZERO, KEPT)
    assert found is not None
    assert found[2] > 0
    assert proved(ball, found, KEPT)
    # With P = diag(4, 1) and multiplier 2 both -4 p + 2 + p^2 / 2 < 0: the whole strips are filled, 0.5, less two percent.
    assert 0.48 < np.prod(semi_axes(found)) <= 0.5


@pytest.mark.parametrize("bound", [{"jacobian": (-np.eye(2), np.eye(2))}, {"lipschitz": 1.0}])
def test_discrete_plants(bound: dict[str, object]) -> None:
    sampled = discretize(plant(**bound), 0.2, "euler")
    found = validity_storage(sampled, ZERO, KEPT)
    assert proved(sampled, found, KEPT)
    assert np.prod(semi_axes(found)) > 0.4


def test_states_that_f_does_not_read_do_not_make_it_unbounded() -> None:
    f = Nonlinearity.bounded(lambda z, u: jnp.sin(z), [[1.0, 0.0]], jacobian=([[-1.0]], [[1.0]]), domain=SQUARE)
    half = System.nonlinear(-2 * np.eye(2), None, [[1.0, 0.0]], F=[[1.0], [0.0]], nonlinearity=f)
    found = validity_storage(half, ZERO, np.array([0.5, 0.0]))
    assert proved(half, found, np.array([0.5, 0.0]))
    # The search holds the free state within the width of the domain.
    np.testing.assert_allclose(semi_axes(found), [0.5, 4.0], rtol=0.05)


def test_an_error_that_grows_has_no_set() -> None:
    assert validity_storage(plant(rate=0.5), ZERO, KEPT) is None
    with pytest.raises(BadInput, match="no nonlinearity with a `domain`"):
        validity_storage(System.linear(-np.eye(2), C=[[1.0, 0.0]]), ZERO, KEPT)
    f = plant().nonlinearity
    assert f is not None
    with pytest.raises(BadInput, match="no nonlinearity with a `domain`"):
        validity_storage(plant().replace(nonlinearity=replace(f, domain=None)), ZERO, KEPT)
