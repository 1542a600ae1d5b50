"""Claims about the enclosure that an interval observer draws: order, width, containment."""

from luenberger.algebra import Polynomial
from luenberger.certify.claim import Claim
from luenberger.certify.continuum import Verdict
from luenberger.core import NotAccepted
from luenberger.systems import System


def enclosure_verdict(system: System, gain: Polynomial, claim: Claim) -> tuple[str, Verdict]:
    """Decide a claim about the enclosure from plant, gain and witnesses.

    Args:
        system: plant.
        gain: L(r).
        claim: one of `ENCLOSURE_KINDS`.

    Returns:
        the condition that failed (empty where none did), and the verdict.
    """
    raise NotAccepted(f"The claim `{claim.kind}` of `{system.name}` is not decided yet.")
