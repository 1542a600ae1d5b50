"""Two-degree-of-freedom design by multipliers: known optima, limits, shifts, noise, and what it refuses."""

from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

from luenberger.algebra import Polynomial
from luenberger.core import BadInput, Infeasible, NotAccepted, Outcome
from luenberger.design import Design
from luenberger.methods.two_dof import TwoDofLuenberger
from luenberger.synthesize import synthesize
from luenberger.systems import Nonlinearity, Parameter, System
from two_dof_plants import mixed_plant, oscillator, slipping_car


def designed(system: System, **options: Any) -> Design:
    design = synthesize(system, TwoDofLuenberger(**options))
    assert design.certificate.outcome is Outcome.PROVED
    return design


def optimum(design: Design) -> float:
    return float(np.sqrt(design.statistics["optimum"]))


def norms(design: Design) -> tuple[float, float]:
    second = design.argument_gain
    return float(np.linalg.norm(design.gain({}))), 0.0 if second is None else float(np.linalg.norm(second({})))


@pytest.mark.parametrize(
    ("reach", "rate", "plain", "both"),
    [(1.0, 0.0, 5.768, 1.780), (2.7, 0.0, 27.969, 1.815), (5.0, 0.0, 88.314, 1.819), (5.0, 1.0, 112.55, 8.809)],
)
def test_van_der_pol(reach: float, rate: float, plain: float, both: float) -> None:
    # The stated optima have four or five digits; half a unit of the last, and 1e-4 of solver slack where the optimum is flat.
    one = designed(oscillator(reach), decay_rate=rate, argument_gain_limit=0.0)
    assert optimum(one) == pytest.approx(plain, abs=5.1e-3 if plain > 100 else 5.1e-4)
    assert one.argument_gain is None
    two = designed(oscillator(reach), decay_rate=rate)
    assert optimum(two) == pytest.approx(both, abs=6e-4)
    # The squared bound is backed off by one percent for the margin and by half a percent for a small L2.
    for design, best in ((one, plain), (two, both)):
        level = design.certificate.level("gain_bound")
        assert level is not None
        assert norms(design)[0] <= level <= best * 1.008
    # L2 = (1, .) feeds the measured position into f.
    assert two.argument_gain is not None
    assert two.argument_gain({})[0, 0] == pytest.approx(1.0, abs=1e-4)
    assert norms(two)[1] <= two.certificate.level("argument_gain_bound") <= 2.3


def test_shifted_form_is_as_good_as_the_unshifted_one() -> None:
    # (b') finds storage and L2 in turn, and ends where the convex (b) ends; the rounds stop at one part in ten thousand.
    assert optimum(designed(oscillator(2.7), shift="lower")) == pytest.approx(1.8145, rel=1e-3)


def test_limit_on_the_argument_gain() -> None:
    gains = []
    for limit in (1.2, 0.5):
        design = designed(oscillator(5.0), argument_gain_limit=limit)
        first, second = norms(design)
        assert second <= limit
        gains.append(first)
    # Each share of L2 that is taken away costs injected gain, up to 88.3 without any.
    assert 1.82 < gains[0] < gains[1] < 88.3
    # A limit that the smallest L2 keeps anyhow costs nothing.
    assert optimum(designed(oscillator(5.0), argument_gain_limit=2.0)) == pytest.approx(1.819, abs=6e-4)


@pytest.mark.parametrize(("share", "level"), [(0.3, 0.03580), (0.5, 0.07280), (0.69, 4.05)])
@pytest.mark.parametrize("second", [None, 0.0])
def test_slip_angles(share: float, level: float, second: float | None) -> None:
    design = designed(slipping_car(share), goal="l2", argument_gain_limit=second)
    # Stated per kN and kN m with three or four digits. L2 buys nothing here.
    assert 1e3 * optimum(design) == pytest.approx(level, abs=5.1e-6 if level < 1 else 5.1e-3)
    claimed = design.certificate.level("l2_gain")
    assert claimed is not None
    # Without `gain_limit` four percent of the square are given away for a small gain, one more for the margin.
    assert optimum(design) < claimed <= optimum(design) * np.sqrt(1.04 * 1.01) * 1.001


