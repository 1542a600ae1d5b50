"""Ordinary mistakes at the doors: what was given, what is needed, what to do next, and no library's words."""

import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from luenberger import System
from luenberger.core import BadInput
from luenberger.design import Design
from luenberger.observers import ZonotopicFilter
from mistakes import MISTAKES, windy


@pytest.fixture(scope="module")
def answers() -> dict[str, list[str]]:
    """What users hear: a program of its own, since the type checks of the tests would speak first."""
    file = Path(__file__).parents[1] / "mistakes.py"
    told = subprocess.run([sys.executable, str(file)], capture_output=True, text=True, check=True, timeout=300)
    return json.loads(told.stdout.splitlines()[-1])


@pytest.mark.parametrize("name", MISTAKES)
def test_mistakes_are_answered_in_words(name: str, answers: dict[str, list[str]]) -> None:
    _, kind, message = MISTAKES[name]
    given, words = answers[name]
    assert given == kind.__name__, words
    assert re.search(message, words, re.DOTALL), words


def test_files_of_the_other_kind_say_who_reads_them(tmp_path: Path) -> None:
    windy().save(tmp_path / "one.json")
    with pytest.raises(BadInput, match=r"its `format` is `luenberger switched.*load_design` reads both"):
        Design.load(tmp_path / "one.json")
    (tmp_path / "cut.json").write_text((tmp_path / "one.json").read_text()[:200])
    with pytest.raises(BadInput, match="or is cut off"):
        Design.load(tmp_path / "cut.json")


def test_sets_need_no_number_of_generators() -> None:
    plant = System.linear(np.diag([0.9] * 6), C=np.eye(6), dt=0.1, noise_bound=[1.0] * 6)
    assert ZonotopicFilter(plant, initial_half_width=np.ones(6)).count == 30
    assert windy().observer(initial_half_width=[1.0, 1.0]).count == 20
