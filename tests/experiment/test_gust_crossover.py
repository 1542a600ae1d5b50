"""Bounding the gust costs more the larger the bound, decoupling it does not; the command says so."""

import json
from pathlib import Path

import numpy as np
import pytest

from experiment.gust_files import written
from luenberger.cli import main
from luenberger.experiment.gust_crossover import crossing


def test_the_crossover_rises_with_the_bound_and_decoupling_does_not(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = written(tmp_path, "crossover", bounds=(50.0, 500.0, 5000.0))
    with pytest.raises(SystemExit) as stopped:
        main(["run", str(path), "--out", str(tmp_path), "--json", "--quiet"])
    assert not stopped.value.code
    report = json.loads(capsys.readouterr().out)
    assert all(Path(f).is_file() for f in report["files"])
    (widths,), scores = (table["rows"] for table in report["assumptions"]), report["table"]["rows"]
    decoupled, bounded, predictor = (
        np.array([row[n] for row in widths]) for n in ("decoupled", "bounded", "bounded, predictor")
    )
    assert widths[0]["narrowest"] == "bounded"
    assert [row["runs left"] for row in scores] == [0, 0, 0]
    # The gust moves the car, and with it what the stiffness can do; not more.
    assert np.ptp(decoupled) < 0.05 * decoupled[0]
    assert (np.diff(predictor) > 0).all()
    assert bounded[0] < 0.5 * decoupled[0]
    assert predictor[-1] > decoupled[-1]
    assert "No bound was left on any run." in report["summary"]
    assert "bound it; else decouple" in report["summary"]
    crossings = {row["entrant"]: row["crosses at [N]"] for row in scores}
    assert crossings["decoupled"] is None
    assert 50 < crossings["bounded, predictor"] < 5000


def test_a_crossing_is_found_between_two_bounds() -> None:
    # In the middle of the widths, and so of the logarithms.
    assert crossing((10.0, 1000.0), [1.0, 3.0], 2.0) == pytest.approx(100.0)
    assert crossing((10.0, 1000.0), [1.0, 1.5], 2.0) is None
    assert crossing((10.0, 1000.0), [2.5, 3.0], 2.0) is None
