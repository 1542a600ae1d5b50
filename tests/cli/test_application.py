"""The command line as a user meets it: help with examples, JSON that parses, errors as one panel, exit codes."""

import json
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

import luenberger
from luenberger.cli import app, main
from luenberger.cli.application import COMMANDS
from luenberger.design import Design
from luenberger.methods import PolytopicLuenberger
from luenberger.synthesize import synthesize
from luenberger.systems import System

ROOT = Path(__file__).parents[2]


def run(*words: str) -> int:
    with pytest.raises(SystemExit) as stopped:
        main(list(words))
    return int(stopped.value.code or 0)


def panel(capsys: pytest.CaptureFixture[str]) -> str:
    """What standard error says, without frame and line ends."""
    return " ".join(capsys.readouterr().err.replace("│", " ").split())


@pytest.fixture
def design(tmp_path: Path) -> Path:
    path = tmp_path / "design.json"
    synthesize(System.linear([[0.0, 1.0], [-1.0, -1.0]], C=[[1.0, 0.0]]), PolytopicLuenberger(0.2)).save(path)
    return path


@pytest.mark.parametrize("command", COMMANDS)
def test_help_has_an_example(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(command, "--help") == 0
    assert f"Example: luenberger {command}" in " ".join(capsys.readouterr().out.split())


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("--version") == 0
    assert luenberger.__version__ in capsys.readouterr().out


def test_list_is_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("list", "--json") == 0
    data = json.loads(capsys.readouterr().out)
    assert "PolytopicLuenberger" in data["method"]
    assert "KalmanFilter" in data["observer"]
    assert data["references"]["StructuredLipschitz"]
    assert run("list") == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert "carmaker_car" in shown
    assert all(reference in shown for reference in data["references"]["StructuredLipschitz"])


def test_certify_proves_again(design: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("certify", str(design)) == 0
    assert "proved" in capsys.readouterr().out
    assert run("certify", str(design), "--json") == 0
    data = json.loads(capsys.readouterr().out)
    assert data["outcome"] == "proved"
    assert all(proof["seconds"] >= 0 for proof in data["proofs"])
    assert len(data["proofs"]) == len(Design.load(design).certificate.proofs)


def test_certify_believes_no_file_without_claims(design: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data = json.loads(design.read_text())
    data["certificate"]["proofs"] = []
    design.write_text(json.dumps(data))
    assert run("certify", str(design)) == 1
    assert "claims nothing" in capsys.readouterr().out


def test_certify_refuses_what_was_altered(design: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data = json.loads(design.read_text())
    data["gain"]["terms"][0]["coefficient"][0][0] = "-50"
    design.write_text(json.dumps(data))
    # The file still says "proved"; nobody believes it.
    assert all(p.outcome.value == "proved" for p in Design.load(design).certificate.proofs)
    assert run("certify", str(design)) == 1
    assert "refuted" in capsys.readouterr().out
    assert run("certify", str(design), "--json") == 1
    assert json.loads(capsys.readouterr().out)["outcome"] == "refuted"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("certify", "nowhere.json"), "cannot be read"),
        (("run", "nowhere.toml"), "cannot be read"),
        (("reproduce", "song-hendrick"), "Did you mean `song-hedrick`?"),
        (("reproduce", "relaxations", "--page", "x.html"), "has no page of figures"),
        (("certfy",), "Did you mean `certify`?"),
        (("run", "nowhere.toml", "--json"), "cannot be read"),
    ],
)
def test_errors_are_one_panel(words: tuple[str, ...], message: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(*words) == 2
    shown = capsys.readouterr()
    assert shown.out == ""
    assert message in " ".join(shown.err.replace("│", " ").split())
    assert "Traceback" not in shown.err


def test_typer_runs_the_application_as_the_shell_does(design: Path) -> None:
    runner = CliRunner()
    assert runner.invoke(app, ["certify", str(design)]).exit_code == 0
    bad = runner.invoke(app, ["certify", "nowhere.json"])
    assert bad.exit_code == 2
    assert "cannot be read" in " ".join(bad.output.split())


def test_a_file_that_is_no_design_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "x.json").write_text('{"format": "something else"}')
    assert run("certify", str(tmp_path / "x.json")) == 2
    assert "no design file" in panel(capsys)


def test_page_of_commands_says_what_each_does(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("--help") == 0
    shown = " ".join(capsys.readouterr().out.replace("│", " ").split())
    assert all(f"{name} {sentence}" in shown for name, (_, sentence) in COMMANDS.items())


def test_a_package_that_lacks_is_named(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.delitem(sys.modules, "luenberger.cli.run", raising=False)
    monkeypatch.setitem(sys.modules, "luenberger.experiment", None)
    with pytest.raises(ModuleNotFoundError):
        # One of our own files that lacks is a fault of ours, not a package to install.
        main(["run", "x.toml"])
    monkeypatch.undo()

    def lacking(name: str) -> None:
        raise ModuleNotFoundError("No module named 'cvxpy'", name="cvxpy.atoms")

    monkeypatch.setattr("importlib.import_module", lacking)
    assert run("run", "x.toml") == 2
    assert "pip install cvxpy" in panel(capsys)


def test_debug_shows_the_traceback(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(luenberger.core.BadInput):
        main(["--debug", "certify", "nowhere.json"])
    monkeypatch.setenv("LUENBERGER_DEBUG", "1")
    with pytest.raises(luenberger.core.BadInput):
        main(["certify", "nowhere.json"])


def test_reproduce(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("reproduce") == 0
    assert "song-hedrick" in capsys.readouterr().out
    assert run("reproduce", "relaxations", "--json") == 0
    data = json.loads(capsys.readouterr().out)
    assert data["counts"] == {"reproduced": 3}
    assert run("reproduce", "relaxations", "--quiet") == 0
    assert "3 reproduced" in capsys.readouterr().out


def test_run_writes_a_page(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = (ROOT / "experiments/slip_angle_slalom.toml").read_text()
    small = text[: text.index('[entrants."rear-axle algebra"]')] + '[entrants."LPV"]\nkind = "lpv_luenberger"\n'
    path = tmp_path / "small.toml"
    path.write_text(small)
    assert run("run", str(path), "--out", str(tmp_path / "out"), "--json") == 0
    shown = capsys.readouterr()
    data = json.loads(shown.out)
    assert all(Path(f).is_file() for f in data["files"])
    assert run("run", str(path), "--out", str(tmp_path / "out"), "--quiet") == 0
    printed = capsys.readouterr().out
    assert "RMSE [deg]" in printed
    assert "Page:" in printed
