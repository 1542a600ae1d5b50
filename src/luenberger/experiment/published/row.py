"""One line of the comparison of a published paper with this library."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import Enum

import numpy as np

# Where a number stands that no paper prints.
INDEPENDENT = "independent implementation"


class Verdict(Enum):
    """What became of a printed number or claim. `value` is the word for tables."""

    REPRODUCED = "reproduced"
    BETTERED = "bettered"
    CORRECTED = "corrected"
    NOT_REPRODUCIBLE = "not reproducible"

    @property
    def sentence(self) -> str:
        """What this verdict means, in one sentence."""
        return {
            Verdict.REPRODUCED: "The printed number or claim was obtained here from the printed data.",
            Verdict.BETTERED: "Ours is better than the print in every number compared, so the print itself was not obtained.",
            Verdict.CORRECTED: "The print does not hold as it stands; the reason says what holds instead and how that is known.",
            Verdict.NOT_REPRODUCIBLE: "The print cannot be checked or obtained; the reason says why.",
        }[self]


@dataclass(frozen=True)
class Row:
    """One printed item beside our own.

    Args:
        item: what is compared.
        equation: where it stands in the paper.
        printed: what is printed, "-" where nothing is.
        ours: what was computed here.
        verdict: how the two compare.
        reason: why, with the kind of evidence.
        deviation: largest absolute difference in the printed unit, None where nothing numeric is compared.
    """

    item: str
    equation: str
    printed: str
    ours: str
    verdict: Verdict
    reason: str
    deviation: float | None = None


def judged(
    item: str,
    equation: str,
    printed: str,
    ours: str,
    reason: str,
    *,
    reproduced: bool | np.bool_,
    bettered: bool | np.bool_ = False,
    corrected: bool | np.bool_ = False,
    deviation: float | None = None,
) -> Row:
    """Return a row whose verdict follows from what was computed.

    Args:
        item: what is compared.
        equation: where it stands in the paper.
        printed: what is printed.
        ours: what was computed here.
        reason: why, with the kind of evidence.
        reproduced: the print holds here.
        bettered: it does not, and ours is at least as good in every number and better in one.
        corrected: it does not, and what holds instead was shown.
        deviation: largest absolute difference, where numbers are compared.
    """
    facts = {Verdict.REPRODUCED: reproduced, Verdict.BETTERED: bettered, Verdict.CORRECTED: corrected}
    verdict = next((v for v, holds in facts.items() if holds), Verdict.NOT_REPRODUCIBLE)
    return Row(item, equation, printed, ours, verdict, reason, deviation)


def collected(rows: Iterable[Row], progress: Callable[[Row], None] | None = None) -> list[Row]:
    """Return all rows, telling each as soon as it is known.

    Args:
        rows: made one by one.
        progress: called with each row.
    """
    found: list[Row] = []
    for row in rows:
        found.append(row)
        if progress is not None:
            progress(row)
    return found


def compared(item: str, equation: str, expected: float, ours: float, reason: str) -> Row:
    """Return the row of a number that the print lacks, beside that of an independent implementation, to half a percent.

    Args:
        item: what is compared.
        equation: where it would stand in the paper.
        expected: what the independent implementation has.
        ours: what was computed here.
        reason: why, with the kind of evidence.
    """
    return judged(
        item,
        f"{equation}, {INDEPENDENT}",
        f"{expected:g}",
        f"{ours:.5f}",
        f"{reason} Beside stands an independent implementation.",
        reproduced=abs(ours - expected) <= 0.005 * expected,
        deviation=abs(ours - expected),
    )
