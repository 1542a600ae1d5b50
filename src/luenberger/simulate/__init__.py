"""Truth models integrated to trajectories, and what sensors make of them."""

from luenberger.simulate.inputs import HeldSamples, LinearSamples
from luenberger.simulate.integrate import Integration, integrate, iterate
from luenberger.simulate.monte_carlo import monte_carlo, piecewise_signal
from luenberger.simulate.sensors import Sensor, measure
from luenberger.simulate.simulate import Model, TruthModel, simulate

__all__ = [
    "HeldSamples",
    "Integration",
    "LinearSamples",
    "Model",
    "Sensor",
    "TruthModel",
    "integrate",
    "iterate",
    "measure",
    "monte_carlo",
    "piecewise_signal",
    "simulate",
]
