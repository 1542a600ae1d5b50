"""Gain look-up tables: a scheduled gain on a grid, with the interpolation bounded and its use proved on the continuum."""

import csv
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from luenberger.algebra import Polynomial
from luenberger.certify import Certificate, Claim, certify_claims
from luenberger.core import BadInput, NotAccepted, Outcome
from luenberger.core.checks import finite_array
from luenberger.design import Design
from luenberger.systems import Parameter


@dataclass(frozen=True)
class Axis:
    """Grid points of one scheduling parameter.

    Args:
        parameter: scheduling parameter of the gain.
        points: rising grid points, in units of the parameter, or of its reciprocal.
        reciprocal: name of the signal 1 / parameter that the table is read by, e.g. "speed" for inverse_speed; empty for the parameter.

    Raises:
        BadInput: fewer than two points, points that do not rise, or a reciprocal that passes zero.
    """

    parameter: str
    points: tuple[float, ...]
    reciprocal: str = ""

    def __post_init__(self) -> None:
        values = finite_array("points", self.points)
        object.__setattr__(self, "points", tuple(values.tolist()))
        if values.ndim != 1 or len(values) < 2 or (np.diff(values) <= 0).any():
            raise BadInput(
                f"The points of `{self.parameter}` are {values.tolist()}; at least two that rise are needed."
            )
        if self.reciprocal and not values[0] > 0:
            raise BadInput(f"`{self.reciprocal}` starts at {values[0]:g}; a reciprocal needs points above zero.")

    @property
    def name(self) -> str:
        """The signal that the table is read by."""
        return self.reciprocal or self.parameter

    def values(self) -> np.ndarray:
        """Return the parameter at the points."""
        points = np.array(self.points)
        return 1 / points if self.reciprocal else points

    def interval(self, k: int) -> tuple[float, float]:
        """Return the interval of the parameter on cell k, rounded outward.

        Args:
            k: number of the cell.
        """
        low, high = self.points[k], self.points[k + 1]
        if not self.reciprocal:
            return low, high
        return float(np.nextafter(1 / high, 0.0)), float(np.nextafter(1 / low, np.inf))


@dataclass(frozen=True, eq=False)
class GainTable:
    """A gain on a grid, read by multi-linear interpolation.

    Args:
        design: where it comes from.
        axes: one for each scheduling parameter of the gain.
        values: L at the grid points, shape (n1, ..., nk, nx, ny), rounded to the precision in which it is stored.
        error: largest |entry| by which the interpolated gain differs from that of the design, bounded over the whole grid.
        certificate: the claims of the design, proved again for the interpolated gain, cell by cell.
        precision: "double" or "float".
    """

    design: Design
    axes: tuple[Axis, ...]
    values: np.ndarray
    error: float
    certificate: Certificate
    precision: str

    def __call__(self, **signals: float) -> np.ndarray:
        """Return the interpolated gain, shape (nx, ny); signals outside the grid are held at its edge.

        Args:
            signals: name of an axis -> value.
        """
        table = self.values
        for axis in self.axes:
            points = np.array(axis.points)
            x = float(np.clip(signals[axis.name], points[0], points[-1]))
            k = int(np.clip(np.searchsorted(points, x, side="right") - 1, 0, len(points) - 2))
            share = (x - points[k]) / (points[k + 1] - points[k])
            table = table[k] + share * (table[k + 1] - table[k])
        return table

    def save_csv(self, path: str | Path) -> None:
        """Write one line a grid point: the signals, then the entries of L row by row.

        Args:
            path: file to write.
        """
        nx, ny = self.values.shape[-2:]
        names = [f"L_{i + 1}_{j + 1}" for i in range(nx) for j in range(ny)]
        with Path(path).open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow([*(axis.name for axis in self.axes), *names])
            for index in np.ndindex(*self.values.shape[:-2]):
                point = [axis.points[k] for axis, k in zip(self.axes, index, strict=True)]
                writer.writerow([*map(repr, point), *(repr(float(v)) for v in self.values[index].ravel())])


