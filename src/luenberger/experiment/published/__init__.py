"""Published papers row by row: printed, ours, verdict."""

from collections.abc import Callable, Mapping
from pathlib import Path

from luenberger.experiment.published import (
    conservatism_figure,
    guaranteed_estimation,
    ifqir,
    ifqir_figures,
    lipschitz_conservatism,
    relaxation_study,
    relaxations,
    song_hedrick,
    truth_models,
    wang_figures,
    wang_interval,
    wang_lpv,
    wang_nonlinear,
    wang_nonlinear_figures,
)
from luenberger.experiment.published.row import Row, Verdict

Progress = Callable[[Row], None]
SOURCES: Mapping[str, Callable[[Progress | None], list[Row]]] = {
    "song-hedrick": song_hedrick.rows,
    "relaxations": relaxations.rows,
    "truth-models": truth_models.rows,
    "wang-lpv": wang_lpv.rows,
    "wang-interval": wang_interval.rows,
    "wang-nonlinear": wang_nonlinear.rows,
    "wang-relaxations": relaxation_study.rows,
    "lipschitz-conservatism": lipschitz_conservatism.rows,
    "guaranteed-estimation": guaranteed_estimation.rows,
    "ifqir": ifqir.rows,
}
# Papers whose figures are drawn again on a page.
PAGES: Mapping[str, Callable[[Path], Path]] = {
    "wang-lpv": wang_figures.write_page,
    "wang-interval": wang_figures.write_page,
    "wang-nonlinear": wang_nonlinear_figures.write_page,
    "lipschitz-conservatism": conservatism_figure.write_page,
    "ifqir": ifqir_figures.write_page,
}

__all__ = ["PAGES", "SOURCES", "Row", "Verdict"]
