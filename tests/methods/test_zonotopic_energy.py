"""Gains by one inequality: the Riccati gain as the limit of least segments, the energy gain against a frequency sweep."""

from typing import Any

import numpy as np
import pytest

from luenberger.core import NotAccepted, Outcome
from luenberger.methods.zonotopic_energy import HInfinityGain, SegmentGain
from luenberger.methods.zonotopic_plant import DrivenError
from luenberger.observers.zonotopic import ZonotopicKalmanFilter
from luenberger.synthesize import synthesize
from luenberger.systems import System

PLANT = System.build(
    [[0.8, -0.5], [0.5, 0.7]],
    [[1.0], [0.5]],
    [[1.0, 0.3]],
    E=[[1.0, 0.0], [-0.4, 0.2]],
    G=[[1.0, 0.0]],
    N=[[0.1, 0.3]],
    dt=1.0,
    disturbance_bound=[0.1, 0.3],
    noise_bound=[0.2, 0.1],
)
ERROR = DrivenError.of(PLANT)


def gain_of(method: Any) -> np.ndarray:
    return np.asarray(method.design(PLANT).gain({}))


def trace(L: np.ndarray) -> float:
    """Sum of squares of the steady generators."""
    return float(sum((X**2).sum() for X in ERROR.terms(L)))


def energy_gain(L: np.ndarray) -> float:
    """Largest singular value of the frequency response from unit generators to the error."""
    z = np.exp(1j * np.linspace(0.0, np.pi, 4001))
    response = np.linalg.solve(z[:, None, None] * np.eye(2) - ERROR.loop(L), ERROR.drive(L).astype(complex)[None])
    return float(np.linalg.norm(response, 2, axis=(1, 2)).max())


def test_least_segments_are_the_kalman_gain() -> None:
    L = gain_of(SegmentGain())
    best = ERROR.kalman()
    assert best is not None
    # A thousandth of the trace is given away for a strict inequality.
    assert trace(best) * (1 - 1e-4) <= trace(L) <= 1.002 * trace(best)
    np.testing.assert_allclose(L, best, atol=0.02)


def test_the_adaptive_filter_ends_at_the_gain_of_least_segments() -> None:
    # Without noise of inputs, and without reduction: the stationary gain is the limit of the gain that follows the set.
    plant = PLANT.replace(N=np.zeros((1, 2)))
    observer = ZonotopicKalmanFilter(plant, initial_half_width=[1.0, 1.0], count=400)
    state = observer.init(np.zeros(2))
    for _ in range(40):
        state, _ = observer.step(state, np.zeros(1), np.zeros(1), np.zeros(0))
    P = np.asarray(state.generators @ state.generators.T)
    A, C = np.asarray(plant.at("A")), np.asarray(plant.at("C"))
    adaptive = A @ P @ C.T / (C @ P @ C.T + 0.2**2)
    np.testing.assert_allclose(np.asarray(SegmentGain().design(plant).gain({})), adaptive, atol=0.02)


def test_no_other_gain_has_a_lower_energy_gain() -> None:
    candidate = HInfinityGain().design(PLANT)
    L = np.asarray(candidate.gain({}))
    reached = energy_gain(L)
    # The level is squared, backed off by a thousandth; the sweep is dense enough for the rest.
    assert reached <= np.sqrt(candidate.statistics["optimum"]) * 1.001
    rng = np.random.default_rng(0)
    others = [energy_gain(L + d) for d in 0.1 * rng.normal(size=(300, 2, 1)) if ERROR.radius(L + d) < 1]
    assert min(others) > reached * 0.998


def test_the_boxes_are_those_of_the_gains() -> None:
    for method in (SegmentGain(), HInfinityGain()):
        candidate = method.design(PLANT)
        np.testing.assert_allclose(candidate.statistics["box"], ERROR.box(np.asarray(candidate.gain({}))), rtol=1e-12)


@pytest.mark.parametrize("method", [SegmentGain(), HInfinityGain()])
def test_designs_are_proved(method: Any) -> None:
    design = synthesize(PLANT, method)
    assert [c.kind for c in design.certificate.claims] == ["decay", "gain_bound", "steady_box"]
    assert design.certificate.outcome is Outcome.PROVED


@pytest.mark.parametrize("method", [SegmentGain(), HInfinityGain()])
def test_continuous_plants_are_refused(method: Any) -> None:
    with pytest.raises(NotAccepted, match="discrete linear plant"):
        method.accept(PLANT.replace(dt=None))
