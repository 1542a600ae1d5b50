"""Claims of switched unknown-input observers against constants worked out by hand; every ingredient spoiled once."""

from typing import Any

import numpy as np
import pytest

from luenberger.algebra import Polynomial
from luenberger.certify import SwitchedClaim, certify_switched_claims
from luenberger.certify.switched import prove_switched
from luenberger.core import BadInput, NotAccepted, Outcome
from luenberger.systems import Parameter, Switched, System
from switched_plants import COUPLING, H, K, constant, mode, plant

# Room for one rounding in each of a handful of operations, far below any wrong constant.
HAIR = 1e-9
FADE = 0.3


def supply(a: float, before: float = 1.0, after: float = 1.0, fade: float = FADE) -> float:
    """Least s with after (a e + w)^2 <= (1 - fade) before e^2 + s w^2 for all e, w."""
    return after + (after * a) ** 2 / ((1 - fade) * before - after * a**2)


def stability(s: float, level: float, Q: tuple[float, ...] = (1.0,), **options: Any) -> SwitchedClaim:
    given = {"fade": FADE, "supply": s * (1 + HAIR), **options}
    return SwitchedClaim("iss", level * (1 + 2 * HAIR), tuple(q * np.eye(2) for q in Q), **given)


def proved(system: Switched, claim: SwitchedClaim, gain: Any = K, decoupling: Any = H) -> Any:
    n = len(system.modes)
    return prove_switched(system, constant([gain] * n), constant([decoupling] * n), claim)


def test_the_ultimate_bound_has_fade_under_the_root() -> None:
    s = supply(0.6)
    level = np.sqrt(s / FADE)
    assert proved(plant(0.6), stability(s, level)).outcome is Outcome.PROVED
    # One minus fade in its place, none at all, and a hair less than what is needed.
    for wrong in (np.sqrt(s / (1 - FADE)), np.sqrt(s), level * (1 - 1e-6)):
        found = proved(plant(0.6), stability(s, wrong))
        assert found.outcome is Outcome.REFUTED
        assert found.point["level needed"] == pytest.approx(level, rel=1e-6)
        assert "below what storages, fade and supply give" in found.reason


def test_the_bound_is_kept_and_nearly_met_by_the_worst_input() -> None:
    # e+ = 0.6 e + w ends in w / 0.4; the best fade for it is 0.4, where the bound is exactly that.
    s = supply(0.6, fade=0.4)
    claim = stability(s, np.sqrt(s / 0.4), fade=0.4)
    assert proved(plant(0.6), claim).outcome is Outcome.PROVED
    assert claim.level == pytest.approx(1 / 0.4, rel=1e-6)


def test_a_supply_or_a_fade_beyond_what_holds_is_refused() -> None:
    s = supply(0.6)
    large = 10 * np.sqrt(s / FADE)
    assert proved(plant(0.6), stability(s * (1 - 1e-6), large)).outcome is Outcome.REFUTED
    # V falls by 1 - 0.36 at most.
    assert proved(plant(0.6), stability(1e6, 1e4, fade=0.641)).outcome is Outcome.REFUTED
    assert proved(plant(0.6), stability(1e6, 1e4, fade=0.639)).outcome is Outcome.PROVED


def test_the_scale_of_the_storage_is_in_the_bound() -> None:
    # A thousandth of V needs a thousandth of the supply, and the same bound: attenuation alone means nothing.
    s = supply(0.6)
    assert proved(plant(0.6), stability(1e-3 * s, np.sqrt(s / FADE), (1e-3,))).outcome is Outcome.PROVED
    assert proved(plant(0.6), stability(1e-3 * s, np.sqrt(1e-3 * s / FADE), (1e-3,))).outcome is Outcome.REFUTED


