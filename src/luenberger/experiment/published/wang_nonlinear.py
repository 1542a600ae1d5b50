"""Y. Wang, dissertation 2014, chapter 5: observers of plants with bounded Jacobians, checked."""

from collections.abc import Callable, Iterator
from itertools import chain

from luenberger.experiment.published.row import Row, collected
from luenberger.experiment.published.wang_fishhook import fishhook_rows
from luenberger.experiment.published.wang_nonlinear_car import car_rows
from luenberger.experiment.published.wang_nonlinear_gains import gain_rows
from luenberger.experiment.published.wang_nonlinear_oscillator import oscillator_rows
from luenberger.experiment.published.wang_nonlinear_printed import printed_rows
from luenberger.experiment.published.wang_nonlinear_sector import sector_rows
from luenberger.experiment.published.wang_nonlinear_slip import slip_rows
from luenberger.experiment.published.wang_nonlinear_text import text_rows

SOURCE = "Y. Wang, Robust Gain-Scheduled Observer Design with Application to Vehicle State Estimation (dissertation), Auburn University, 2014, chapter 5"


def rows(progress: Callable[[Row], None] | None = None) -> list[Row]:
    """Recompute lemmas, theorems, examples and figures of the chapter; about two minutes on two cores.

    Args:
        progress: called with each row as soon as it is known.

    Returns:
        rows in the order sector lemma, equations, oscillator, its gains, car, printed gains, slip designs, fishhook.
    """
    return collected(_all(), progress)


def _all() -> Iterator[Row]:
    return chain(
        sector_rows(),
        text_rows(),
        oscillator_rows(),
        gain_rows(),
        car_rows(),
        printed_rows(),
        slip_rows(),
        fishhook_rows(),
    )