def look_up_table(
    design: Design,
    axes: Sequence[Axis],
    *,
    precision: str = "double",
    levels: Mapping[str, float] | None = None,
    require: bool = True,
    progress: Callable[[str, float], None] | None = None,
) -> GainTable:
    """Tabulate a scheduled gain and prove its claims again for the table.

    Choose it where the target wants a table, e.g. over speed and acceleration, and not polynomials. What is proved is the interpolated
    gain: on every cell it is a polynomial in the scheduling signals, and the storage of the design has to hold there.

    Args:
        design: with a scheduled gain and constant storages.
        axes: one for each scheduling parameter of the plant that the gain depends on; they have to cover its interval.
        precision: in which the entries are stored; the rounded ones are proved.
        levels: claim kind -> level to prove of the table where it may be weaker than that of the design, e.g. {"decay": 4.5}.
        require: False returns a table whose claims do not hold, with its certificate.
        progress: called with what is being proved and the share done.

    Raises:
        BadInput: an axis is missing, unknown, or does not cover the interval.
        NotAccepted: a claim of the table is not proved (`require`), or the design has storages that move or a second gain.
    """
    gain, system = design.gain, design.system
    used = [n for n, d in gain.degree.items() if d]
    _require(design, axes, used)
    kind = np.float32 if precision == "float" else np.float64
    axes = tuple(_stored(a, kind) for a in sorted(axes, key=lambda a: system.scheduling_names.index(a.parameter)))
    grids = [axis.values() for axis in axes]
    shape = tuple(len(g) for g in grids)
    values = np.zeros((*shape, *gain.shape))
    for index in np.ndindex(*shape):
        at = {axis.parameter: g[k] for axis, g, k in zip(axes, grids, index, strict=True)}
        values[index] = np.asarray(gain({n: at[n] for n in gain.names}), float).astype(kind)
    bounds = {p.name: p for p in system.parameters if p.lower < p.upper}
    proofs: list[Any] = []
    error, cells = 0.0, list(product(*(range(n - 1) for n in shape)))
    for done, cell in enumerate(cells):
        if progress is not None:
            progress("proving the table", done / len(cells))
        piece, box = _cell_gain(axes, values, cell), _box(axes, cell)
        if any(box[n][0] >= p.upper or box[n][1] <= p.lower for n, p in bounds.items() if n in box):
            # Outside the interval of the plant there is nothing to prove.
            continue
        error = max(error, _largest_difference(piece, gain, axes, box))
        # A signal that the table is read by joins the plant as a parameter of its own: both vary freely on the cell.
        inside = [
            replace(
                p,
                lower=max(p.lower, box.get(p.name, p.interval)[0]),
                upper=min(p.upper, box.get(p.name, p.interval)[1]),
            )
            for p in system.parameters
        ]
        joined = [
            Parameter(a.reciprocal, *_signal_ends(a, k, bounds.get(a.parameter)))
            for a, k in zip(axes, cell, strict=True)
            if a.reciprocal
        ]
        plant = system.replace(parameters=[*inside, *joined])
        claims = [replace(c, level=(levels or {}).get(c.kind, _room(c, values))) for c in design.certificate.claims]
        proofs.append(certify_claims(plant, piece, claims))
    certificate = _together(design, proofs)
    if require and certificate.outcome is not Outcome.PROVED:
        worst = next(p for p in certificate.proofs if p.outcome is not Outcome.PROVED)
        raise NotAccepted(
            f"The table of {' x '.join(map(str, shape))} points keeps not all claims of the design: `{worst.claim.kind}` is {worst.outcome.value} "
            f"on a cell ({worst.reason}) Take more points, or a weaker level by `levels`; the interpolated gain is off by up to {error:.3g}."
        )
    return GainTable(design, axes, values, error, certificate, precision)


def _require(design: Design, axes: Sequence[Axis], used: Sequence[str]) -> None:
    box = design.system.scheduling_box
    named = [axis.parameter for axis in axes]
    if design.argument_gain is not None or any(isinstance(c.storage, Polynomial) for c in design.certificate.claims):
        raise NotAccepted(
            "A table is proved with constant storages and one gain; this design has a moving storage or a second gain."
        )
    if inexact := [p.name for p in design.system.parameters if p.measured and not p.is_exact]:
        raise NotAccepted(
            f"{inexact} are read with an error, so a table may be read on another cell than the plant is on, and no cell can be proved by "
            "itself. Export the observer with its polynomial gain (`export_c`)."
        )
    if design.system.scheduling_error is not None:
        raise NotAccepted(
            "The scheduling error of this plant is a map; export the observer with its polynomial gain (`export_c`)."
        )
    if not used:
        raise NotAccepted("The gain of this design is constant; it needs no table.")
    if missing := [n for n in used if n not in named]:
        axes_needed = ", ".join(f"{n} in [{box[n][0]:.6g}, {box[n][1]:.6g}]" for n in missing)
        raise BadInput(
            f"The gain depends on {used}; an axis is missing for {axes_needed}. Give one with points from end to end: `Axis(name, points)`, or "
            f"`--axis {missing[0]}:{box[missing[0]][0]:.6g},...,{box[missing[0]][1]:.6g}` on the command line."
        )
    for axis in axes:
        if axis.parameter not in used or named.count(axis.parameter) > 1:
            raise BadInput(f"`{axis.parameter}` is no parameter of the gain, or is given twice; it depends on {used}.")
        low, high = sorted((axis.values()[0], axis.values()[-1]))
        lower, upper = box[axis.parameter]
        slack = 1e-12 * max(abs(lower), abs(upper))
        if low > lower + slack or high < upper - slack:
            raise BadInput(
                f"The points of `{axis.name}` cover {axis.parameter} in [{low:.6g}, {high:.6g}], the proof needs [{lower:.6g}, {upper:.6g}]; "
                "add points at the ends."
            )


