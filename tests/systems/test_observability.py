"""Which motions no sensor shows, against textbook cases and the textbook formula."""

from typing import Any

import control
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from luenberger.algebra import Polynomial
from luenberger.core import BadInput
from luenberger.systems import Nonlinearity, Parameter, System
from luenberger.systems.observability import detectability, observability, observability_matrix, require_detectable

SLIPS = ["front_slip", "rear_slip", "yaw_rate"]


def single_track(**options: Any) -> System:
    """Both slips decay alike and only their difference is measured, so their sum stays hidden."""
    A = [[-3.63, 0.0, 1.0], [0.0, -3.63, 1.0], [0.0, 0.0, -1.0]]
    return System.linear(A, C=[[1.0, -1.0, 0.0], [0.0, 0.0, 1.0]], states=SLIPS, name="single track", **options)


def speed_scheduled() -> System:
    """The coupling of the second state into the measured one vanishes at standstill."""
    A = Polynomial.affine([[-1.0, 0.0], [0.0, -2.0]], vx=[[0.0, 1.0], [0.0, 0.0]])
    return System.lpv(A, C=[[1.0, 0.0]], parameters=[Parameter("vx", 0.0, 30.0, "m/s")], states=["slip", "bias"])


def test_the_hidden_mode_is_named_in_state_names() -> None:
    report = observability(single_track())
    assert not report
    assert report.rank == 2
    assert [m.text for m in report.modes] == ["-3.63 1/s (0.71*front_slip + 0.71*rear_slip)"]
    assert "`single track` is not observable: 2 of 3 states are shown" in str(report)
    assert "relative tolerance 1e-09" in str(report)
    assert "No output shows the mode -3.63 1/s" in str(report)


def test_an_observable_plant_tells_its_weakest_eigenvalue() -> None:
    report = observability(System.linear([[0.0, 1.0], [-6.0, -5.0]], C=[[1.0, 0.0]]))
    assert report
    assert report.modes == ()
    assert report.rank == 2
    assert "The PBH test is weakest at the eigenvalue" in report.sentences[1]


