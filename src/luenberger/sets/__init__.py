"""Sets that hold what is not known: intervals, zonotopes, and order reduction."""

from luenberger.sets.interval import Interval
from luenberger.sets.reduction import combastel, girard, pca
from luenberger.sets.zonotope import Zonotope

__all__ = ["Interval", "Zonotope", "combastel", "girard", "pca"]
