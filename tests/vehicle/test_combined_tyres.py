"""Loaded tyres: the friction circle, the stiffness of the axle they came from, and agreement with pure-slip tyres."""

from math import inf

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from luenberger.core import BadInput
from luenberger.vehicle import MagicFormulaTyre
from luenberger.vehicle.combined_tyres import DugoffTyre, LoadedTyre, MagicFormulaCombined, secant_stiffness

NUMBERS = {"cornering": 40e3, "slip_stiffness": 50e3, "nominal_load": 3000.0, "peak_load": 7000.0}
TYRES = [MagicFormulaCombined(**NUMBERS), MagicFormulaCombined(**NUMBERS, curvature=-2.0), DugoffTyre(**NUMBERS)]
every_tyre = pytest.mark.parametrize("tyre", TYRES, ids=["magic formula", "curved magic formula", "dugoff"])


@every_tyre
@given(
    alpha=st.floats(-1.5, 1.5),
    kappa=st.floats(-1.0, 2.0),
    load=st.floats(0.0, 12e3),
    friction=st.floats(0.05, 1.3),
)
def test_the_force_never_leaves_the_friction_circle(
    tyre: LoadedTyre, alpha: float, kappa: float, load: float, friction: float
) -> None:
    forces = np.array(tyre(alpha, kappa, load, friction))
    assert np.isfinite(forces).all()
    # The bound holds exactly; the slack is rounding of the norm.
    assert np.hypot(*forces) <= friction * load * (1 + 1e-14)
    assert forces[0] * kappa >= 0
    assert forces[1] * alpha >= 0