def test_a_hidden_oscillation_is_one_mode_in_a_plane() -> None:
    A = np.array([[0.0, 2.0, 0.0], [-2.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    report = observability(System.linear(A, C=[[0.0, 0.0, 1.0]]))
    assert [m.text for m in report.modes] == ["0 +/- 2j 1/s (plane of 0.71*x1 and 0.71*x2)"]
    assert report.rank == 1


def test_a_double_integrator_with_the_wrong_sensor() -> None:
    A = [[0.0, 1.0], [0.0, 0.0]]
    assert observability(System.linear(A, C=[[1.0, 0.0]]))
    blind = observability(System.linear(A, C=[[0.0, 1.0]]))
    assert [m.text for m in blind.modes] == ["0 1/s (x1)"]


def test_singular_values_that_lose_digits_are_mentioned() -> None:
    A = np.diag([-1e4, -5e3, -4.0, -3.0, -2.0, -1.0])
    report = observability(System.linear(A, C=np.ones((1, 6))))
    assert report
    assert "the subspace recursion decides" in report.sentences[0]


@given(st.integers(0, 10**6), st.integers(1, 5), st.integers(1, 3))
def test_rank_is_that_of_the_observability_matrix(seed: int, nx: int, ny: int) -> None:
    # Small integers: the textbook rank is exact enough to judge, and often deficient.
    generator = np.random.default_rng(seed)
    A, C = (generator.integers(-1, 2, size=s).astype(float) for s in ((nx, nx), (ny, nx)))
    assert observability(System.linear(A, C=C)).rank == np.linalg.matrix_rank(control.obsv(A, C))


def test_the_matrix_is_the_textbook_one() -> None:
    generator = np.random.default_rng(1)
    A, C = generator.normal(size=(4, 4)), generator.normal(size=(2, 4))
    np.testing.assert_allclose(observability_matrix(A, C), control.obsv(A, C), rtol=1e-12)


def test_a_scheduled_plant_is_looked_at_where_asked() -> None:
    assert observability(speed_scheduled(), [10.0])
    report = observability(speed_scheduled(), [0.0])
    assert [m.text for m in report.modes] == ["-2 1/s (bias) at vx = 0"]
    with pytest.raises(BadInput, match=r"`r` has 0 entries but `plant` is scheduled by \['vx'\]"):
        observability(speed_scheduled())


def test_detectability_looks_at_the_whole_box() -> None:
    report = detectability(speed_scheduled())
    assert report
    assert report.rank == 1
    assert "at all 3 vertices and middle points of its box" in str(report)
    too_fast = detectability(speed_scheduled(), 2.5)
    assert not too_fast
    assert too_fast.modes[0].where == {"vx": 0.0}


@pytest.mark.parametrize(("decay_rate", "holds"), [(0.0, True), (3.6, True), (3.63, False), (5.0, False)])
def test_detectability_compares_the_hidden_mode_with_the_rate(decay_rate: float, holds: bool) -> None:
    assert bool(detectability(single_track(), decay_rate)) is holds


def test_a_plant_without_hidden_modes_sets_no_limit() -> None:
    report = detectability(System.linear([[5.0]]), 1e6)
    assert report
    assert "sets no limit" in str(report)


@pytest.mark.parametrize(("eigenvalue", "holds"), [(0.5, True), (0.99, True), (1.0, False), (-1.1, False)])
def test_discrete_modes_are_compared_with_the_unit_circle(eigenvalue: float, holds: bool) -> None:
    plant = System.linear(np.diag([0.3, eigenvalue]), C=[[1.0, 0.0]], dt=0.1)
    assert bool(detectability(plant)) is holds


def test_a_discrete_rate_is_a_circle_inside() -> None:
    # 0.9 a step of 0.1 s is a decay of 1.0536 1/s.
    plant = System.linear(np.diag([0.3, 0.9]), C=[[1.0, 0.0]], dt=0.1)
    assert detectability(plant, 1.05)
    with pytest.raises(BadInput, match=r"0\.9 a step \(x2\), a decay of 1\.05 1/s; decay_rate = 1\.06 1/s"):
        require_detectable(plant, 1.06)


def test_a_rate_no_gain_can_meet_is_refused_with_the_largest() -> None:
    message = (
        r"The pair \(A, C\) has an unobservable mode at -3\.63 1/s \(0\.71\*front_slip \+ 0\.71\*rear_slip\); "
        r"decay_rate = 5\.0 1/s cannot be met by any gain; ask for less than 3\.63 1/s or add a sensor\."
    )
    with pytest.raises(BadInput, match=message):
        require_detectable(single_track(), 5.0)
    require_detectable(single_track(), 3.62)


def test_a_hidden_integrator_is_refused_for_any_rate() -> None:
    plant = System.linear([[0.0, 0.0], [0.0, -1.0]], C=[[0.0, 1.0]], states=["bias", "rate"])
    with pytest.raises(BadInput, match=r"0 1/s \(bias\), which does not die out; no gain"):
        require_detectable(plant)


@pytest.mark.parametrize("decay_rate", [-1.0, np.nan, np.inf])
def test_an_indefinite_rate_is_refused(decay_rate: float) -> None:
    with pytest.raises(BadInput, match="an indefinite request"):
        require_detectable(single_track(), decay_rate)
    with pytest.raises(BadInput, match="an indefinite request"):
        detectability(single_track(), decay_rate)


def sector(lower: float, upper: float) -> System:
    f = Nonlinearity.bounded(lambda z, u: jnp.sin(z), [[0.0, 1.0]], jacobian=([[lower]], [[upper]]))
    return System.nonlinear([[-1.0, 1.0], [0.0, -2.0]], C=[[1.0, 0.0]], F=[[1.0], [0.0]], nonlinearity=f)


def test_a_nonlinear_plant_asks_to_be_looked_at_linearly() -> None:
    with pytest.raises(BadInput, match="pass `linear_part=True`"):
        observability(sector(-1.0, 1.0))
    assert observability(sector(-1.0, 1.0), linear_part=True)


def test_the_jacobian_box_counts_in_detectability() -> None:
    # df/dz = -1 cancels the coupling, and the second state with its -2 1/s is then hidden.
    assert detectability(sector(-1.0, 1.0), 1.9)
    assert not detectability(sector(-1.0, 1.0), 2.1)
    assert detectability(sector(-1.0, 1.0), 2.1, linear_part=True)
    assert detectability(sector(-0.5, 1.0), 2.1)


def test_a_lipschitz_bound_allows_no_nonlinearity_at_all() -> None:
    f = Nonlinearity.bounded(lambda z, u: jnp.sin(z), [[0.0, 1.0]], lipschitz=1.0)
    plant = System.nonlinear(np.diag([-1.0, -2.0]), C=[[1.0, 0.0]], F=[[1.0], [0.0]], nonlinearity=f)
    with pytest.raises(BadInput, match="ask for less than 2 1/s"):
        require_detectable(plant, 3.0)
