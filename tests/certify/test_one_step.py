"""The claim on the sampled step: the exact polynomial is the step, true levels are proved and false ones are not."""

from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.linalg

from export_plants import running, scheduled
from luenberger.algebra import Polynomial
from luenberger.certify.one_step import OneStep, Sampling, sampled_decay_verdict
from luenberger.core import BadInput, NotAccepted, Outcome
from luenberger.observers import CorrectionObserver, TwoDofObserver
from luenberger.systems import Nonlinearity, System
from luenberger.systems.jacobian_box import as_floats


def slope(observer: CorrectionObserver, r: list[float], x: Any, u: Any = (0.0,)) -> np.ndarray:
    """The Jacobian of the step that runs, by JAX."""
    y = jnp.zeros(observer.plant.value.ny)
    return np.asarray(jax.jacfwd(lambda s: observer.step(s, jnp.array(u), y, jnp.array(r))[0])(jnp.asarray(x)))


@pytest.mark.parametrize(("method", "substeps"), [("rk4", 1), ("rk4", 3), ("exact", None)])
def test_the_polynomial_is_the_jacobian_of_the_step_that_runs(method: str, substeps: int | None) -> None:
    plant, gain = scheduled(), running().gain
    observer = CorrectionObserver(plant, gain, 0.3, method=method, substeps=substeps)
    parts = 2**observer.order.squarings if method == "exact" else observer.substeps
    step = OneStep.of(plant, gain, Sampling(method, 0.3, parts, observer.order.degree), lift=as_floats)
    for stiffness in (1.0, 2.3, 4.0):
        M = np.linalg.matrix_power(np.asarray(step.M({"stiffness": stiffness}), float), parts)
        # Equal up to the rounding of a few dozen operations.
        np.testing.assert_allclose(M, slope(observer, [stiffness], np.zeros(2)), rtol=0, atol=1e-13)


def test_stages_of_a_nonlinear_plant_have_jacobians_of_their_own() -> None:
    f = Nonlinearity.bounded(lambda z, u: jnp.tanh(z), [[1.0, 0.0]], jacobian=([[0.0]], [[1.0]]))
    plant = System.nonlinear([[0.0, 1.0], [0.0, -1.0]], C=[[1.0, 0.0]], F=[[0.0], [-1.0]], nonlinearity=f)
    L, L2 = np.array([[2.0], [1.0]]), np.array([[0.3]] * 2)
    observer = TwoDofObserver(plant, L, L2, 0.1, substeps=1)
    step = OneStep.of(plant, Polynomial.constant(L), Sampling("rk4", 0.1), Polynomial.constant(L2), lift=as_floats)
    assert set(step.box) == {f"df1_dz1 at stage {k}" for k in (1, 2, 3, 4)}
    rng = np.random.default_rng(0)
    # By the mean value theorem the difference of two runs is M e for Jacobians in the box; the hull of all M holds every slope met.
    corners = [np.asarray(step.M(dict(zip(step.M.names, bits, strict=True))), float) for bits in np.ndindex(2, 2, 2, 2)]
    low, high = np.min(corners, axis=0), np.max(corners, axis=0)
    for _ in range(50):
        J = slope(observer, [], rng.normal(size=2) * 2, ())
        assert (low - 1e-12 <= J).all()
        assert (high + 1e-12 >= J).all()


def storage(gain: Polynomial) -> np.ndarray:
    F = np.asarray(scheduled().at("A", [2.0])) - np.asarray(gain({"stiffness": 2.0})) @ [[1.0, 0.0]]
    P = scipy.linalg.solve_continuous_lyapunov(F.T, -np.eye(2))
    return 0.5 * (P + P.T)


def factor(parts: int, dt: float = 0.05) -> float:
    gain = running().gain
    P = storage(gain)
    step = OneStep.of(scheduled(), gain, Sampling("rk4", dt, parts), lift=as_floats)
    worst = 0.0
    for stiffness in np.linspace(1, 4, 61):
        M = np.asarray(step.M({"stiffness": stiffness}), float)
        worst = max(worst, float(scipy.linalg.eigh(M.T @ P @ M, P, eigvals_only=True)[-1]))
    return float(np.sqrt(worst)) ** parts


@pytest.mark.parametrize("parts", [1, 4])
def test_levels_above_the_true_factor_are_proved_and_below_it_refuted(parts: int) -> None:
    gain = running().gain
    decide = partial(sampled_decay_verdict, scheduled(), gain, Sampling("rk4", 0.05, parts), storage=storage(gain))
    true = factor(parts)
    assert 0.9 < true < 1
    assert decide(true + 1e-4 * (1 - true))[1].outcome is Outcome.PROVED
    failed, verdict = decide(true - 1e-3 * (1 - true))
    assert failed == "sampled_decay"
    assert verdict.outcome is Outcome.REFUTED


def test_a_step_that_is_too_long_is_refuted_though_the_continuous_loop_decays() -> None:
    # Eigenvalues near -50: RK4 of 0.06 s in one part leaves its stability region at 2.78.
    plant, gain = System.linear([[-50.0]], C=[[1.0]]), Polynomial.constant([[0.0]])
    short = sampled_decay_verdict(plant, gain, Sampling("rk4", 0.06, 2), 0.999, np.eye(1))[1]
    long = sampled_decay_verdict(plant, gain, Sampling("rk4", 0.06, 1), 0.999, np.eye(1))[1]
    assert short.outcome is Outcome.PROVED
    assert long.outcome is Outcome.REFUTED


def test_a_storage_that_is_not_positive_is_named() -> None:
    failed, verdict = sampled_decay_verdict(
        scheduled(), running().gain, Sampling("rk4", 0.05), 0.99, np.diag([1.0, -1.0])
    )
    assert failed == "storage"
    assert verdict.outcome is Outcome.REFUTED


def test_a_nonlinearity_held_over_several_parts_is_refused() -> None:
    f = Nonlinearity.bounded(lambda z, u: jnp.tanh(z), [[1.0]], jacobian=([[0.0]], [[1.0]]))
    plant = System.nonlinear([[-1.0]], C=[[1.0]], F=[[-1.0]], nonlinearity=f)
    one = OneStep.of(plant, Polynomial.constant([[0.5]]), Sampling("exact", 0.1, 1, 12), lift=as_floats)
    observer = CorrectionObserver(plant, [[0.5]], 0.1, method="exact")
    assert observer.order.squarings == 0
    low, high = (float(np.asarray(one.M({"df1_dz1": end}), float)[0, 0]) for end in (1.0, 0.0))
    assert low < float(slope(observer, [], np.array([0.7]), ())[0, 0]) < high
    with pytest.raises(NotAccepted, match="held over all of them"):
        OneStep.of(plant, Polynomial.constant([[0.5]]), Sampling("exact", 0.1, 2, 12), lift=as_floats)


def test_refusals() -> None:
    with pytest.raises(BadInput, match="`scheme` is `heun`"):
        Sampling("heun", 0.1)
    with pytest.raises(BadInput, match="no sampling"):
        Sampling("exact", 0.1)
    with pytest.raises(BadInput, match="factor a step"):
        sampled_decay_verdict(scheduled(), running().gain, Sampling("rk4", 0.05), 1.0, np.eye(2))
