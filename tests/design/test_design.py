"""Designs as files: nothing is lost, damage is named, and code is never read from a file."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

from catalogue import robot, scheduled_oscillator
from luenberger.algebra import Polynomial
from luenberger.certify import Claim, certify_claims
from luenberger.core import BadInput, NotAccepted, Outcome
from luenberger.design import Design
from luenberger.methods import PolytopicLuenberger, PRadiusGain, SegmentGain, StructuredLipschitz
from luenberger.observers import CorrectionObserver, TwoDofObserver, ZonotopicLuenberger, ZonotopicStripFilter
from luenberger.synthesize import synthesize
from luenberger.systems import MatrixFunction, Nonlinearity, Parameter, System


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("design") / "robot.json"
    synthesize(robot(), StructuredLipschitz(decay_rate=1.0)).save(path)
    return path


def test_numbers_are_rationals_as_text(saved: Path) -> None:
    data = json.loads(saved.read_text())
    text = data["certificate"]["proofs"][0]["claim"]["storage"][0][0]
    assert isinstance(text, str)
    assert "/" in text or text.lstrip("-").isdigit()


@pytest.mark.parametrize("spoil", ["gain", "matrix", "bound", "storage"])
def test_spoiled_file_is_refused(saved: Path, spoil: str) -> None:
    data = json.loads(saved.read_text())
    if spoil == "gain":
        data["gain"]["terms"][0]["coefficient"][1][1] = "-40"
    elif spoil == "matrix":
        data["system"]["matrices"]["A"]["terms"][0]["coefficient"][3][2] = "30"
    elif spoil == "bound":
        data["system"]["nonlinearity"]["lipschitz"] = "40"
    else:
        data["certificate"]["proofs"][0]["claim"]["storage"][0][0] = "1/1024"
    changed = saved.with_name(f"{spoil}.json")
    changed.write_text(json.dumps(data))
    assert Design.load(changed).certify().outcome is not Outcome.PROVED


def test_function_is_code_and_stays_out(saved: Path) -> None:
    design = Design.load(saved)
    with pytest.raises(BadInput, match="function="):
        design.system.dynamics(0.0, np.zeros(4), np.zeros(1))


@pytest.mark.parametrize(
    ("text", "message"),
    [("{", "not JSON"), ("[]", "no design file"), ('{"format": "luenberger design 1", "extra": 1}', "unknown key")],
)
def test_damaged_file_is_named(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "bad.json"
    path.write_text(text)
    with pytest.raises(BadInput, match=message):
        Design.load(path)


@pytest.mark.parametrize(
    ("place", "value"),
    [
        (("system", "matrices"), None),
        (("system", "parameters"), [{"interval": []}]),
        (("certificate", "proofs", 0, "claim"), None),
        (("certificate", "proofs", 0, "claim", "vector"), []),
        (("certificate", "proofs", 0, "outcome"), "true"),
        (("gain", "terms", 0, "exponents"), [0.5]),
        (("gain", "shape"), 4),
    ],
)
def test_damage_anywhere_is_told_as_damage(tmp_path: Path, saved: Path, place: tuple[Any, ...], value: object) -> None:
    data = json.loads(saved.read_text())
    inner = data
    for key in place[:-1]:
        inner = inner[key]
    inner[place[-1]] = value
    (tmp_path / "damaged.json").write_text(json.dumps(data))
    with pytest.raises(BadInput, match="is damaged"):
        Design.load(tmp_path / "damaged.json")


@pytest.mark.parametrize(
    ("bound", "value"),
    [("domain", [["0"], ["1"]]), ("lipschitz", None), ("lipschitz", "-1"), ("jacobian_lower", [["0"] * 9])],
)
def test_bounds_of_a_function_are_checked_like_those_of_users(
    tmp_path: Path, saved: Path, bound: str, value: object
) -> None:
    data = json.loads(saved.read_text())
    data["system"]["nonlinearity"][bound] = value
    if bound == "jacobian_lower":
        data["system"]["nonlinearity"]["jacobian_upper"] = value
    (tmp_path / "damaged.json").write_text(json.dumps(data))
    with pytest.raises(BadInput, match=bound.replace("_", " ").split(" lower")[0]):
        Design.load(tmp_path / "damaged.json")


def test_missing_file_and_missing_part(tmp_path: Path, saved: Path) -> None:
    with pytest.raises(BadInput, match="cannot be read"):
        Design.load(tmp_path / "nowhere.json")
    data = json.loads(saved.read_text())
    del data["gain"]
    (tmp_path / "less.json").write_text(json.dumps(data))
    with pytest.raises(BadInput, match="damaged"):
        Design.load(tmp_path / "less.json")


def test_scheduled_plant_round_trip(tmp_path: Path) -> None:
    design = synthesize(scheduled_oscillator(), PolytopicLuenberger(decay_rate=0.5))
    design.save(tmp_path / "d.json")
    again = Design.load(tmp_path / "d.json")
    r = np.array([2.0, 0.3])
    for letter in "ABCDEG":
        np.testing.assert_array_equal(again.system.at(letter, r), design.system.at(letter, r))
    assert again.system.parameters == design.system.parameters
    assert again.options["decay_rate"] == 0.5
    assert again.gain_at(stiffness=2.0, damping=0.3).shape == (2, 1)


def test_function_matrix_has_no_text(tmp_path: Path) -> None:
    A = MatrixFunction(lambda p: np.array([[-1.0]]) * p["r"], ("r",), (1, 1))
    design = synthesize(System.linear([[-1.0]], C=[[1.0]]), PolytopicLuenberger())
    plant = System.lpv(A, C=[[1.0]], parameters=[Parameter("r", 1.0, 2.0)])
    other = Design(plant, design.gain, design.certificate, "none")
    with pytest.raises(NotAccepted, match="JAX function"):
        other.save(tmp_path / "d.json")


def two_dof_by_hand(**changes: object) -> Design:
    """x1' = -x1 + 50 g x1 with x1 measured: an argument gain of one takes it out."""
    hull = np.array([[[-50.0, 0.0]], [[50.0, 0.0]]])
    f = Nonlinearity.bounded(lambda z, u: 50.0 * jnp.sin(z[:1]), np.eye(2), hull=hull, domain=([-9.0] * 2, [9.0] * 2))
    plant = System.nonlinear(-np.eye(2), C=[[1.0, 0.0]], F=[[1.0], [0.0]], nonlinearity=f)
    zero, one = Polynomial.constant(np.zeros((2, 1))), Polynomial.constant([[1.0], [0.0]])
    claims = [Claim("decay", 0.9, np.eye(2)), Claim("argument_gain_bound", 1.5)]
    certificate = certify_claims(plant, zero, claims, argument_gain=one)
    return replace(Design(plant, zero, certificate, "by hand", argument_gain=one), **changes)  # type: ignore[arg-type]