def _stored(axis: Axis, kind: type) -> Axis:
    """The grid as it is stored, its ends rounded outward."""
    points = np.array(axis.points).astype(kind)
    down, up = np.array([-np.inf, np.inf]).astype(kind)
    if float(points[0]) > axis.points[0]:
        points[0] = np.nextafter(points[0], down)
    if float(points[-1]) < axis.points[-1]:
        points[-1] = np.nextafter(points[-1], up)
    return replace(axis, points=tuple(points.astype(float).tolist()))


def _ends(axis: Axis, k: int) -> tuple[float, float]:
    return axis.points[k], axis.points[k + 1]


def _signal_ends(axis: Axis, k: int, parameter: Parameter | None) -> tuple[float, float]:
    """Where a signal is on a cell, its inverse inside the interval of the plant."""
    low, high = _ends(axis, k)
    if parameter is None:
        return low, high
    return max(low, float(np.nextafter(1 / parameter.upper, 0.0))), min(
        high, float(np.nextafter(1 / parameter.lower, np.inf))
    )


def _box(axes: Sequence[Axis], cell: Sequence[int]) -> dict[str, tuple[float, float]]:
    return {axis.parameter: axis.interval(k) for axis, k in zip(axes, cell, strict=True)}


def _cell_gain(axes: Sequence[Axis], values: np.ndarray, cell: Sequence[int]) -> Polynomial:
    """The interpolation on a cell as a polynomial in the signals the table is read by."""
    total: Polynomial | None = None
    for corner in product((0, 1), repeat=len(axes)):
        weight: Polynomial = Polynomial.constant(np.eye(values.shape[-2]))
        for axis, k, upper in zip(axes, cell, corner, strict=True):
            low, high = _ends(axis, k)
            width, eye = high - low, np.eye(values.shape[-2])
            slope = eye / width if upper else -eye / width
            start = -low / width * eye if upper else high / width * eye
            weight = weight @ Polynomial.affine(start, **{axis.name: slope})
        index = tuple(k + c for k, c in zip(cell, corner, strict=True))
        term = weight @ Polynomial.constant(values[index])
        total = term if total is None else total + term
    assert total is not None
    return total


def _largest_difference(
    piece: Polynomial, gain: Polynomial, axes: Sequence[Axis], box: Mapping[str, tuple[float, float]]
) -> float:
    """Bound of |piece - gain| on a cell. With reciprocals, |1/v - its chord| is taken exactly, times the slopes of the gain."""
    straight = {a.parameter: Polynomial.affine(np.zeros((1, 1)), **{a.parameter: np.ones((1, 1))}) for a in axes}
    chord: dict[str, Polynomial] = {}
    bends: dict[str, float] = {}
    for a in axes:
        if a.reciprocal:
            # On [v0, v1] the chord of 1/v is (v0 + v1 - v) / (v0 v1); it lies above by at most (1/sqrt v0 - 1/sqrt v1)^2.
            high, low = 1 / box[a.parameter][0], 1 / box[a.parameter][1]
            chord[a.reciprocal] = Polynomial.affine(
                np.array([[low + high]]), **{a.parameter: np.array([[-low * high]])}
            )
            bends[a.parameter] = (1 / np.sqrt(low) - 1 / np.sqrt(high)) ** 2
    # In the parameter itself the inverse chord reads the same points: v = v0 + v1 - s v0 v1.
    read = piece.compose({**{n: p for n, p in straight.items() if n in piece.names}, **chord}) if chord else piece
    difference = read - gain
    base = max(
        float(np.abs(np.asarray(c, float)).max())
        for c in difference.bernstein({n: box[n] for n in difference.names}).values()
    )
    bend = 0.0
    for name, size in bends.items():
        slope = gain.partial(name) if gain.degree.get(name, 0) else None
        if slope is not None:
            bend += size * max(
                float(np.abs(np.asarray(c, float)).max())
                for c in slope.bernstein({n: box[n] for n in slope.names}).values()
            )
    return base + bend


def _room(claim: Claim, values: np.ndarray) -> float:
    """The norm of an interpolation stays below that of its corners, up to rounding; other claims stand as they are."""
    if claim.kind != "gain_bound":
        return claim.level
    corners = max(float(np.linalg.norm(L, 2)) for L in values.reshape(-1, *values.shape[-2:]))
    return max(claim.level, corners) * (1 + 1e-6) + 1e-12


def _together(design: Design, proofs: Sequence[Certificate]) -> Certificate:
    """One proof a claim: the worst of all cells, with all their pieces."""
    merged = []
    for k in range(len(proofs[0].proofs)):
        found = [c.proofs[k] for c in proofs]
        bad = next((p for p in found if p.outcome is not Outcome.PROVED), None)
        margin = min(p.margin for p in found)
        kept = found[0] if bad is None else bad
        merged.append(replace(kept, margin=margin, pieces=sum(p.pieces for p in found)))
    lines = [
        *design.certificate.assumptions,
        f"The gain is read from a table by linear interpolation; each of its {len(proofs)} cells in the box of the plant was proved.",
    ]
    return Certificate(tuple(merged), tuple(lines), sum(c.seconds for c in proofs))
