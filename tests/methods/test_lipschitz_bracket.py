"""Proved brackets of margins and of the largest epsilon."""

from fractions import Fraction

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from lipschitz_plants import POINT_THREE, integrator, pendulum, random_plant
from luenberger.core import BadInput, Infeasible
from luenberger.methods.lipschitz_bracket import epsilon_interval, largest_epsilon, margin_bracket
from luenberger.methods.lipschitz_margin import margin_at, stability_margin
from luenberger.methods.lipschitz_plant import LumpedPlant
from luenberger.systems import System

GAIN = [[3.0], [4.0]]


@pytest.mark.parametrize("transform", [None, POINT_THREE, [[1.0, 0.2], [-0.3, 0.5]]])
def test_margin_of_a_gain_is_bracketed(transform: object) -> None:
    low, high = margin_bracket(pendulum(), gain=GAIN, transform=transform).alpha
    alpha = stability_margin(pendulum(), GAIN, transform)
    assert low < alpha < high * (1 + 1e-12)
    # The widths tried start at 1e-8; 1e-6 leaves room for one coarser step.
    assert high / low < 1 + 1e-6


@pytest.mark.parametrize("epsilon", [0.01, 0.1, 1.0])
def test_margin_at_an_epsilon_is_bracketed(epsilon: float) -> None:
    low, high = margin_bracket(pendulum(), epsilon=epsilon, transform=POINT_THREE).alpha
    alpha = margin_at(pendulum(), epsilon, POINT_THREE)
    assert low < alpha * (1 + 1e-12)
    assert alpha < high * (1 + 1e-12)
    assert high / low < 1 + 1e-6


def test_margin_of_a_resonant_loop_peaks_off_zero_frequency() -> None:
    # Poles at -0.05 +- 1j: the margin is decided near 1 rad/s, by the frequency bound.
    plant = System.linear([[0.0, 1.0], [-1.0, -0.1]], C=[[1.0, 0.0]])
    low, high = margin_bracket(plant, gain=[[0.0], [0.0]]).alpha
    assert low < stability_margin(plant, [[0.0], [0.0]]) < high * (1 + 1e-12)
    assert high / low < 1 + 1e-6


def test_margin_needs_exactly_one_question() -> None:
    with pytest.raises(BadInput, match="either `epsilon` or `gain`"):
        margin_bracket(pendulum())
    with pytest.raises(BadInput, match="either `epsilon` or `gain`"):
        margin_bracket(pendulum(), gain=GAIN, epsilon=1.0)
    with pytest.raises(BadInput, match="positive finite"):
        margin_bracket(pendulum(), epsilon=0.0)
    with pytest.raises(Infeasible, match="margin is zero"):
        margin_bracket(pendulum(), gain=[[-1.0], [0.0]])


def test_largest_epsilon_of_the_integrator() -> None:
    # g^2 < 1/epsilon, so epsilon* = 1/4 for g = 2.
    found = largest_epsilon(integrator(), 2.0, width=1e-8)
    assert found.infeasible is not None
    assert found.feasible < 0.25 < found.infeasible
    assert found.infeasible - found.feasible < 1e-7


def test_largest_epsilon_agrees_with_the_margin() -> None:
    found = largest_epsilon(pendulum(), None, POINT_THREE)
    assert found.infeasible is not None
    assert (
        margin_at(pendulum(), found.feasible, POINT_THREE) > 0.3 > margin_at(pendulum(), found.infeasible, POINT_THREE)
    )
    assert found.infeasible / found.feasible < 1 + 1e-5


def test_every_epsilon_serves_a_stable_plant() -> None:
    found = largest_epsilon(System.linear([[-1.0]], C=[[1.0]]), 0.5)
    assert found.infeasible is None
    assert found.feasible > 1e5


def test_no_epsilon_serves_too_large_a_constant() -> None:
    with pytest.raises(Infeasible, match=r"No epsilon down to 1e-08 .* `transform`"):
        largest_epsilon(pendulum(50.0))


def test_interval_spans_one_decade() -> None:
    good, bad = epsilon_interval(LumpedPlant.of(pendulum(), POINT_THREE))
    assert bad == pytest.approx(10 * good, rel=1e-12)


@settings(max_examples=25)
@given(st.integers(0, 10_000), st.sampled_from([0.03, 0.3, 3.0]))
def test_random_plants_are_bracketed(seed: int, epsilon: float) -> None:
    plant = random_plant(seed)
    alpha = margin_at(plant, epsilon)
    # A margin near zero has no relative bracket.
    assume(alpha > 1e-3)
    found = margin_bracket(plant, epsilon=epsilon)
    low, high = found.alpha
    assert low < alpha * (1 + 1e-12)
    assert alpha < high * (1 + 1e-12)
    assert found.lower < found.upper
    # Badly scaled plants may need a wider step; one part in a thousand is the widest that is tried.
    assert high / low < 1 + 2e-3
    # Half the margin as Lipschitz constant: the bracket of epsilon lies above the epsilon of the margin.
    assert largest_epsilon(plant, 0.5 * alpha).feasible > epsilon
    assert Fraction(0.5 * alpha) ** 2 < found.lower
