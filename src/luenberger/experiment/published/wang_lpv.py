"""Y. Wang, dissertation 2014, chapters 2 and 3: slip-angle observers scheduled by speed and acceleration, checked."""

from collections.abc import Callable, Iterator
from itertools import chain

from luenberger.experiment.published.row import Row, collected
from luenberger.experiment.published.wang_designs import design_rows
from luenberger.experiment.published.wang_estimates import estimate_rows
from luenberger.experiment.published.wang_filters import filter_rows
from luenberger.experiment.published.wang_preliminaries import preliminary_rows
from luenberger.experiment.published.wang_storage import storage_rows

SOURCE = "Y. Wang, Robust Gain-Scheduled Observer Design with Application to Vehicle State Estimation (dissertation), Auburn University, 2014, chapters 2 and 3"


def rows(progress: Callable[[Row], None] | None = None) -> list[Row]:
    """Recompute designs, figures and claims of the chapter; about a minute on two cores.

    Args:
        progress: called with each row as soon as it is known.

    Returns:
        rows in the order preliminaries, designs, estimates and claims, filters, moving storages.
    """
    return collected(_all(), progress)


def _all() -> Iterator[Row]:
    return chain(preliminary_rows(), design_rows(), estimate_rows(), filter_rows(), storage_rows())
