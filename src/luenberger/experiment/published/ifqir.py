"""S. Ifqir et al., set-membership switched observers, IFAC 2020: every printed number and claim, checked."""

from collections.abc import Callable, Iterator
from itertools import chain

from luenberger.experiment.published.ifqir_claims import claim_rows
from luenberger.experiment.published.ifqir_continuous import continuous_rows
from luenberger.experiment.published.ifqir_crossover import crossover_rows
from luenberger.experiment.published.ifqir_example import example_rows
from luenberger.experiment.published.ifqir_observer import observer_rows
from luenberger.experiment.published.ifqir_preliminaries import preliminary_rows
from luenberger.experiment.published.ifqir_recursion import recursion_rows
from luenberger.experiment.published.ifqir_sets import set_rows
from luenberger.experiment.published.ifqir_storages import storage_rows
from luenberger.experiment.published.ifqir_theorem import theorem_rows
from luenberger.experiment.published.ifqir_widths import width_rows
from luenberger.experiment.published.row import Row, collected

SOURCE = (
    "S. Ifqir, V. Puig, D. Ichalal, N. Ait-Oufroukh, S. Mammar, Set-membership Switched Observers based on Interval Characterization "
    "of the Estimation Error, 21st IFAC World Congress, Berlin 2020, 14261-14266"
)


def rows(progress: Callable[[Row], None] | None = None) -> list[Row]:
    """Recompute every number and claim of the paper and say what became of it; about two minutes on one core.

    Args:
        progress: called with each row as soon as it is known.

    Returns:
        rows in the order preliminaries, observer, theorem, recursion, sets, example, claims, storages, widths, continuous time, crossover.
    """
    return collected(_all(), progress)


def _all() -> Iterator[Row]:
    return chain(
        preliminary_rows(),
        observer_rows(),
        theorem_rows(),
        recursion_rows(),
        set_rows(),
        example_rows(),
        claim_rows(),
        storage_rows(),
        width_rows(),
        continuous_rows(),
        crossover_rows(),
    )
