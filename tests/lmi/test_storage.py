"""Storage matrices for a fixed gain, against what linear algebra says."""

import numpy as np
import pytest

from luenberger.algebra import Polynomial
from luenberger.core import BadInput
from luenberger.lmi import decay_storage, l2_storage, rounded_storage
from luenberger.systems import System

PLANT = System.linear([[0.0, 1.0], [-2.0, -3.0]], C=[[1.0, 0.0]], E=[[0.0], [1.0]])
NO_GAIN = Polynomial.constant(np.zeros((2, 1)))


def test_decay_up_to_the_slowest_mode_and_not_beyond() -> None:
    assert decay_storage(PLANT, NO_GAIN, 0.98) is not None
    assert decay_storage(PLANT, NO_GAIN, 1.02) is None


def test_l2_level_is_the_h_infinity_norm() -> None:
    found = l2_storage(PLANT, NO_GAIN, np.array([[1.0, 0.0]]), "disturbance")
    assert found is not None
    # 1/(s^2+3s+2) peaks at s = 0 with 1/2; the level is backed off by two percent of its square.
    assert 0.5 < found[0] <= 0.5 * np.sqrt(1.021)


def test_rounding_keeps_short_binary_numbers() -> None:
    P = np.array([[1 / 3, 0.1], [0.1, 7.0]])
    rounded = rounded_storage(P, bits=10)
    np.testing.assert_array_equal(rounded, rounded.T)
    assert np.abs(rounded - P).max() <= 2.0**-8
    assert np.all(rounded * 2.0**7 == np.round(rounded * 2.0**7))


def test_unstable_error_has_no_storage() -> None:
    assert decay_storage(PLANT.replace(A=[[0.0, 1.0], [2.0, 0.0]]), NO_GAIN, 0.0) is None
    with pytest.raises(BadInput, match="has no input"):
        l2_storage(PLANT, NO_GAIN, np.eye(2), "wind")
