"""Gains of switched and scheduled unknown-input observers by one matrix inequality."""

from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np

from luenberger.algebra import Polynomial
from luenberger.certify.switched_claim import SwitchedClaim
from luenberger.core import BadInput, Infeasible, NotAccepted
from luenberger.core.checks import known_keys
from luenberger.lmi import Bernstein, Relaxation
from luenberger.methods.method import SwitchedCandidate, statistics
from luenberger.methods.unknown_input_claims import unknown_input_claims
from luenberger.methods.unknown_input_inequality import Attenuate, Form, Storage
from luenberger.methods.unknown_input_plant import OpenMode, largest_fade, require_decouplable
from luenberger.methods.unknown_input_search import (
    FoundGain,
    best_fade,
    found_gain,
    least_supply,
    no_gain,
    ultimate_bound,
)
from luenberger.systems import Switched, System
from luenberger.systems.mode import Mode


@dataclass(frozen=True)
class UnknownInputGain:
    """Gains of an observer that the unknown input does not reach, mode by mode, for the least effect of all the rest.

        xh+ = N xh + K y + P B u - H y+,     P = I + H C,     N = P A - K C,     P E = 0

    Choose it where a disturbance without a useful bound drives the plant, and the outputs feel it one step later: a gust on a
    car whose yaw rate is measured. Not where the disturbance is small and its bound is known, since decoupling it amplifies
    the noise; a zonotopic observer bounds it instead. Several modes stand for a plant that one model does not fit; a scheduled
    plant is one mode whose gain follows the scheduling.

    Assumes: x+ = A(r,q) x + B(r,q) u + E d, y = C x + G v in every mode, d arbitrary, rank(C E) = rank(E), all invariant zeros
        inside the unit circle, the mode known, r measured.
    Certifies: P E = 0; |K| <= the reported bound; V_j(e+) <= (1 - fade) V_i(e) + supply |w|^2 on every transition, and with it
        limsup |e| <= sqrt(supply / (alpha fade)) sup |w|, V >= alpha |e|^2; the sets of the observer contain the state.

    Args:
        fade: share by which V falls in a step, 0 < fade < 1 - max |z|^2 over the invariant zeros z; None looks for the one with
            the least ultimate bound.
        storage: "common" uses one Q for all modes; "mode" one each, with any switching; "last" one each too, that of the mode
            which acted last, which needs no slack and gives the lower level; "dwell" one each, with Q_j <= growth Q_i at a switch
            and the dwell time of the plant. The last three find gains where no common Q exists.
        attenuate: "lumped" counts all that reaches the error as one vector; "physical" counts the uncertain factors and the
            noises v and v+ one by one: a factor in the size that it has where [x; u] has length one, a noise in its bound.
        growth: largest ratio of storages at a switch, for "dwell"; growth (1 - fade)^dwell < 1 is needed.
        schedule: "plant" gives K(r) the monomials of A, "constant" one gain for the whole box.
        slack: True poses the printed slack matrix S where S = Q does the same; "mode" always has one.
        relaxation: how polynomial inequalities become matrix inequalities; exact for multi-affine plants.

    Reference: S. Ifqir, V. Puig, D. Ichalal, N. Ait-Oufroukh, S. Mammar 2020, Theorem 1, changed where it does not hold as
        printed. Q >= I is added, since (21) is homogeneous and its least supply would be zero. The bound (22) has fade under the
        root in the place of 1 - fade; (15) and (16) lack I of size ny and a transpose, (21) has I_n in the place of J; the zeros
        of (18) count from |z| = 1 on, not from Re(s) = 0. The error is driven by H v+ - (K G + P B N) v too. S = Q is as
        good as a free S there; storages of the modes follow J. Daafouz, P. Riedinger, C. Iung 2002, the dwell time J. P. Hespanha,
        A. S. Morse 1999.

    Example:
        >>> import luenberger as lb
        >>> from luenberger.methods.unknown_input import UnknownInputGain
        >>> from luenberger.synthesize import synthesize
        >>> plant = lb.System.linear(
        ...     [[0.8, 0.1], [0.0, 0.5]], C=[[0.0, 1.0]], E=[[0.0], [1.0]], dt=0.1, noise_bound=[0.01])
        >>> design = synthesize(plant, UnknownInputGain(fade=0.2))
        >>> design.certificate.outcome.value, round(design.statistics["ultimate_bound"], 3)
        ('proved', 5.0)
    """

    fade: float | None = 0.5
    storage: Storage = "common"
    attenuate: Attenuate = "lumped"
    growth: float = 4.0
    schedule: str = "plant"
    slack: bool = False
    relaxation: Relaxation = field(default_factory=Bernstein)

    takes_modes: ClassVar[bool] = True
    references: ClassVar[tuple[str, ...]] = (
        "S. Ifqir, V. Puig, D. Ichalal, N. Ait-Oufroukh, S. Mammar, Set-membership switched observers based on interval "
        "characterization of the estimation error, 21st IFAC World Congress, 2020, Theorem 1",
        "J. Daafouz, P. Riedinger, C. Iung, Stability analysis and control synthesis for switched systems: a switched Lyapunov "
        "function approach, IEEE Trans. Autom. Control 47 (2002) 1883-1887",
        "J. P. Hespanha, A. S. Morse, Stability of switched systems with average dwell-time, Proc. 38th IEEE Conference on "
        "Decision and Control (1999) 2655-2660",
    )

    def accept(self, system: Switched | System) -> None:
        """Refuse plants outside the theorem and fades that the zeros rule out, before any solver runs.

        Args:
            system: switched plant, or a plant that is its only mode.

        Raises:
            NotAccepted: see `require_decouplable`; or no noise and no factor to attenuate one by one.
            BadInput: options that no plant could satisfy, or a dwell time too short for the growth.
            Infeasible: a zero that no gain moves fades more slowly.
        """
        self._require_options()
        switched = Switched.of(system)
        zeros = require_decouplable(switched)
        if self.attenuate == "physical":
            _require_channels(switched)
        if self.fade is None:
            return
        self._require_dwell(switched, self.fade)
        limit = largest_fade(zeros)
        if self.fade >= limit:
            raise _too_fast(switched, zeros, self.fade, limit)

    def design(self, system: Switched | System) -> SwitchedCandidate:
        """Find the gains of least supply.

        Args:
            system: accepted plant.

        Raises:
            Infeasible: nothing was found; says the largest fade that was.
        """
        switched = Switched.of(system)
        modes = tuple(OpenMode.of(mode) for mode in switched.modes)
        limit = largest_fade(require_decouplable(switched))
        form = self._form(modes)
        growth = self.growth if self.storage == "dwell" and len(modes) > 1 else 1.0

        def bound(supply: float, fade: float) -> float:
            return ultimate_bound(supply, fade, growth, switched.dwell)

        fade = self.fade
        if fade is None:
            fade = best_fade(lambda share: bound(least_supply(modes, form, share), share), limit)
        found = found_gain(modes, form, fade)
        if found is None:
            raise no_gain(modes, form, fade, limit)

        def claims(gains: Any, decoupling: Any) -> list[SwitchedClaim]:
            return unknown_input_claims(switched, modes, gains, decoupling, form, fade)

        H = tuple(Polynomial.constant(h) for h in found.H)
        return SwitchedCandidate(found.K, H, claims, _facts(found, fade, bound(found.supply, fade)))

    def _form(self, modes: tuple[OpenMode, ...]) -> Form:
        form = Form(self.storage, self.attenuate, self.growth, self.schedule == "constant", self.slack, self.relaxation)
        return form if self.attenuate == "lumped" else replace(form, unit=_unit(modes))

    def _require_options(self) -> None:
        known_keys("`storage`", [self.storage], ["common", "mode", "last", "dwell"])
        known_keys("`attenuate`", [self.attenuate], ["lumped", "physical"])
        known_keys("`schedule`", [self.schedule], ["plant", "constant"])
        if self.fade is not None and not 0 < self.fade < 1:
            raise BadInput(
                f"`fade` is {self.fade}; the share by which V falls in a step lies between 0 and 1, both left out. None looks for it."
            )
        if not (np.isfinite(self.growth) and self.growth >= 1):
            raise BadInput(f"`growth` is {self.growth}; the ratio of two storages is at least 1.")

    def _require_dwell(self, plant: Switched, fade: float) -> None:
        if self.storage != "dwell" or len(plant.modes) == 1 or self.growth * (1 - fade) ** plant.dwell < 1:
            return
        least = int(np.floor(np.log(self.growth) / -np.log1p(-fade))) + 1
        raise BadInput(
            f"`{plant.name}` dwells for {plant.dwell} samples in a mode; growth {self.growth:g} with fade {fade:g} needs at least "
            f"{least}. Give `Switched.of(..., dwell={least})` where that is true, or a smaller `growth`."
        )


