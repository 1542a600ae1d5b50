"""The figures drawn again: what they show and what they say."""

from pathlib import Path

import numpy as np
import pytest

from luenberger.experiment.published import wang_figures
from luenberger.experiment.published.wang_figures import (
    CERTIFIED,
    NOMINAL,
    PRINTED,
    envelope_figures,
    error_table,
    write_page,
)


def test_bands_hold_the_truth_which_the_nominal_observer_leaves() -> None:
    for figure in envelope_figures():
        assert set(figure.colours) == {NOMINAL, CERTIFIED, PRINTED}
        traces = {trace.name: trace for trace in figure.plot.data if trace.name and trace.showlegend is not False}
        assert {"single track", NOMINAL} <= set(traces)
        time, truth = (np.asarray(traces["single track"][k], np.float64) for k in ("x", "y"))
        nominal = np.interp(time, traces[NOMINAL].x, traces[NOMINAL].y)
        there = (time >= 1.5) & (time < 4.5)
        # Degrees; ten times as far on the second lane as on the first.
        assert np.abs(nominal - truth)[there].max() > 10 * np.abs(nominal - truth)[time < 1.45].max()


def test_the_page_says_what_it_shows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(wang_figures, "envelope_figures", lambda: ())
    text = write_page(tmp_path / "page.html").read_text(encoding="utf-8")
    for words in ("Figs. 3.14 to 3.17: rear slip angle", "Auburn University", "no correction"):
        assert words in text


def test_errors_are_whole_microradians() -> None:
    table = error_table()
    assert len(table.columns) == 7
    none = next(row for row in table.rows if row[0] == "no correction")
    assert none[1:] == [3, 4, 339, 312, 852, 784]
