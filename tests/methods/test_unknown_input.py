"""Gains of unknown-input observers: levels of the car, options, refusals, and what is claimed after rounding."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from luenberger.certify.switched import certify_switched_claims
from luenberger.core import BadInput, Infeasible, LuenbergerError, NotAccepted, Outcome
from luenberger.design import SwitchedDesign
from luenberger.methods.method import SwitchedCandidate
from luenberger.methods.unknown_input import UnknownInputGain
from luenberger.methods.unknown_input_plant import require_decouplable
from luenberger.synthesize import synthesize
from luenberger.systems import Switched, System
from luenberger.systems.discretize import discretize
from luenberger.vehicle import gust_car
from luenberger.vehicle.wind import wind_plant

SPEEDS = (8.5, 13.55, 18.05)


def gusty(step: float = 0.06, arm: float = 0.4, dwell: int = 1, **options: Any) -> Switched:
    """The car in a side wind at three speeds, sampled by Euler's method."""
    plant = discretize(wind_plant(gust_car, (6.0, 19.9), gust_arm=arm, **options), step, "euler")
    modes = [plant.freeze(speed=v, inverse_speed=1 / v) for v in SPEEDS]
    return Switched.of(modes, "speed", (6.0, 11.0, 16.0, 19.899), unit="m/s", dwell=dwell)


def uncertain() -> dict[str, Any]:
    """Tyres that differ by a tenth, gyro and steering with errors."""
    return {"stiffness": ((54e3, 66e3), (58.5e3, 71.5e3)), "yaw_rate_noise": 0.005, "steering_error": 0.01}


def scheduled() -> System:
    """The same car as one mode that follows the speed."""
    return discretize(wind_plant(gust_car, (8.0, 18.0), gust_arm=0.4, yaw_rate_noise=0.005), 0.06, "euler")


def random_plant(seed: int, dwell: int = 1) -> Switched:
    """Two modes with one unknown input and eigenvalues up to the unit circle."""
    rng = np.random.default_rng(seed)
    C = rng.standard_normal((1, 3))
    modes = []
    for _ in range(2):
        A = rng.standard_normal((3, 3))
        modes.append(System.linear(A / np.abs(np.linalg.eigvals(A)).max(), C=C, E=rng.standard_normal((3, 1)), dt=1.0))
    return Switched.of(modes, dwell=dwell)


def designed(plant: Switched | System, **options: Any) -> SwitchedCandidate:
    method = UnknownInputGain(**options)
    method.accept(plant)
    return method.design(plant)


@pytest.mark.parametrize(("step", "level"), [(0.06, 2.47274), (0.1, 3.83063), (0.05, 4.39233)])
def test_the_levels_of_the_car(step: float, level: float) -> None:
    assert designed(gusty(step, **uncertain())).statistics["optimum"] == pytest.approx(level, abs=1e-4)


@pytest.mark.parametrize(
    ("step", "error", "words"),
    [
        (0.6, NotAccepted, r"z = -8\.65 a step .*a shorter sample time or the exact hold"),
        (0.02, Infeasible, r"fade = 0\.5: the zero z = 0\.849 a step of mode 2 .* = 0\.279931 .*longer sample time"),
        (0.01, Infeasible, r"fade = 0\.5: the zero z = 0\.924 a step of mode 2 .* = 0\.145698 .*longer sample time"),
    ],
)
def test_steps_that_do_not_fit_the_fade_are_refused(step: float, error: type[LuenbergerError], words: str) -> None:
    with pytest.raises(error, match=words):
        UnknownInputGain().accept(gusty(step))


def test_the_refusal_names_the_largest_fade_and_just_below_it_works() -> None:
    with pytest.raises(Infeasible) as refusal:
        UnknownInputGain().accept(gusty(0.02))
    assert refusal.value.nearest is not None
    assert designed(gusty(0.02), fade=0.99 * refusal.value.nearest).statistics["optimum"] > 0


def test_a_zero_that_swings_asks_for_a_shorter_step() -> None:
    with pytest.raises(Infeasible, match=r"z = -0\.7.*shorter sample time, or the exact hold"):
        UnknownInputGain().accept(gusty(0.107))


def test_a_plant_without_a_good_sensor_is_refused() -> None:
    with pytest.raises(NotAccepted, match="Rank error in mode 0"):
        UnknownInputGain().accept(gusty(arm=0.0))
    with pytest.raises(NotAccepted, match="unstable zero"):
        UnknownInputGain().accept(gusty(arm=-0.2))


@pytest.mark.parametrize("fade", [0.0, 1.0, -0.1, 1.5])
def test_a_fade_outside_its_range_is_refused(fade: float) -> None:
    with pytest.raises(BadInput, match=r"lies between 0 and 1"):
        UnknownInputGain(fade=fade).accept(gusty())


