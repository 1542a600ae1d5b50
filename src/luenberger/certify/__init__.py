"""Claims recomputed on the closed-loop error system over the whole continuum, in exact or outward-rounded arithmetic."""

from luenberger.certify.certificate import Certificate, Proof, certify, certify_claims, prove
from luenberger.certify.claim import Claim

__all__ = ["Certificate", "Claim", "Proof", "certify", "certify_claims", "prove"]
