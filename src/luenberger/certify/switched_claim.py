"""What can be claimed of an unknown-input observer with several modes, each claim with the witness that lets anybody check it."""

import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from luenberger.certify.rational_text import from_text, matrix_from_text, matrix_text, to_text
from luenberger.core import BadInput
from luenberger.core.checks import known_words, symmetric_matrix

SwitchedKind = Literal["decoupling", "gain_bound", "iss", "containment"]
Order = Literal["next", "last"]
_CHANNELS = {
    "lumped": "what is added to the error",
    "uncertainty": "uncertain factors",
    "disturbance": "disturbance",
    "noise": "noise",
    "next noise": "noise of the next sample",
}


@dataclass(frozen=True, eq=False)
class SwitchedClaim:
    """One statement about the error of an unknown-input observer, over all modes and their scheduling boxes.

    * decoupling: every |entry of P_i E_i| <= level, so the unknown input does not reach the error but for rounding.
    * gain_bound: |K_i(r)|_2 <= level in every mode.
    * iss: V_j(e+) <= (1 - fade) V_i(e) + supply |w|^2 on every transition, V_i = e' Q_i e; hence limsup |e|_2 <= level sup |w|_2. With
      growth > 1 the storage may grow at a switch, by that factor at most, and the dwell time of the plant makes up for it.
      With order "last" mode j acts, and V_i is the storage of the mode that acted before it; else mode i acts.
    * containment: the state never leaves the set of the observer; `level` is what rounding of the gains may add a step, relative to the
      signals, and no more than rounding is accepted. With `vector`, an error inside |e_k| <= vector_k stays there.

    Args:
        kind: which statement.
        level: bound, see above.
        storages: Q_i, one a mode or one for all, each (nx, nx).
        fade: share by which V falls in a step.
        supply: what |w|^2 may add to V.
        growth: largest ratio of storages at a switch; 1 where every transition is covered by the inequality itself.
        inputs: channels of w joined by "+", see `DecoupledError`, all that reach the error; "lumped" and factors in units of the state,
            the others in units of their bounds. The noise reused in the set is no channel here: it belongs to another error.
        order: whose storage counts at a sample: of the mode that acts "next", or of the one that acted "last".
        vector: half widths of an invariant box, shape (nx,).
        state_bound: |x_k| <= bound that `vector` assumes, shape (nx,).

    Raises:
        BadInput: unknown kind or order, numbers out of range, or a missing witness.
    """

    kind: SwitchedKind
    level: float
    storages: tuple[np.ndarray, ...] = ()
    fade: float = 0.0
    supply: float = 0.0
    growth: float = 1.0
    inputs: str = "lumped"
    vector: np.ndarray | None = None
    state_bound: np.ndarray | None = None
    order: Order = "next"

    def __post_init__(self) -> None:
        known_words(self, kind=SwitchedKind, order=Order)
        if not (math.isfinite(self.level) and self.level >= 0):
            raise BadInput(f"The claim `{self.kind}` has level {self.level}; a finite level >= 0 is needed.")
        if self.kind != "iss":
            return
        if not (
            0 < self.fade < 1 and self.supply >= 0 and self.growth >= 1 and math.isfinite(self.supply * self.growth)
        ):
            raise BadInput(
                f"An ISS claim with fade {self.fade}, supply {self.supply} and growth {self.growth}: 0 < fade < 1, supply >= 0 and "
                "growth >= 1 are needed."
            )
        if not self.storages:
            raise BadInput("An ISS claim has no storages; nothing could check it.")
        if unknown := [c for c in self.inputs.split("+") if c not in _CHANNELS]:
            raise BadInput(f"An ISS claim speaks of the inputs {unknown}; known are {list(_CHANNELS)}.")
        object.__setattr__(self, "storages", tuple(symmetric_matrix("storages", Q) for Q in self.storages))

    def sentence(self, discrete: bool = True) -> str:
        """The claim in words.

        Args:
            discrete: plants with modes are sampled; kept for the common signature of claims.
        """
        if self.kind == "decoupling":
            return f"Of the unknown input no more than |P E| <= {self.level:.3g} reaches the error in every mode."
        if self.kind == "gain_bound":
            return f"The gain norm |K| stays below {self.level:.6g} in every mode."
        if self.kind == "containment":
            held = (
                ""
                if self.vector is None
                else f" An error within ({_numbers(self.vector)}), state by state, stays there."
            )
            return (
                "The state never leaves the set of the observer while the stated bounds hold and it starts inside, but for rounding of at "
                f"most {self.level:.1e} of the signals a step.{held}"
            )
        what = " and ".join(_CHANNELS[c] for c in self.inputs.split("+"))
        pace = "a step" if self.growth == 1 else "a step between switches"
        unit = "" if self.inputs == "lumped" else ", noise in units of its bound, factors in those of the state"
        return (
            f"Under every switching that is allowed the error ends in |e|_2 <= {self.level:.6g} sup |w|_2, w being {what}{unit}, and "
            f"forgets its start by a factor {math.sqrt(1 - self.fade):.6g} {pace}."
        )

    def as_text(self) -> dict[str, Any]:
        """Plain data for JSON; every number that the proof uses is a rational as a string."""
        return {
            "modes": True,
            "kind": self.kind,
            "level": to_text(self.level),
            "storages": [matrix_text(Q) for Q in self.storages],
            "fade": to_text(self.fade),
            "supply": to_text(self.supply),
            "growth": to_text(self.growth),
            "inputs": self.inputs,
            "order": self.order,
            "vector": None if self.vector is None else matrix_text(self.vector),
            "state_bound": None if self.state_bound is None else matrix_text(self.state_bound),
        }

    @staticmethod
    def from_text(data: dict[str, Any]) -> "SwitchedClaim":
        """Read what `as_text` wrote."""
        rows = {k: None if data[k] is None else matrix_from_text(data[k])[0] for k in ("vector", "state_bound")}
        return SwitchedClaim(
            kind=data["kind"],
            level=from_text(data["level"]),
            storages=tuple(matrix_from_text(Q) for Q in data["storages"]),
            fade=from_text(data["fade"]),
            supply=from_text(data["supply"]),
            growth=from_text(data["growth"]),
            inputs=data["inputs"],
            order=data.get("order", "next"),
            **rows,
        )


def _numbers(vector: Any) -> str:
    return ", ".join(f"{v:.4g}" for v in np.ravel(vector))
