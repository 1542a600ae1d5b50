"""Designs with modes: what is saved is what is loaded, what the file says is not trusted, what is missing is said."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from luenberger.cli import main
from luenberger.core import BadInput, Outcome
from luenberger.design import Design, SwitchedDesign, load_design
from luenberger.methods import PolytopicLuenberger, UnknownInputGain
from luenberger.synthesize import synthesize
from luenberger.systems import System
from switched_plants import plant


@pytest.fixture(scope="module")
def design() -> SwitchedDesign:
    return synthesize(plant(0.6, 0.3, dwell=3), UnknownInputGain(fade=0.3, storage="mode"))


@pytest.fixture
def saved(design: SwitchedDesign, tmp_path: Path) -> Path:
    design.save(tmp_path / "design.json")
    return tmp_path / "design.json"


def certified(path: Path) -> int:
    with pytest.raises(SystemExit) as stopped:
        main(["certify", str(path), "--quiet"])
    return int(stopped.value.code or 0)


def test_a_file_gives_back_the_design(design: SwitchedDesign, saved: Path) -> None:
    again = load_design(saved)
    assert isinstance(again, SwitchedDesign)
    assert (again.method, again.references, dict(again.options)) == (
        design.method,
        design.references,
        dict(design.options),
    )
    assert (again.system.dwell, again.system.ends) == (3, design.system.ends)
    for mode in range(2):
        np.testing.assert_array_equal(again.gain_at(mode), design.gain_at(mode))
    assert [c.as_text() for c in again.certificate.claims] == [c.as_text() for c in design.certificate.claims]
    assert again.certify().outcome is Outcome.PROVED
    assert certified(saved) == 0


@pytest.mark.parametrize(
    ("kind", "entry", "value"),
    [
        ("iss", "level", "1/1024"),
        ("iss", "supply", "1/1024"),
        ("iss", "fade", "63/64"),
        ("gain_bound", "level", "1/1024"),
        ("containment", "vector", [["1/1024", "1/1024"]]),
    ],
)
def test_a_file_that_claims_too_much_is_not_believed(saved: Path, kind: str, entry: str, value: Any) -> None:
    data = json.loads(saved.read_text())
    proofs = data["certificate"]["proofs"]
    proof = next(p for p in proofs if p["claim"]["kind"] == kind)
    assert proof["outcome"] == "proved"
    proof["claim"][entry] = value
    saved.write_text(json.dumps(data))
    assert SwitchedDesign.load(saved).certify().outcome is Outcome.REFUTED
    assert certified(saved) == 1


def test_a_spoiled_plant_or_decoupling_is_not_believed(design: SwitchedDesign, saved: Path) -> None:
    spoiled = design.with_gains(design.gains, [H * 1.01 for H in design.decoupling])
    outcomes = {p.claim.kind: p.outcome for p in spoiled.certificate.proofs}
    assert outcomes["decoupling"] is Outcome.REFUTED
    assert outcomes["containment"] is Outcome.REFUTED
    text = saved.read_text()
    assert text.count('"dwell": 3') == 1
    saved.write_text(text.replace('"dwell": 3', '"dwell": 0'))
    with pytest.raises(BadInput, match="at least one sample"):
        SwitchedDesign.load(saved)


def test_what_a_set_needs_is_asked_for(design: SwitchedDesign) -> None:
    with pytest.raises(BadInput, match=r"`initial_half_width` is given; .* \(x1, x2\)"):
        design.observer()
    with pytest.raises(BadInput, match=r"`dt` is 0\.2 s but the design is for 0\.1 s"):
        design.observer(0.2, initial_half_width=[1.0, 1.0])
    observer = design.observer(0.1, initial_half_width=[1.0, 2.0])
    np.testing.assert_array_equal(observer.initial_half_width, [1.0, 2.0])


def test_each_kind_of_file_is_read_as_what_it_is(saved: Path, tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="is no design file of this kind"):
        Design.load(saved)
    single = synthesize(System.linear([[0.0, 1.0], [-1.0, 0.0]], C=[[1.0, 0.0]]), PolytopicLuenberger(decay_rate=1.0))
    single.save(tmp_path / "single.json")
    assert isinstance(load_design(tmp_path / "single.json"), Design)
    with pytest.raises(BadInput, match="is no design file of this kind"):
        SwitchedDesign.load(tmp_path / "single.json")
    damaged = json.loads(saved.read_text())
    del damaged["system"]["modes"]
    saved.write_text(json.dumps(damaged))
    with pytest.raises(BadInput, match="is damaged"):
        SwitchedDesign.load(saved)
