#!/usr/bin/env python3
"""Run the demonstration, the tests or the checks from a fresh clone; needs Python 3.11 or newer with pip.

    python3 make.py demo              install what runs, then replay experiments/slip_angle_slalom.toml
    python3 make.py test [ARGS...]    install what tests need, then run pytest with ARGS
    python3 make.py lint              install the linters, then run them all

Everything is installed into .venv beside this file and kept; a second run starts at once unless pyproject.toml changed.
"""

# Old interpreters have to get as far as the version message, so nothing newer than Python 3.6 is written here.
import hashlib
import json
import os
import subprocess
import sys
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parent
VENV = ROOT / ".venv"
STAMP = VENV / "luenberger-installed.json"
SCRIPTS = VENV / ("Scripts" if os.name == "nt" else "bin")
PYTHON = SCRIPTS / ("python.exe" if os.name == "nt" else "python")
NEEDED = (3, 11)


def main(words):
    """Carry out one command line and return its exit status."""
    commands = {"demo": demo, "test": test, "lint": lint}
    if not words or words[0] not in commands:
        print(__doc__)
        return 2
    if sys.version_info < NEEDED:
        have = ".".join(map(str, sys.version_info[:3]))
        print(f"Python {have} runs this script; 3.11 or newer is needed. Try e.g. `python3.12 make.py ...`.")
        return 2
    try:
        return commands[words[0]](words[1:])
    except subprocess.CalledProcessError as failed:
        print("`{}` failed with status {}.".format(" ".join(map(str, failed.cmd)), failed.returncode))
        return 1


def demo(words):
    """Install the package as a user would and run the demonstration."""
    install([], editable=False)
    return run(SCRIPTS / "luenberger", "run", "experiments/slip_angle_slalom.toml", *words)


def test(words):
    """Install the working tree with the test extra and run pytest."""
    install(["test"], editable=True)
    # Files side by side on all cores; a later -n 0 runs them in one process.
    return run(PYTHON, "-m", "pytest", "-n", "auto", "--dist", "loadfile", *words)


def lint(words):
    """Install the linters and run them all, so that one run shows every finding."""
    install(["lint"], editable=True)
    results = [
        run(PYTHON, "-m", "ruff", "check", "."),
        run(PYTHON, "-m", "ruff", "format", "--check", "."),
        run(PYTHON, "-m", "pyright", "--pythonpath", PYTHON),
        run(SCRIPTS / "lint-imports"),
    ]
    return int(any(results))


def install(extras, editable):
    """Make .venv hold the package and the extras; what the stamp says is there is not installed again."""
    make_venv()
    wanted = {"pyproject": digest([ROOT / "pyproject.toml"]), "python": interpreter()}
    stamp = read_stamp()
    current = all(stamp.get(key) == value for key, value in wanted.items())
    have = set(stamp.get("extras", [])) if current else set()
    source = digest(f for f in sorted((ROOT / "src").rglob("*")) if f.is_file() and f.suffix != ".pyc")
    # An editable install shows the working tree to everybody, a copy only as long as the sources stay.
    fresh = current and (stamp["editable"] or (not editable and stamp["source"] == source))
    if fresh and set(extras) <= have:
        return
    extras = sorted(have | set(extras))
    target = "." + ("[{}]".format(",".join(extras)) if extras else "")
    print(f"Installing {target} into {VENV}; the first time takes a few minutes.", flush=True)
    STAMP.unlink() if STAMP.exists() else None
    pip = [PYTHON, "-m", "pip", "install", "--quiet", "--no-input", "--disable-pip-version-check"]
    checked(*pip, *(["--editable"] if editable else []), target)
    wanted.update(extras=extras, editable=editable, source=source)
    STAMP.write_text(json.dumps(wanted, indent=1) + "\n")


def make_venv():
    """Create .venv where it is absent; one that does not run is reported, not repaired."""
    if not VENV.exists():
        print(f"Creating {VENV}.", flush=True)
        try:
            venv.create(str(VENV), with_pip=True)
        except subprocess.CalledProcessError:
            sys.exit(
                f"Python could not make {VENV}; install its venv module (Debian: `apt install python3-venv`), "
                "remove the folder and try again."
            )
    version = interpreter()
    if version is None or tuple(version[:2]) < NEEDED:
        found = "does not run" if version is None else "holds Python {}.{}".format(*version)
        sys.exit(f"{VENV} {found}; 3.11 or newer is needed. Remove the folder and try again.")


def interpreter():
    """Return the version of the interpreter in .venv as a list, or None where it does not run."""
    ask = "import sys; print(*sys.version_info[:3])"
    try:
        said = subprocess.run([str(PYTHON), "-c", ask], stdout=subprocess.PIPE, stdin=subprocess.DEVNULL, check=True)
    except (OSError, subprocess.CalledProcessError):
        return None
    return [int(word) for word in said.stdout.split()]


def read_stamp():
    """Return what the last installation wrote, or nothing."""
    try:
        return json.loads(STAMP.read_text())
    except (OSError, ValueError):
        return {}


def digest(files):
    """Return one hash of names and contents."""
    total = hashlib.sha256()
    for file in files:
        total.update(str(file.relative_to(ROOT)).encode())
        total.update(file.read_bytes())
    return total.hexdigest()


def run(*command):
    """Show and run a command in the project folder and return its status."""
    print("$ " + " ".join(map(str, command)), flush=True)
    return subprocess.run([str(word) for word in command], cwd=str(ROOT), stdin=subprocess.DEVNULL).returncode


def checked(*command):
    """Run a command in the project folder that has to succeed."""
    subprocess.run([str(word) for word in command], cwd=str(ROOT), stdin=subprocess.DEVNULL, check=True)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
