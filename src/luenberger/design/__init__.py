"""Designs: gain + certificate, as text."""

from luenberger.design.design import Design
from luenberger.design.switched import SwitchedDesign

__all__ = ["Design", "SwitchedDesign"]
