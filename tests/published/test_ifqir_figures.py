"""The page says what it shows, and its bands hold what is drawn inside them."""

from pathlib import Path

import numpy as np
import pytest

from luenberger.experiment.published import ifqir_figures
from luenberger.experiment.published.ifqir import SOURCE
from luenberger.experiment.published.ifqir_figures import (
    CORRECTED,
    NARROW,
    PRINTED,
    drive_figures,
    error_figures,
    width_figure,
    write_page,
)
from luenberger.experiment.published.ifqir_runs import VARIANTS, variant_enclosure


def test_the_page_holds_all_figures(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # Five recursions are enough to see that all are drawn; those of a wrong steering angle are run where their widths are tested.
    monkeypatch.setattr(ifqir_figures, "INPUT_ERROR", 1e-12)
    monkeypatch.setattr(ifqir_figures, "variant_enclosure", lambda name, error=0.0: variant_enclosure(name))
    text = write_page(tmp_path / "page.html").read_text(encoding="utf-8")
    for words in (
        "Figs. 1 and 2",
        "Fig. 3",
        "Fig. 4",
        "Fig. 5",
        "How wide each recursion is",
        SOURCE,
        "left on none of them",
    ):
        assert words in text


def test_errors_lie_inside_corrected_bounds_and_leave_the_printed_ones() -> None:
    calm, noisy = error_figures()
    for figure, leaves in ((calm, False), (noisy, True)):
        # First panel: the error, then a lower and an upper edge of every recursion, in one order.
        lines = [t for t in figure.plot.data if t.yaxis in (None, "y")]
        error = np.asarray(next(t for t in lines if t.name == "error").y)
        for name in (PRINTED, CORRECTED, NARROW):
            lower, upper = (np.asarray(t.y) for t in lines if t.name == name)
            # Drawn in single precision.
            outside = bool((error < lower - 1e-6).any() or (error > upper + 1e-6).any())
            assert outside == (leaves and name == PRINTED), (figure.title, name)


def test_modes_and_widths_are_drawn() -> None:
    (figure,) = drive_figures()
    mode = next(t for t in figure.plot.data if t.name == "mode")
    assert set(np.asarray(mode.y)) == {1.0, 2.0, 3.0}
    bars = width_figure({0.0: dict.fromkeys(VARIANTS, 1.0), 0.01: dict.fromkeys(VARIANTS, 2.0)})
    assert [len(t.x) for t in bars.plot.data] == [5, 5]
    assert np.asarray(bars.plot.data[1].x) == pytest.approx(2.0)