def test_unknown_options_are_refused() -> None:
    with pytest.raises(BadInput, match="`schedule`"):
        UnknownInputGain(schedule="plants").accept(gusty())
    with pytest.raises(BadInput, match=r"`growth` is 0\.5"):
        UnknownInputGain(storage="dwell", growth=0.5).accept(gusty())


def test_a_dwell_time_too_short_is_refused_with_the_least_that_does() -> None:
    method = UnknownInputGain(storage="dwell")
    with pytest.raises(BadInput, match="needs at least 3"):
        method.accept(gusty(dwell=2))
    method.accept(gusty(dwell=3))


def test_one_by_one_there_has_to_be_something_to_attenuate() -> None:
    parts: dict[str, Any] = {"C": [[0.0, 1.0]], "E": [[0.0], [1.0]], "dt": 0.1}
    plain = System.linear([[0.8, 0.1], [0.2, 0.5]], **parts)
    silent = System.linear([[0.8, 0.1], [0.2, 0.5]], G=np.zeros((1, 0)), **parts)
    with pytest.raises(NotAccepted, match="without a `noise_bound`"):
        UnknownInputGain(fade=0.1, attenuate="physical").accept(plain)
    for mute in (silent, plain.replace(noise_bound=[0.0])):
        with pytest.raises(NotAccepted, match="neither noise nor unmeasured parameters"):
            UnknownInputGain(fade=0.1, attenuate="physical").accept(mute)


def test_the_bound_is_the_least_for_no_fade_given() -> None:
    facts = designed(gusty(), fade=None).statistics
    assert facts["ultimate_bound"] == pytest.approx(2.2012, abs=1e-4)
    assert facts["fade"] == pytest.approx(0.4543, abs=5e-3)


@pytest.mark.parametrize("storage", ["common", "mode", "last", "dwell"])
@pytest.mark.parametrize("slack", [False, True])
def test_switching_costs_nothing_in_the_car(storage: Any, slack: bool) -> None:
    found = designed(gusty(dwell=10), storage=storage, slack=slack)
    assert found.statistics["optimum"] == pytest.approx(2.47274, abs=1e-4)
    # The claim finds that no growth is needed at a switch.
    claim = next(c for c in found.claims(found.gains, found.decoupling) if c.kind == "iss")
    assert claim.level == pytest.approx(2.22385, abs=1e-4)
    assert claim.growth == 1.0


def test_a_common_storage_that_does_not_exist_is_refused_with_what_helps() -> None:
    with pytest.raises(Infeasible, match=r'the largest found was 0\.0.*storage="mode", "last" or "dwell"'):
        designed(random_plant(225), fade=0.1)
    assert designed(random_plant(225), fade=0.1, storage="mode").statistics["optimum"] < 16
    assert designed(random_plant(295, dwell=30), fade=0.1, storage="dwell").statistics["optimum"] < 4


def test_a_scheduled_plant_is_one_mode_whose_gain_follows() -> None:
    found = designed(scheduled())
    (K,) = found.gains
    assert set(K.names) == {"speed", "inverse_speed"}
    # Slowest at 18 m/s: z = 1 - 0.06 * 136.666 / 18; the gain takes (P A)_12 out at every speed.
    z = 1 - 0.06 * (60e3 * (0.4 - 1.2) + 65e3 * (0.4 + 1.6)) / (1500 * 0.4) / 18
    assert found.statistics["optimum"] == pytest.approx(0.5 / (0.5 - z**2), abs=1e-4)
    for v in (8.0, 11.0, 18.0):
        A = np.asarray(scheduled().at("A", [v, 1 / v]))
        P = np.eye(2) + np.asarray(found.decoupling[0]({})) @ [[0.0, 1.0]]
        gain = np.asarray(K({"speed": v, "inverse_speed": 1 / v}))
        np.testing.assert_allclose(gain, [[(P @ A)[0, 1]], [0.0]], atol=1e-4)


def test_a_constant_gain_for_all_speeds_costs() -> None:
    constant = designed(scheduled(), schedule="constant")
    assert not any(constant.gains[0].degree.values())
    assert constant.statistics["optimum"] > 1.5 * designed(scheduled()).statistics["optimum"]


def test_claims_are_made_for_the_gains_that_ship() -> None:
    found = designed(gusty(yaw_rate_noise=0.005, steering_error=0.01))
    rounded = tuple(K.map(lambda c: np.round(c, 3)) for K in found.gains)
    exact, coarse = ({c.kind: c for c in found.claims(gains, found.decoupling)} for gains in (found.gains, rounded))
    assert list(coarse) == ["decoupling", "gain_bound", "iss", "containment"]
    assert coarse["decoupling"].level < 1e-12
    largest = max(np.linalg.norm(np.asarray(K({})), 2) for K in rounded)
    assert largest < coarse["gain_bound"].level <= largest * (1 + 1e-5)
    # Three digits leave up to 5e-4 in N, which the level shows.
    assert exact["iss"].level < coarse["iss"].level < exact["iss"].level * 1.001
    # The noise alone: |e| <= vector stays, V+ H v+ - K v of the best gain at the fastest speed.
    assert coarse["containment"].vector is not None