@pytest.mark.parametrize(("order", "failing"), [("next", (0, 1)), ("last", (0, 1))])
def test_every_transition_counts(order: Any, failing: tuple[int, int]) -> None:
    # Mode 0 has storage 1, mode 1 has storage 4. The slowest transition is 0 -> 1: "next" with a of mode 0, "last" with that of mode 1.
    good, bad = ((0.3, 0.8), (0.5, 0.8)) if order == "next" else ((0.8, 0.3), (0.8, 0.5))
    Q = (1.0, 4.0)
    acting = {"next": lambda i, j: i, "last": lambda i, j: j}[order]
    steps = [(i, j) for i in (0, 1) for j in (0, 1)]
    s = max(supply(good[acting(i, j)], Q[i], Q[j]) for i, j in steps)
    claim = stability(s, np.sqrt(s / FADE), Q, order=order)
    assert proved(plant(*good), claim).outcome is Outcome.PROVED
    found = proved(plant(*bad), claim)
    assert found.outcome is Outcome.REFUTED
    assert (found.point["from"], found.point["to"]) == failing
    # A hair less supply is too little for the transition that needs most.
    assert (
        proved(plant(*good), stability(s * (1 - 1e-6), 2 * np.sqrt(s / FADE), Q, order=order)).outcome
        is Outcome.REFUTED
    )


def test_a_dwell_time_pays_for_storages_that_grow() -> None:
    Q, growth = (1.0, 4.0), 4.0 * (1 + HAIR)
    s = max(supply(0.5), supply(0.8, 4.0, 4.0))
    left = (1 - FADE) ** 4
    level = np.sqrt(growth * (1 - left) / (1 - growth * left) * s / FADE)
    # 1 / (1 - 4 * 0.7^4) magnifies each rounding by 25.
    claim = stability(s, level * (1 + 100 * HAIR), Q, growth=growth)
    assert proved(plant(0.5, 0.8, dwell=4), claim).outcome is Outcome.PROVED
    assert (
        proved(plant(0.5, 0.8, dwell=4), stability(s, level * (1 - 1e-6), Q, growth=growth)).outcome is Outcome.REFUTED
    )
    # Three samples: 4 * 0.7^3 = 1.37, the storage need not fall at all.
    short = proved(plant(0.5, 0.8, dwell=3), claim)
    assert (short.outcome, short.point) == (Outcome.REFUTED, {"dwell": 3.0})
    less = proved(plant(0.5, 0.8, dwell=4), stability(s, 1e3 * level, Q, growth=3.9))
    assert (less.outcome, less.point) == (Outcome.REFUTED, {"from": 0.0, "to": 1.0})
    assert "grows by more than 3.9" in less.reason
    # Without growth every transition has to hold by itself.
    assert proved(plant(0.5, 0.8, dwell=4), stability(s, 1e3 * level, Q)).outcome is Outcome.REFUTED


def test_what_reaches_the_error_has_to_be_named() -> None:
    s = 10.0
    both = stability(s, np.sqrt(s / FADE), inputs="noise+next noise")
    assert proved(plant(0.6), both).outcome is Outcome.PROVED
    for one in ("noise", "next noise"):
        found = proved(plant(0.6), stability(s, np.sqrt(s / FADE), inputs=one))
        assert found.outcome is Outcome.REFUTED
        assert ({"noise", "next noise"} - {one}) <= set(found.point)
    uncertain = System.lpv(
        Polynomial.affine(np.array([[0.6, COUPLING], [0.0, 0.0]]), q=np.array([[0.1, 0.0], [0.0, 0.0]])),
        C=[[0.0, 1.0]],
        E=[[0.0], [1.0]],
        dt=0.1,
        noise_bound=[0.1],
        parameters=[Parameter("q", -1.0, 1.0, measured=False)],
    )
    assert "uncertainty" in proved(Switched.of(uncertain), both).point
    named = stability(s, np.sqrt(s / FADE), inputs="uncertainty+noise+next noise")
    assert proved(Switched.of(uncertain), named).outcome is Outcome.PROVED
    # A decoupling that lets the unknown input in: lumped w holds it, noise alone does not.
    assert "disturbance" in proved(plant(0.6), both, decoupling=1.01 * H).point
    with pytest.raises(BadInput, match="reused noise"):
        stability(s, 10.0, inputs="reused noise")


def test_noise_is_counted_in_units_of_its_bound() -> None:
    # e1 sees b v, e2 sees -v+; ten times the bound needs a hundred times the supply.
    s = 1e-2 * max(supply(0.6) * COUPLING**2, 1.0)
    claim = stability(s, np.sqrt(s / FADE), inputs="noise+next noise")
    assert proved(plant(0.6), claim).outcome is Outcome.PROVED
    assert proved(plant(0.6, noise_bound=[1.0]), claim).outcome is Outcome.REFUTED


