"""Y. Wang, dissertation 2014, chapter 4: the interval observer for slip angles with unknown cornering stiffness, checked."""

from collections.abc import Callable, Iterator
from itertools import chain

from luenberger.experiment.published.row import Row, collected
from luenberger.experiment.published.wang_envelopes import envelope_rows
from luenberger.experiment.published.wang_interval_designs import interval_design_rows

SOURCE = "Y. Wang, Robust Gain-Scheduled Observer Design with Application to Vehicle State Estimation (dissertation), Auburn University, 2014, chapter 4"


def rows(progress: Callable[[Row], None] | None = None) -> list[Row]:
    """Recompute levels, envelopes and claims of the chapter; about a minute on two cores.

    Args:
        progress: called with each row as soon as it is known.

    Returns:
        rows in the order levels, envelopes, claims.
    """
    return collected(_all(), progress)


def _all() -> Iterator[Row]:
    return chain(interval_design_rows(), envelope_rows())
