"""What the synthesis of an unknown-input observer returns: gains of every mode, certificate and where both come from."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from luenberger.algebra import Polynomial
from luenberger.certify import Certificate, certify_switched_claims
from luenberger.certify.rational_text import from_text, polynomial_as_text, polynomial_from_text, to_text
from luenberger.core import BadInput
from luenberger.design.design import Design
from luenberger.design.design_file import built_from, read_file, write_file
from luenberger.design.system_text import system_as_text, system_from_text
from luenberger.observers import UnknownInputObserver
from luenberger.systems import Switched

SWITCHED_FORMAT = "luenberger switched design 1"
_KEYS = ("format", "method", "options", "references", "system", "gains", "decoupling", "certificate", "statistics")


@dataclass(frozen=True, eq=False)
class SwitchedDesign:
    """Gains of an unknown-input observer, mode by mode, with their certificate.

        xh+ = N_i xh + K_i y + P_i B_i u - H_i y+,     P_i = I + H_i C,     N_i = P_i A_i - K_i C

    Args:
        system: plant with its modes; one mode for a plant that does not switch.
        gains: K_i(r), each of shape (nx, ny).
        decoupling: H_i, each of shape (nx, ny), with P_i E_i = 0.
        certificate: claims with proofs.
        method: name of the method.
        options: its options.
        references: papers, one string each.
        statistics: solver name, times [s], residuals; informative only.
    """

    system: Switched
    gains: tuple[Polynomial, ...]
    decoupling: tuple[Polynomial, ...]
    certificate: Certificate
    method: str
    options: Mapping[str, Any] = field(default_factory=dict)
    references: tuple[str, ...] = ()
    statistics: Mapping[str, Any] = field(default_factory=dict)

    def observer(self, dt: float | None = None, **options: Any) -> UnknownInputObserver:
        """Return the running observer, which draws a guaranteed set around its estimate.

        Args:
            dt: sample time [s], that of the plant; may be left out.
            options: see `UnknownInputObserver`; `initial_half_width` is needed.

        Raises:
            BadInput: a sample time that is not the plant's, or no `initial_half_width`.
        """
        own = self.system.first.dt
        if dt is not None and own is not None and abs(dt - own) > 1e-12 * own:
            raise BadInput(
                f"`dt` is {dt:g} s but the design is for {own:g} s; design again for the wanted sample time."
            )
        if "initial_half_width" not in options:
            raise BadInput(
                "The observer draws a set around its estimate and no `initial_half_width` is given; give how far each of the states "
                f"({', '.join(self.system.first.states)}) may be from the first guess (`--half-width` on the command line)."
            )
        return UnknownInputObserver(self.system, self.gains, self.decoupling, **options)

    def certify(self, progress: Any = None) -> Certificate:
        """Check all claims again, from plant, gains and witnesses alone.

        Args:
            progress: called with what is being proved and the share done.
        """
        claims = self.certificate.claims
        return certify_switched_claims(self.system, self.gains, self.decoupling, claims, progress)

    def with_gains(self, gains: Any, decoupling: Any = None) -> "SwitchedDesign":
        """Return the design with other gains and its claims checked again; nothing is trusted.

        Args:
            gains: K of every mode.
            decoupling: H of every mode; left out: as they are.
        """
        kept = self.decoupling if decoupling is None else tuple(map(Polynomial.constant, decoupling))
        changed = replace(self, gains=tuple(map(Polynomial.constant, gains)), decoupling=kept)
        return replace(changed, certificate=changed.certify())

    def gain_at(self, mode: int = 0, **values: float) -> np.ndarray:
        """Return K of a mode at given scheduling values, shape (nx, ny).

        Args:
            mode: number of the mode.
            values: scheduling name -> value.
        """
        return np.asarray(self.gains[mode](values))

    def save(self, path: str | Path) -> None:
        """Write the design as JSON.

        Args:
            path: file to write.
        """
        data = {
            "format": SWITCHED_FORMAT,
            "method": self.method,
            "options": dict(self.options),
            "references": list(self.references),
            "system": switched_as_text(self.system),
            "gains": [polynomial_as_text(K) for K in self.gains],
            "decoupling": [polynomial_as_text(H) for H in self.decoupling],
            "certificate": self.certificate.as_text(),
            "statistics": dict(self.statistics),
        }
        write_file(path, data)

    @staticmethod
    def load(path: str | Path) -> "SwitchedDesign":
        """Read a design; its outcomes are what the file says until `certify` checks them.

        Args:
            path: file written by `save`.

        Raises:
            BadInput: no such file, not JSON, or no switched design.
        """
        return built_from(path, SWITCHED_FORMAT, _KEYS, _built)


def load_design(path: str | Path, function: Any = None) -> Design | SwitchedDesign:
    """Read a design file of either kind; its outcomes are what the file says until `certify` checks them.

    Args:
        path: file written by `save`.
        function: the nonlinear JAX function of the plant, where it has one and an observer is wanted.

    Raises:
        BadInput: no such file, not JSON, or no design.
    """
    if read_file(path)["format"] == SWITCHED_FORMAT:
        return SwitchedDesign.load(path)
    return Design.load(path, function)


def switched_as_text(system: Switched) -> dict[str, Any]:
    """Return a switched plant as plain data.

    Args:
        system: plant.

    Raises:
        NotAccepted: a matrix is a function on the domain, which has no text.
    """
    return {
        "modes": [system_as_text(mode) for mode in system.modes],
        "signal": system.signal,
        "ends": [to_text(end) for end in system.ends],
        "dwell": system.dwell,
        "unit": system.unit,
    }


def switched_from_text(data: Mapping[str, Any]) -> Switched:
    """Read what `switched_as_text` wrote.

    Args:
        data: plain data.

    Raises:
        BadInput: an unknown or missing entry.
    """
    modes = [system_from_text(mode) for mode in data["modes"]]
    ends = [from_text(end) for end in data["ends"]] or None
    return Switched.of(modes, data["signal"], ends, dwell=data["dwell"], unit=data["unit"])


def _built(data: Mapping[str, Any]) -> SwitchedDesign:
    return SwitchedDesign(
        system=switched_from_text(data["system"]),
        gains=tuple(polynomial_from_text(K) for K in data["gains"]),
        decoupling=tuple(polynomial_from_text(H) for H in data["decoupling"]),
        certificate=Certificate.from_text(data["certificate"], discrete=True),
        method=data["method"],
        options=data["options"],
        references=tuple(data["references"]),
        statistics=data["statistics"],
    )
