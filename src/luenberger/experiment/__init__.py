"""Experiments: a TOML file becomes designs, replays, scores and a page; published papers become rows with verdicts."""

from luenberger.experiment.gust import run_gust
from luenberger.experiment.gust_specification import GustSpecification, read_gust
from luenberger.experiment.outcome import Report
from luenberger.experiment.run import Result, run_experiment
from luenberger.experiment.specification import Specification, read_specification

__all__ = [
    "GustSpecification",
    "Report",
    "Result",
    "Specification",
    "read_gust",
    "read_specification",
    "run_experiment",
    "run_gust",
]