def test_argument_gain_and_hull_are_kept_in_the_file(tmp_path: Path) -> None:
    design = two_dof_by_hand()
    assert design.certificate.outcome is Outcome.PROVED
    design.save(tmp_path / "design.json")
    again = Design.load(tmp_path / "design.json", design.system.nonlinearity.function)  # type: ignore[union-attr]
    assert again.certify().outcome is Outcome.PROVED
    f = again.system.nonlinearity
    assert f is not None
    assert f.jacobian_vertices is not None
    assert f.jacobian_vertices.shape == (2, 1, 2)
    assert isinstance(again.observer(0.01), TwoDofObserver)
    assert replace(again, argument_gain=None).certify().outcome is Outcome.REFUTED


def test_a_clipped_function_is_known_as_such_from_the_file(tmp_path: Path) -> None:
    design = two_dof_by_hand()
    f = design.system.nonlinearity
    assert f is not None
    clipped = replace(design, system=design.system.replace(nonlinearity=f.boxed().clipped()))
    clipped.save(tmp_path / "design.json")
    certificate = Design.load(tmp_path / "design.json").certify()
    assert certificate.outcome is Outcome.PROVED
    assert any(line.startswith("The state stays in the box") for line in certificate.assumptions)
    assert any(line.startswith("State and estimate") for line in design.certify().assumptions)


DRIVEN = System.build(
    [[0.9, -0.4], [0.4, 0.8]],
    [[0.0], [1.0]],
    [[1.0, 0.3], [0.2, 1.0]],
    E=[[1.0], [-0.4]],
    dt=0.5,
    disturbance_bound=[0.1],
    noise_bound=[0.2, 0.4],
    name="driven",
)
SETS = {"initial_half_width": [1.0, 2.0]}


