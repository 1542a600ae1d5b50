"""The command line as a user meets it: help with examples, JSON that parses, errors as one panel, exit codes."""

import json
from pathlib import Path

import pytest

import luenberger
from luenberger.cli import main
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
    assert "carmaker_car" in capsys.readouterr().out


def test_certify_proves_again(design: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("certify", str(design)) == 0
    assert "proved" in capsys.readouterr().out
    assert run("certify", str(design), "--json") == 0
    assert json.loads(capsys.readouterr().out)["outcome"] == "proved"


def test_certify_refuses_what_was_altered(design: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data = json.loads(design.read_text())
    data["gain"]["terms"][0]["coefficient"][0][0] = "-50"
    design.write_text(json.dumps(data))
    # The file still says "proved"; nobody believes it.
    assert all(p.outcome.value == "proved" for p in Design.load(design).certificate.proofs)
    assert run("certify", str(design)) == 1
    assert "refuted" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("certify", "nowhere.json"), "cannot be read"),
        (("run", "nowhere.toml"), "cannot be read"),
        (("reproduce", "song-hendrick"), "Did you mean `song-hedrick`?"),
    ],
)
def test_errors_are_one_panel(words: tuple[str, ...], message: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(*words) == 2
    shown = capsys.readouterr()
    assert shown.out == ""
    assert message in " ".join(shown.err.replace("│", " ").split())
    assert "Traceback" not in shown.err


def test_unknown_command(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("certfy") == 2
    assert "certfy" in capsys.readouterr().err


def test_debug_shows_the_traceback(monkeypatch: pytest.MonkeyPatch) -> None:
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
