"""Width-optimal gains: within one percent of the best of a scan over all gains, narrower than the gains they start from."""

from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from luenberger.algebra import Polynomial
from luenberger.certify import Claim
from luenberger.certify.steady_box import steady_box_verdict
from luenberger.core import BadInput, NotAccepted, Outcome
from luenberger.experiment.published.guaranteed_estimation_problem import stored
from luenberger.methods.zonotopic_plant import ROOM, DrivenError, fading_storage
from luenberger.methods.zonotopic_width import SteadyWidth
from luenberger.synthesize import synthesize
from luenberger.systems import System

STORED = Path(__file__).parents[3] / "shared" / "data" / "guaranteed-estimation"
needs_stored = pytest.mark.skipif(not STORED.exists(), reason="the stored benchmark problems are not redistributed")
TURN = System.build(
    [[0.8, -0.5], [0.5, 0.7]],
    None,
    [[1.0, 0.3]],
    E=[[1.0, 0.0], [-0.4, 0.2]],
    dt=1.0,
    disturbance_bound=[0.1, 0.3],
    noise_bound=[0.2],
    name="turn",
)


def boxes(error: DrivenError, gains: np.ndarray) -> np.ndarray:
    """Steady boxes of many gains, shape (count, nx), by plain sums; infinite where a loop is not stable."""
    F = error.A - gains[:, :, None] * error.C
    X = error.base - gains[:, :, None] * error.seen
    stable = np.abs(np.linalg.eigvals(F)).max(axis=1) < 0.98
    F, X = np.where(stable[:, None, None], F, 0.0), X
    total = np.zeros(gains.shape)
    for _ in range(600):
        size = np.abs(X).sum(axis=2)
        total += size
        X = F @ X
    return np.where(stable[:, None], total, np.inf)


def scanned(error: DrivenError, cost: Any, around: np.ndarray) -> float:
    """The least cost of a scan over a wide grid, then twice around its best node."""
    width, best = np.full(2, 1.5 * max(1.0, np.abs(around).max())), np.zeros(2)
    least = np.inf
    for points in (81, 41, 41):
        axes = [np.linspace(c - w, c + w, points) for c, w in zip(best, width, strict=True)]
        gains = np.array(list(product(*axes)))
        costs = cost(boxes(error, gains))
        best, least = gains[costs.argmin()], min(least, float(costs.min()))
        width = 4 * 2 * width / (points - 1)
    return least


@pytest.mark.parametrize("uses", ["previous", "current"])
@pytest.mark.parametrize("measure", ["sum", "largest"])
def test_a_scan_over_all_gains_finds_nothing_narrower(measure: str, uses: str) -> None:
    check(TURN, SteadyWidth(measure=measure, uses=uses))


@needs_stored
@pytest.mark.parametrize("name", ["academic2d", "vehicle2d"])
def test_a_scan_of_the_stored_problems_finds_nothing_narrower(name: str) -> None:
    check(stored(name, STORED).system, SteadyWidth())


def check(plant: System, method: SteadyWidth) -> None:
    """The optimum is within one percent of the scan, and no worse than the Kalman gain."""
    error = DrivenError.of(plant) if method.uses == "previous" else DrivenError.filtered(plant)
    found = method.best(plant)
    cost = method.cost(plant, found)
    measured = (lambda w: w.sum(axis=1)) if method.measure == "sum" else (lambda w: w.max(axis=1))
    assert cost <= 1.01 * scanned(error, measured, found)
    kalman = error.kalman()
    assert kalman is not None
    assert cost < method.cost(plant, kalman)


def test_weights_say_which_state_counts() -> None:
    first, second = (DrivenError.of(TURN).box(SteadyWidth(weights=w).best(TURN)) for w in ([1.0, 0.0], [0.0, 1.0]))
    assert first[0] < second[0]
    assert second[1] < first[1]
    # One number times all weights changes nothing but the cost.
    L = np.array([[0.5], [0.3]])
    assert SteadyWidth(weights=[2.0, 2.0]).cost(TURN, L) == pytest.approx(2 * SteadyWidth().cost(TURN, L))


