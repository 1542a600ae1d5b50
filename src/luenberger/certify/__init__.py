"""Claims recomputed on the closed-loop error system over the whole continuum, in exact or outward-rounded arithmetic."""

from luenberger.certify.certificate import Certificate, Proof, certify, certify_claims, prove
from luenberger.certify.claim import Claim
from luenberger.certify.switched import certify_switched_claims
from luenberger.certify.switched_claim import SwitchedClaim

__all__ = [
    "Certificate",
    "Claim",
    "Proof",
    "SwitchedClaim",
    "certify",
    "certify_claims",
    "certify_switched_claims",
    "prove",
]
