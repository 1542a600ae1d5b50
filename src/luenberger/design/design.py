"""What a synthesis returns: gain, certificate and where both come from, saved and loaded as text."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from luenberger.algebra import Polynomial
from luenberger.certify import Certificate, certify
from luenberger.certify.rational_text import polynomial_as_text, polynomial_from_text
from luenberger.core import BadInput
from luenberger.core.checks import known_keys
from luenberger.design.system_text import system_as_text, system_from_text
from luenberger.observers import CorrectionObserver, IntervalObserver, TwoDofObserver
from luenberger.systems import System

FORMAT = "luenberger design 1"
_KEYS = ("format", "method", "options", "references", "system", "gain", "model", "certificate", "statistics")
_LATER = ("argument_gain",)


@dataclass(frozen=True, eq=False)
class Design:
    """A gain with its certificate.

    Args:
        system: plant with the bounds that were trusted.
        gain: L(r), shape (nx, ny), continuous [1/s] or discrete.
        certificate: claims with proofs.
        method: name of the method.
        options: its options.
        references: papers, one string each.
        statistics: solver name, times [s], residuals; informative only.
        model: what the observer copies where that is not the plant (unstructured designs), else None.
        argument_gain: L2(r), shape (nx, ny), by which the output error also corrects the argument of f; None for zero.
    """

    system: System
    gain: Polynomial
    certificate: Certificate
    method: str
    options: Mapping[str, Any] = field(default_factory=dict)
    references: tuple[str, ...] = ()
    statistics: Mapping[str, Any] = field(default_factory=dict)
    model: System | None = None
    argument_gain: Polynomial | None = None

    def observer(self, dt: float, **options: Any) -> CorrectionObserver | IntervalObserver | TwoDofObserver:
        """Return the running observer with sample time dt [s].

        A design that claims containment runs as an interval observer in the coordinates of that claim, one with an argument
        gain as an observer with two degrees of freedom, one with a model of its own as a copy of that model, any other as a
        copy of the plant.

        Args:
            dt: sample time [s]; a discrete design needs its own.
            options: see `CorrectionObserver`, `IntervalObserver` or `TwoDofObserver`.
        """
        enclosing = next((c for c in self.certificate.claims if c.kind == "containment"), None)
        if enclosing is not None:
            return IntervalObserver(self.system, self.gain, dt, transform=enclosing.transform, **options)
        if self.argument_gain is not None:
            return TwoDofObserver(self.system, self.gain, self.argument_gain, dt, **options)
        return CorrectionObserver(self.system if self.model is None else self.model, self.gain, dt, **options)

    def certify(self) -> Certificate:
        """Check all claims again, from plant, gain and witnesses alone."""
        return certify(self)

    def with_gain(self, gain: Any) -> "Design":
        """Return the design with another gain and its claims checked again; nothing is trusted."""
        changed = replace(self, gain=Polynomial.constant(gain))
        return replace(changed, certificate=certify(changed))

    def gain_at(self, **values: float) -> np.ndarray:
        """Return L at given scheduling values, shape (nx, ny)."""
        return np.asarray(self.gain(values))

    def save(self, path: str | Path) -> None:
        """Write the design as JSON.

        Args:
            path: file to write.
        """
        data = {
            "format": FORMAT,
            "method": self.method,
            "options": dict(self.options),
            "references": list(self.references),
            "system": system_as_text(self.system),
            "gain": polynomial_as_text(self.gain),
            "model": None if self.model is None else system_as_text(self.model),
            "argument_gain": None if self.argument_gain is None else polynomial_as_text(self.argument_gain),
            "certificate": self.certificate.as_text(),
            "statistics": dict(self.statistics),
        }
        Path(path).write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")

    @staticmethod
    def load(path: str | Path, function: Any = None) -> "Design":
        """Read a design; its outcomes are what the file says until `certify` checks them.

        Args:
            path: file written by `save`.
            function: the nonlinear JAX function of the plant, where it has one and an observer is wanted.

        Raises:
            BadInput: no such file, not JSON, or not a design.
        """
        try:
            data = json.loads(Path(path).read_text(encoding="utf-8"))
        except OSError as cause:
            raise BadInput(f"`{path}` cannot be read ({cause.strerror}); give the path of a design file.") from None
        except ValueError as cause:
            raise BadInput(f"`{path}` is not JSON ({cause}); give a file written by `Design.save`.") from None
        if not isinstance(data, dict) or data.get("format") != FORMAT:
            raise BadInput(f"`{path}` is no design file; its `format` needs to be `{FORMAT}`.")
        known_keys(f"`{path}`", data, [*_KEYS, *_LATER])
        try:
            return Design(
                system=system_from_text(data["system"], function),
                gain=polynomial_from_text(data["gain"]),
                model=None if data.get("model") is None else system_from_text(data["model"]),
                argument_gain=None
                if data.get("argument_gain") is None
                else polynomial_from_text(data["argument_gain"]),
                certificate=Certificate.from_text(data["certificate"]),
                method=data["method"],
                options=data["options"],
                references=tuple(data["references"]),
                statistics=data["statistics"],
            )
        except (KeyError, TypeError, ValueError) as cause:
            if isinstance(cause, BadInput):
                raise
            raise BadInput(
                f"`{path}` is damaged ({type(cause).__name__}: {cause}); write it again with `Design.save`."
            ) from None
