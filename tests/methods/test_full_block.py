"""The full-block multiplier finds what the vertices find, and its multiplier says true things about every Jacobian."""

import cvxpy as cp
import jax.numpy as jnp
import numpy as np
import pytest

from luenberger.admissible import largest_admissible
from luenberger.algebra import Polynomial
from luenberger.core import Infeasible, NotAccepted, Outcome
from luenberger.lmi import Block, Problem, solve
from luenberger.methods.extended_luenberger import ExtendedLuenberger
from luenberger.methods.full_block import FullBlockLuenberger, jacobian_matrices
from luenberger.methods.supply import Supply
from luenberger.synthesize import synthesize
from luenberger.systems import Nonlinearity, System
from luenberger.vehicle import brush_tyres, slip_angle_plant, wang_car


def van_der_pol(reach: float, hull: bool = False, **channels: object) -> System:
    box = np.array([[-2 * reach**2, 1 - reach**2]]), np.array([[2 * reach**2, 1.0]])
    # The triangle of both lower corners and the tangents that start there holds the parabola of true Jacobians.
    triangle = np.array([[[-2 * reach**2, 1 - reach**2]], [[2 * reach**2, 1 - reach**2]], [[0.0, 1 + reach**2]]])
    f = Nonlinearity.bounded(
        lambda z, u: jnp.array([(1 - z[0] ** 2) * z[1]]),
        np.eye(2),
        **({"hull": triangle} if hull else {"jacobian": box}),
    )
    A = [[0.0, 1.0], [-1.0, 0.0]]
    return System.nonlinear(A, C=[[1.0, 0.0]], F=[[0.0], [1.0]], nonlinearity=f, **channels)


def slip_angles(kappa: float) -> System:
    tyres = brush_tyres(wang_car)
    limit = (1 - np.sqrt(1 - kappa)) / float(tyres[0].theta)
    return slip_angle_plant(
        wang_car, (15 / 3.6, 150 / 3.6), (-8.0, 8.0), tyres=tyres, slip_limit=limit, disturbance=True
    )


@pytest.mark.parametrize(("reach", "rate", "hull"), [(1.0, 0.0, False), (5.0, 0.0, False), (5.0, 1.0, True)])
def test_gain_of_the_oscillator_is_that_of_the_vertices(reach: float, rate: float, hull: bool) -> None:
    plant = van_der_pol(reach, hull)
    design = synthesize(plant, FullBlockLuenberger(rate))
    wanted = ExtendedLuenberger(rate).design(plant).statistics["optimum"]
    # Two problems with one optimum; both solved to 1e-10 in units that differ by thousands.
    assert design.statistics["optimum"] == pytest.approx(wanted, rel=1e-5)
    assert design.certificate.outcome is Outcome.PROVED


@pytest.mark.parametrize("kappa", [0.3, 0.9])
@pytest.mark.parametrize("limit", [None, 10.0])
def test_level_of_slip_angles_is_that_of_the_vertices(kappa: float, limit: float | None) -> None:
    plant = slip_angles(kappa)
    design = synthesize(plant, FullBlockLuenberger(goal="l2", gain_limit=limit))
    wanted = ExtendedLuenberger(goal="l2", gain_limit=limit).design(plant).statistics["optimum"]
    assert design.statistics["optimum"] == pytest.approx(wanted, rel=1e-5)


def test_noise_decay_and_a_limit_together() -> None:
    plant = van_der_pol(2.7, E=[[0.5], [1.0]], G=[[0.1]])
    method = FullBlockLuenberger(0.5, "l2", "both", gain_limit=60.0)
    wanted = ExtendedLuenberger(0.5, "l2", "both", gain_limit=60.0).design(plant).statistics["optimum"]
    design = synthesize(plant, method)
    assert design.statistics["optimum"] == pytest.approx(wanted, rel=1e-5)
    assert {p.claim.kind for p in design.certificate.proofs} == {"l2_gain", "decay", "gain_bound"}


def test_largest_loss_of_stiffness() -> None:
    found = largest_admissible(slip_angles, FullBlockLuenberger(), 0.9, 0.97, 1e-3)
    # No method can pass 0.94980, where the unobservable mode stops dying out.
    assert found.proved >= 0.949


def test_multiplier_speaks_of_every_jacobian_and_is_convex() -> None:
    plant = van_der_pol(2.0, hull=True)
    P, Y = cp.Variable((2, 2), symmetric=True, name="P"), cp.Variable((2, 1), name="Y")
    method = FullBlockLuenberger()
    blocks, more = method.dissipates(plant, Polynomial.constant(P), Polynomial.constant(Y), Supply("decay", 0.0 * P))
    blocks.append(Block("storage", Polynomial.constant(np.eye(2) - P)))
    found = solve(Problem({"P": P, "Y": Y, **more}, blocks, cp.trace(P)))
    assert found is not None
    M = found.values["M_decay"]
    assert M[2, 2] > 0
    vertices = jacobian_matrices(plant)
    middle = 0.5 * (np.max(vertices, axis=0) + np.min(vertices, axis=0))
    unit = np.abs(np.array(vertices) - middle).max()
    shares = np.random.default_rng(0).dirichlet(np.full(len(vertices), 0.3), 500)
    for J in np.tensordot(shares, np.array(vertices), 1):
        graph = np.vstack([np.eye(2), (J - middle) / unit])
        # The residual that `solve` accepts, relative to the size of M.
        assert np.linalg.eigvalsh(graph.T @ M @ graph)[-1] <= 1e-6 * (1 + np.abs(M).max())


def test_nearest_limit_is_named() -> None:
    with pytest.raises(Infeasible, match=r"gain_limit = 3 *; the closest found was 5\.4"):
        synthesize(van_der_pol(1.0), FullBlockLuenberger(gain_limit=3.0))


def test_plant_without_nonlinearity_is_sent_to_the_vertices() -> None:
    with pytest.raises(NotAccepted, match="use `ExtendedLuenberger`"):
        synthesize(System.linear([[-1.0]], C=[[1.0]]), FullBlockLuenberger())
