"""Claims over a hull of Jacobians, and claims about an observer that also corrects the argument of f."""

import numpy as np
import pytest

from luenberger.algebra import Polynomial
from luenberger.certify import Claim
from luenberger.certify.certificate import prove
from luenberger.core import BadInput, Outcome
from luenberger.systems import Nonlinearity, System

ZERO = Polynomial.constant(np.zeros((2, 1)))


def plant(**bound: object) -> System:
    """x1' = -x1 + f, x2' = -x2, f of both states."""
    f = Nonlinearity.bounded(lambda z, u: z[:1], np.eye(2), **bound)  # type: ignore[arg-type]
    return System.nonlinear(-np.eye(2), C=[[1.0, 0.0]], F=[[1.0], [0.0]], nonlinearity=f)


# With P = I the loop is stable where (g1 - 1) < 0 and 4 (1 - g1) > g2^2.
def test_a_hull_proves_what_its_box_refutes() -> None:
    hull = np.array([[[0.9, 0.0]], [[-3.0, 2.0]], [[-3.0, -2.0]]])
    claim = Claim("decay", 0.0, np.eye(2))
    proof = prove(plant(hull=hull), ZERO, claim)
    assert proof.outcome is Outcome.PROVED
    assert proof.pieces == 3
    boxed = plant(jacobian=(hull.min(axis=0), hull.max(axis=0)))
    assert prove(boxed, ZERO, claim).outcome is Outcome.REFUTED


def test_one_bad_vertex_of_a_hull_refutes() -> None:
    hull = np.array([[[0.5, 0.0]], [[0.0, 2.1]]])
    assert prove(plant(hull=hull), ZERO, Claim("decay", 0.0, np.eye(2))).outcome is Outcome.REFUTED


# e1' = (-1 + g1 (1 - l)) e1 + g2 e2: an argument gain l = 1 takes g1 out whatever it is.
def test_an_argument_gain_takes_a_measured_argument_out() -> None:
    wild = plant(jacobian=([[-50.0, 0.0]], [[50.0, 0.0]]))
    one = Polynomial.constant([[1.0], [0.0]])
    claim = Claim("decay", 0.99, np.eye(2))
    assert prove(wild, ZERO, claim).outcome is Outcome.REFUTED
    assert prove(wild, ZERO, claim, argument_gain=one).outcome is Outcome.PROVED
    assert prove(wild, ZERO, claim, argument_gain=one * 1.05).outcome is Outcome.REFUTED


def test_the_argument_gain_has_a_bound_of_its_own() -> None:
    second = Polynomial.constant([[3.0], [4.0]])
    given = plant(lipschitz=0.5)
    for level, outcome in ((5.0 + 1e-9, Outcome.PROVED), (5.0 - 1e-9, Outcome.REFUTED)):
        assert prove(given, ZERO, Claim("argument_gain_bound", level), argument_gain=second).outcome is outcome
    # Without an argument gain there is nothing that could exceed a positive bound.
    assert prove(given, second, Claim("argument_gain_bound", 1.0)).outcome is Outcome.PROVED


def test_a_domain_claim_needs_its_distances() -> None:
    with pytest.raises(BadInput, match="distances from the faces"):
        Claim("domain", 1.0, np.eye(2))
    text = Claim("domain", 4.0, np.eye(2), state_bound=np.array([1.0, 2.0])).sentence(False)
    assert "semi-axes 2 to 2" in text
