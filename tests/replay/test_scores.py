"""Every score against its definition on numbers small enough to check by hand, and against chance."""

import io

import jax.numpy as jnp
import numpy as np
import pytest
from rich.console import Console
from scipy.stats import chi2

from luenberger.core import BadInput, Signal, Trajectory
from luenberger.observers import Estimate
from luenberger.replay import Channels, Replay, Score, score_table, scores
from luenberger.replay.scores import normalised_error_squared, settling_time

TIME = np.arange(5.0)
TRUE = np.zeros(5)
GUESS = np.array([4.0, 2.0, 0.1, -0.1, 0.0])


def said(x: np.ndarray, **parts: np.ndarray) -> Estimate:
    return Estimate(jnp.asarray(x), **{name: jnp.asarray(part) for name, part in parts.items()})


def made(
    estimate: Estimate, true: np.ndarray = TRUE, states: tuple[str, ...] = ("x",), time: np.ndarray = TIME
) -> Replay:
    truth = Trajectory(time, [Signal(s, "m", np.atleast_2d(true.T)[k]) for k, s in enumerate(states)])
    return Replay(time, {"one": estimate}, {"one": states}, {"one": Channels()}, truth, {"one": 2e-6})


def test_errors_by_hand() -> None:
    (row,) = scores(made(said(GUESS[:, None])))
    assert row.rmse == pytest.approx(np.sqrt((16 + 4 + 0.01 + 0.01) / 5), rel=1e-15)
    assert row.max_error == 4.0
    # 5 % of 4 is 0.2, met from t = 2 on.
    assert row.settling_time == 2.0
    assert (row.observer, row.state, row.unit, row.samples, row.seconds_per_step) == ("one", "x", "m", 5, 2e-6)
    assert row.coverage is row.mean_width is row.nees is None


def test_bounds_by_hand() -> None:
    lower, upper = np.array([0.0, 1.0, -1.0, -1.0, -1.0]), np.array([4.0, 3.0, 1.0, 1.0, 2.0])
    (row,) = scores(made(said(GUESS[:, None], lower=lower[:, None], upper=upper[:, None])))
    # The truth 0 lies outside [1, 3] only; ends belong to the interval.
    assert row.coverage == 0.8
    assert row.mean_width == pytest.approx((4 + 2 + 2 + 2 + 3) / 5)


def test_covariance_by_hand() -> None:
    P = np.full((5, 1, 1), 4.0)
    (row,) = scores(made(said(GUESS[:, None], covariance=P)))
    # |e| <= 1.96 * 2 = 3.92 holds for all but the first.
    assert row.coverage == row.ellipse_coverage == 0.8
    assert row.mean_width == pytest.approx(4 * 1.959964, rel=1e-6)
    assert row.nees == pytest.approx((16 + 4 + 0.02) / 4 / 5, rel=1e-14)
    np.testing.assert_allclose(row.nees_interval, chi2.ppf([0.025, 0.975], 5) / 5)


def test_an_honest_filter_is_consistent() -> None:
    rng, count = np.random.default_rng(0), 20_000
    P = np.array([[2.0, 0.8], [0.8, 1.0]])
    error = rng.multivariate_normal(np.zeros(2), P, size=count)
    time = np.arange(float(count))
    for scale, honest in ((1.0, True), (0.9, False), (1.1, False)):
        done = made(said(error, covariance=np.tile(scale * P, (count, 1, 1))), np.zeros((count, 2)), ("a", "b"), time)
        rows = scores(done)
        assert [row.state for row in rows] == ["a", "b"]
        low, high = rows[0].nees_interval
        assert (low < rows[0].nees < high) is honest
        if honest:
            # A share of 20 000 samples has a deviation of 0.15 %; five of those.
            assert abs(rows[0].ellipse_coverage - 0.95) < 0.008
            assert abs(rows[1].coverage - 0.95) < 0.008


def test_only_compared_states_enter_the_joint_scores() -> None:
    P = np.tile(np.array([[4.0, 1.0], [1.0, 9.0]]), (5, 1, 1))
    estimate = said(np.stack([GUESS, GUESS], axis=1), covariance=P)
    done = made(estimate, np.zeros((5, 2)), ("a", "b"))
    (row,) = scores(done, {"b": "a"})
    assert row.state == "b"
    assert row.nees == pytest.approx((16 + 4 + 0.02) / 9 / 5)


def test_samples_without_truth_and_outside_the_window_are_left_out() -> None:
    true = np.array([0.0, np.nan, 0.0, 0.0, 0.0])
    (row,) = scores(made(said(GUESS[:, None]), true))
    assert row.samples == 4
    (row,) = scores(made(said(GUESS[:, None])), start=2.0, stop=4.0)
    assert row.samples == 2
    assert row.rmse == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("error", "expected"),
    [
        ([1.0, 0.5, 0.01, 0.01], 2.0),
        ([1.0, 0.01, 0.5, 0.01], 3.0),
        ([1.0, 0.0, 0.0, 0.06], None),
        ([0.0, 0.0, 0.0, 0.0], 0.0),
    ],
)
def test_settling_is_for_good(error: list, expected: float | None) -> None:
    assert settling_time(np.arange(4.0), np.array(error), 0.05) == expected


def test_a_state_claimed_exactly_must_be_exact() -> None:
    P = np.array([[[1.0, 0.0], [0.0, 0.0]]] * 2)
    squared = normalised_error_squared(np.array([[2.0, 0.0], [2.0, 1.0]]), P)
    assert squared.tolist() == [4.0, np.inf]


def test_a_reference_from_elsewhere() -> None:
    done = made(said(GUESS[:, None]))
    other = Trajectory(TIME, [Signal("position", "m", GUESS)])
    (row,) = scores(done, {"x": "position"}, reference=other)
    assert row.rmse == 0.0
    assert row.settling_time == 0.0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"truth": {"y": "x"}}, r"`truth` names the states \['y'\].*they estimate \['x'\]"),
        ({"truth": {"x": "z"}}, "lacks `z`"),
        ({"reference": Trajectory(TIME, [Signal("z", "m", TRUE)])}, r"give `truth=\{'state': 'channel'\}`"),
        ({"reference": Trajectory(TIME[:3], [Signal("x", "m", TRUE[:3])])}, "`reference` has 3 samples"),
        ({"start": 10.0}, "No sample of `one` has a truth"),
    ],
)
def test_scores_without_a_truth_are_refused(options: dict, message: str) -> None:
    with pytest.raises(BadInput, match=message):
        scores(made(said(GUESS[:, None])), **options)


def test_the_table_shows_every_row() -> None:
    full = Score("kalman", "vy", "m/s", 9, 0.123456, 1.0, None, 0.95, 0.5, 1.02, (0.9, 1.1), 0.94, 1.5e-6)
    bare = Score("zero", "beta", "", 9, 1.0, 2.0, 3.0)
    stream = io.StringIO()
    Console(file=stream, width=200).print(score_table([full, bare], "Drive"))
    text = stream.getvalue()
    for part in ("Drive", "kalman", "vy [m/s]", "0.1235", "never", "95.0%", "1.02 (0.9 to 1.1)", "1.5", "zero"):
        assert part in text
