"""The switched study orders the recursions and keeps its guarantees."""

from itertools import pairwise
from pathlib import Path

import pandas as pd

from experiment.gust_files import written
from luenberger.design import SwitchedDesign
from luenberger.experiment import run_gust
from luenberger.experiment.gust_runs import VARIANTS


def test_the_switched_study_orders_the_recursions_and_keeps_its_guarantees(tmp_path: Path) -> None:
    heard: list[float] = []
    report = run_gust(written(tmp_path, "switched"), tmp_path, lambda _, share: heard.append(share))
    assert heard == sorted(heard)
    assert heard[-1] == 1.0
    rows = {row[0].split(":")[0]: row for row in report.table.rows}
    widths = [rows[name][1] for name in VARIANTS]
    assert all(a > b for a, b in pairwise(widths))
    assert all(rows[name][2] == 0 for name in [*VARIANTS, "gust bounded"])
    # Three standard deviations promise nothing, and adversaries take what is not promised.
    assert rows["Kalman filter"][2] > 0
    assert {row[5] for row in report.table.rows} == {"certificate", "recursion", "nothing"}
    assert rows["c4"][5] == "certificate"
    names = {f.name for f in report.files}
    assert {"numbers.csv", "report.html", "a_storage_for_each_mode.json"} <= names
    design = SwitchedDesign.load(next(f for f in report.files if f.name.startswith("c4")))
    assert [p.outcome.value for p in design.certify().proofs] == ["proved"] * 4
    numbers = pd.read_csv(next(f for f in report.files if f.suffix == ".csv"))
    names = [*(f"c4: state bounded by the estimate {end}" for end in ("lower", "upper")), "lateral_speed"]
    lower, upper, truth = numbers[names].to_numpy().T
    assert bool(((lower <= truth + 1e-8) & (truth <= upper + 1e-8)).all())
