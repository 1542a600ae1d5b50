"""What the comparison says: ratios between designs, counts, and the sentences that follow from them."""

from collections.abc import Callable, Sequence

import numpy as np

from luenberger.experiment.published.conservatism_table import HIGHEST, Entry

LUMPED, COORDINATES = "Lipschitz constant, Riccati, states as they are", "Lipschitz constant, Riccati, good coordinates"
CHANNEL = "Lipschitz constant in its channel"
MIDDLE = "Lipschitz constant in its channel, about the middle slope"
SECTOR, MULTIPLIER = "printed sector condition with second gain", "multiplier a channel"
VERTICES, FULL = "vertices of the Jacobian box", "full-block multiplier"
HULL, SECOND = "vertices of the proved Jacobian hull", "multiplier a channel with second gain"
# Two ends of the search a step apart each, and the percent that a design keeps for its margin.
SAME = 0.025


def strengths(entries: Sequence[Entry], method: str) -> dict[str, float]:
    """Return plant -> largest proved strength of one design, zero where none was found, plants it does not accept left out.

    Args:
        entries: of the comparison.
        method: name of the design.
    """
    return {e.plant: e.proved or 0.0 for e in entries if e.method == method and e.status != "not accepted"}


def ratios(entries: Sequence[Entry], method: str, beside: str) -> np.ndarray:
    """Return strengths of one design over those of another, on the plants where both run and the other finds something.

    Args:
        entries: of the comparison.
        method: name of the design above the line.
        beside: name of the design below the line.
    """
    ours, theirs = strengths(entries, method), strengths(entries, beside)
    return np.array([ours[p] / theirs[p] for p in ours if theirs.get(p)])


def shares(entries: Sequence[Entry]) -> dict[str, dict[str, float]]:
    """Return method -> plant -> strength over the largest that any design proves on that plant.

    Args:
        entries: of the comparison.
    """
    best: dict[str, float] = {}
    for e in entries:
        best[e.plant] = max(best.get(e.plant, 0.0), e.proved or 0.0)
    found: dict[str, dict[str, float]] = {}
    for e in entries:
        if e.status != "not accepted" and best[e.plant] > 0:
            found.setdefault(e.method, {})[e.plant] = (e.proved or 0.0) / best[e.plant]
    return found


def costs(entries: Sequence[Entry], method: str) -> tuple[float, float]:
    """Return the medians of solver time [s] and number of unknowns of a design; not a number where it never succeeds.

    Args:
        entries: of the comparison.
        method: name of the design.
    """
    mine = [e for e in entries if e.method == method and e.seconds is not None and e.unknowns is not None]
    if not mine:
        return float("nan"), float("nan")
    return float(np.median([e.seconds or 0.0 for e in mine])), float(np.median([e.unknowns or 0 for e in mine]))


def is_random(entry: Entry) -> bool:
    """Return whether an entry belongs to a drawn plant.

    Args:
        entry: of the comparison.
    """
    return entry.plant.startswith("random ")


def counted(values: np.ndarray, holds: Callable[[np.ndarray], np.ndarray]) -> str:
    """Return "3 of 50" for how many values meet a condition.

    Args:
        values: one a plant.
        holds: elementwise condition.
    """
    return f"{int(np.sum(holds(values)))} of {len(values)}"


def further(values: np.ndarray) -> np.ndarray:
    """Return which ratios exceed one by more than the search can miss.

    Args:
        values: ratios.
    """
    return values > 1 + SAME


def shorter(values: np.ndarray) -> np.ndarray:
    """Return which ratios fall short of one by more than the search can miss.

    Args:
        values: ratios.
    """
    return values < 1 - SAME


def percent(value: float) -> str:
    """Return a share as people read it.

    Args:
        value: share of one.
    """
    return f"{100 * value:.0f} %"


def sentences(entries: Sequence[Entry]) -> list[str]:
    """Return the finding in three sentences, numbers from the entries.

    Args:
        entries: of the comparison.
    """
    drawn = [e for e in entries if is_random(e)] or list(entries)
    named = [e for e in entries if not is_random(e)]
    part = {m: list(p.values()) for m, p in shares(drawn).items()}
    middle = {m: percent(float(np.median(v))) for m, v in part.items()}
    gained, lost = ratios(drawn, SECOND, VERTICES), ratios(drawn, MULTIPLIER, VERTICES)
    hull = ratios(named, HULL, VERTICES)
    seconds = {m: 1e3 * costs(entries, m)[0] for m in (CHANNEL, VERTICES, FULL, SECOND)}
    size = {m: costs(entries, m)[1] for m in (CHANNEL, VERTICES, FULL, SECOND)}
    return [
        f"With one gain, the vertices of the Jacobian set admit most, and a full-block multiplier admits the same; a multiplier a channel "
        f"falls short of them on {counted(lost, shorter)} drawn plants, and a hull in place of the box admits up to "
        f"{float(hull.max()) if hull.size else 1.0:.2g} times as much.",
        f"A second gain in the argument of the nonlinearity goes further than the vertices on {counted(gained, further)} drawn plants and "
        f"less far on {counted(gained, shorter)}; {_exceptions(named)}.",
        f"Of the best strength found, half of the drawn plants leave the Lipschitz constant at most {middle.get(LUMPED, '-')} in the Riccati "
        f"form, {middle.get(COORDINATES, '-')} in good coordinates, {middle.get(CHANNEL, '-')} in its channel and {middle.get(MIDDLE, '-')} "
        f"about the middle slope, where the vertices reach {middle.get(VERTICES, '-')}.",
        "In the median a solve takes "
        + ", ".join(
            f"{seconds[m]:.1f} ms with {size[m]:.0f} unknowns ({word})"
            for m, word in ((CHANNEL, "channel"), (VERTICES, "vertices"), (FULL, "full block"), (SECOND, "second gain"))
        )
        + ": cost decides nothing at this size.",
    ]


def _exceptions(named: Sequence[Entry]) -> str:
    """On which published plants one gain goes further than two."""
    two, one = strengths(named, SECOND), strengths(named, VERTICES)
    tight = strengths(named, HULL)
    found = [p for p, v in two.items() if max(one.get(p, 0.0), tight.get(p, 0.0)) > (1 + SAME) * v]
    if not found:
        return "no published plant has it the other way round"
    return f"vertices of box or hull go further on {', '.join(found)}, so neither contains the other"


def reach(entry: Entry) -> str:
    """Return an entry as text: 3.37, at least 100, none, undecided above 0.2, or a dash where it is not accepted.

    Args:
        entry: of the comparison.
    """
    if entry.status == "not accepted":
        return "-"
    if entry.proved is None:
        return "undecided" if entry.status == "undecided" else "none"
    if entry.refused is None and entry.proved >= 0.999 * 10.0**HIGHEST:
        return f">= {entry.proved:.3g}"
    return f"{entry.proved:.3g}{'?' if entry.status == 'undecided' else ''}"
