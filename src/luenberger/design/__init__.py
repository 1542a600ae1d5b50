"""Designs: gain + certificate, as text."""

from luenberger.design.design import Design
from luenberger.design.switched import SwitchedDesign, load_design

__all__ = ["Design", "SwitchedDesign", "load_design"]