@every_tyre
@given(
    alpha=st.floats(-1.2, 1.2),
    demand=st.floats(-2e4, 2e4),
    load=st.floats(0.0, 12e3),
    friction=st.floats(0.05, 1.3),
)
def test_demanded_force_takes_lateral_force_from_the_circle(
    tyre: LoadedTyre, alpha: float, demand: float, load: float, friction: float
) -> None:
    Fx, Fy = (float(force) for force in tyre.driven(alpha, demand, load, friction, 0.9))
    peak = friction * load
    assert abs(Fx) <= 0.9 * peak * (1 + 1e-14)
    assert np.hypot(Fx, Fy) <= peak * (1 + 1e-14)
    if abs(demand) < 0.9 * peak:
        assert Fx == pytest.approx(demand, rel=1e-13, abs=1e-300)
    free = float(tyre(alpha, 0.0, load, friction)[1])
    # (Fx / peak)^2 + (Fy / free)^2 = 1 is the ellipse that is promised.
    assert Fy**2 == pytest.approx(free**2 * (1 - (Fx / max(peak, 1e-300)) ** 2), rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("demand", [0.0, 1200.0, -2500.0])
def test_peak_force_is_reached_on_the_circle(demand: float) -> None:
    tyre = TYRES[0]
    alpha = jnp.linspace(0.0, 1.0, 20001)
    full = jnp.full_like(alpha, 3000.0)
    Fx, Fy = tyre.driven(alpha, demand * jnp.ones_like(alpha), full, full / 3000.0)
    # The grid passes within 1e-5 rad of the top, where the curve is flat.
    assert float(jnp.max(jnp.hypot(Fx, Fy))) == pytest.approx(3000.0, rel=1e-6)


@every_tyre
def test_small_slip_stiffness_is_the_stated_one_at_nominal_load(tyre: LoadedTyre) -> None:
    slopes = jax.jacfwd(lambda s: jnp.stack(tyre(s[0], s[1], 3000.0, 0.8)))(jnp.zeros(2))
    np.testing.assert_allclose(slopes, [[0.0, 50e3], [40e3, 0.0]], rtol=1e-13)


@every_tyre
@pytest.mark.parametrize("load", [500.0, 3000.0, 6000.0, 9000.0])
@pytest.mark.parametrize("friction", [0.3, 1.0])
def test_stiffness_depends_on_load_and_not_on_friction(tyre: LoadedTyre, load: float, friction: float) -> None:
    found = jax.grad(lambda a: tyre(a, 0.0, load, friction)[1])(0.0)
    z, z0 = load / 7000.0, 3 / 7
    expected = 40e3 * np.sin(2 * np.arctan(z)) / np.sin(2 * np.arctan(z0))
    np.testing.assert_allclose([found, tyre.cornering_at(load)], expected, rtol=1e-12)


def test_load_transfer_costs_stiffness() -> None:
    tyre = TYRES[0]
    pair = float(tyre.cornering_at(1500.0) + tyre.cornering_at(4500.0))
    assert pair < 0.95 * 2 * 40e3
    proportional = MagicFormulaCombined(40e3, 50e3, 3000.0, inf)
    assert float(proportional.cornering_at(1500.0) + proportional.cornering_at(4500.0)) == pytest.approx(80e3)


def test_pure_side_slip_is_the_magic_formula() -> None:
    tyre = MagicFormulaCombined(40e3, 50e3, 3000.0, inf, shape=1.4, curvature=-0.7)
    load, friction = 2400.0, 0.7
    stiffness = 40e3 * load / 3000.0
    pure = MagicFormulaTyre(stiffness / (1.4 * friction * load), 1.4, friction * load, -0.7)
    alpha = jnp.linspace(-0.6, 0.6, 41)
    found = tyre(alpha, 0 * alpha, load + 0 * alpha, friction + 0 * alpha)[1]
    np.testing.assert_allclose(found, pure(alpha), rtol=1e-12, atol=1e-9)


def test_dugoff_is_the_printed_form() -> None:
    tyre = DugoffTyre(40e3, 50e3, 3000.0, inf)
    draw = np.random.default_rng(5)
    for alpha, kappa in draw.uniform([-0.3, -0.3], [0.3, 0.3], (50, 2)):
        norm = np.hypot(50e3 * kappa, 40e3 * np.tan(alpha))
        lam = 0.8 * 3000.0 * (1 + kappa) / (2 * norm)
        bend = (2 - lam) * lam if lam < 1 else 1.0
        expected = np.array([50e3 * kappa, 40e3 * np.tan(alpha)]) / (1 + kappa) * bend
        np.testing.assert_allclose(tyre(alpha, kappa, 3000.0, 0.8), expected, rtol=1e-12)


@every_tyre
def test_braking_at_the_same_slip_angle_costs_lateral_force(tyre: LoadedTyre) -> None:
    # |kappa| and not kappa: Dugoff gains from driving what 1 / (1 + kappa) takes.
    lateral = [float(tyre(0.06, -kappa, 3000.0, 0.9)[1]) for kappa in (0.0, 0.05, 0.1, 0.3)]
    assert lateral[0] > lateral[-1]
    assert float(jnp.abs(tyre(0.06, -0.3, 3000.0, 0.9)[0])) > lateral[-1]


@every_tyre
def test_gradients_are_finite_at_rest_without_load_and_locked(tyre: LoadedTyre) -> None:
    for point in ([0.0, 0.0, 3000.0, 0.9], [0.0, 0.0, 0.0, 0.9], [0.1, -1.0, 3000.0, 0.9], [0.1, 0.0, 0.0, 0.9]):
        slopes = jax.jacfwd(lambda p: jnp.stack(tyre(*p)))(jnp.array(point))
        assert np.isfinite(np.asarray(slopes)).all(), point
        driven = jax.jacfwd(lambda p: jnp.stack(tyre.driven(p[0], 500.0, p[2], p[3])))(jnp.array(point))
        assert np.isfinite(np.asarray(driven)).all(), point


def test_secant_is_the_force_over_the_slip_and_unknown_near_zero() -> None:
    tyre = TYRES[0]
    alpha = jnp.array([-0.05, 1e-4, 0.002, 0.05])
    force = tyre(alpha, 0 * alpha, 3000.0 + 0 * alpha, 0.9 + 0 * alpha)[1]
    found = np.asarray(secant_stiffness(force, alpha))
    np.testing.assert_array_equal(np.isnan(found), [False, True, False, False])
    # Near zero the secant is the slope up to (rho^2), rho = C alpha / (mu Fz) = 0.03.
    assert found[2] == pytest.approx(40e3, rel=1e-3)
    assert found[3] < 0.9 * 40e3
    assert found[0] == found[3]
    with pytest.raises(BadInput, match=r"`least_slip` is 0\.0 rad"):
        secant_stiffness(force, alpha, 0.0)
