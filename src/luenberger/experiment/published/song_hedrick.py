"""B. Song, J. K. Hedrick, Nonlinear Observer Design for Lipschitz Nonlinear Systems, ACC 2011: every printed item, checked."""

from collections.abc import Callable, Iterator
from itertools import chain

from luenberger.experiment.published.row import Row, collected
from luenberger.experiment.published.song_hedrick_figures import figure_rows
from luenberger.experiment.published.song_hedrick_gains import gain_rows
from luenberger.experiment.published.song_hedrick_margins import margin_rows
from luenberger.experiment.published.song_hedrick_text import text_rows

SOURCE = "B. Song, J. K. Hedrick, Nonlinear Observer Design for Lipschitz Nonlinear Systems, American Control Conference 2011"


def rows(progress: Callable[[Row], None] | None = None) -> list[Row]:
    """Recompute every number and claim of the paper and say what became of it; some seconds on one core.

    Args:
        progress: called with each row as soon as it is known.

    Returns:
        rows in the order margins, gains, figures, errata.
    """
    return collected(_all(), progress)


def _all() -> Iterator[Row]:
    return chain(margin_rows(), gain_rows(), figure_rows(), text_rows())
