"""Experiments: a TOML file becomes designs, replays, scores and a page; published papers become rows with verdicts."""

from luenberger.experiment.run import Result, run_experiment
from luenberger.experiment.specification import Specification, read_specification

__all__ = ["Result", "Specification", "read_specification", "run_experiment"]
