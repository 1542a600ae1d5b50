"""Searches for two gains: levels fall from round to round, and the smallest limit is the smallest."""

from dataclasses import replace

import numpy as np

from luenberger.algebra import Polynomial
from luenberger.lmi import Bernstein, solve
from luenberger.methods.channels import Channels
from luenberger.methods.two_dof_inequality import Limits, Posing
from luenberger.methods.two_dof_search import SHARE, best_improved, improved, largest_norm, smallest, zero_gain
from two_dof_plants import oscillator


def posing() -> Posing:
    plant = oscillator(1.0)
    return Posing(plant, Channels.of(plant), 0.0, None, "disturbance", True, Bernstein())


def test_rounds_only_improve() -> None:
    start = zero_gain(oscillator(1.0))
    first = solve(posing().problem(posing().fixed(start), Limits()))
    last = improved(posing(), start, Limits())
    assert first is not None
    assert last is not None
    # From L2 = 0, |L|^2 <= 33.27; the joint optimum is 3.17.
    assert last[1].objective < 0.2 * first.objective
    best = best_improved(posing(), [start, Polynomial.constant([[1.0], [0.6]])], Limits())
    assert best is not None
    assert best[1].objective <= last[1].objective * (1 + 1e-9)


def test_a_start_without_level_gives_nothing() -> None:
    fast = replace(posing(), decay_rate=1e6)
    assert improved(fast, zero_gain(fast.system), Limits(1.0)) is None
    assert best_improved(posing(), [], Limits()) is None


def test_smallest_limit() -> None:
    here = posing()
    free = here.free()
    best = solve(here.problem(free, Limits()))
    assert best is not None
    found = smallest(here, free, Limits(), "argument")
    assert found.argument is not None
    for factor, holds in ((1.0, True), (0.9, False)):
        again = solve(here.problem(free, Limits(None, factor * found.argument)))
        assert again is not None
        assert (again.objective <= best.objective * (1 + SHARE)) is holds
    assert smallest(here, free, Limits(None, 7.0), "argument") == Limits(None, 7.0)


def test_largest_norm_is_a_bound() -> None:
    plant = oscillator(1.0)
    assert largest_norm(plant, Polynomial.constant(np.array([[3.0], [4.0]]))) == 5.0
