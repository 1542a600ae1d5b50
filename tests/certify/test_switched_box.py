"""Containment claims: what is taken for rounding, and boxes that errors never leave, against sums worked out by hand."""

from typing import Any

import numpy as np
import pytest

from luenberger.algebra import Polynomial
from luenberger.certify import SwitchedClaim
from luenberger.certify.switched import prove_switched
from luenberger.core import Outcome
from luenberger.systems import Parameter, Switched, System
from switched_plants import COUPLING, NOISE, H, K, constant, plant

# Rounding of a few operations; any wrong term is far larger.
HAIR = 1e-9
# e1 = a e1 + b v, e2 = -v+: the smallest box for a = 0.6.
BOX = np.array([COUPLING * NOISE / 0.4, NOISE])


def uncertain(lower: float = 0.5, upper: float = 0.7, **options: Any) -> Switched:
    """A in [lower, upper], which nobody knows."""
    A = Polynomial.affine(np.array([[0.0, COUPLING], [0.0, 0.0]]), a=np.array([[1.0, 0.0], [0.0, 0.0]]))
    return Switched.of(
        System.lpv(
            A,
            C=[[0.0, 1.0]],
            E=[[0.0], [1.0]],
            dt=0.1,
            noise_bound=[NOISE],
            parameters=[Parameter("a", lower, upper, measured=False)],
            **options,
        )
    )


def proved(
    system: Switched, vector: Any = None, gain: Any = K, decoupling: Any = H, level: float = 1e-15, **options: Any
):
    n = len(system.modes)
    box = None if vector is None else np.asarray(vector, dtype=float)
    claim = SwitchedClaim("containment", level, vector=box, **options)
    return prove_switched(system, constant([gain] * n), constant([decoupling] * n), claim)


def test_a_decoupling_that_leaks_is_no_rounding_whatever_the_level() -> None:
    assert proved(plant(0.6)).outcome is Outcome.PROVED
    # A level of one would let anything pass; a free unknown input has no size.
    for level in (1e-15, 1.0):
        found = proved(plant(0.6), decoupling=1.01 * H, level=level)
        assert found.outcome is Outcome.REFUTED
        assert found.point["P E"] == pytest.approx(0.01, rel=1e-9)
    # With a bound the observer widens its set by what leaks, and the level says how much that is.
    bounded = plant(0.6, disturbance_bound=[2.0])
    assert proved(bounded, decoupling=1.01 * H, level=0.011).outcome is Outcome.PROVED
    assert proved(bounded, decoupling=1.01 * H, level=0.009).outcome is Outcome.REFUTED


def test_the_smallest_box_divides_what_is_proved_from_what_is_refuted() -> None:
    assert proved(plant(0.6), BOX * (1 + HAIR)).outcome is Outcome.PROVED
    for k in range(2):
        found = proved(plant(0.6), BOX * (1 + HAIR - 1e-6 * np.eye(2)[k]))
        assert found.outcome is Outcome.REFUTED
        assert found.point["room"] < 0
        assert "faces of the box" in found.reason
    # The slower mode decides.
    assert proved(plant(0.3, 0.6), BOX * (1 + HAIR)).outcome is Outcome.PROVED
    assert proved(plant(0.3, 0.61), BOX * (1 + HAIR)).point["mode"] == 1.0
    for bad in ([1.0], [-1.0, 1.0], [1.0, 1.0, 1.0]):
        assert proved(plant(0.6), bad).outcome is Outcome.REFUTED


def test_a_negative_box_holds_nothing() -> None:
    # 1.2 w + 0.02 <= w holds for w = -1, of a plant that diverges.
    assert proved(plant(1.2), [-1.0, NOISE * (1 + HAIR)]).outcome is Outcome.REFUTED


def test_the_box_holds_over_the_whole_scheduling() -> None:
    A = Polynomial.affine(np.array([[0.0, COUPLING], [0.0, 0.0]]), a=np.array([[1.0, 0.0], [0.0, 0.0]]))
    options = {"C": [[0.0, 1.0]], "E": [[0.0], [1.0]], "dt": 0.1, "noise_bound": [NOISE]}
    for upper, outcome in ((0.6, Outcome.PROVED), (0.61, Outcome.REFUTED)):
        scheduled = System.lpv(A, parameters=[Parameter("a", -0.2, upper)], **options)
        assert proved(Switched.of(scheduled), BOX * (1 + HAIR)).outcome is outcome


def test_a_leak_with_a_bound_is_in_the_box() -> None:
    # P E = [0, -0.01]': two hundredths more on the second state.
    bounded = plant(0.6, disturbance_bound=[2.0])
    wide = np.array([BOX[0] * 1.1, 1.01 * NOISE + 0.02])
    for room, outcome in ((HAIR, Outcome.PROVED), (-1e-6, Outcome.REFUTED)):
        assert proved(bounded, wide * (1 + room), decoupling=1.01 * H, level=0.011).outcome is outcome


def test_uncertain_factors_need_a_bound_of_the_state() -> None:
    missing = proved(uncertain(), [1.0, 1.0])
    assert missing.outcome is Outcome.UNDECIDED
    # e1 = 0.6 e1 + 0.1 s x1 + b v with |x1| <= 3.
    w1 = (0.1 * 3.0 + COUPLING * NOISE) / 0.4
    box, bound = np.array([w1, NOISE]), np.array([3.0, 9.0])
    assert proved(uncertain(), box * (1 + HAIR), state_bound=bound).outcome is Outcome.PROVED
    assert proved(uncertain(), box * (1 - 1e-6), state_bound=bound).outcome is Outcome.REFUTED
    assert proved(uncertain(upper=0.71), box * (1 + HAIR), state_bound=bound).outcome is Outcome.REFUTED
    # Bounds of the states alone are not those of states and inputs where there are inputs.
    assert proved(uncertain(B=[[0.0], [0.0]]), box, state_bound=bound).outcome is Outcome.UNDECIDED


def test_the_box_holds_the_errors_of_the_worst_run() -> None:
    rng = np.random.default_rng(0)
    e, v, largest = np.zeros(2), 0.0, np.zeros(2)
    for k in range(400):
        # The sign of the last error drives the first one furthest.
        later = NOISE * (np.sign(e[0]) or 1.0) if k % 2 else NOISE * rng.choice([-1.0, 1.0])
        e, v = np.array([0.6 * e[0] - COUPLING * v, -later]), later
        largest = np.maximum(largest, np.abs(e))
    assert (largest <= BOX * (1 + HAIR)).all()
    assert largest[1] == pytest.approx(BOX[1])


def test_noise_without_a_bound_proves_nothing() -> None:
    found = proved(
        Switched.of(System.linear([[0.6, COUPLING], [0.0, 0.0]], C=[[0.0, 1.0]], E=[[0.0], [1.0]], G=[[1.0]], dt=0.1))
    )
    assert found.outcome is Outcome.REFUTED
    assert "is missing" in found.reason
