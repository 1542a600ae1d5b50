"""A guarantee on a car that the plant does not know breaks, and holds again once the mismatch is covered."""

from pathlib import Path

from experiment.gust_files import written
from luenberger.experiment import run_gust


def test_on_the_double_track_the_mismatch_is_what_has_to_be_covered(tmp_path: Path) -> None:
    slippery = {
        "sample_time": 0.02,
        "samples": 300,
        "steering": 0.06,
        "steering_period": 3.0,
        "friction": 0.4,
        "fade": 0.2,
        "state_bound": (),
    }
    report = run_gust(written(tmp_path, "double_track", **slippery), tmp_path)
    left = dict(zip(report.table.column("entrant"), report.table.column("runs left"), strict=True))
    assert left["decoupled, as stated"] > 0
    assert left["decoupled, mismatch covered"] == 0
    # What looks like gust is decoupled with it; who bounds the gust has to bound that too.
    assert left["gust bounded"] > 0
    assert left["gust bounded, mismatch covered"] == 0
    assert "a proof about a plant says nothing about another car" in report.summary
