"""C programs of the tests: compiled with the flags that the exported code is held to, and what they print."""

import subprocess
from pathlib import Path

import numpy as np
import pytest

from luenberger.export.build import FLAGS, compiler

needs_compiler = pytest.mark.skipif(compiler() is None, reason="no C compiler on the path")


def printed(folder: Path, source: str, *arguments: str, flags: tuple[str, ...] = ()) -> np.ndarray:
    """The numbers that a program prints, in one row.

    Args:
        folder: where its headers are and it is built.
        source: of its main file.
        arguments: of its run.
        flags: of the compiler, beside those of every export.
    """
    (folder / "main.c").write_text(source, encoding="utf-8")
    words = [str(compiler()), *FLAGS, *flags, "main.c", "-o", "main", "-lm"]
    made = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)
    assert made.returncode == 0, made.stderr
    shown = subprocess.run(["./main", *arguments], cwd=folder, capture_output=True, text=True, check=True).stdout
    return np.array(shown.split(), dtype=float)
