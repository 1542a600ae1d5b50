"""The printed design: what it accepts, what it gives there, and why it has to refuse the rest."""

from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from luenberger.algebra import Polynomial
from luenberger.certify import Claim, certify_claims
from luenberger.core import BadInput, Infeasible, NotAccepted, Outcome
from luenberger.design import Design
from luenberger.lmi import decay_storage, solve
from luenberger.methods.printed_two_dof import PrintedTwoDof, sector_lemma_violation, sector_product
from luenberger.methods.two_dof import TwoDofLuenberger
from luenberger.synthesize import synthesize
from luenberger.systems import System
from two_dof_plants import oscillator, slipping_car


def designed(system: System, **options: Any) -> Design:
    return synthesize(system, PrintedTwoDof(**options))


@pytest.mark.parametrize(
    ("reach", "gain", "flipped"), [(1.0, 5.274, 3.140), (2.7, 22.974, 7.584), (5.0, 66.192, 14.395)]
)
def test_what_the_print_gives_where_it_does_not_hold(reach: float, gain: float, flipped: float) -> None:
    # The same plant with the sign of the position turned: a sound condition gives the same smallest gain.
    method = PrintedTwoDof(argument_gain_limit=0.0)
    for sign, wanted in ((1.0, gain), (-1.0, flipped)):
        plant = oscillator(reach, sign)
        posed = method.posed(plant)
        found = solve(posed.problem)
        assert found is not None
        # Stated with three decimals.
        assert np.sqrt(found.objective) == pytest.approx(wanted, abs=6e-4)
        if sign < 0:
            # Not even some other storage shows decay for the flipped gain: a corner of the Jacobian box is unstable.
            assert decay_storage(plant, posed.gains(found.values)[0], 0.0) is None


def test_van_der_pol_is_refused() -> None:
    with pytest.raises(NotAccepted) as refused:
        designed(oscillator(5.0))
    words = (
        "Row 1",
        "(1, 1)",
        "(1, 2)",
        "Theorem 7",
        "sector_lemma_violation",
        "TwoDofLuenberger",
        "ExtendedLuenberger",
    )
    for word in words:
        assert word in str(refused.value)
    with pytest.raises(NotAccepted, match="Theorem 8"):
        designed(oscillator(5.0), goal="l2")


@pytest.mark.parametrize("share", [0.3, 0.69])
def test_slip_angles(share: float) -> None:
    for goal in ("feasible", "l2"):
        assert designed(slipping_car(share), goal=goal).certificate.outcome is Outcome.PROVED
    # One multiplier for both tyres instead of one each.
    printed, own = (
        synthesize(slipping_car(share), m).statistics["optimum"]
        for m in (PrintedTwoDof("l2"), TwoDofLuenberger(goal="l2", gain_limit=1e3))
    )
    assert own <= printed * (1 + 1e-6)
    assert printed < 1.03 * own


def test_slip_angles_beyond_its_reach() -> None:
    with pytest.raises(Infeasible):
        designed(slipping_car(0.7))


def test_limits_speak_of_what_the_print_calls_the_gains() -> None:
    plain = designed(slipping_car(0.5), goal="l2", gain_limit=5.0, argument_gain_limit=0.5)
    assert plain.argument_gain is not None
    level = plain.certificate.level("argument_gain_bound")
    assert level is not None
    assert level <= 0.5
    # |L1| <= 5 bounds L = L1 - F K1 L2 only together with the norm of F K1 L2.
    assert plain.certificate.level("gain_bound") <= 5.0 + 0.5 * _largest_shift(0.5)
    # Printed, epsilon bounds the squared norm: 0.25 says 0.5, 0.09 says 0.3.
    squared = designed(slipping_car(0.5), goal="l2", argument_gain_limit=0.09, epsilon="printed", multiplier_floor=1e-2)
    assert squared.certificate.level("argument_gain_bound") <= 0.3


def _largest_shift(share: float) -> float:
    plant = slipping_car(share)
    shift = plant.polynomial("F") @ plant.nonlinearity.jacobian_lower
    return max(float(np.linalg.norm(c, 2)) for c in shift.bernstein(plant.scheduling_box).values())


def test_refusals() -> None:
    for name in ("storage_floor", "multiplier_floor"):
        with pytest.raises(BadInput, match=name):
            designed(slipping_car(0.5), **{name: 0.0})
    with pytest.raises(NotAccepted, match="no input `disturbance`"):
        designed(slipping_car(0.5).replace(E=np.zeros((2, 0))), goal="l2")


def test_lemma_of_the_sector_fails_on_van_der_pol() -> None:
    K1, K2 = [[-50, -24]], [[50, 1]]
    e = [Fraction(1, 10), Fraction(-3, 10)]
    assert sector_product(K1, K2, e, [(1 - e[0] ** 2) * e[1]]) == Fraction(12477509, 10**6)
    found = sector_lemma_violation(K1, K2)
    assert found is not None
    assert found.product == sector_product(K1, K2, found.error, found.difference) == 1
    assert found.row == 0


@pytest.mark.parametrize("seed", range(5))
def test_counterexamples_lie_inside_the_bounds(seed: int) -> None:
    generator = np.random.default_rng(seed)
    K1 = generator.normal(size=(2, 3))
    K2 = K1 + generator.uniform(0, 2, (2, 3)) * (generator.random((2, 3)) < 0.7)
    found = sector_lemma_violation(K1, K2)
    if found is None:
        assert ((K2 > K1).sum(axis=1) < 2).all()
        return
    assert found.product > 0
    e = np.array([float(x) for x in found.error])
    # The least and the greatest of g e over the box of g, row by row.
    low, high = np.minimum(K1 * e, K2 * e).sum(axis=1), np.maximum(K1 * e, K2 * e).sum(axis=1)
    phi = np.array([float(x) for x in found.difference])
    assert np.all(low - 1e-12 <= phi)
    assert np.all(phi <= high + 1e-12)


def test_lemma_of_the_sector_holds_with_one_varying_entry_a_row() -> None:
    assert sector_lemma_violation([[-0.3, 0.0], [2.0, -0.2]], [[0.0, 0.0], [2.0, 0.1]]) is None
    with pytest.raises(BadInput, match="one shape"):
        sector_lemma_violation([[1.0]], [[1.0, 2.0]])
    with pytest.raises(BadInput, match="exceeds"):
        sector_lemma_violation([[1.0]], [[0.0]])


def test_a_feasible_gain_of_the_print_is_unstable() -> None:
    # With y = -x1 the gain is (-10, -30); (5.22) holds with multiplier one, that is 100^2 for f in units of its largest slope.
    plant = oscillator(5.0, -1.0)
    L, P = np.array([[-10.0], [-30.0]]), np.array([[125.66, 29.35], [29.35, 10.87]])
    posed = PrintedTwoDof(argument_gain_limit=0.0).posed(plant)
    for name, value in {"P": P, "Y": P @ L, "tau": 1e4, "squared": 1e4}.items():
        posed.problem.variables[name].save_value(np.asarray(value))
    block = next(b for b in posed.problem.blocks if b.name == "decay")
    assert np.linalg.eigvalsh(next(iter(block.matrix.terms.values())).value)[-1] < 0
    # At the origin the Jacobian is (0, 1) and the error matrix has determinant -39.
    J = np.array([[0.0, 1.0]])
    A, C, F = (np.asarray(plant.at(letter)) for letter in "ACF")
    assert np.linalg.det(A - L @ C + F @ J) == pytest.approx(-39.0)
    checked = certify_claims(plant, Polynomial.constant(L), [Claim("decay", 0.0, P)])
    assert checked.outcome is Outcome.REFUTED
