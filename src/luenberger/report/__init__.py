"""Tables, figures, citations and the one HTML page they make."""

from luenberger.report.citations import citations, numbered
from luenberger.report.decimation import decimated
from luenberger.report.figures import (
    Figure,
    comparison_figures,
    cost_bars,
    error_bars,
    error_shares,
    estimate_figure,
)
from luenberger.report.page import Page
from luenberger.report.palette import Style, styles
from luenberger.report.tables import Table, certificate_table, gain_table

__all__ = [
    "Figure",
    "Page",
    "Style",
    "Table",
    "certificate_table",
    "citations",
    "comparison_figures",
    "cost_bars",
    "decimated",
    "error_bars",
    "error_shares",
    "estimate_figure",
    "gain_table",
    "numbered",
    "styles",
]