def test_a_predictor_hands_out_a_set_where_one_is_asked_for() -> None:
    design = synthesize(DRIVEN, SegmentGain())
    point, whole = design.observer(0.5), design.observer(**SETS)
    assert isinstance(point, CorrectionObserver)
    assert isinstance(whole, ZonotopicLuenberger)
    assert whole.count == 20
    np.testing.assert_array_equal(np.asarray(whole.gain({})), np.asarray(design.gain({})))
    assert whole.init(np.zeros(2)).generators.shape == (2, 20)
    assert design.observer(0.5, count=7, **SETS).count == 7  # type: ignore[union-attr]
    with pytest.raises(BadInput, match=r"dt = 0\.5 s"):
        design.observer(0.1, **SETS)
    # Five for each state.
    wide = System.linear(0.5 * np.eye(6), C=np.eye(6), dt=1.0, noise_bound=[1.0] * 6)
    large = Design(wide, Polynomial.constant(np.zeros((6, 6))), certify_claims(wide, design.gain, []), "by hand")
    assert large.observer(initial_half_width=np.ones(6)).count == 30  # type: ignore[union-attr]


def test_a_filter_hands_out_a_set_cut_by_strips(tmp_path: Path) -> None:
    design = synthesize(DRIVEN, PRadiusGain("current", "one by one"))
    assert isinstance(design.observer(), CorrectionObserver)
    whole = design.observer(0.5, **SETS)
    assert isinstance(whole, ZonotopicStripFilter)
    assert whole.strips == "together"
    K = design.filter_gain
    assert K is not None
    # One step by hand: the first guess is corrected by K, and predicted with L = A K.
    state, estimate = whole.step(whole.init(np.zeros(2)), np.zeros(1), np.array([0.1, -0.2]), np.zeros(0))
    np.testing.assert_allclose(estimate.x, K({}) @ [0.1, -0.2], rtol=1e-12)
    np.testing.assert_allclose(state.center, design.gain({}) @ [0.1, -0.2], rtol=1e-12)
    design.save(tmp_path / "design.json")
    again = Design.load(tmp_path / "design.json")
    assert again.certify().outcome is Outcome.PROVED
    np.testing.assert_array_equal(again.filter_gain({}), K({}))  # type: ignore[misc]
    assert isinstance(again.observer(**SETS), ZonotopicStripFilter)


def test_a_spoiled_filter_gain_is_refused(tmp_path: Path) -> None:
    design = synthesize(DRIVEN, PRadiusGain("current"))
    K = design.filter_gain
    assert K is not None
    assert design.with_filter_gain(K).certificate.outcome is Outcome.PROVED
    assert design.with_filter_gain(K * -5.0).certificate.outcome is not Outcome.PROVED
    design.save(tmp_path / "design.json")
    data = json.loads((tmp_path / "design.json").read_text())
    data["filter_gain"]["terms"][0]["coefficient"][0][0] = "3"
    (tmp_path / "design.json").write_text(json.dumps(data))
    proofs = {p.claim.kind: p.outcome for p in Design.load(tmp_path / "design.json").certify().proofs}
    assert proofs["filter_box"] is not Outcome.PROVED
    assert proofs["steady_box"] is Outcome.PROVED
    # Another gain for the prediction is another observer, of which the box of the filter says nothing.
    other = design.with_gain(design.gain)
    assert other.filter_gain is None
    outcomes = {p.claim.kind: p.outcome for p in other.certificate.proofs}
    assert outcomes.pop("filter_box") is Outcome.REFUTED
    assert set(outcomes.values()) == {Outcome.PROVED}


def test_files_from_before_filters_still_load(tmp_path: Path) -> None:
    design = synthesize(DRIVEN, SegmentGain())
    design.save(tmp_path / "design.json")
    data = json.loads((tmp_path / "design.json").read_text())
    assert data.pop("filter_gain") is None
    assert data.pop("argument_gain") is None
    (tmp_path / "design.json").write_text(json.dumps(data))
    again = Design.load(tmp_path / "design.json")
    assert again.filter_gain is None
    assert again.certify().outcome is Outcome.PROVED


def test_what_has_no_set_says_so(saved: Path) -> None:
    with pytest.raises(NotAccepted, match="is continuous"):
        Design.load(saved).observer(0.01, initial_half_width=np.ones(4))
    design = synthesize(DRIVEN, SegmentGain())
    with pytest.raises(NotAccepted, match="another model"):
        replace(design, model=DRIVEN).observer(**SETS)
