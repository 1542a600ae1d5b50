"""Published papers row by row: printed, ours, verdict."""

from collections.abc import Callable, Mapping

from luenberger.experiment.published import relaxations, song_hedrick, truth_models, wang_interval, wang_lpv
from luenberger.experiment.published.row import Row, Verdict

Progress = Callable[[Row], None]
SOURCES: Mapping[str, Callable[[Progress | None], list[Row]]] = {
    "song-hedrick": song_hedrick.rows,
    "relaxations": relaxations.rows,
    "truth-models": truth_models.rows,
    "wang-lpv": wang_lpv.rows,
    "wang-interval": wang_interval.rows,
}

__all__ = ["SOURCES", "Row", "Verdict"]
