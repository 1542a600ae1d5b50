"""The published procedure as one call."""

import numpy as np
import pytest

from lipschitz_plants import POINT_THREE, pendulum
from luenberger.core import BadInput, Infeasible, NotAccepted, Outcome
from luenberger.methods.lipschitz_algorithm import lipschitz_algorithm
from luenberger.methods.lipschitz_margin import margin_at
from luenberger.synthesize import synthesize
from luenberger.systems import System


def test_takes_the_first_coordinates_that_serve() -> None:
    report = lipschitz_algorithm(pendulum(3.0), [None, POINT_THREE, (1.0, 0.2)], points=5)
    assert report.transform == POINT_THREE
    assert [t.transform for t in report.tables] == [None, POINT_THREE]
    assert report.tables[0].feasible == 0


def test_bracket_lies_between_grid_points_where_the_count_ends() -> None:
    report = lipschitz_algorithm(pendulum(3.0), [POINT_THREE], points=9)
    table = report.tables[-1]
    assert np.all(np.diff(table.margins) < 0)
    assert 0 < table.feasible < 9
    assert table.epsilons[table.feasible - 1] <= report.bracket.feasible
    assert report.bracket.infeasible is not None
    assert report.bracket.infeasible <= table.epsilons[table.feasible]
    assert table.margins[0] == pytest.approx(margin_at(pendulum(3.0), 0.1, POINT_THREE), rel=1e-9)


def test_designs_are_those_of_the_methods() -> None:
    plant = pendulum(1.0, disturbed=True)
    report = lipschitz_algorithm(plant, [POINT_THREE], epsilon=0.005, delta=0.5, points=3)
    assert set(report.methods) == set(report.designs) == {"riccati", "disturbance"}
    for name, method in report.methods.items():
        design = synthesize(plant, method)
        assert design.certificate.outcome is Outcome.PROVED
        # Rounding to seven digits.
        np.testing.assert_allclose(design.gain_at(), np.asarray(report.designs[name].gain({})), rtol=1e-6)


def test_default_epsilon_is_a_tenth_of_the_bracket() -> None:
    report = lipschitz_algorithm(pendulum(), [POINT_THREE], points=3)
    assert set(report.methods) == {"riccati"}
    assert report.methods["riccati"].epsilon == pytest.approx(report.bracket.feasible / 10)


def test_refusals() -> None:
    with pytest.raises(Infeasible, match=r"None of the 1 coordinates .* `StructuredLipschitz`"):
        lipschitz_algorithm(pendulum(50.0), points=3)
    with pytest.raises(BadInput, match=r"`epsilon` is 50.* proved feasible"):
        lipschitz_algorithm(pendulum(), [POINT_THREE], epsilon=50.0, points=3)
    with pytest.raises(BadInput, match="0 transforms"):
        lipschitz_algorithm(pendulum(), [])
    with pytest.raises(NotAccepted, match="no nonlinearity"):
        lipschitz_algorithm(System.linear([[0.0]], C=[[1.0]]))
