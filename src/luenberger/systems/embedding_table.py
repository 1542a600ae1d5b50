"""How much each kind of bound admits: sizes of sets of Jacobians, side by side, and who accepts them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull

from luenberger.systems.embedding_weights import WeightedNorm
from luenberger.systems.nonlinearity import Nonlinearity
from luenberger.systems.system import System


@dataclass(frozen=True, eq=False)
class JacobianSets:
    """Sizes of the sets that hold df/dz, in the space of its varying entries.

    Args:
        varying: number of varying entries.
        volumes: kind of bound -> volume.
        radii: kind of bound -> largest |J - middle| (spectral norm).
        notes: kind of bound -> what describes it best.
    """

    varying: int
    volumes: dict[str, float]
    radii: dict[str, float]
    notes: dict[str, str]

    @staticmethod
    def of(box: Nonlinearity, hull: Nonlinearity | None) -> "JacobianSets":
        """Measure the sets of a nonlinearity.

        Args:
            box: with a Jacobian box.
            hull: the same with a hull, or None.
        """
        assert box.jacobian_lower is not None
        assert box.jacobian_upper is not None
        lower, upper = box.jacobian_lower, box.jacobian_upper
        varies = lower < upper
        tight = box if hull is None else hull
        plain, weighted = WeightedNorm.around(tight, weighted=False), WeightedNorm.around(tight)
        half = 0.5 * (upper - lower)
        volumes = {
            "lipschitz, plain": plain.volume(varies),
            "lipschitz, weighted": weighted.volume(varies),
            "box": float(np.prod((upper - lower)[varies])),
        }
        radii = {
            "lipschitz, plain": plain.radius,
            "lipschitz, weighted": weighted.radius,
            "box": float(np.linalg.norm(half, 2)),
        }
        scales = ", ".join(f"{x:.3g}" for x in [*weighted.rows, *weighted.columns])
        notes = {
            "lipschitz, plain": f"constant {plain.constant:.5g} about the middle",
            "lipschitz, weighted": f"constant {weighted.constant:.5g}, scales {scales}",
            "box": f"{2 ** int(varies.sum())} vertices",
        }
        if hull is not None and hull.jacobian_vertices is not None:
            V = hull.jacobian_vertices
            volumes["hull"] = _volume(V[:, varies])
            radii["hull"] = max(float(np.linalg.norm(J - 0.5 * (lower + upper), 2)) for J in V)
            notes["hull"] = f"{len(V)} vertices" + (
                ", flat: some slopes follow from others" if not volumes["hull"] else ""
            )
        return JacobianSets(int(varies.sum()), volumes, radii, notes)

    @property
    def least(self) -> str:
        """The kind of bound with the smallest volume; the first of equals, in the order box, hull, lipschitz."""
        order = sorted(self.volumes, key=lambda kind: ("box", "hull").index(kind) if kind in ("box", "hull") else 2)
        return min(order, key=lambda kind: self.volumes[kind] * (0.99 if kind == "box" else 1.0))


_ACCEPTED = {
    "lipschitz, plain": "LipschitzRiccati, LipschitzPareto, LipschitzDisturbance, StructuredLipschitz",
    "lipschitz, weighted": "StructuredLipschitz",
    "box": "PolytopicLuenberger, ExtendedLuenberger, TwoDofLuenberger, FullBlockLuenberger",
    "hull": "PolytopicLuenberger, ExtendedLuenberger, FullBlockLuenberger",
}


def _volume(points: np.ndarray) -> float:
    """Volume of the convex hull of points, zero where they are flat."""
    if points.shape[1] == 1:
        return float(np.ptp(points))
    if np.linalg.matrix_rank(points[1:] - points[0]) < points.shape[1]:
        return 0.0
    return float(ConvexHull(points).volume)


def channel_rows(plant: System) -> list[str]:
    """Return lines that say of every slope of the nonlinearity what is known of it.

    Args:
        plant: plant whose nonlinearity has a Jacobian box.
    """
    f = plant.nonlinearity
    assert f is not None
    assert f.jacobian_lower is not None
    assert f.jacobian_upper is not None
    names = [_argument_name(row, plant.states) for row in np.asarray(f.H)]
    F = np.asarray(plant.at("F"))
    rows: list[list[str]] = [["channel", "enters", "slope along", "from", "to", "kind"]]
    for k in range(f.size):
        enters = ", ".join(plant.states[i] for i in np.flatnonzero(F[:, k]))
        for j, state in enumerate(names):
            low, high = float(f.jacobian_lower[k, j]), float(f.jacobian_upper[k, j])
            if low < high:
                rows.append([f"f{k + 1}", enters, state, f"{low:.6g}", f"{high:.6g}", slope_kind(low, high)])
        if not (f.jacobian_lower[k] < f.jacobian_upper[k]).any():
            rows.append([f"f{k + 1}", enters, "-", "0", "0", "constant in the state"])
    return _aligned(rows)


def _argument_name(row: np.ndarray, states: Sequence[str]) -> str:
    terms = [(float(c), name) for c, name in zip(row, states, strict=True) if c]
    return (
        " ".join(f"{c:+.4g} {n}" for c, n in terms)
        .replace("+1 ", "+ ")
        .replace("-1 ", "- ")
        .removeprefix("+ ")
        .removeprefix("+")
    )


def slope_kind(lower: float, upper: float) -> str:
    """Return "constant", "increasing", "decreasing" or "sector" for a slope interval.

    Args:
        lower: least slope.
        upper: greatest slope.
    """
    if lower == upper:
        return "constant"
    return "increasing" if lower >= 0 else "decreasing" if upper <= 0 else "sector"


def set_rows(sets: JacobianSets, scheduled: str) -> list[str]:
    """Return lines that compare the sets.

    Args:
        sets: their sizes.
        scheduled: what is to be said of the scheduled form.
    """
    if not sets.varying:
        return ["No slope varies: the nonlinearity is known exactly and costs nothing.", f"polytopic: {scheduled}"]
    unit = sets.volumes["box"]
    rows: list[list[str]] = [["view", "volume", "of box", "radius", "bound", "accepted by"]]
    for kind, volume in sets.volumes.items():
        rows.append(
            [
                kind,
                f"{volume:.5g}",
                f"{volume / unit:.3f}",
                f"{sets.radii[kind]:.5g}",
                sets.notes[kind],
                _ACCEPTED[kind],
            ]
        )
    best = sets.least
    return [
        *_aligned(rows),
        f"polytopic: {scheduled}",
        f"Least conservative of the sets: {best} ({_ACCEPTED[best]}); volumes are in the {sets.varying} varying slopes.",
    ]


def _aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    return ["  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)).rstrip() for row in rows]
