"""Bisection for the largest scale: on a plant whose limit is known by hand, and where there is nothing to look for."""

import jax.numpy as jnp
import numpy as np
import pytest

from luenberger.admissible import largest_admissible
from luenberger.core import BadInput, NotAccepted, Outcome
from luenberger.methods import PolytopicLuenberger, StructuredLipschitz
from luenberger.systems import Nonlinearity, System


def pendulum(scale: float) -> System:
    """e2' = -2 e2 + J e2 beside a measured first state: J < 2 is what any observer needs."""
    f = Nonlinearity.bounded(lambda z, u: 0.5 * scale * jnp.sin(z), [[0.0, 1.0]], jacobian=([[0.0]], [[scale]]))
    return System.nonlinear([[0.0, 0.0], [0.0, -2.0]], C=[[1.0, 0.0]], F=[[0.0], [1.0]], nonlinearity=f)


def test_limit_known_by_hand_is_met_from_below() -> None:
    found = largest_admissible(pendulum, PolytopicLuenberger(), 0.5, 5.0, 1e-3)
    assert found.refused is not None
    assert found.proved < 2.0
    assert found.refused - found.proved <= 1e-3
    # A slope within 1e-3 of the limit leaves a decay of 1e-3, which solver and proof still see.
    assert found.refused >= 1.999
    assert found.design.certificate.outcome is Outcome.PROVED
    assert np.asarray(found.design.system.nonlinearity.jacobian_upper)[0, 0] == found.proved
    assert "unobservable mode" in found.reason


def test_largest_scale_of_all_is_proved_in_one_step() -> None:
    found = largest_admissible(pendulum, PolytopicLuenberger(), 0.5, 1.0)
    assert (found.proved, found.refused, found.reason) == (1.0, None, "")


def test_smallest_scale_refused_is_told_as_it_is() -> None:
    with pytest.raises(BadInput, match="unobservable mode"):
        largest_admissible(pendulum, PolytopicLuenberger(), 2.5, 5.0)
    with pytest.raises(NotAccepted, match="no nonlinearity"):
        largest_admissible(lambda scale: System.linear([[-scale]], C=[[1.0]]), StructuredLipschitz(), 1.0, 2.0)


@pytest.mark.parametrize(("low", "high", "tolerance"), [(1.0, 1.0, 1e-3), (0.5, np.inf, 1e-3), (0.5, 1.0, 0.0)])
def test_empty_intervals_are_refused(low: float, high: float, tolerance: float) -> None:
    with pytest.raises(BadInput, match="needed"):
        largest_admissible(pendulum, PolytopicLuenberger(), low, high, tolerance)
