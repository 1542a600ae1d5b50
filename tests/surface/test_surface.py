"""What users see: names, docstrings, arguments, references, and what an import costs."""

import ast
import importlib
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from luenberger.export.build import compiler
from luenberger.methods import METHODS

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "src/luenberger"
ROOMS = sorted(p.parent.name for p in PACKAGE.glob("*/__init__.py") if p.stat().st_size)
# Commands document their arguments in their own --help.
MODULES = sorted(p for p in PACKAGE.rglob("*.py") if p.name != "__init__.py" and p.parent.name != "cli")


@pytest.mark.parametrize("room", ROOMS)
def test_all_is_what_is_visible(room: str) -> None:
    module = importlib.import_module(f"luenberger.{room}")
    tree = ast.parse((PACKAGE / room / "__init__.py").read_text())
    imported = {a.asname or a.name for node in tree.body if isinstance(node, ast.ImportFrom) for a in node.names}
    # Standard library names serve annotations; they are nobody's to import from here.
    foreign = {
        a.asname or a.name
        for node in tree.body
        if isinstance(node, ast.ImportFrom) and not (node.module or "").startswith("luenberger")
        for a in node.names
    }
    assigned = {
        t.id for node in tree.body if isinstance(node, ast.Assign) for t in node.targets if isinstance(t, ast.Name)
    }
    annotated = {
        node.target.id for node in tree.body if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name)
    }
    visible = {n for n in (imported - foreign) | assigned | annotated if not n.startswith("_")}
    assert sorted(module.__all__) == sorted(visible)
    assert all(hasattr(module, name) for name in module.__all__)


def _undocumented(path: Path) -> list[str]:
    """Names without a docstring, and arguments that the docstring of their function does not mention."""
    found = []
    for node in ast.parse(path.read_text()).body:
        if isinstance(node, ast.FunctionDef) and any(ast.unparse(d) == "overload" for d in node.decorator_list):
            continue
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_"):
            text = ast.get_docstring(node) or ""
            found += [] if text else [node.name]
            members = (
                [node]
                if isinstance(node, ast.FunctionDef)
                else [m for m in node.body if isinstance(m, ast.FunctionDef) and not m.name.startswith("_")]
            )
            for member in members:
                own = ast.get_docstring(member) or ""
                if isinstance(node, ast.ClassDef) and any(ast.unparse(b).startswith("Protocol") for b in node.bases):
                    continue
                found += [] if own else [f"{node.name}.{member.name}"]
                if "see `" in own.lower() or "arguments as" in own or isinstance(node, ast.ClassDef):
                    continue
                arguments = [*member.args.posonlyargs, *member.args.args, *member.args.kwonlyargs]
                found += [
                    f"{member.name}({a.arg})" for a in arguments if a.arg not in own and a.arg not in ("self", "cls")
                ]
    return found