def test_slip_angles_beyond_the_reach_of_multipliers() -> None:
    # The largest share is 0.693; the vertex inequality goes on to 0.9498.
    assert designed(slipping_car(0.692)).certificate.level("decay") == 0.0
    for share, goal in ((0.694, "gain"), (0.9, "l2")):
        with pytest.raises(Infeasible, match="ExtendedLuenberger"):
            designed(slipping_car(share), goal=goal)


@pytest.mark.parametrize("inputs", ["disturbance", "noise", "both"])
def test_l2_gain_under_a_limit(inputs: str) -> None:
    design = designed(oscillator(2.7), goal="l2", inputs=inputs, gain_limit=20.0)
    assert norms(design)[0] <= 20.0
    # Back-off of one percent of the square.
    assert optimum(design) < design.certificate.level("l2_gain") <= optimum(design) * 1.0051
    assert [c.kind for c in design.certificate.claims] == ["decay", "gain_bound", "argument_gain_bound", "l2_gain"]


def test_l2_gain_under_two_limits() -> None:
    wide, narrow = (designed(oscillator(2.7), goal="l2", gain_limit=20.0, argument_gain_limit=a) for a in (None, 1.2))
    assert norms(narrow)[0] <= 20.0
    assert norms(narrow)[1] <= 1.2
    assert optimum(wide) < optimum(narrow)


def test_gain_limit_that_cannot_be_met_names_the_smallest() -> None:
    with pytest.raises(Infeasible, match="gain_limit = 30") as caught:
        designed(oscillator(5.0), goal="l2", gain_limit=30.0, argument_gain_limit=0.0)
    assert caught.value.nearest == pytest.approx(88.314, rel=1e-4)
    with pytest.raises(Infeasible, match="gain_limit = 2 ") as shifted:
        designed(mixed_plant(), decay_rate=0.5, goal="l2", gain_limit=2.0, inputs="both")
    assert shifted.value.nearest is not None
    assert shifted.value.nearest > 2.0


def test_an_l2_gain_without_infimum_in_finite_gains_stops_at_a_finite_one() -> None:
    # Position measured, force on the speed: the level goes to zero as the gain goes to infinity.
    assert norms(designed(oscillator(2.7), goal="l2"))[0] < 2e3


@pytest.mark.parametrize("shift", ["none", "lower"])
def test_slopes_that_hold_no_zero(shift: str) -> None:
    two = designed(mixed_plant(), decay_rate=1.0, shift=shift)
    one = designed(mixed_plant(), decay_rate=1.0, shift=shift, argument_gain_limit=0.0)
    # L2 = 0 is among the starts, so a free L2 is never worse than none.
    assert optimum(two) <= optimum(one) * (1 + 1e-6)
    bounded = designed(mixed_plant(), decay_rate=0.5, goal="l2", gain_limit=20.0, inputs="both", shift=shift)
    assert norms(bounded)[0] <= 20.0


def test_arguments_that_depend_on_each_other() -> None:
    # Three arguments of two states: L2 has fewer degrees of freedom than tau h L2, so all share one tau.
    f = Nonlinearity.bounded(
        lambda z, u: jnp.array([jnp.sin(z[0]) + jnp.sin(z[1]) + jnp.sin(z[2])]),
        [[0.0, 1.0], [1.0, 0.0], [1.0, 1.0]],
        jacobian=([[-1.0, -1.0, -1.0]], [[1.0, 1.0, 1.0]]),
    )
    plant = System.nonlinear([[0, 1], [-1, -1]], C=[[1, 0]], F=[[0], [1]], nonlinearity=f)
    two, one = designed(plant, decay_rate=1.0), designed(plant, decay_rate=1.0, argument_gain_limit=0.0)
    assert optimum(two) < optimum(one)
    assert norms(designed(plant, decay_rate=1.0, argument_gain_limit=0.5))[1] <= 0.5


def test_channels_that_share_an_argument() -> None:
    # One angle drives two states by unlike slopes: with both gains given each channel has a multiplier of its own.
    f = Nonlinearity.bounded(
        lambda z, u: jnp.array([jnp.sin(z[0]), 5.0 * jnp.cos(z[0])]),
        [[0.0, 1.0, 0.0]],
        size=2,
        jacobian=([[-1.0], [-5.0]], [[1.0], [5.0]]),
    )
    A = [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [-1.0, -1.0, -2.0]]
    plant = System.nonlinear(A, C=[[1, 0, 0]], F=[[0, 0], [1, 0], [0, 1]], E=[[0], [0], [1]], nonlinearity=f)
    free, none = designed(plant), designed(plant, argument_gain_limit=0.0)
    assert optimum(free) <= optimum(none) * (1 + 1e-6)
    wide, narrow = (designed(plant, goal="l2", gain_limit=r) for r in (None, 300.0))
    # The rounds stop at one part in a thousand of the square.
    assert optimum(wide) <= optimum(narrow) * (1 + 1e-3)


