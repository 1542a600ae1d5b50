"""Designs: gain + certificate, as text."""

from luenberger.design.design import Design

__all__ = ["Design"]
