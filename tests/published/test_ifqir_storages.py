"""The library's own Theorem 1 on the printed car, and what it refuses."""

from luenberger.experiment.published.ifqir_storages import certified, design_rows, random_plant, steady_width
from luenberger.experiment.published.row import Verdict


def test_verdicts_and_numbers() -> None:
    rows = list(design_rows())
    R, C = Verdict.REPRODUCED, Verdict.CORRECTED
    assert [(row.item, row.verdict) for row in rows] == [
        (row.item, verdict) for row, verdict in zip(rows, [R, R, R, C, C, C, C], strict=True)
    ]
    told = [row.ours for row in rows]
    assert "2.47274" in told[0]
    assert "iss proved, containment proved; c = 2.22385" in told[1]
    assert told[2] == "2.2012 at epsilon = 0.4543"
    assert "Rank error" in told[4]
    assert "unstable zero z = -8.65" in told[6]


def test_gains_are_one_for_each_mode() -> None:
    assert len(certified().gains) == len(certified().system.modes) == 3


def test_the_steady_width_depends_on_how_noise_is_counted() -> None:
    plant = random_plant(3, modes=1).first
    # Other gains, other widths; a third less on this plant.
    assert steady_width(plant, "physical") < 0.9 * steady_width(plant, "lumped")