def scheduled() -> System:
    plant = oscillator(2.7)
    return System.lpv(
        Polynomial.affine([[0.0, 1.0], [-1.0, 0.0]], s=[[0.0, 0.0], [0.0, -0.2]]),
        C=Polynomial.affine([[1.0, 0.0]], s=[[0.2, 0.1]]),
        F=Polynomial.affine([[0.0], [1.0]], s=[[0.1], [0.3]]),
        E=[[0.0], [1.0]],
        nonlinearity=plant.nonlinearity,
        parameters=[Parameter("s", -1.0, 1.0)],
    )


def test_scheduled_gains() -> None:
    follow, held = designed(scheduled()), designed(scheduled(), schedule="constant")
    assert follow.argument_gain is not None
    assert held.argument_gain is not None
    assert follow.argument_gain.names == ("s",)
    assert all(d == 0 for d in held.argument_gain.degree.values())
    assert optimum(follow) < optimum(held)
    assert designed(scheduled(), shift="lower").certificate.outcome is Outcome.PROVED


def test_units_of_the_nonlinearity_do_not_matter() -> None:
    plant = oscillator(2.7)
    f = plant.nonlinearity
    assert f is not None
    tiny = Nonlinearity.bounded(
        lambda z, u: 1e-6 * f.function(z, u), np.eye(2), jacobian=(1e-6 * f.jacobian_lower, 1e-6 * f.jacobian_upper)
    )
    same = plant.replace(F=[[0.0], [1e6]], nonlinearity=tiny)
    assert optimum(designed(same)) == pytest.approx(optimum(designed(plant)), rel=1e-6)


def test_units_of_disturbance_and_weight_only_scale_the_level() -> None:
    plant = slipping_car(0.5)
    kilo = plant.replace(E=plant.polynomial("E") * 1e3)
    one = designed(plant, goal="l2", weight=((1.0, 0.0),), gain_limit=50.0)
    other = designed(kilo, goal="l2", weight=((20.0, 0.0),), gain_limit=50.0)
    assert optimum(other) == pytest.approx(2e4 * optimum(one), rel=1e-5)


def test_file_keeps_both_gains(tmp_path: Any) -> None:
    design = designed(oscillator(2.7))
    design.save(tmp_path / "design.json")
    again = Design.load(tmp_path / "design.json")
    assert again.certify().outcome is Outcome.PROVED
    assert design.argument_gain is not None
    assert again.argument_gain is not None
    np.testing.assert_array_equal(design.argument_gain({}), again.argument_gain({}))


def test_refusals() -> None:
    plain = oscillator(1.0)
    with pytest.raises(NotAccepted, match="no nonlinearity"):
        designed(System.linear([[0.0]], C=[[1.0]]))
    lipschitz = Nonlinearity.bounded(lambda z, u: jnp.sin(z[:1]), np.eye(2), lipschitz=1.0)
    with pytest.raises(NotAccepted, match="no Jacobian box"):
        designed(plain.replace(nonlinearity=lipschitz))
    with pytest.raises(BadInput, match="belongs to goal"):
        designed(plain, gain_limit=3.0)
    with pytest.raises(BadInput, match="argument_gain_limit"):
        designed(plain, argument_gain_limit=-1.0)
    with pytest.raises(BadInput, match="gain_limit"):
        designed(plain, goal="l2", gain_limit=0.0)
    with pytest.raises(BadInput, match="weight"):
        designed(plain, goal="l2", weight=((0.0, 0.0),))
    with pytest.raises(NotAccepted, match="no input `disturbance`"):
        designed(plain.replace(E=np.zeros((2, 0))), goal="l2")
    erring = scheduled().replace(parameters=[Parameter("s", -1.0, 1.0, factor=(0.9, 1.1))])
    with pytest.raises(NotAccepted, match="measured with error"):
        designed(erring)
