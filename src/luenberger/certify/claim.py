"""What can be claimed of an error system, each claim with the witness that lets anybody check it."""

import math
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal

import numpy as np

from luenberger.algebra import Polynomial
from luenberger.certify.rational_text import (
    from_text,
    matrix_from_text,
    matrix_text,
    polynomial_as_text,
    polynomial_from_text,
    to_text,
)
from luenberger.core import BadInput
from luenberger.core.checks import known_keys, known_words, symmetric_matrix
from luenberger.systems.error_system import Form

Kind = Literal[
    "decay",
    "l2_gain",
    "h2_gain",
    "gain_bound",
    "argument_gain_bound",
    "domain",
    "steady_box",
    "filter_box",
    "cooperative",
    "width_decay",
    "width_gain",
    "width",
    "containment",
]
# Claims about the width of an enclosure; `luenberger.certify.enclosure` proves them.
ENCLOSURE_KINDS: tuple[Kind, ...] = ("cooperative", "width_decay", "width_gain", "width", "containment")


@dataclass(frozen=True, eq=False)
class Claim:
    """One statement about the closed-loop error over the whole parameter box and Jacobian set.

    * decay: V = e' P e falls at least like exp(-2 level t) (a step of a discrete plant: V falls by level^2).
    * l2_gain: |weight e|_2 <= level |w|_2 from zero initial error, w the disturbance, the noise, or both.
    * h2_gain: unit white noise w drives weight e to a root mean square <= level (for frozen parameters the H2 norm).
    * gain_bound: |L(r)|_2 <= level, L what multiplies the output error in the derivative of the estimate.
    * argument_gain_bound: |L2(r)|_2 <= level, L2 what multiplies it in the argument of f.
    * domain: while the state keeps `state_bound` away from the faces of the domain of f, errors with e' P e <= level keep
      the argument of f (the estimate, or zeta with an argument gain) inside the domain, stay in that set, and go to zero.
    * steady_box: with disturbance and noise inside their bounds every error of a discrete plant ends in |e_k| <= `vector`_k, and
      what starts in the smallest invariant set stays in that box; `level` is the largest of them, `storage` shows contraction.
    * filter_box: the same of the error that is left once the current output is used, x - xh - K (y - C xh - D u), with the
      filter gain K of the design; `storage` shows contraction of A - A K C.
    * cooperative: all entries of T (A(r,q) - L(r) C(r)) T^-1 off the diagonal are >= 0, so that order is kept.
    * width_decay, width_gain: as decay and l2_gain, for the width of the enclosure that an interval observer draws.
    * width: once every width |T x| is below `vector` it stays there, inside the stated bounds.
    * containment: the state never leaves the enclosure, inside the stated bounds.

    Args:
        kind: which statement.
        level: decay rate [1/s], factor a step, L2 or H2 gain, norm bound, or largest width.
        storage: the witness P, shape (nx, nx), or P(r) as a polynomial of the scheduling; None where none is needed.
        multiplier: witness of the norm-bounded channel where the plant has one.
        weight: performance output of a gain claim, shape (nz, nx).
        inputs: channels of w joined by "+": "disturbance", "noise", "scheduling"; "both" is "disturbance+noise". For a
            width gain "residual" (what the maximisation over q adds to the drift) or "mismatch" (|x| in units of
            `state_bound`), each with "+noise" where noise counts too.
        form: which signal a scheduling error multiplies, see `ErrorSystem.of`.
        trace: witness Z of an H2 claim, shape (nz, nz): [P, W'; W, Z] > 0 and trace Z < level.
        transform: coordinates T of an enclosure claim, shape (nx, nx); None for the states themselves.
        vector: witness of a width claim, or the half widths of a steady or filter box, shape (nx,).
        state_bound: |x_k| <= bound that a width claim assumes, shape (nx,), or (nx + nu,) with bounds of the inputs; of a
            domain claim the distance that the state keeps from the faces of the domain, shape (nx,).

    Raises:
        BadInput: unknown kind or form, negative or non-finite level, missing witness.
    """

    kind: Kind
    level: float
    storage: np.ndarray | Polynomial | None = None
    multiplier: float | None = None
    weight: np.ndarray | None = None
    inputs: str = ""
    form: Form = "plant"
    trace: np.ndarray | None = None
    transform: np.ndarray | None = None
    vector: np.ndarray | None = None
    state_bound: np.ndarray | None = None

    def __post_init__(self) -> None:
        known_words(self, kind=Kind, form=Form)
        if not (math.isfinite(self.level) and self.level >= 0):
            raise BadInput(f"The claim `{self.kind}` has level {self.level}; a finite level >= 0 is needed.")
        if self.kind in ("gain_bound", "argument_gain_bound", "cooperative", "containment"):
            return
        if self.kind == "domain" and (self.state_bound is None or not self.level > 0):
            raise BadInput("A domain claim needs a level above zero and `state_bound`, the distances from the faces.")
        if self.kind == "width":
            if self.vector is None:
                raise BadInput("A width claim needs its witness `vector`; nothing could check it.")
            return
        if self.kind in ("steady_box", "filter_box") and self.vector is None:
            raise BadInput(f"A {self.kind.replace('_', ' ')} needs `vector`, its half widths; nothing could check it.")
        if self.storage is None:
            raise BadInput(f"The claim `{self.kind}` has no storage matrix; nothing could check it.")
        if isinstance(self.storage, Polynomial):
            object.__setattr__(self, "storage", self.storage.map(partial(symmetric_matrix, "storage")))
        else:
            object.__setattr__(self, "storage", symmetric_matrix("storage", self.storage))
        if self.kind in ("l2_gain", "h2_gain", "width_gain") and self.weight is None:
            raise BadInput(f"The claim `{self.kind}` needs `weight`, what of the error it is about.")
        if self.kind in ("l2_gain", "h2_gain"):
            asked = ("disturbance+noise" if self.inputs == "both" else self.inputs).split("+")
            known_keys("`inputs` of a gain claim", asked, list(_inputs))
        if self.kind == "width_gain":
            known_keys("`inputs` of a width gain", [self.inputs], _WIDTH_INPUTS)
        if self.kind == "h2_gain" and self.trace is None:
            raise BadInput("An H2 claim needs its witness `trace`, Z with [P, W'; W, Z] > 0; nothing could check it.")

    def sentence(self, discrete: bool) -> str:
        """The claim in words; `Proof.sentence` knows the time of its plant.

        Args:
            discrete: the plant has a sample time, so that a decay is a factor a step.
        """
        if self.kind == "gain_bound":
            return f"The gain norm |L(r)| stays below {self.level:.6g} on the whole scheduling box."
        if self.kind == "argument_gain_bound":
            return f"The gain in the argument of f, |L2(r)|, stays below {self.level:.6g} on the whole scheduling box."
        if self.kind == "domain":
            return self._domain_sentence()
        if self.kind in ("steady_box", "filter_box"):
            box = ", ".join(f"{w:.4g}" for w in np.asarray(self.vector))
            which = "error" if self.kind == "steady_box" else "error left by the current output"
            return f"With disturbance and noise inside their bounds every {which} ends in |e| <= ({box}), state by state, for good."
        if self.kind in ("l2_gain", "h2_gain"):
            channels = ("disturbance+noise" if self.inputs == "both" else self.inputs).split("+")
            what = " and ".join(_inputs[c].format(signal="x" if self.form == "plant" else "xhat") for c in channels)
            if self.kind == "h2_gain":
                return f"From unit white {what}, the root mean square of W e stays below {self.level:.6g} at frozen parameters."
            return f"From zero initial error, |W e|_2 <= {self.level:.6g} |w|_2 for every {what} w of finite energy."
        if self.kind in _enclosures:
            drive = {"residual": "residual of the maximisation", "mismatch": "|x|"}.get(
                self.inputs.split("+")[0], "input"
            )
            noise = " and noise" * self.inputs.endswith("+noise")
            how = f"falls at least like exp(-{self.level:.6g} t)" if self.level else "goes to zero"
            return _enclosures[self.kind].format(level=self.level, drive=drive + noise, how=how)
        if isinstance(self.storage, Polynomial):
            return f"Without disturbance and noise, e' P(r) e falls at least like exp(-{2 * self.level:.6g} t) inside the stated sets and rates."
        P = np.asarray(self.storage)
        values = np.linalg.eigvalsh(P)
        bound = math.sqrt(max(values[-1], 0.0) / values[0]) if values[0] > 0 else math.inf
        if not discrete and self.level == 0:
            return f"Without disturbance and noise, |e| <= {bound:.4g} |e0| at all times and e goes to zero, inside the stated sets."
        law = f"{self.level:.6g}^k" if discrete else f"exp(-{self.level:.6g} t)"
        return f"Without disturbance and noise, |e| <= {bound:.4g} |e0| {law} for every error inside the stated sets."

    def _domain_sentence(self) -> str:
        axes = np.sqrt(self.level / np.linalg.eigvalsh(np.asarray(self.storage)))
        kept = ", ".join(f"{m:.4g}" for m in np.asarray(self.state_bound))
        return (
            f"While the state keeps ({kept}) away from the faces of the domain of f, errors in e' P e <= {self.level:.6g} "
            f"(semi-axes {axes.min():.4g} to {axes.max():.4g}) keep the argument of f inside the domain and go to zero."
        )

    def as_text(self) -> dict[str, Any]:
        """Plain data for JSON; every number that the proof uses is a rational as a string."""
        return {
            "kind": self.kind,
            "level": to_text(self.level),
            "storage": _storage_text(self.storage),
            "multiplier": None if self.multiplier is None else to_text(self.multiplier),
            "inputs": self.inputs,
            "form": self.form,
            **{k: _optional_text(getattr(self, k)) for k in _MATRICES},
        }

    @staticmethod
    def from_text(data: dict[str, Any]) -> "Claim":
        """Read what `as_text` wrote."""
        return Claim(
            kind=data["kind"],
            level=from_text(data["level"]),
            storage=_storage_from_text(data["storage"]),
            multiplier=None if data["multiplier"] is None else from_text(data["multiplier"]),
            inputs=data["inputs"],
            form=data.get("form", "plant"),
            **{k: _optional_from_text(k, data.get(k)) for k in _MATRICES},
        )


