"""Each fault of a sensor alone, their order, and repeatable noise."""

import jax
import numpy as np
import pytest

from luenberger.core import BadInput, Signal, Trajectory
from luenberger.simulate import Sensor, measure

TIME = 0.01 * np.arange(20_000)
TRUE = np.sin(0.3 * TIME)


def drive() -> Trajectory:
    return Trajectory(TIME, [Signal("yaw_rate", "rad/s", TRUE)])


def reading(seed: int = 0, **faults: float) -> np.ndarray:
    return measure(drive(), [Sensor("yaw_rate", **faults)], seed)["yaw_rate_measured"].values


def test_a_perfect_sensor_reads_the_truth() -> None:
    assert np.array_equal(reading(), TRUE)


def test_bias_is_added() -> None:
    assert np.array_equal(reading(bias=0.25), TRUE + 0.25)


def test_noise_has_its_deviation_and_no_memory() -> None:
    noise = reading(noise=0.1) - TRUE
    # 20 000 samples: the deviation is known to 0.5 %, mean and correlation to 0.7 %; five of those.
    assert abs(noise.std() / 0.1 - 1) < 0.025
    assert abs(noise.mean()) < 0.1 * 0.035
    assert abs(np.corrcoef(noise[1:], noise[:-1])[0, 1]) < 0.035


def test_delay_shifts_and_holds_the_first_value() -> None:
    late = reading(delay=0.025)
    np.testing.assert_allclose(late[3:], np.interp(TIME[3:] - 0.025, TIME, TRUE), atol=1e-15)
    assert late[0] == late[2] == TRUE[0]


def test_quantisation_rounds_to_the_grid() -> None:
    steps = reading(quantum=0.125, bias=0.03, noise=0.01) / 0.125
    assert np.array_equal(steps, np.round(steps))
    assert np.abs(reading(quantum=0.125) - TRUE).max() <= 0.0625


def test_dropout_loses_its_share() -> None:
    lost = np.isnan(reading(dropout=0.2))
    # A binomial share of 20 000 has a deviation of 0.28 %; five of those.
    assert abs(lost.mean() - 0.2) < 0.015
    assert np.array_equal(reading(dropout=0.2)[~lost], TRUE[~lost])


def test_seed_and_place_decide_the_noise() -> None:
    assert np.array_equal(reading(3, noise=0.1), reading(3, noise=0.1))
    assert not np.array_equal(reading(3, noise=0.1), reading(4, noise=0.1))
    both = measure(drive(), [Sensor("yaw_rate", noise=0.1, name="a"), Sensor("yaw_rate", noise=0.1, name="b")], 3)
    assert not np.array_equal(both["a"].values, both["b"].values)
    assert both["a"].unit == "rad/s"


def test_monte_carlo_is_a_vmap_over_keys() -> None:
    sensor, keys = Sensor("yaw_rate", noise=0.1, dropout=0.1), jax.random.split(jax.random.key(0), 3)
    batch = jax.vmap(lambda key: sensor.apply(TIME[:50], TRUE[:50], key))(keys)
    for values, key in zip(batch, keys, strict=True):
        np.testing.assert_allclose(values, sensor.apply(TIME[:50], TRUE[:50], key), rtol=1e-14)


@pytest.mark.parametrize(
    ("faults", "message"),
    [
        ({"noise": -1.0}, "`noise` of the sensor on `yaw_rate` is -1.0; a finite number >= 0"),
        ({"delay": np.inf}, "`delay`.*is inf"),
        ({"bias": np.nan}, "`bias`.*is nan"),
        ({"dropout": 1.0}, "`dropout`.*a probability below 1"),
    ],
)
def test_impossible_faults_are_refused(faults: dict, message: str) -> None:
    with pytest.raises(BadInput, match=message):
        Sensor("yaw_rate", **faults)


def test_two_sensors_on_one_name_and_missing_channels_are_refused() -> None:
    with pytest.raises(BadInput, match=r"Two sensors write \['yaw_rate_measured'\]"):
        measure(drive(), [Sensor("yaw_rate"), Sensor("yaw_rate")])
    with pytest.raises(BadInput, match="no channel `yaw`"):
        measure(drive(), [Sensor("yaw")])


def test_bounded_noise_stays_inside_and_reaches_its_bound() -> None:
    values = np.zeros(20_000)
    reading = np.asarray(Sensor("x", bound=5e-3).apply(np.arange(20_000.0), values, jax.random.key(1)))
    assert np.abs(reading).max() <= 5e-3
    # The largest of 20 000 uniform draws lies within a thousandth of the bound but for one seed in a billion.
    assert np.abs(reading).max() > 0.999 * 5e-3