def _facts(found: FoundGain, fade: float, bound: float) -> dict[str, Any]:
    """What the design file records."""
    return {**statistics(found.solution), "optimum": found.supply, "fade": fade, "ultimate_bound": bound}


def _unit(modes: tuple[OpenMode, ...]) -> float:
    """Size of what reaches the error before a gain is chosen, over all modes."""
    sizes = [0.0]
    for mode in modes:
        weights = np.concatenate([mode.sizes, np.ones(2 * mode.measured.shape[1])])
        hull = mode.driven(Polynomial.constant(np.zeros(mode.U.shape)), mode.U).bernstein(mode.box)
        sizes += [float(np.linalg.norm(np.asarray(c) * weights, 2)) for c in hull.values() if weights.size]
    return max(sizes)


def _require_channels(plant: Switched) -> None:
    if plant.first.nv and plant.first.noise_bound is None:
        raise NotAccepted(
            f'`{plant.name}` has noise without a `noise_bound`, in whose unit it would be counted; give one, or attenuate="lumped".'
        )
    if not _unit(tuple(OpenMode.of(mode) for mode in plant.modes)) > 0:
        raise NotAccepted(
            f"`{plant.name}` has neither noise nor unmeasured parameters; there is nothing to attenuate one by one. Use "
            'attenuate="lumped".'
        )


def _too_fast(plant: Switched, zeros: tuple[tuple[int, Mode], ...], fade: float, limit: float) -> Infeasible:
    """The refusal of a fade that a zero rules out."""
    number, zero = zeros[0]
    where = "" if len(plant.modes) == 1 else f" of mode {number}"
    advice = (
        "A shorter sample time, or the exact hold in the place of an Euler step, may bring it nearer to zero."
        if zero.eigenvalue.real < 0
        else "A longer sample time lets it fade more in a step."
    )
    return Infeasible(
        f"No observer of this form exists for fade = {fade:.6g}: the zero z = {zero.value}{where} stays in the error whatever the "
        f"gain, so fade < 1 - |z|^2 = {limit:.6g} is needed. Ask for less, or let `fade=None` look for the best. {advice}",
        "",
        limit,
    )