_MATRICES = ("weight", "trace", "transform", "vector", "state_bound")
_WIDTH_INPUTS = ("residual", "residual+noise", "mismatch", "mismatch+noise")
_inputs = {
    "disturbance": "disturbance",
    "noise": "noise",
    "scheduling": "({signal}, u), which the scheduling error multiplies,",
}
_enclosures = {
    "cooperative": "The error keeps its order: what starts between the bounds stays between them.",
    "width_decay": "Without noise, offsets and mismatch the width of the enclosure {how}.",
    "width_gain": "From zero width, the energy norm of W width stays below {level:.6g} times that of the {drive}.",
    "width": "Once below the stated widths the enclosure stays below them; the largest is {level:.6g}.",
    "containment": "The true state never leaves the enclosure while the stated bounds hold and it starts inside.",
}


def _storage_text(storage: Any) -> Any:
    return polynomial_as_text(storage) if isinstance(storage, Polynomial) else _optional_text(storage)


def _storage_from_text(data: Any) -> Any:
    if data is None or isinstance(data, list):
        return _optional_from_text("storage", data)
    return polynomial_from_text(data)


def _optional_text(array: Any) -> Any:
    return None if array is None else matrix_text(array)


def _optional_from_text(name: str, rows: Any) -> Any:
    if rows is None:
        return None
    found = matrix_from_text(rows)
    return found[0] if name in ("vector", "state_bound") else found
