"""The bricks of chapter 2 against what frequency responses, the circle criterion and by-hand examples say."""

import numpy as np
import pytest

from luenberger.core import BadInput
from luenberger.lmi.classical import (
    bounded_real_gain,
    kyp_storage,
    largest_slope,
    positive_real_storage,
    unstructured_margin,
    unstructured_nominal,
)

A, B = np.array([[0.0, 1.0], [-2.0, -3.0]]), np.array([[0.0], [1.0]])
C, D = np.array([[1.0, 0.5]]), np.array([[0.1]])


def response(omega: float) -> complex:
    return complex((C @ np.linalg.solve(1j * omega * np.eye(2) - A, B) + D)[0, 0])


@pytest.mark.parametrize("form", ["square", "linear"])
def test_bounded_real_is_the_largest_response(form: str) -> None:
    peak = max(abs(response(w)) for w in np.linspace(0, 20, 2001))
    assert peak == pytest.approx(0.6, abs=1e-9)
    # The solver's own tolerance of 1e-10 under a square root of a flat optimum.
    assert bounded_real_gain(A, B, C, D, form) == pytest.approx(0.6, abs=1e-5)  # type: ignore[arg-type]


def test_bounded_real_needs_a_hurwitz_plant() -> None:
    assert bounded_real_gain(-A, B, C, D) is None


def test_largest_slope_is_the_circle_criterion() -> None:
    plant, entry, out = np.array([[0.0, 1.0], [-1.0, -1.0]]), np.array([[0.0], [-1.0]]), np.array([[1.0, 0.0]])
    # w = f(z) with z = x1 and -G the transfer from w to z: stable where Re(1 + k G) > 0 with G = 1/(s^2 + s + 1).
    omega = np.linspace(0, 10, 100_001)
    circle = -1 / (1 / (1 - omega**2 + 1j * omega)).real.min()
    assert circle == pytest.approx(3.0, abs=1e-6)
    assert largest_slope(plant, entry, out) == pytest.approx(3.0, abs=1e-4)


def test_kyp_holds_for_a_plant_that_no_definite_storage_covers() -> None:
    # |1/(jw - 1)| <= 1 < 2 although the plant is unstable: z'z - 4 w'w <= 0 at every frequency.
    plant, entry, supply = np.array([[1.0]]), np.array([[1.0]]), np.diag([1.0, -4.0])
    P = kyp_storage(plant, entry, supply)
    assert P is not None
    assert P[0, 0] < 0
    # 2 p + 1 - ... < 0 with [2p + 1, p; p, -4] < 0: p between -4 -/+ sqrt(12) and so negative.
    assert -4 - np.sqrt(12) < P[0, 0] < -4 + np.sqrt(12)
    assert kyp_storage(plant, entry, supply, definite=True) is None
    with pytest.raises(BadInput, match="is needed"):
        kyp_storage(plant, entry, np.eye(3))


def test_positive_real_is_an_equality() -> None:
    # 1/(s+1) is strictly positive real, P = 1/2; the same with the other sign is not.
    one = np.eye(1)
    P = positive_real_storage(-one, one, one)
    assert P is not None
    assert P[0, 0] == pytest.approx(0.5, abs=1e-7)
    assert positive_real_storage(-one, one, -one) is None


def test_printed_unstructured_inequality_is_never_strict() -> None:
    # A zero diagonal block leaves nothing: whatever is positive here is solver dust.
    assert abs(unstructured_margin(A, C)) < 1e-7


def test_equality_version_is_an_observer() -> None:
    # C does not see the mode of -2, which limits every decay.
    assert unstructured_nominal(A, C, 2.1) is None
    found = unstructured_nominal(A, C, 1.9)
    assert found is not None
    Ao, Bo = found
    np.testing.assert_allclose(Ao, A - Bo @ C, rtol=1e-14)
    assert np.linalg.eigvals(Ao).real.max() <= -1.9
