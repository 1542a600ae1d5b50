"""From a design to a folder that checks itself, and what is said of the step that ships."""

import json
from pathlib import Path

import numpy as np
import pytest

from c_programs import needs_compiler
from catalogue import ROWS
from export_plants import running, scheduled
from luenberger.cli import main
from luenberger.core import BadInput, NotAccepted, Outcome
from luenberger.design import Design, SwitchedDesign
from luenberger.export import export_c, sampled_step
from luenberger.export.sampled import quantised
from luenberger.methods import PolytopicLuenberger, SteadyWidth, UnknownInputGain
from luenberger.synthesize import synthesize
from luenberger.systems import System


@pytest.fixture(scope="module")
def design() -> Design:
    return synthesize(scheduled(), PolytopicLuenberger(decay_rate=1.0))


@pytest.fixture(scope="module")
def switched() -> SwitchedDesign:
    modes = [
        System.linear([[a, 0.1], [0.0, 0.5]], C=[[0.0, 1.0]], E=[[0.0], [1.0]], dt=0.1, noise_bound=[0.01])
        for a in (0.8, 0.6)
    ]
    return synthesize(modes, UnknownInputGain(fade=0.2))


@needs_compiler
@pytest.mark.parametrize("precision", ["double", "float"])
def test_the_folder_builds_agrees_and_says_what_is_proved(design: Design, precision: str, tmp_path: Path) -> None:
    made = export_c(design, tmp_path, name="spring", precision=precision, dt=0.02)
    assert made.build.agrees, made.build.says
    assert made.certificate is not None
    assert made.certificate.outcome is Outcome.PROVED
    assert made.step is not None
    assert made.step.outcome is Outcome.PROVED
    names = {f.name for f in made.files}
    assert names == {
        "spring.h",
        "spring.c",
        "spring_vectors.txt",
        "spring_replay.c",
        "Makefile",
        "README.md",
        "spring_proofs.json",
    }
    header = (tmp_path / "spring.h").read_text()
    # A claim about continuous time does not stand alone.
    assert "exp(-1 t)" in header
    assert "Sampled step, proved: under equal signals" in header
    proofs = json.loads((tmp_path / "spring_proofs.json").read_text())
    assert proofs["precision"] == precision
    assert proofs["step"]["outcome"] == "proved"
    assert proofs["step"]["sampling"]["scheme"] == "rk4"


def test_the_gain_that_is_proved_is_the_gain_that_ships(design: Design) -> None:
    single = quantised(design, "float")
    for _, coefficient in single.gain:
        assert (np.asarray(coefficient) == np.asarray(coefficient, np.float32)).all()
    assert any((np.asarray(a) != np.asarray(b)).any() for (_, a), (_, b) in zip(single.gain, design.gain, strict=True))
    assert single.certificate.outcome is Outcome.PROVED
    # Claims are decided for the rounded gain: one that rounding broke is refuted, not carried over.
    spoiled = quantised(design.with_gain([[-9.0], [-9.0]]), "float")
    assert spoiled.certificate.outcome is Outcome.REFUTED


def test_a_step_that_is_not_proved_is_said_so(design: Design) -> None:
    step = sampled_step(design, design.observer(2.0, substeps=1))
    assert step is not None
    assert step.outcome is not Outcome.PROVED
    assert "no decay" in step.sentence


@needs_compiler
def test_sets_and_modes_are_exported_too(switched: SwitchedDesign, tmp_path: Path) -> None:
    made = export_c(switched, tmp_path, name="modes", initial_half_width=[0.1, 0.1], count=6)
    assert made.build.agrees, made.build.says
    assert "proved in [-0.5, 1.5]" in made.code.header
    assert made.step is None
    with pytest.raises(NotAccepted, match="single precision"):
        export_c(switched, tmp_path, precision="float", initial_half_width=[0.1, 0.1])