def test_what_is_unbounded_is_not_claimed_to_be_contained() -> None:
    found = designed(random_plant(225), fade=0.1, storage="mode")
    assert [c.kind for c in found.claims(found.gains, found.decoupling)] == ["decoupling", "gain_bound", "iss"]


def test_one_by_one_the_noise_is_counted_in_its_bound() -> None:
    # Half the noise bound halves nothing but the unit of w: gamma falls by four, the bound in units of noise by two.
    whole = designed(gusty(yaw_rate_noise=0.005, steering_error=0.01), attenuate="physical").statistics
    half = designed(gusty(yaw_rate_noise=0.0025, steering_error=0.005), attenuate="physical").statistics
    assert half["ultimate_bound"] == pytest.approx(whole["ultimate_bound"] / 2, rel=1e-3)


def test_the_design_ships_with_its_proof_and_reads_back(tmp_path: Path) -> None:
    design = synthesize(gusty(**uncertain()), UnknownInputGain())
    assert design.certificate.outcome is Outcome.PROVED
    design.save(tmp_path / "gust.json")
    again = SwitchedDesign.load(tmp_path / "gust.json")
    assert again.certify().outcome is Outcome.PROVED
    np.testing.assert_array_equal(again.gain_at(1), design.gain_at(1))
    assert again.options["storage"] == "common"


def rounded(coefficient: np.ndarray) -> np.ndarray:
    """Seven significant digits, as designs ship them."""
    return np.array([float(f"{x:.7g}") for x in coefficient.flat]).reshape(coefficient.shape)


@pytest.mark.parametrize(
    ("plant", "options"),
    [
        (gusty(**uncertain()), {}),
        (gusty(**uncertain()), {"fade": None, "attenuate": "physical"}),
        (gusty(yaw_rate_noise=0.005), {"storage": "mode", "attenuate": "physical"}),
        (gusty(dwell=10, **uncertain()), {"storage": "dwell"}),
        (scheduled(), {}),
        (scheduled(), {"schedule": "constant", "slack": True}),
        (random_plant(47), {"fade": 0.1, "storage": "mode"}),
        (random_plant(47), {"fade": 0.1, "storage": "last"}),
        (random_plant(295, dwell=30), {"fade": 0.1, "storage": "dwell"}),
    ],
)
def test_every_claim_is_proved_for_the_digits_that_ship(plant: Switched | System, options: dict[str, Any]) -> None:
    found = designed(plant, **options)
    gains = tuple(K.map(rounded) for K in found.gains)
    claims = found.claims(gains, found.decoupling)
    certificate = certify_switched_claims(Switched.of(plant), gains, found.decoupling, claims)
    assert certificate.outcome is Outcome.PROVED, [p.reason for p in certificate.proofs]
    # What is claimed is what was designed for: a thousandth was given away, and the rounding takes little.
    if options.get("attenuate") != "physical" and options.get("storage") != "dwell":
        assert claims[2].level <= found.statistics["ultimate_bound"] * (1 + 2e-3)


def test_the_storage_of_the_last_mode_is_no_storage_of_the_next() -> None:
    found = designed(random_plant(225), fade=0.1, storage="last")
    claim = next(c for c in found.claims(found.gains, found.decoupling) if c.kind == "iss")
    for order, proved in (("last", True), ("next", False)):
        again = type(claim).from_text(replace(claim, order=order).as_text())
        certificate = certify_switched_claims(random_plant(225), found.gains, found.decoupling, [again])
        assert (certificate.outcome is Outcome.PROVED) == proved


def test_a_spoiled_gain_loses_its_proof() -> None:
    found = designed(gusty(**uncertain()))
    claims = found.claims(found.gains, found.decoupling)
    spoiled = tuple(K.map(lambda c: c + 0.1) for K in found.gains)
    kinds = {
        p.claim.kind: p.outcome
        for p in certify_switched_claims(gusty(**uncertain()), spoiled, found.decoupling, claims).proofs
    }
    assert kinds["iss"] is not Outcome.PROVED


def test_the_exact_hold_takes_the_long_step_that_euler_does_not() -> None:
    # At 0.6 s Euler's step leaves z = -8.65, -5.05, -3.54; the exact hold leaves them next to zero.
    plant = wind_plant(gust_car, (6.0, 19.9), gust_arm=0.4)
    modes = [discretize(plant.freeze(speed=v, inverse_speed=1 / v), 0.6) for v in SPEEDS]
    found = designed(Switched.of(modes))
    z = [mode.eigenvalue.real for _, mode in require_decouplable(Switched.of(modes))]
    assert -0.03 < min(z) < max(z) < 0.0
    assert found.statistics["optimum"] == pytest.approx(1.0, abs=0.01)
