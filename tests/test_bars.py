"""Files stay short enough to be read in one go."""

from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
LONGEST = 350


@pytest.mark.parametrize("folder", ["src", "tests", "benchmarks"])
def test_no_file_outgrows_the_bar(folder: str) -> None:
    lengths = {f: len(f.read_text(encoding="utf-8").splitlines()) for f in (ROOT / folder).rglob("*.py")}
    assert len(lengths) > 5
    assert {str(f.relative_to(ROOT)): n for f, n in lengths.items() if n > LONGEST} == {}
