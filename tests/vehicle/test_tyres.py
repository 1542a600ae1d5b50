"""Tyre forces: sign, stiffness at zero, slopes inside the stated range, and the printed cubic."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from luenberger.core import BadInput
from luenberger.vehicle import (
    BrushTyre,
    LinearTyre,
    MagicFormulaTyre,
    Tyre,
    brush_tyres,
    carmaker_car,
    ferrari_250lm,
    linear_tyres,
    wang_car,
)

MAGIC = MagicFormulaTyre(10.0, 1.4, 5000.0, -0.5)
BRUSH = BrushTyre(76500.0, 0.85 * 6000.0)
TYRES = (LinearTyre(60e3), BRUSH, MAGIC)


@pytest.mark.parametrize("tyre", TYRES, ids=lambda t: type(t).__name__)
def test_force_is_odd_and_positive_for_positive_slip(tyre: Tyre) -> None:
    slip = jnp.linspace(0.001, 0.5, 300)
    assert float(jnp.min(tyre(slip))) > 0
    # An odd function of rounded products is odd to the last bit.
    np.testing.assert_array_equal(tyre(-slip), -tyre(slip))
    assert float(tyre(0.0)) == 0.0


@pytest.mark.parametrize("tyre", TYRES, ids=lambda t: type(t).__name__)
def test_slope_at_zero_is_the_stiffness(tyre: Tyre) -> None:
    assert float(jax.grad(lambda a: tyre(a))(0.0)) == pytest.approx(float(tyre.stiffness), rel=1e-14)


@pytest.mark.parametrize("tyre", TYRES, ids=lambda t: type(t).__name__)
@pytest.mark.parametrize("limit", [0.05, 0.15, 0.4])
def test_slopes_stay_in_the_range_and_reach_its_ends(tyre: Tyre, limit: float) -> None:
    low, high = tyre.slope_range(limit)
    slopes = jax.vmap(jax.grad(lambda a: tyre(a)))(jnp.linspace(-limit, limit, 4001))
    least, most = float(jnp.min(slopes)), float(jnp.max(slopes))
    # Rounding of the gradient itself: 1e-12 of the stiffness.
    slack = 1e-12 * float(tyre.stiffness)
    assert low - slack <= least
    assert most <= high + slack
    # The grid misses an extremum by its step, and the Magic Formula range is proved to 0.1 %.
    assert least - low <= 2e-3 * float(tyre.stiffness)
    assert high - most <= 2e-3 * float(tyre.stiffness)


def test_a_brush_slope_is_zero_from_saturation_on() -> None:
    assert BRUSH.slope_range() == (0.0, 76500.0)
    assert BRUSH.slope_range(10.0) == (0.0, 76500.0)
    with pytest.raises(BadInput, match="bounded on a finite slip range"):
        MAGIC.slope_range()


def test_the_brush_tyre_is_the_printed_cubic_and_then_its_peak() -> None:
    mu, load, theta = 0.85, 6000.0, 5.0
    c1, c2, c3 = 3 * mu * load * theta, -3 * mu * load * theta**2, mu * load * theta**3
    assert c1 == pytest.approx(76500.0)
    inner = np.linspace(-1 / theta, 1 / theta, 101)
    printed = c1 * inner + c2 * inner**2 * np.sign(inner) + c3 * inner**3
    # Forces near 5 kN from products of rounded numbers.
    np.testing.assert_allclose(BRUSH(inner), printed, atol=1e-10)
    outer = np.array([-3.0, -0.2001, 0.2001, 0.7])
    np.testing.assert_allclose(BRUSH(outer), mu * load * np.sign(outer), rtol=1e-15)


def test_the_brush_slope_has_no_jump_at_zero_and_saturation() -> None:
    slope = jax.grad(lambda a: BRUSH(a))
    for where in (0.0, 0.2, -0.2):
        # The slope 3 mu Fz theta (1 - theta |a|)^2 changes by at most 2 theta C da = 0.77 N/rad over da = 1e-6.
        assert float(slope(where + 1e-6)) == pytest.approx(float(slope(where - 1e-6)), abs=2.0)


@given(share=st.floats(-0.999, 0.999))
def test_slip_inverts_the_brush_force(share: float) -> None:
    force = share * 5100.0
    # Near the peak the inverse is a cube root: an error of 1e-12 N there is 1e-5 of the angle, but maps back to 1e-12 N.
    assert float(BRUSH(BRUSH.slip(force))) == pytest.approx(force, abs=1e-9)


def test_slip_beyond_the_peak_is_the_angle_of_saturation() -> None:
    assert float(BRUSH.slip(9000.0)) == pytest.approx(0.2, rel=1e-14)
    assert float(LinearTyre(60e3).slip(600.0)) == pytest.approx(0.01)


def test_the_remainder_is_the_force_beyond_the_linear_part() -> None:
    slip = jnp.array([-0.4, -0.1, 0.0, 0.05, 0.3])
    np.testing.assert_allclose(BRUSH.remainder(slip) + 76500.0 * slip, BRUSH(slip), atol=1e-10)
    np.testing.assert_array_equal(LinearTyre(60e3).remainder(slip), np.zeros(5))


def test_tyres_of_a_car() -> None:
    front, rear = brush_tyres(wang_car)
    assert (float(front.theta), float(rear.theta)) == pytest.approx((5.0, 5.0))
    assert [t.stiffness for t in linear_tyres(carmaker_car)] == [188970.0, 149900.0]
    with pytest.raises(BadInput, match=r"has no friction; give one with `.with_values\(friction=0.9\)`"):
        brush_tyres(ferrari_250lm)


def test_numbers_of_a_tyre_can_be_batched_and_fitted() -> None:
    batch = jax.vmap(BrushTyre)(jnp.array([60e3, 80e3]), jnp.array([4e3, 5e3]))
    forces = jax.jit(jax.vmap(lambda tyre: tyre(0.03)))(batch)
    np.testing.assert_allclose(forces, [BrushTyre(60e3, 4e3)(0.03), BrushTyre(80e3, 5e3)(0.03)], rtol=1e-15)
    slope = jax.grad(lambda tyre: tyre(0.03))(BrushTyre(60e3, 4e3))
    assert slope.cornering > 0
    assert slope.peak > 0