def test_a_scheduled_mode_is_proved_on_the_whole_box() -> None:
    slow = System.lpv(
        Polynomial.affine(np.array([[0.0, COUPLING], [0.0, 0.0]]), a=np.array([[1.0, 0.0], [0.0, 0.0]])),
        C=[[0.0, 1.0]],
        E=[[0.0], [1.0]],
        dt=0.1,
        parameters=[Parameter("a", 0.1, 0.6)],
    )
    s = supply(0.6)
    claim = stability(s, np.sqrt(s / FADE))
    assert proved(Switched.of(slow), claim).outcome is Outcome.PROVED
    found = proved(Switched.of(slow.replace(parameters=[Parameter("a", 0.1, 0.61)])), claim)
    assert found.outcome is Outcome.REFUTED
    assert found.point["a"] > 0.6


def test_storages_that_are_no_storages_are_refused() -> None:
    s = supply(0.6)
    good = np.sqrt(s / FADE)
    for Q in ((-1.0,), (0.0,), (1.0, 1.0)):
        found = proved(plant(0.6), stability(s, good, Q))
        assert found.outcome is Outcome.REFUTED
        assert "storage" in found.reason


def test_decoupling_and_gain_norm_are_exact_to_the_last_digit() -> None:
    leak = abs(float(1.0 - 1.01))
    two = plant(0.6, 0.3)
    given = constant([K, K]), constant([H, 1.01 * H])
    # 1.01 is no double of itself, so the level is the exact difference or one unit below.
    at = prove_switched(two, *given, SwitchedClaim("decoupling", leak))
    below = prove_switched(two, *given, SwitchedClaim("decoupling", float(np.nextafter(leak, 0.0))))
    assert at.outcome is Outcome.PROVED
    assert (below.outcome, below.point) == (Outcome.REFUTED, {"mode": 1.0})
    gains = constant([K, 2 * K]), constant([H, H])
    assert prove_switched(two, *gains, SwitchedClaim("gain_bound", 2 * COUPLING * (1 + HAIR))).outcome is Outcome.PROVED
    high = prove_switched(two, *gains, SwitchedClaim("gain_bound", 2 * COUPLING * (1 - HAIR)))
    assert (high.outcome, high.point["mode"]) == (Outcome.REFUTED, 1.0)


def test_what_a_certificate_rests_on_is_told_mode_by_mode() -> None:
    def uncertain(radius: float) -> System:
        A = Polynomial.affine(np.array([[0.6, COUPLING], [0.0, 0.0]]), q=np.array([[0.1, 0.0], [0.0, 0.0]]))
        return System.lpv(
            A, C=[[0.0, 1.0]], E=[[0.0], [1.0]], dt=0.1, parameters=[Parameter("q", -radius, radius, measured=False)]
        )

    def lines(*radii: float) -> tuple[str, ...]:
        two = Switched.of([uncertain(r) for r in radii], dwell=7)
        given = constant([K, K]), constant([H, H])
        heard: list[str] = []
        found = certify_switched_claims(
            two, *given, [SwitchedClaim("decoupling", 0.0)], lambda what, _: heard.append(what)
        )
        assert found.outcome is Outcome.PROVED
        assert heard == ["proving decoupling"]
        return found.assumptions

    assert any("q is not measured and stays in [-1, 1]" in line for line in lines(1.0, 1.0))
    told = " ".join(lines(1.0, 2.0))
    assert "In mode 0: q is not measured and stays in [-1, 1]" in told
    assert "In mode 1: q is not measured and stays in [-2, 2]" in told
    assert "not before 7 samples" in told
    assert "The unknown input is free." in told


def test_one_gain_a_mode_is_needed() -> None:
    with pytest.raises(BadInput, match="has 2 modes; 1 gains"):
        certify_switched_claims(plant(0.6, 0.3), constant([K]), constant([H]), [])
    with pytest.raises(BadInput, match="has none; give it one"):
        proved(Switched.of(mode(0.6)), stability(9.0, 9.0, inputs="noise+next noise"))


def test_a_plant_without_steps_has_no_claims_about_them() -> None:
    continuous = Switched.of(plant(0.6).first.replace(dt=None, noise_bound=None))
    with pytest.raises(NotAccepted, match="is continuous; these claims are about steps"):
        certify_switched_claims(continuous, constant([K]), constant([H]), [SwitchedClaim("gain_bound", 10.0)])
