"""One published design per file."""

from luenberger.methods.method import Candidate, Method
from luenberger.methods.polytopic import PolytopicLuenberger
from luenberger.methods.structured_lipschitz import StructuredLipschitz

__all__ = ["Candidate", "Method", "PolytopicLuenberger", "StructuredLipschitz"]