@needs_compiler
def test_a_running_observer_is_exported_with_its_plant(tmp_path: Path) -> None:
    made = export_c(running(), tmp_path, system=scheduled())
    assert made.build.agrees
    assert made.certificate is None
    with pytest.raises(BadInput, match="with its `system`"):
        export_c(running(), tmp_path)


@needs_compiler
def test_a_steady_box_bounds_the_residual(tmp_path: Path) -> None:
    plant = System.linear([[0.9]], C=[[1.0]], E=[[1.0]], dt=0.1, disturbance_bound=[0.1], noise_bound=[0.2])
    made = export_c(synthesize(plant, SteadyWidth()), tmp_path)
    assert "residual" in made.code.guarded.flags
    assert made.code.guarded.residual_bound is not None
    assert made.code.guarded.residual_bound[0] > 0.2


def test_bounds_that_hold_step_by_step_do_not_pass_for_a_claim_about_the_step(
    switched: SwitchedDesign, tmp_path: Path
) -> None:
    row = next(r for r in ROWS if r.name == "interval, width")
    made = {
        "continuous": export_c(
            synthesize(row.system(), row.method), tmp_path / "c", dt=0.005, check=False, **row.options
        ),
        "discrete": export_c(switched, tmp_path / "d", initial_half_width=[1.0, 1.0], check=False),
    }
    says = {"continuous": "speaks of continuous time, not of this step", "discrete": "speaks of this map itself"}
    for kind, exported in made.items():
        assert exported.step is None
        assert [w for w, text in says.items() if text in exported.code.header] == [kind]
        proofs = json.loads(next(f for f in exported.files if f.suffix == ".json").read_text())
        assert says[kind] in proofs["statements"][0]


def test_a_discrete_claim_is_told_in_steps(tmp_path: Path) -> None:
    plant = System.linear([[0.9]], C=[[1.0]], E=[[1.0]], dt=2.0, disturbance_bound=[1.0], noise_bound=[1.0])
    found = synthesize(plant, SteadyWidth())
    decay = next(p for p in found.certificate.proofs if p.claim.kind == "decay")
    found.save(tmp_path / "design.json")
    read = next(p for p in Design.load(tmp_path / "design.json").certificate.proofs if p.claim.kind == "decay")
    made = export_c(found, tmp_path / "code", check=False)
    # Read as a rate, a factor of 0.5 a step would promise exp(-0.5 t).
    for words in (decay.sentence, read.sentence, made.code.header):
        assert f"{decay.claim.level:.6g}^k" in words
        assert "exp(" not in words


def run(*words: str) -> int:
    with pytest.raises(SystemExit) as stopped:
        main(list(words))
    return int(stopped.value.code or 0)


@needs_compiler
def test_the_command_writes_builds_and_checks(
    design: Design, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    design.save(tmp_path / "design.json")
    file, folder = str(tmp_path / "design.json"), str(tmp_path / "code")
    assert run("export", file, folder, "--dt", "0.02", "--json") == 0
    data = json.loads(capsys.readouterr().out)
    assert data["replay"] == "agrees"
    assert data["sampled step"] == "proved"
    words = ["--to", "table", "--axis", "stiffness:1,2,3,4", "--decay", "0.9", "--quiet"]
    assert run("export", file, folder, *words) == 0
    assert (tmp_path / "code" / "observer.csv").is_file()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--to", "rust"], "is no target"),
        ([], "`dt` is not given"),
        (["--to", "table", "--axis", "a=b:1,2"], "is not understood"),
        (["--to", "table", "--axis", "stiffness:one"], "is no list of numbers"),
        (["--dt", "0.02", "--function", "nowhere:f"], "cannot be imported"),
    ],
)
def test_the_command_refuses(
    words: list[str], message: str, design: Design, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    design.save(tmp_path / "design.json")
    assert run("export", str(tmp_path / "design.json"), str(tmp_path / "code"), *words) == 2
    assert message in " ".join(capsys.readouterr().err.replace("│", " ").split())