@pytest.mark.parametrize("path", MODULES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_everything_public_is_documented(path: Path) -> None:
    assert _undocumented(path) == []


@pytest.mark.parametrize("path", MODULES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_every_field_of_a_dataclass_is_documented(path: Path) -> None:
    absent = []
    for node in ast.parse(path.read_text()).body:
        if not isinstance(node, ast.ClassDef) or node.name.startswith("_"):
            continue
        if not any("dataclass" in ast.unparse(d) for d in node.decorator_list):
            continue
        fields = [m for m in node.body if isinstance(m, ast.AnnAssign) and "ClassVar" not in ast.unparse(m.annotation)]
        names = [f.target.id for f in fields if isinstance(f.target, ast.Name) and not f.target.id.startswith("_")]
        text = ast.get_docstring(node) or ""
        absent += [f"{node.name}.{name}" for name in names if not re.search(rf"\b{name}\b.*:", text)]
    assert absent == []


@pytest.mark.parametrize("method", METHODS.values(), ids=lambda m: m.__name__)
def test_every_method_is_cited(method: type) -> None:
    assert method.references
    assert "Reference:" in (method.__doc__ or "")
    assert "Certifies:" in (method.__doc__ or "")
    assert "Assumes:" in (method.__doc__ or "")


def _loads(code: str) -> str:
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=120)
    assert run.returncode == 0, run.stderr
    return run.stdout


def test_import_loads_no_solver() -> None:
    shown = _loads("import sys, luenberger; print([m for m in ('cvxpy', 'matplotlib', 'diffrax') if m in sys.modules])")
    assert shown.strip() == "[]"


@pytest.mark.parametrize("words", [["--help"], ["certify", "--help"], ["--version"]], ids=" ".join)
def test_help_loads_no_solver_and_no_plots_of_other_commands(words: list[str]) -> None:
    code = "import sys, luenberger.cli\ntry:\n    luenberger.cli.main(sys.argv[1:])\nexcept SystemExit:\n    pass\n"
    heavy = "('cvxpy', 'diffrax', 'luenberger.methods', 'luenberger.experiment')"
    code += f"print('loaded:', [m for m in {heavy} if m in sys.modules])"
    run = subprocess.run([sys.executable, "-c", code, *words], capture_output=True, text=True, check=False, timeout=120)
    assert run.returncode == 0, run.stderr
    assert run.stdout.rstrip().endswith("loaded: []")


def test_certify_runs_without_a_solver(tmp_path: Path) -> None:
    _loads(
        "from luenberger.methods import PolytopicLuenberger\nfrom luenberger.synthesize import synthesize\n"
        "from luenberger.systems import System\n"
        f"synthesize(System.linear([[-1.0]], C=[[1.0]]), PolytopicLuenberger()).save(r'{tmp_path / 'd.json'}')"
    )
    blocked = "import sys\nsys.modules['cvxpy'] = None\nsys.modules['clarabel'] = None\n"
    shown = _loads(blocked + f"from luenberger.cli import main\nmain(['certify', r'{tmp_path / 'd.json'}'])")
    assert "proved" in shown


def test_readme_commands_exist() -> None:
    readme, script = (ROOT / "README.md").read_text(), (ROOT / "make.py").read_text()
    for word in ("demo", "test"):
        assert f"python3 make.py {word}" in readme
        assert f'"{word}"' in script
    assert (ROOT / "experiments/slip_angle_slalom.toml").is_file()


def test_readme_example_of_a_nonlinear_plant_runs(capsys: pytest.CaptureFixture[str]) -> None:
    names: dict[str, object] = {}
    exec(readme_block(3), names)
    assert "hull" in capsys.readouterr().out
    one, two, safe = (names[k].certificate for k in ("one", "two", "safe"))  # type: ignore[attr-defined]
    assert two.level("gain_bound") < one.level("gain_bound") / 5
    assert safe.level("domain") > 0


def test_readme_examples_of_the_gust_and_of_the_export_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    for block in (4, 5):
        exec(readme_block(block), names)
    shown = capsys.readouterr().out
    assert shown.count("proved") == 4
    assert (tmp_path / "build/wind/wind.c").is_file()
    assert compiler() is None or "0 disagreements" in shown


def test_readme_examples_of_a_design_and_its_replay_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    for block in (1, 2):
        exec(readme_block(block), names)
    assert (tmp_path / "robot.json").is_file()
    assert all(p.outcome.value == "proved" for p in names["design"].certificate.proofs)  # type: ignore[attr-defined]
    assert "plotly" in (tmp_path / "link.html").read_text()
    estimate, drive = names["found"]["ours"].x, names["drive"]  # type: ignore[index]
    error = np.abs(np.asarray(estimate) - drive.table(["x1", "x2", "x3", "x4"]))  # type: ignore[attr-defined]
    # Proved: 12.1 exp(-1 t), 0.08 after five seconds; the input moves within a step here and adds a little.
    assert np.linalg.norm(error[-1]) < 0.1 * np.linalg.norm(error[0])


def readme_block(number: int) -> str:
    """One Python example of the README, the first being 1."""
    return (ROOT / "README.md").read_text().split("```python\n")[number].split("```")[0]


def test_every_experiment_of_the_readme_ships() -> None:
    named = set(re.findall(r"experiments/\w+\.toml", (ROOT / "README.md").read_text()))
    assert len(named) >= 5
    assert all((ROOT / name).is_file() for name in named)


def test_nothing_names_this_machine() -> None:
    text = "\n".join(p.read_text() for p in [*PACKAGE.rglob("*.py"), *(ROOT / "experiments").glob("*")])
    assert "/work/" not in text
    assert "/home/" not in text
