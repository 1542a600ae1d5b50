"""Short experiment files of cars in side wind."""

from pathlib import Path
from typing import Any

SHORT = {"samples": 120, "runs": 4}


def written(folder: Path, study: str, **options: Any) -> Path:
    """Write the file of a study, short unless the options say otherwise, and return its path."""
    lines = [f'title = "{study}"', "[gust]", f'study = "{study}"']
    lines += [f"{k} = {list(v) if isinstance(v, tuple) else v}" for k, v in {**SHORT, **options}.items()]
    path = folder / f"{study}.toml"
    path.write_text("\n".join(lines) + "\n")
    return path
