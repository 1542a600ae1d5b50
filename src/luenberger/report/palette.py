"""One colour and one line style for each entrant, the same in every figure and table of a page."""

from collections.abc import Sequence
from dataclasses import dataclass

TRUTH = "#1a1a1a"
# Okabe and Ito's colours, told apart with every common colour vision, without black (truth) and yellow (too pale on white);
# then the darkest of Paul Tol's muted ones, which differ from those in lightness too.
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#332288", "#999933", "#882255", "#8a8a8a")
DASHES = ("solid", "dash", "dot", "dashdot")


@dataclass(frozen=True)
class Style:
    """How an entrant is drawn.

    Args:
        colour: "#rrggbb".
        dash: plotly's name of the line style.
    """

    colour: str
    dash: str


def styles(names: Sequence[str]) -> dict[str, Style]:
    """Return a style for each name, in order; when the colours run out the line style changes.

    Args:
        names: entrants in the order of the page.
    """
    return {
        name: Style(COLOURS[k % len(COLOURS)], DASHES[k // len(COLOURS) % len(DASHES)]) for k, name in enumerate(names)
    }


def faded(colour: str, strength: float) -> str:
    """Return a colour as plotly's "rgba(...)" text.

    Args:
        colour: "#rrggbb".
        strength: 0 invisible to 1 full.
    """
    red, green, blue = (int(colour[k : k + 2], 16) for k in (1, 3, 5))
    return f"rgba({red},{green},{blue},{strength:g})"
