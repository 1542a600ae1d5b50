"""The error of an unknown-input observer of one mode, channel by channel.

    xh+ = N xh + K y + P B0 u - H y+,      P = I + H C,     N = P A0 - K C

leaves, for e = x - xh and a plant taken apart by `Uncertain`, u read as u + Nu v,

    e+ = N e + P E0 d + P directions s - (K G + P B0 Nu) v + H G v+.

The noise of one sample enters twice, as v+ and a step later as v. Written for ebar = e - H' G v, with the H' that made e, it enters once:

    ebar+ = N ebar + P E0 d + P directions s + (N H' G - K G - P B0 Nu) v.

Reference: Ifqir, Puig, Ichalal, Ait-Oufroukh, Mammar 2020, equations 8 to 11.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from luenberger.algebra import Polynomial
from luenberger.core import BadInput, NotAccepted
from luenberger.systems.error_system import Lift, beside
from luenberger.systems.jacobian_box import as_floats
from luenberger.systems.system import System
from luenberger.systems.uncertainty import Uncertain


@dataclass(frozen=True, eq=False)
class DecoupledError:
    """Error of an unknown-input observer over the measured scheduling.

    Args:
        A: N(r), shape (nx, nx).
        projection: P, shape (nx, nx).
        inputs: channel -> direction: "lumped" (nx, nx), "uncertainty" (nx, nk), "disturbance" (nx, nd), "noise" (nx, nv), "next noise"
            (nx, nv), "reused noise" (nx, nv).
        box: name -> interval of the measured scheduling, wider than that of the true one where it is measured with error.
        uncertain: the plant taken apart.
        lift: arithmetic of the polynomials.
    """

    A: Polynomial
    projection: Polynomial
    inputs: Mapping[str, Polynomial]
    box: dict[str, tuple[float, float]]
    uncertain: Uncertain
    lift: Lift

    @staticmethod
    def of(
        system: System,
        gain: Polynomial,
        decoupling: Polynomial,
        lift: Lift = as_floats,
        *,
        before: Polynomial | None = None,
    ) -> "DecoupledError":
        """Close the loop.

        Args:
            system: mode of the plant.
            gain: K(r), shape (nx, ny).
            decoupling: H, shape (nx, ny).
            lift: arithmetic of the result.
            before: H of the mode of the sample before; None for the same mode.

        Raises:
            BadInput: gains of the wrong shape or with parameters that are no scheduling.
            NotAccepted: a direct feedthrough D, or a plant that `Uncertain.of` refuses.
        """
        require_no_feedthrough(system)
        for name, value in (("gain", gain), ("decoupling", decoupling)):
            if value.shape != (system.nx, system.ny):
                raise BadInput(f"`{name}` has shape {value.shape}; ({system.nx}, {system.ny}) is needed.")
            if unknown := set(value.names) - set(system.scheduling_names):
                raise BadInput(
                    f"`{name}` depends on {sorted(unknown)}, which `{system.name}` does not measure; use {list(system.scheduling_names)}."
                )
        uncertain = Uncertain.of(system)
        plant = uncertain.nominal
        A, B, C, E, G, Nu = (lift(plant.polynomial(letter)) for letter in "ABCEGN")
        K, H = lift(gain), lift(decoupling)
        eye = lift(Polynomial.constant(np.eye(system.nx)))
        P = eye + H @ C
        N = P @ A - K @ C
        entering = K @ G + P @ B @ Nu if system.nu else K @ G
        earlier = H if before is None else lift(before)
        inputs = {
            "lumped": eye,
            "uncertainty": P @ lift(Polynomial.constant(uncertain.directions)),
            "disturbance": P @ E,
            "noise": -entering,
            "next noise": H @ G,
            "reused noise": N @ earlier @ G - entering,
        }
        return DecoupledError(N, P, inputs, plant.scheduling_box, uncertain, lift)

    def joined(self, names: str) -> Polynomial:
        """Return the directions of several channels side by side.

        Args:
            names: channels joined by "+", e.g. "uncertainty+noise+next noise".

        Raises:
            BadInput: an unknown channel.
        """
        wanted = names.split("+")
        if unknown := [n for n in wanted if n not in self.inputs]:
            raise BadInput(f"The error has no input {unknown}; it has {list(self.inputs)}.")
        total = self.inputs[wanted[0]]
        for name in wanted[1:]:
            total = beside(total, self.inputs[name], self.lift)
        return total


def require_no_feedthrough(system: System) -> None:
    """Refuse plants whose outputs feel the inputs at once.

    Args:
        system: plant.

    Raises:
        NotAccepted: D is not zero.
    """
    if any(np.any(c) for _, c in system.polynomial("D")):
        raise NotAccepted(
            f"`{system.name}` has a direct feedthrough D; an unknown-input observer is written for D = 0. Take D u off the outputs first."
        )
