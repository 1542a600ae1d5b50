"""Stored benchmark problems of guaranteed estimation, read where they lie: plant, signals, and half widths of other methods."""

import json
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import numpy as np

from luenberger.core import BadInput
from luenberger.observers.observer import Estimate
from luenberger.observers.zonotopic import ZonotopicObserver
from luenberger.sets import Zonotope
from luenberger.systems import System

PROBLEMS = ("vehicle2d", "academic2d")
_PLACES = ("shared/data", "../shared/data")


@dataclass(frozen=True, eq=False)
class Stored:
    """One problem.

    Args:
        name: how it is called.
        system: discrete plant with its bounds.
        start: set that holds the initial state.
        u: inputs, shape (nt, nu).
        y: outputs, shape (nt, ny).
        count: generators kept.
        boxes: method -> stored box of the last step, shape (2, nx), with full digits.
        half_widths: row of the stored table -> half widths as texts, with the digits that are stored.
    """

    name: str
    system: System
    start: Zonotope
    u: np.ndarray
    y: np.ndarray
    count: int
    boxes: Mapping[str, np.ndarray]
    half_widths: Mapping[str, tuple[str, ...]]

    def run(self, observer: ZonotopicObserver) -> Estimate:
        """Return the estimates of an observer along the stored signals, stacked over time.

        Args:
            observer: built on `system`.
        """
        return _scan(observer, observer.init(self.start), self.u, self.y)

    def last(self, observer: ZonotopicObserver) -> np.ndarray:
        """Return the half widths of the box that an observer reports at the last sample, (nx,).

        Args:
            observer: built on `system`.
        """
        found = self.run(observer)
        return 0.5 * (np.asarray(found.upper)[-1] - np.asarray(found.lower)[-1])


def data_folder() -> Path:
    """Return the folder of the stored problems: $LUENBERGER_DATA, else shared/data here or one level up.

    Raises:
        BadInput: it is not there.
    """
    given = os.environ.get("LUENBERGER_DATA")
    places = [Path(p) / "guaranteed-estimation" for p in ([given] if given else _PLACES)]
    for place in places:
        if place.is_dir():
            return place
    looked = ", ".join(f"`{p.absolute()}`" for p in places)
    raise BadInput(
        f"The benchmark problems of guaranteed estimation were not found in {looked}. They are not part of this project; put the "
        "folder `guaranteed-estimation` somewhere and name its parent in LUENBERGER_DATA."
    )


def stored(name: str, folder: Path | None = None) -> Stored:
    """Read one problem.

    Args:
        name: one of `PROBLEMS`.
        folder: where the problems lie; None: `data_folder()`.

    Raises:
        BadInput: no such folder or file, or a table that cannot be read.
    """
    place = data_folder() if folder is None else folder
    path, table = place / f"{name}.json", place / "README.md"
    for needed in (path, table):
        if not needed.is_file():
            raise BadInput(f"`{needed}` does not exist; the folder of the stored problems needs it.")
    data = json.loads(path.read_text())
    (_, W), (_, V), (c0, R0) = (map(np.array, data[k]) for k in ("W", "V", "R0"))
    system = System.build(
        data["A"],
        data["B"],
        data["C"],
        E=W,
        G=V,
        dt=data["dt"],
        disturbance_bound=[1.0] * W.shape[1],
        noise_bound=[1.0] * V.shape[1],
        name=name,
    )
    boxes = {k: np.array(v) for k, v in data["final_box"].items()}
    u, y = np.array(data["u"]).T, np.array(data["y"]).T
    count = int(data["zonotope_order"]) * system.nx
    return Stored(name, system, Zonotope.of(c0[:, 0], R0), u, y, count, boxes, half_widths(table.read_text(), name))


def half_widths(text: str, problem: str) -> dict[str, tuple[str, ...]]:
    """Return one column of the table of half widths: row name -> numbers as texts.

    Args:
        text: page with one table whose first column is headed "method".
        problem: head of the column.

    Raises:
        BadInput: no such table or column, or a cell that holds no numbers.
    """
    lines = [[cell.strip() for cell in line.strip().strip("|").split("|")] for line in text.splitlines() if "|" in line]
    head = next((line for line in lines if line[0] == "method"), [])
    if problem not in head:
        raise BadInput(f"The table of half widths has the columns {head}; a column `{problem}` is needed.")
    found: dict[str, tuple[str, ...]] = {}
    for line in lines[lines.index(head) + 1 :]:
        if set("".join(line)) <= set("-: "):
            continue
        numbers = tuple(part.strip() for part in line[head.index(problem)].split(","))
        if not all(re.fullmatch(r"\d+(\.\d+)?", n) for n in numbers):
            raise BadInput(
                f'The table of half widths holds "{line[head.index(problem)]}" for {line[0]}; numbers are needed.'
            )
        found[line[0]] = numbers
    return found


@eqx.filter_jit
def _scan(observer: ZonotopicObserver, start: Zonotope, u: Any, y: Any) -> Estimate:
    def advance(state: Zonotope, now: Any) -> tuple[Zonotope, Estimate]:
        return observer.step(state, now[0], now[1], np.zeros(0))

    return jax.lax.scan(advance, start, (u, y))[1]
