"""Proofs about the lumped inequality in rational arithmetic."""

from fractions import Fraction

import numpy as np

from lipschitz_plants import POINT_THREE, integrator, pendulum
from luenberger.algebra.definiteness import exact
from luenberger.methods.hamiltonian import positive_solution
from luenberger.methods.lipschitz_inequality import LumpedInequality, exact_inverse


def test_integrator_in_closed_form() -> None:
    # p^2 + a - 4 < 0 holds at p = 1 for a < 3 and for no a >= 4.
    found = LumpedInequality.of(integrator(), None, None, 0.25)
    one = np.eye(1)
    assert found.tolerates(one, Fraction(3) - Fraction(1, 10**12))
    assert not found.tolerates(one, Fraction(3))
    assert not found.tolerates(-one, Fraction(-9))
    # X = 1, Y = eta > 0, V > eta^2: the bound is 4 + V.
    eta = 2.0**-20
    bound = found.refuted_above(one, eta * one, 2 * eta**2 * one)
    assert bound == 4 + 2 * Fraction(eta) ** 2
    assert found.refuted_above(one, -eta * one, one) is None
    assert found.refuted_above(one, eta * one, 0 * one) is None


def test_frequency_bound_of_a_loop() -> None:
    # |j w + 3|^2 at the frequency where the Hamiltonian of level 9.01 crosses the axis, w = 0.1; never below 9.
    found = LumpedInequality.of(integrator(), None, [[3.0]])
    bound = found.refuted_by_frequency(9.01)
    assert bound is not None
    assert 9 <= bound < Fraction(9011, 1000)
    assert found.refuted_by_frequency(8.9) is None


def test_proposed_dual_is_tight() -> None:
    found = LumpedInequality.of(pendulum(), POINT_THREE, None, 0.1)
    level = 0.2
    P = positive_solution(found.A, np.eye(2), level * np.eye(2) - found.K)
    assert P is not None
    bound = found.refuted_above(*found.proposed_dual(P))
    assert bound is not None
    assert level < float(bound)


def test_coordinates_are_inverted_exactly() -> None:
    # 0.3 as a double has no exact double inverse; the rational one has.
    T = exact(np.diag([1.0, 0.3]))
    assert (T @ exact_inverse(T) == exact(np.eye(2))).all()
    found = LumpedInequality.of(pendulum(), POINT_THREE, None, 0.1)
    assert found.exact_A[0, 1] * exact(np.array([[0.3]]))[0, 0] == 1
