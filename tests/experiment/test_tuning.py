"""The search finds a known minimum, keeps to its budget, and walks round places where nothing exists."""

from collections.abc import Mapping

import numpy as np
import pytest

from luenberger.core import BadInput, Infeasible
from luenberger.experiment.tuning import tune


def bowl(knobs: Mapping[str, float]) -> float:
    return np.log(knobs["a"] / 2) ** 2 + np.log(knobs["b"] / 30) ** 2


def test_known_minimum() -> None:
    found = tune(bowl, {"a": 1.0, "b": 10.0}, 150)
    assert found.evaluations <= 150
    # A quadratic bowl in the logarithms: the simplex settles well below a per mille in 150 steps.
    assert found.knobs == pytest.approx({"a": 2.0, "b": 30.0}, rel=1e-3)
    assert found.cost == bowl(found.knobs)


def test_budget_is_kept() -> None:
    calls: list[float] = []

    def counted(knobs: Mapping[str, float]) -> float:
        calls.append(1.0)
        return bowl(knobs)

    assert tune(counted, {"a": 1.0, "b": 10.0}, 12).evaluations == len(calls) <= 14


def test_infeasible_places_are_walked_round() -> None:
    def walled(knobs: Mapping[str, float]) -> float:
        if knobs["a"] > 1.5:
            raise Infeasible("no observer")
        return bowl(knobs)

    found = tune(walled, {"a": 1.0, "b": 10.0}, 200)
    assert 1.4 < found.knobs["a"] <= 1.5


def test_bad_starts() -> None:
    with pytest.raises(BadInput, match="positive start"):
        tune(bowl, {"a": 0.0}, 10)
    with pytest.raises(BadInput, match="No observer runs"):
        tune(lambda knobs: float("inf"), {"a": 1.0}, 10)
    assert tune(lambda knobs: 3.0, {}, 10).cost == 3.0