def test_the_designed_box_is_proved_and_a_narrower_one_is_not() -> None:
    candidate = SteadyWidth().design(TURN)
    gain = candidate.gain
    L = np.asarray(gain({}))
    assert candidate.statistics["optimum"] < candidate.statistics["kalman"]
    box = DrivenError.of(TURN).box(L)
    storage = fading_storage(DrivenError.of(TURN).loop(L), "turn")[1]
    for scale, outcome in ((1 + ROOM, Outcome.PROVED), (1 - ROOM, Outcome.REFUTED)):
        claim = Claim("width", float((box * scale).max()), storage, vector=box * scale)
        assert steady_box_verdict(TURN, gain, claim)[1].outcome is outcome
    # The same box for a spoiled gain is refuted.
    spoiled = Polynomial.constant(L * 1.2)
    claim = Claim("width", float(box.max()) * 2, storage, vector=box * (1 + ROOM))
    assert steady_box_verdict(TURN, spoiled, claim)[1].outcome is not Outcome.PROVED


@pytest.mark.parametrize("uses", ["previous", "current"])
def test_a_design_carries_its_claims(uses: str) -> None:
    design = synthesize(TURN, SteadyWidth(uses=uses))
    filtered = ["filter_box"] if uses == "current" else []
    assert [c.kind for c in design.certificate.claims] == ["decay", "gain_bound", "steady_box", *filtered]
    assert design.certificate.outcome is Outcome.PROVED


def test_the_gain_of_the_prediction_is_that_of_the_rounded_filter_gain() -> None:
    design = synthesize(TURN, SteadyWidth(uses="current"), digits=3)
    assert design.filter_gain is not None
    K = np.asarray(design.filter_gain({}))
    assert all(float(f"{k:.3g}") == k for k in K.flat)
    np.testing.assert_array_equal(np.asarray(design.gain({})), np.asarray(TURN.at("A")) @ K)
    # The box that the method minimised is the one that is claimed, up to the three digits.
    claimed = next(c for c in design.certificate.claims if c.kind == "filter_box")
    assert np.asarray(claimed.vector).sum() == pytest.approx(design.statistics["optimum"], rel=1e-2)
    assert np.asarray(claimed.vector).sum() < DrivenError.of(TURN).box(np.asarray(design.gain({}))).sum()


def test_a_filter_gain_belongs_to_a_filter() -> None:
    method = SteadyWidth(uses="current")
    K = method.filter_gain(TURN)
    L = np.asarray(method.design(TURN).gain({}))
    np.testing.assert_allclose(L, np.asarray(TURN.at("A")) @ K)
    with pytest.raises(NotAccepted, match="no filter gain"):
        SteadyWidth().filter_gain(TURN)


def test_plants_that_need_no_gain_get_none() -> None:
    # Noise only: every correction widens.
    quiet = System.linear([[0.5]], C=[[1.0]], dt=1.0, noise_bound=[1.0])
    assert np.abs(SteadyWidth().best(quiet)).max() < 1e-3
    # No noise: what is seen is known at once.
    clear = System.linear([[0.5]], C=[[1.0]], E=[[1.0]], dt=1.0, disturbance_bound=[1.0], noise_bound=[0.0])
    np.testing.assert_allclose(SteadyWidth().best(clear), [[0.5]], atol=1e-3)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"weights": [1.0]}, "not all zero"),
        ({"weights": [0.0, 0.0]}, "not all zero"),
        ({"weights": [-1.0, 1.0]}, "not all zero"),
        ({"measure": "area"}, '"sum" or "largest"'),
        ({"uses": "both"}, '"previous" or "current"'),
    ],
)
def test_options_that_do_not_fit_are_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(BadInput, match=message):
        SteadyWidth(**options).accept(TURN)
    with pytest.raises(NotAccepted, match="discrete linear plant"):
        SteadyWidth().accept(TURN.replace(dt=None))
