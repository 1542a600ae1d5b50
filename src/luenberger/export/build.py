"""Exported files on disk, and what a compiler says of them."""

import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

from luenberger.core import BadInput
from luenberger.export.c import CCode
from luenberger.export.golden import Golden, replay_text, vectors_text

# What the tests compile with; a target's own flags may be added, but not -ffast-math.
FLAGS = ("-std=c99", "-O2", "-Wall", "-Wextra", "-Wconversion", "-Werror", "-pedantic")
SANITIZE = ("-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-g")


@dataclass(frozen=True)
class Build:
    """What came of compiling and replaying.

    Args:
        ran: False where there is no compiler.
        agrees: the program compiled without a warning and every vector agreed.
        says: what compiler and program printed.
    """

    ran: bool
    agrees: bool
    says: str


def write_c(code: CCode, run: Golden, folder: str | Path, *, tolerance: float) -> tuple[Path, ...]:
    """Write code, vectors, replay program, Makefile and README, and return their paths.

    Args:
        code: exported observer.
        run: vectors of the same observer.
        folder: where to write; made where absent.
        tolerance: of the replay, see `replay_text`.

    Raises:
        BadInput: the folder cannot be written.
    """
    place, name = Path(folder), code.name
    texts = {
        f"{name}.h": code.header,
        f"{name}.c": code.source,
        f"{name}_vectors.txt": vectors_text(run),
        f"{name}_replay.c": replay_text(code, tolerance),
        "Makefile": _makefile(name),
        "README.md": _readme(code, tolerance, run.status.size),
    }
    try:
        place.mkdir(parents=True, exist_ok=True)
        for file, text in texts.items():
            (place / file).write_text(text, encoding="utf-8")
    except OSError as cause:
        raise BadInput(f"`{folder}` cannot be written ({cause.strerror}); give a folder of your own.") from None
    return tuple(place / file for file in texts)


def compiler() -> str | None:
    """Return the first C compiler on the path, or None."""
    return next((found for word in ("cc", "gcc", "clang") if (found := shutil.which(word))), None)


def build(folder: str | Path, name: str, *, sanitize: bool = False, vectors: str | None = None) -> Build:
    """Compile exported files and replay their vectors, where a compiler is there.

    Args:
        folder: where `write_c` wrote.
        name: prefix of the files.
        sanitize: run under the address and undefined-behaviour sanitizers.
        vectors: file with the vectors; left out: those written with the code.
    """
    found = compiler()
    if found is None:
        return Build(False, False, "No C compiler is on the path; run `make check` in the folder where one is.")
    place, program = Path(folder), f"{name}_replay"
    words = [found, *FLAGS, *(SANITIZE if sanitize else ()), f"{name}.c", f"{program}.c", "-o", program, "-lm"]
    made = subprocess.run(words, cwd=place, capture_output=True, text=True, check=False)
    if made.returncode:
        return Build(True, False, made.stdout + made.stderr)
    ran = subprocess.run(
        [f"./{program}", vectors or f"{name}_vectors.txt"], cwd=place, capture_output=True, text=True, check=False
    )
    return Build(True, ran.returncode == 0, ran.stdout + ran.stderr)


def _makefile(name: str) -> str:
    return f"""# Builds the replay of the golden vectors; `make check` runs it.
CFLAGS = {" ".join(FLAGS)}

{name}_replay: {name}.c {name}_replay.c {name}.h
\t$(CC) $(CFLAGS) {name}.c {name}_replay.c -o $@ -lm

check: {name}_replay
\t./{name}_replay {name}_vectors.txt

.PHONY: check
"""


def _readme(code: CCode, tolerance: float, count: int) -> str:
    name, s = code.name, code.guarded.signals
    rows = [
        f"| `{letter}[{k}]` | {signal} | {dict(s.units).get(signal, '')} |"
        for letter, names in (("u", s.inputs), ("y", s.outputs), ("r", s.scheduling), ("x", s.states))
        for k, signal in enumerate(names)
    ]
    table = "\n".join(rows)
    return f"""# {name}

`{type(code.guarded.observer).__name__}`, one step of {code.guarded.observer.dt!r} s, in C99 ({code.precision}).

    {name}_state state;
    {name}_estimate estimate;
    {name}_init(&state, x0);
    unsigned status = {name}_step(&state, u, y, r, &estimate);   /* once a sample */

| place | signal | unit |
|---|---|---|
{table}

The status word says which assumption of the certificate was seen to break; its bits stand in `{name}.h`, with what was proved.
`make check` compiles everything and replays {count} golden vectors; they agree within {tolerance:.3g} relative to the largest
value met. Do not compile with -ffast-math.
"""
