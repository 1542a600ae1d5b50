"""Which observer inequality is least conservative: the claims of the literature put to one set of plants."""

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from luenberger.experiment.published.conservatism_entrants import ENTRANTS
from luenberger.experiment.published.conservatism_findings import (
    CHANNEL,
    COORDINATES,
    FULL,
    HULL,
    LUMPED,
    MIDDLE,
    MULTIPLIER,
    SAME,
    SECOND,
    SECTOR,
    VERTICES,
    counted,
    further,
    is_random,
    ratios,
    reach,
    sentences,
    shorter,
    strengths,
)
from luenberger.experiment.published.conservatism_plants import SOURCES, plant_names
from luenberger.experiment.published.conservatism_table import GAIN_LIMIT, Entry, rows_of
from luenberger.experiment.published.row import INDEPENDENT, Row, judged

SOURCE = (
    "Own comparison on published and random plants of: S. Raghavan, J. K. Hedrick 1994 and B. Song, J. K. Hedrick 2011 (Lipschitz constant), "
    "A. Zemouche, M. Boutayeb, G. I. Bara 2008 and G. Phanomchoeng, R. Rajamani 2010 (bounded Jacobian), M. Arcak, P. Kokotovic 2001 (second "
    "gain), Y. Wang 2014 (sector condition), C. W. Scherer 2001 (full-block multiplier)"
)
# Where theory says that the first admits whatever the second does, and where each stands in print.
CONTAINED = (
    (CHANNEL, LUMPED, "Song and Hedrick 2011, Theorem 3"),
    (CHANNEL, COORDINATES, "Song and Hedrick 2011, Theorem 3"),
    (VERTICES, CHANNEL, "Zemouche, Boutayeb and Bara 2008; Phanomchoeng and Rajamani 2010"),
    (VERTICES, MIDDLE, "Zemouche, Boutayeb and Bara 2008; Arcak and Kokotovic 2001"),
    (VERTICES, MULTIPLIER, "Zemouche, Boutayeb and Bara 2008; Acikmese and Corless 2011"),
    (HULL, VERTICES, "Wang 2014, section 5.2"),
    (SECOND, MULTIPLIER, "Arcak and Kokotovic 2001; Wang 2014, (5.3)"),
)


def rows(progress: Callable[[Row], None] | None = None) -> list[Row]:
    """Compute the comparison and return the strengths plant by plant, then what follows; some minutes on two cores.

    Args:
        progress: called with each row as soon as it is known, and with one for each random plant, which is not returned.

    Returns:
        one row for each published plant, what follows from all, and the finding.
    """
    found: list[Entry] = []
    made: list[Row] = []

    def told(row: Row, *, kept: bool = True) -> None:
        if kept:
            made.append(row)
        if progress is not None:
            progress(row)

    for entries in rows_of(plant_names()):
        found += entries
        told(plant_row(entries), kept=not is_random(entries[0]))
    for row in conclusions(found):
        told(row)
    return made


def conclusions(entries: Sequence[Entry]) -> Iterator[Row]:
    """Yield the rows about all plants together.

    Args:
        entries: of the comparison.
    """
    for better, other, where in CONTAINED:
        yield _containment(entries, better, other, where)
    yield _equality(entries)
    yield _fixed_multiplier(entries)
    yield _slip_limits(entries)
    yield _finding(entries)


def _containment(entries: Sequence[Entry], better: str, other: str, where: str) -> Row:
    values = ratios(entries, better, other)
    won, lost = counted(values, further), int(shorter(values).sum())
    return judged(
        f"{better} over {other}",
        where,
        "at least as strong a nonlinearity",
        f"stronger on {won} plants, weaker on {lost}; ratio {_spread(values)}",
        f"Ratios within {100 * SAME:g} % count as equal; the gain limit and the end of the search bound them.",
        reproduced=values.size > 0 and lost == 0,
        corrected=lost > 0,
    )


