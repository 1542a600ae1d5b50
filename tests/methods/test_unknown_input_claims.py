"""The claims made for given gains: each level against plain arithmetic, and what happens to gains that show nothing."""

from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from luenberger.algebra import Polynomial
from luenberger.core import NotCertified
from luenberger.lmi import Bernstein
from luenberger.methods.unknown_input_claims import shown_supply, unknown_input_claims
from luenberger.methods.unknown_input_inequality import Form
from luenberger.methods.unknown_input_plant import OpenMode
from luenberger.systems import Parameter, Switched, System

COMMON = Form("common", "lumped", 4.0, False, False, Bernstein())
TURN = np.array([[0.6, -0.4], [0.4, 0.6]])


def plant(*A: np.ndarray, dwell: int = 1) -> Switched:
    """Modes without unknown inputs and with the first state measured, so that H = 0 and K = 0 leave N = A."""
    modes = [System.linear(a, C=[[1.0, 0.0]], dt=1.0, noise_bound=[0.1]) for a in A]
    return Switched.of(modes, dwell=dwell)


def claims_of(system: Switched, form: Form, fade: float, gain: float = 0.0) -> dict[str, Any]:
    modes = [OpenMode.of(mode) for mode in system.modes]
    K = [Polynomial.constant(np.array([[gain], [0.0]])) for _ in modes]
    H = [Polynomial.constant(np.zeros((2, 1))) for _ in modes]
    return {c.kind: c for c in unknown_input_claims(system, modes, K, H, form, fade)}


def test_the_shown_supply_is_the_smallest_that_holds() -> None:
    # Against the block matrix [(1 - fade) Q - N'QN, -N'QB; *, s - B'QB] at s a little above and below.
    rng = np.random.default_rng(2)
    N, B = 0.25 * rng.standard_normal((2, 2)), rng.standard_normal((2, 3))
    before, after = np.diag([2.0, 1.0]), np.array([[1.5, 0.3], [0.3, 1.0]])
    s = shown_supply((Polynomial.constant(N), Polynomial.constant(B), {}), before, after, 0.2)

    def least(supply: float) -> float:
        cross = -N.T @ after @ B
        whole = np.block([[0.8 * before - N.T @ after @ N, cross], [cross.T, supply * np.eye(3) - B.T @ after @ B]])
        return float(np.linalg.eigvalsh(whole)[0])

    assert least(s * (1 + 1e-6)) > 0 > least(s * (1 - 1e-6))


def test_storages_that_do_not_fall_show_nothing() -> None:
    loop = (Polynomial.constant(1.1 * np.eye(2)), Polynomial.constant(np.eye(2)), {})
    assert shown_supply(loop, np.eye(2), np.eye(2), 0.1) == np.inf


def test_a_scheduled_loop_shows_what_its_worst_corner_needs() -> None:
    slope = Polynomial(("p",), {(0,): 0.3 * np.eye(2), (1,): 0.4 * np.eye(2)})
    loop = (slope, Polynomial.constant(np.eye(2)), {"p": (0.0, 1.0)})
    # N = 0.7 I at p = 1: (1 - fade) / (1 - fade - 0.49).
    assert shown_supply(loop, np.eye(2), np.eye(2), 0.2) == pytest.approx(0.8 / (0.8 - 0.49), rel=1e-12)


def test_the_level_is_that_of_a_loop_that_turns_and_shrinks() -> None:
    # |N e| = sqrt(0.52) |e| in every direction: Q = I is best, supply (1 - fade) / (1 - fade - 0.52).
    claim = claims_of(plant(TURN), COMMON, 0.2)["iss"]
    assert claim.supply == pytest.approx(0.8 / 0.28, rel=1e-5)
    assert claim.level == pytest.approx(np.sqrt(0.8 / 0.28 / 0.2), rel=1e-5)
    assert np.linalg.eigvalsh(claim.storages[0])[0] == pytest.approx(1.0, abs=1e-5)
    assert claim.inputs == "lumped"


def test_channels_are_named_and_counted_in_their_bounds() -> None:
    form = replace(COMMON, attenuate="physical")
    one = claims_of(plant(TURN), form, 0.2, gain=0.1)["iss"]
    other = claims_of(plant(TURN), replace(form, unit=0.01), 0.2, gain=0.1)["iss"]
    assert one.inputs == "noise+next noise"
    # The unit is the solver's affair alone. K v with |v| <= 0.1 and K = 0.1: a hundredth of the lump's bound and more.
    assert other.level == pytest.approx(one.level, rel=1e-3)
    lump = claims_of(plant(TURN), COMMON, 0.2, gain=0.1)["iss"].level
    assert one.level <= 0.01 * lump


