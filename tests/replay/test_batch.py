"""A batch is its single replays, whatever is batched."""

import jax.numpy as jnp
import numpy as np
import pytest

from luenberger.core import BadInput, ReplayFailed, Trajectory
from luenberger.observers import CorrectionObserver, ExtendedKalmanFilter, KalmanFilter, zero_estimate
from luenberger.replay import Channels, replay, replay_batch
from luenberger.simulate import Sensor, measure
from observers.plants import DT, car, drive, pendulum

READ = Channels(("delta",), ("yaw",), ("vx", "inverse_vx"))
LOG = drive(car(), 60)
NOISY = [measure(LOG, [Sensor("yaw", noise=0.1, name="yaw")], seed) for seed in range(3)]


def kalman(noise: float) -> KalmanFilter:
    return KalmanFilter(
        car(), DT, measurement_covariance=[[noise]], process_density=np.eye(2), initial_covariance=np.eye(2)
    )


def single(observer: KalmanFilter, log: Trajectory, x0: object) -> np.ndarray:
    return np.asarray(replay({"one": observer}, log, READ, np.asarray(x0))["one"].x)


def test_tunings() -> None:
    tuned = [kalman(noise) for noise in (0.01, 0.1, 1.0)]
    batch = replay_batch(tuned, LOG, READ, np.zeros(2))
    assert batch.estimate.covariance.shape == (3, 60, 2, 2)
    assert batch.states == ("vy", "yaw_rate")
    for x, observer in zip(batch.estimate.x, tuned, strict=True):
        # Vectorised code may contract products and sums differently.
        np.testing.assert_allclose(x, single(observer, LOG, [0.0, 0.0]), rtol=1e-9, atol=1e-11)


def test_noise_draws_and_guesses() -> None:
    guesses = np.array([[0.0, 0.0], [1.0, 0.5], [-1.0, 0.2]])
    batch = replay_batch(kalman(0.1), NOISY, READ, guesses)
    for x, log, guess in zip(batch.estimate.x, NOISY, guesses, strict=True):
        np.testing.assert_allclose(x, single(kalman(0.1), log, guess), rtol=1e-9, atol=1e-11)
    truth = np.ones((60, 2))
    assert np.array_equal(batch.errors(truth), batch.estimate.x - 1.0)


def test_all_three_batched_and_nothing_batched() -> None:
    tuned = [kalman(noise) for noise in (0.01, 0.1, 1.0)]
    guesses = np.array([[0.0, 0.0], [1.0, 0.5], [-1.0, 0.2]])
    batch = replay_batch(tuned, NOISY, READ, guesses)
    np.testing.assert_allclose(batch.estimate.x[2], single(tuned[2], NOISY[2], guesses[2]), rtol=1e-9, atol=1e-11)
    alone = replay_batch(tuned[0], LOG, READ, np.zeros(2))
    assert np.array_equal(alone.estimate.x[0], single(tuned[0], LOG, [0.0, 0.0]))


def test_gains_of_a_correction_observer() -> None:
    gains = [np.array([[0.5], [g]]) for g in (5.0, 10.0)]
    batch = replay_batch([CorrectionObserver(car(), g, DT, substeps=1) for g in gains], LOG, READ, np.zeros(2))
    assert not np.allclose(batch.estimate.x[0], batch.estimate.x[1])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"x0": np.zeros((2, 2)), "trajectories": NOISY},
            r"'trajectories': 3, 'x0': 2\}; each needs one entry, or one for each of the 3 runs",
        ),
        (
            {"observers": [kalman(0.1), CorrectionObserver(car(), [[0.5], [1.0]], DT)]},
            "Observer 1 of the batch differs",
        ),
        ({"trajectories": [LOG, drive(car(), 61)]}, "Trajectory 1 of the batch has 61 samples"),
        (
            {"trajectories": [LOG, Trajectory(LOG.time + 1.0, LOG.signals)]},
            "Trajectory 1 of the batch has 60 samples that are not at the times",
        ),
    ],
)
def test_batches_that_do_not_fit_are_refused(changes: dict, message: str) -> None:
    with pytest.raises(BadInput, match=message):
        replay_batch(**({"observers": kalman(0.1), "trajectories": LOG, "channels": READ, "x0": np.zeros(2)} | changes))


def test_functions_built_twice_are_two_structures() -> None:
    given = {"measurement_covariance": [[1.0]], "process_covariance": np.eye(2), "initial_covariance": np.eye(2)}
    pair = [ExtendedKalmanFilter(pendulum(), DT, **given) for _ in range(2)]
    with pytest.raises(BadInput, match="functions built twice"):
        replay_batch(pair, drive(pendulum(), 60), Channels(("u1",), ("y1",)), np.zeros(2))


def test_a_diverging_run_is_named() -> None:
    gains = [np.array([[0.5], [g]]) for g in (10.0, 1e30)]
    with pytest.raises(ReplayFailed, match="`run 1` gives an estimate that is not finite"):
        replay_batch([CorrectionObserver(car(), g, DT, substeps=1) for g in gains], LOG, READ, np.zeros(2))


def test_shared_settings_stay_shared() -> None:
    batch = replay_batch([zero_estimate(2, DT), zero_estimate(2, DT)], LOG, Channels(), np.zeros(2))
    assert jnp.shape(batch.estimate.x) == (2, 60, 2)