def _equality(entries: Sequence[Entry]) -> Row:
    values = ratios(entries, FULL, VERTICES)
    return judged(
        f"{FULL} over {VERTICES}",
        "Scherer 2001; Wang 2014, Lemma 17",
        "the same",
        f"ratio {_spread(values)} on {len(values)} plants",
        "With a free multiplier both decide the same problem; what differs is the last step of the search.",
        reproduced=values.size > 0 and bool(np.all(np.abs(values - 1) <= SAME)),
        corrected=True,
    )


def _fixed_multiplier(entries: Sequence[Entry]) -> Row:
    values = ratios(entries, SECOND, SECTOR)
    won, lost = counted(values, further), int(shorter(values).sum())
    return judged(
        f"{SECOND} over {SECTOR}",
        "Wang 2014, remarks 4 and 5",
        "the fixed multiplier is less conservative",
        f"the free ones are stronger on {won} plants that both accept, weaker on {lost}; ratio {_spread(values)}",
        "The free multipliers contain the fixed one; the gain limit may still cut off one form earlier, since neither minimises |L| itself. "
        "Where a row of the Jacobian varies in two entries the printed condition is false and accepts no plant.",
        reproduced=values.size > 0 and not np.any(further(values)),
        corrected=bool(np.any(further(values))),
    )


def _spread(values: np.ndarray) -> str:
    if not values.size:
        return "unknown"
    return f"{values.min():.3g} to {values.max():.3g}, median {np.median(values):.3g}"


def _slip_limits(entries: Sequence[Entry]) -> Row:
    """The two strengths of the slip-angle plant that are known otherwise."""
    name = "slip angles"
    found = {m: strengths(entries, m).get(name, 0.0) for m in (VERTICES, MULTIPLIER)}
    known = {VERTICES: 0.9498, MULTIPLIER: 0.693}
    return judged(
        "slip angles: largest part of the stiffness that may be lost",
        f"section 5.4, {INDEPENDENT}",
        ", ".join(f"{v:g} ({m})" for m, v in known.items()),
        ", ".join(f"{v:.4f} ({m})" for m, v in found.items()),
        "The limit of the vertices is that of the plant: beyond it a mode that no output shows is unstable.",
        reproduced=all((1 - SAME) * known[m] <= found[m] <= known[m] * 1.001 for m in known),
        deviation=max(abs(found[m] - known[m]) for m in known),
    )


def plant_row(entries: Sequence[Entry]) -> Row:
    """Return all strengths on one plant, and whether they stand in the order that theory demands.

    Args:
        entries: of that plant.
    """
    name = entries[0].plant
    value = {e.method: e.proved or 0.0 for e in entries if e.status != "not accepted"}
    order = [(other, better) for better, other, _ in CONTAINED]
    broken = [f"{a} above {b}" for a, b in order if a in value and b in value and value[a] > (1 + SAME) * value[b]]
    short = {e.name: e.short for e in ENTRANTS}
    gains = ", ".join(f"{short[e.method]} {e.gain:.3g}" for e in entries if e.gain is not None)
    strength = next((e.strength for e in entries if e.strength is not None), None)
    return judged(
        f"{name}: largest strength with a proof",
        SOURCES.get(name, "drawn here"),
        "Riccati <= channel <= vertices <= hull, multipliers <= vertices and second gain",
        ", ".join(f"{short[e.method]} {reach(e)}" for e in entries if e.status != "not accepted"),
        (f"Gains at strength {strength:.3g}: {gains}." if gains else "No design is proved at the nominal strength.")
        + (f" Out of order: {'; '.join(broken)}." if broken else ""),
        reproduced=not broken,
    )


def _finding(entries: Sequence[Entry]) -> Row:
    drawn = len({e.plant for e in entries if is_random(e)})
    return judged(
        "which inequality is least conservative",
        f"{len({e.plant for e in entries}) - drawn} published and {drawn} random plants, |L| <= {GAIN_LIMIT:g}",
        "disputed",
        f"{VERTICES}, or {SECOND}",
        " ".join(sentences(entries)),
        reproduced=False,
        corrected=True,
    )
