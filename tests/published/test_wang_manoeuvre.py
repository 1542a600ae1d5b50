"""The manoeuvre, its two truths, and the observers made of the printed gains."""

import importlib.util

import jax
import numpy as np
import pytest

from luenberger.experiment.published.wang_gains import (
    H2,
    LUENBERGER,
    UNSTRUCTURED,
    printed_gain,
    printed_observers,
    unstructured_model,
)
from luenberger.experiment.published.wang_manoeuvre import (
    STEP,
    acceleration,
    drift_truth,
    linear_truth,
    sample_times,
    speed,
    steering,
    steering_rate,
)
from luenberger.experiment.published.wang_runs import SLIPS, Case, Readings
from luenberger.vehicle import wang_car


def test_the_rates_are_the_derivatives() -> None:
    t = np.array([0.7, 1.3, 2.2, 4.4, 5.1, 8.0])
    for value, rate in ((speed, acceleration), (steering, steering_rate)):
        # Automatic differentiation and the formula agree to rounding.
        np.testing.assert_allclose(jax.vmap(jax.grad(value))(t), rate(t), rtol=1e-12, atol=1e-14)


def test_the_printed_ends_of_the_speed_and_smooth_lobes() -> None:
    assert float(speed(0.0)) * 3.6 == pytest.approx(78)
    assert float(speed(10.0)) * 3.6 == pytest.approx(23)
    peak = float(np.abs(steering(sample_times())).max())
    # 0.7698 stands for 4 / sqrt(27).
    assert peak == pytest.approx(0.045, rel=1e-4)
    for t in (0.5, 3.0, 4.0, 6.5):
        assert float(steering_rate(t)) == pytest.approx(0.0, abs=1e-15)


def test_linear_truth_has_the_known_peaks_and_the_slip_difference() -> None:
    truth = linear_truth()
    front, rear = (1e3 * np.abs(truth[name].values).max() for name in SLIPS)
    # An independent implementation with Runge-Kutta at the same step says 23.951 and 23.004 mrad.
    assert front == pytest.approx(23.951, abs=1e-3)
    assert rear == pytest.approx(23.004, abs=1e-3)
    difference = truth["front_slip"].values - truth["rear_slip"].values
    np.testing.assert_allclose(truth["slip_difference"].values, difference, atol=1e-15)


@pytest.mark.skipif(importlib.util.find_spec("vehiclemodels") is None, reason="CommonRoad models are not installed")
def test_drift_truth_has_the_known_peaks_and_holds_the_speed() -> None:
    truth = drift_truth()
    assert truth is not None
    front, rear = (1e3 * np.abs(truth[name].values).max() for name in SLIPS)
    assert (round(front), round(rear)) == (26, 34)
    # The feedback leaves one hundredth of a metre per second.
    assert np.abs(truth["speed"].values - np.asarray(speed(truth.time))).max() < 0.05


def test_without_the_package_there_is_no_drift_truth(monkeypatch: pytest.MonkeyPatch) -> None:
    def absent(name: str) -> None:
        raise ImportError(name)

    monkeypatch.setattr("luenberger.experiment.published.wang_manoeuvre.importlib.import_module", absent)
    assert drift_truth.__wrapped__() is None


def test_row_two_is_turned() -> None:
    gain, literal = (printed_gain(H2, flipped=f)({"inverse_speed": 0.1, "acceleration": -2.0}) for f in (True, False))
    np.testing.assert_array_equal(gain, np.diag([1.0, -1.0]) @ literal)
    assert literal[0, 0] == pytest.approx(7250.9 + 3577.6 - 0.2 * 831.9374)


def test_an_unstructured_copy_is_the_printed_loop() -> None:
    where = {"inverse_speed": 0.1, "acceleration": -2.0}
    for parts in UNSTRUCTURED.values():
        model, gain = unstructured_model(parts, flipped=False)
        A, B, L = (np.asarray(p(where)) for p in (model.A, model.B, gain))
        loop, inputs = (sum(t * np.array(p) for t, p in zip((1.0, 0.1, -0.2), part, strict=True)) for part in parts[:2])
        np.testing.assert_allclose(A - L @ [[1.0, -1.0]], loop)
        np.testing.assert_allclose(B, inputs)


def test_observers_of_both_kinds() -> None:
    assert set(printed_observers(STEP)) == {*LUENBERGER, *UNSTRUCTURED}


def test_readings_err_as_the_case_says() -> None:
    truth = linear_truth()
    exact, erring = Readings.of(truth), Readings.of(truth, Case(-0.1, 0.15, exact_output=False))
    # Means of products differ from products of means by the square of a step.
    np.testing.assert_allclose(erring.r[:, 0], exact.r[:, 0] / 0.9, rtol=1e-12)
    np.testing.assert_allclose(erring.r[:, 1], exact.r[:, 1] * 1.15, rtol=1e-9)
    shift = wang_car.wheelbase * exact.u[:, 2] * (exact.r[:, 0] - erring.r[:, 0])
    np.testing.assert_allclose(erring.y[:, 0] - exact.y[:, 0], shift, atol=1e-7)
