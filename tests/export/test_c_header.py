"""Headers hold what users wrote without being ended by it."""

import subprocess
from pathlib import Path

import pytest

from c_programs import needs_compiler
from luenberger.export import export_c
from luenberger.export.c_text import in_comment
from luenberger.methods import KalmanGain
from luenberger.synthesize import synthesize
from luenberger.systems import System


@pytest.mark.parametrize(
    ("text", "held"),
    [("m/s", "m/s"), ("a */ b", "a * / b"), ("a /* b", "a / * b"), ("/*/", "/ * /"), ("two\nlines", "two lines")],
)
def test_a_comment_goes_on_to_its_own_end(text: str, held: str) -> None:
    assert in_comment(text) == held


@needs_compiler
@pytest.mark.parametrize("unit", ["m*/s", "m/*s", "m\ns"])
def test_any_unit_compiles(unit: str, tmp_path: Path) -> None:
    plant = System.linear([[0.9]], [[1.0]], [[1.0]], dt=0.1, units={"x1": unit, "u1": unit, "y1": unit}, name="a */ b")
    made = export_c(synthesize(plant, KalmanGain([[1.0]], [[1.0]])), tmp_path)
    assert made.build.agrees, made.build.says
    assert f"[{in_comment(unit)}]" in made.code.header
    assert subprocess.run(["make", "check"], cwd=tmp_path, capture_output=True, check=False).returncode == 0