def test_each_mode_may_have_its_storage() -> None:
    # Flat and steep by turns: no common Q shrinks both by this fade, storages with a dwell time do.
    long = np.array([[0.5, 1.2], [0.0, 0.5]])
    system = plant(long, long.T, dwell=12)
    with pytest.raises(NotCertified, match=r"does not provably fade by 0\.3"):
        claims_of(system, COMMON, 0.3)
    claim = claims_of(system, replace(COMMON, storage="dwell", growth=30.0), 0.3)["iss"]
    assert len(claim.storages) == 2
    assert 1 < claim.growth <= 30 * (1 + 1e-6)
    alpha = min(np.linalg.eigvalsh(q)[0] for q in claim.storages)
    s = 0.7**12
    factor = claim.growth * (1 - s) / (1 - claim.growth * s)
    assert claim.level == pytest.approx(np.sqrt(claim.supply / (alpha * 0.3) * factor), rel=1e-6)


def test_with_modes_of_their_own_every_transition_is_shown() -> None:
    system = plant(TURN, 0.8 * TURN.T)
    claim = claims_of(system, replace(COMMON, storage="mode"), 0.2)["iss"]
    assert claim.growth == 1.0
    for i, N in enumerate((TURN, 0.8 * TURN.T)):
        loop = (Polynomial.constant(N), Polynomial.constant(np.eye(2)), {})
        for j in range(2):
            assert shown_supply(loop, claim.storages[i], claim.storages[j], 0.2) < claim.supply


def test_the_box_of_errors_is_kept_by_noise_at_its_worst() -> None:
    claim = claims_of(plant(0.5 * TURN), COMMON, 0.2, gain=0.1)["containment"]
    loop = 0.5 * TURN - np.array([[0.1, 0.0], [0.0, 0.0]])
    box = np.linalg.solve(np.eye(2) - np.abs(loop), [0.01, 0.0])
    np.testing.assert_allclose(claim.vector, box, rtol=1e-4)
    assert (np.abs(loop) @ claim.vector + [0.01, 0.0] < claim.vector).all()


def test_a_loop_whose_signs_matter_keeps_no_box() -> None:
    # Eigenvalues inside the circle, |N| outside: the sets contain the state all the same, but no box of errors is claimed.
    swing = np.array([[0.7, -0.6], [0.6, 0.7]])
    claim = claims_of(plant(swing), COMMON, 0.1)["containment"]
    assert claim.vector is None


def test_uncertain_factors_take_the_box_away() -> None:
    unsure = Polynomial(("a",), {(0,): TURN * 0.5, (1,): np.diag([0.1, 0.0])})
    system = System.build(
        unsure, C=[[1.0, 0.0]], dt=1.0, noise_bound=[0.1], parameters=[Parameter("a", -1.0, 1.0, measured=False)]
    )
    assert claims_of(Switched.of(system), COMMON, 0.2)["containment"].vector is None


def test_gains_that_no_storage_fits_are_refused() -> None:
    with pytest.raises(NotCertified, match="does not provably fade"):
        claims_of(plant(TURN), COMMON, 0.2, gain=5.0)


def test_the_leak_of_the_decoupling_is_its_rounding() -> None:
    rng = np.random.default_rng(4)
    system = System.linear(
        0.1 * rng.standard_normal((3, 3)), C=rng.standard_normal((2, 3)), E=rng.standard_normal((3, 1)), dt=1.0
    )
    mode = OpenMode.of(system)
    claims = unknown_input_claims(
        Switched.of(system), [mode], [Polynomial.constant(np.zeros((3, 2)))], [Polynomial.constant(mode.U)], COMMON, 0.1
    )
    assert [c.kind for c in claims] == ["decoupling", "gain_bound", "iss"]
    # The exact product of the very doubles.
    exact = [[[Fraction(float(x)) for x in row] for row in m] for m in (mode.U, mode.C, mode.E)]
    CE = [sum(c * e[0] for c, e in zip(row, exact[2], strict=True)) for row in exact[1]]
    PE = [e[0] + sum(h * ce for h, ce in zip(row, CE, strict=True)) for e, row in zip(exact[2], exact[0], strict=True)]
    assert 0 < max(map(abs, PE)) <= claims[0].level < 1e-12
