"""The three answers a proof can have, each with its sentence."""

from enum import Enum


class Outcome(Enum):
    """Answer of a rigorous check. `value` is the word stored in files, `sentence` is for people."""

    PROVED = "proved"
    REFUTED = "refuted"
    UNDECIDED = "undecided"

    @property
    def sentence(self) -> str:
        """What this outcome means, in one sentence."""
        return {
            Outcome.PROVED: "The claim holds everywhere on the stated set.",
            Outcome.REFUTED: "The claim fails; a point where it fails is named.",
            Outcome.UNDECIDED: "The claim was neither proved nor refuted within the allowed effort.",
        }[self]

    def __and__(self, other: "Outcome") -> "Outcome":
        """The outcome of both claims together: refuted beats undecided beats proved."""
        order = (Outcome.REFUTED, Outcome.UNDECIDED, Outcome.PROVED)
        return min(self, other, key=order.index)
