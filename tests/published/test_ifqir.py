"""What the rows say about Ifqir et al. 2020: verdicts and numbers of everything that is quick to compute."""

from collections import Counter
from collections.abc import Callable, Iterator

import pytest

from luenberger.experiment.published.ifqir_example import example_rows
from luenberger.experiment.published.ifqir_observer import observer_rows
from luenberger.experiment.published.ifqir_preliminaries import preliminary_rows
from luenberger.experiment.published.ifqir_recursion import recursion_rows
from luenberger.experiment.published.ifqir_sets import (
    METHODS,
    box_hull,
    exact_hull,
    reduced_hull,
    sequence,
)
from luenberger.experiment.published.ifqir_theorem import scalar_gamma, theorem_rows, ultimate_bound
from luenberger.experiment.published.row import Row, Verdict

R, C, N = Verdict.REPRODUCED, Verdict.CORRECTED, Verdict.NOT_REPRODUCIBLE
Group = Callable[[], Iterator[Row]]
# One letter a row, in order.
VERDICTS: dict[Group, list[Verdict]] = {
    preliminary_rows: [R, C, C, C, R, R],
    observer_rows: [R, C, C, C, C, C, C],
    theorem_rows: [R, C, C, C, C, C, C],
    recursion_rows: [C, C, C, N, R, R, R],
    example_rows: [C, C, C, N, C, R, C, C, N, N, C, C, N, R],
}


@pytest.fixture(scope="module")
def found() -> dict[Group, list[Row]]:
    return {group: list(group()) for group in VERDICTS}


@pytest.mark.parametrize("group", list(VERDICTS), ids=lambda group: group.__name__)
def test_verdicts(found: dict[Group, list[Row]], group: Group) -> None:
    assert [(row.item, row.verdict) for row in found[group]] == [
        (row.item, verdict) for row, verdict in zip(found[group], VERDICTS[group], strict=True)
    ]


def test_every_row_says_why(found: dict[Group, list[Row]]) -> None:
    rows = [row for group in found.values() for row in group]
    assert all(row.reason and row.printed and row.ours and row.equation for row in rows)
    assert max(Counter((row.item, row.equation) for row in rows).values()) == 1


def test_numbers_that_the_rows_tell(found: dict[Group, list[Row]]) -> None:
    told = {row.item: row.ours for group in found.values() for row in group}
    assert "-8.65, -5.05, -3.54" in told["Sample time"]
    assert "5.76" in told["The car itself at that sample time"]
    assert "2.47274 at Ts = 0.06 s" in told["Attenuation level"]
    assert "alpha = 0.00485" in told["Attenuation level"]
    assert "V0 = 6" in told["Switching law"]
    assert "2.4086 at 0.3000, 2.2012 at 0.4543" in told["Choice of epsilon"]
    assert "0.0387 to 0.1062 s; 0.006 s infeasible, 0.06 s feasible" in told["Sample times that epsilon = 0.5 allows"]


def test_the_ultimate_bound_is_attained() -> None:
    gamma = scalar_gamma(0.8, 0.2)
    # 1 / (1 - z) in exact arithmetic; a few roundings.
    assert ultimate_bound(gamma, 0.2) == pytest.approx(1 / (1 - 0.8), rel=1e-12)
    assert (gamma / 0.8) ** 0.5 == pytest.approx(2.5, rel=1e-12)


def test_zonotopes_stay_where_boxes_grow() -> None:
    N = sequence("turning by 30 degrees")
    # Four decimals are known of the hull, one digit of the box.
    assert exact_hull(N)[0] == pytest.approx(2.4606, abs=5e-5)
    assert box_hull(N)[0] == pytest.approx(7e10, rel=0.05)
    assert (reduced_hull(N, 6, METHODS["Girard"]) / exact_hull(N)).max() < 1.001
    # A reduced set holds the exact one.
    assert (reduced_hull(N, 6, METHODS["Combastel"]) >= exact_hull(N) - 1e-12).all()
