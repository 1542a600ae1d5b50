"""The box in which the error of a discrete filter ends once the current output is used, proved in exact rationals.

With the filter gain K the error e of the prediction is cut by each new output:

    z = (I - K C) e - K (G - D N) v,        e+ = (A - A K C) e + E d - (B N + A K (G - D N)) v.

The v in z is that of the sample, which e has not met yet, so both move freely inside their bounds. The half widths of all z
that can be reached again and again are exactly

    w_i = sum over k >= 0 and j of |(I - K C) F^k M|_ij + sum over j of |K (G - D N) vbar|_ij,

F and M those of e. Nothing is lost where inputs are noisy too, while an error written for z alone, z+ = (I - K C) A z + ...,
would have to take the noise of input and output for two.
"""

import numpy as np

from luenberger.algebra import Polynomial
from luenberger.algebra.definiteness import exact
from luenberger.certify.claim import Claim
from luenberger.certify.continuum import Verdict
from luenberger.certify.steady_box import Driven, driven_box_verdict, require_bounded
from luenberger.core import BadInput, NotAccepted
from luenberger.systems import System


def filter_box_verdict(
    system: System, filter_gain: Polynomial, claim: Claim, *, steps: int = 20000
) -> tuple[str, Verdict]:
    """Decide whether every error that the current output leaves ends in a box, from plant, filter gain and witnesses.

    Args:
        system: discrete linear plant without parameters, with bounds of disturbance and noise.
        filter_gain: constant K, shape (nx, ny), all outputs at once.
        claim: of kind "filter_box"; `storage` shows contraction of A - A K C.
        steps: largest number of terms to add.

    Returns:
        the condition that failed (empty where none did), and the verdict; see `steady_box_verdict`.

    Raises:
        NotAccepted: a continuous, scheduled, uncertain or nonlinear plant, or a storage that moves.
        BadInput: a bound is missing, a vector of the wrong length, or a gain that does not fit.
    """
    if not isinstance(claim.storage, np.ndarray):
        raise NotAccepted("A filter box needs a constant storage matrix as its witness; the claim has none.")
    require_bounded(system)
    if filter_gain.names or tuple(filter_gain.shape) != (system.nx, system.ny):
        raise BadInput(
            f"The filter gain has shape {tuple(filter_gain.shape)} and depends on {list(filter_gain.names)}; a constant of shape "
            f"({system.nx}, {system.ny}) is needed."
        )
    A, B, C, D, E, G, N = (exact(np.asarray(system.polynomial(letter)({}), dtype=float)) for letter in "ABCDEGN")
    K = exact(np.asarray(filter_gain({}), dtype=float))
    disturbance, noise = (
        exact(np.asarray(b or (), dtype=float)) for b in (system.disturbance_bound, system.noise_bound)
    )
    entering = K @ (G - D @ N)
    loop = A - A @ K @ C
    drive = np.hstack([E * disturbance, -(B @ N + A @ entering) * noise])
    seen = exact(np.eye(system.nx)) - K @ C
    return driven_box_verdict(Driven(loop, drive, seen, -entering * noise), claim, system.states, steps, "filter_box")
