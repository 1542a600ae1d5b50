"""The robot arm with a flexible joint."""

import numpy as np
import pytest

from luenberger.experiment.published.flexible_joint import PRINTED_GAINS, TRANSFORM, flexible_joint, gravity
from luenberger.methods.lipschitz_plant import LumpedPlant
from luenberger.systems import Nonlinearity


def test_matrices_are_the_printed_ones() -> None:
    plant = flexible_joint()
    assert plant.states == ("motor_angle", "motor_rate", "link_angle", "link_rate")
    A = np.asarray(plant.at("A"))
    # Spring torque depends on the twist alone, and the rates are the derivatives of the angles.
    np.testing.assert_array_equal(A @ [1.0, 0.0, 1.0, 0.0], np.zeros(4))
    np.testing.assert_array_equal(A[[0, 2]], [[0, 1, 0, 0], [0, 0, 0, 1]])
    np.testing.assert_array_equal(A[[1, 3], 0], [-48.6, 19.5])
    np.testing.assert_array_equal(np.asarray(plant.at("B")).ravel(), [0, 21.6, 0, 0])


def test_dynamics_at_a_point() -> None:
    dx = flexible_joint().dynamics(0.0, np.array([0.1, 0.2, 0.3, 0.4]), np.array([0.5]))
    expected = [0.2, 48.6 * 0.2 - 1.25 * 0.2 + 10.8, 0.4, -19.5 * 0.2 - 3.33 * np.sin(0.3)]
    np.testing.assert_allclose(dx, expected, rtol=1e-14)


@pytest.mark.parametrize(("direction", "E"), [("printed", [0, 2, 0, 0]), ("motor_angle", [1, 0, 0, 0])])
def test_disturbance_directions(direction: str, E: list[float]) -> None:
    np.testing.assert_array_equal(np.asarray(flexible_joint(direction).at("E")).ravel(), E)
    assert flexible_joint("none").nd == 0


def test_lipschitz_constant_is_proved_by_ball_arithmetic() -> None:
    domain = (np.full(4, -4.0), np.full(4, 4.0))
    proved = Nonlinearity.enclosed(gravity, [[0.0, 0.0, 1.0, 0.0]], domain)
    # The enclosure may overshoot by its tolerance of 1e-3.
    assert proved.lipschitz_bound * (1 + 1e-12) >= 3.33
    assert proved.lipschitz_bound <= 3.33 * 1.002
    assert LumpedPlant.of(flexible_joint(), TRANSFORM).lipschitz == pytest.approx(0.333, rel=1e-14)


def test_printed_gains_stabilise_the_linear_part() -> None:
    plant = flexible_joint("none")
    for L in PRINTED_GAINS.values():
        assert np.linalg.eigvals(np.asarray(plant.at("A")) - L @ np.asarray(plant.at("C"))).real.max() < 0
