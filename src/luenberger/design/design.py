"""What a synthesis returns: gain, certificate and where both come from, saved and loaded as text."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from luenberger.algebra import Polynomial
from luenberger.certify import Certificate, certify
from luenberger.certify.rational_text import polynomial_as_text, polynomial_from_text
from luenberger.core import NotAccepted
from luenberger.design.design_file import built_from, write_file
from luenberger.design.system_text import system_as_text, system_from_text
from luenberger.observers import (
    CorrectionObserver,
    IntervalObserver,
    TwoDofObserver,
    ZonotopicLuenberger,
    ZonotopicObserver,
    ZonotopicStripFilter,
)
from luenberger.observers.plant import sample_time
from luenberger.systems import System

Running = CorrectionObserver | IntervalObserver | TwoDofObserver | ZonotopicObserver

FORMAT = "luenberger design 1"
_KEYS = ("format", "method", "options", "references", "system", "gain", "model", "certificate", "statistics")
_LATER = ("argument_gain", "filter_gain")


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
        filter_gain: K(r), shape (nx, ny), by which the current output corrects the prediction; None for a predictor. `gain` is A K.
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
    filter_gain: Polynomial | None = None

    def observer(self, dt: float | None = None, **options: Any) -> Running:
        """Return the running observer with sample time dt [s].

        A design that claims containment runs as an interval observer in the coordinates of that claim. Any other that is asked
        for a set, by `initial_half_width`, runs as a zonotope: cut by the strips of the current output where it has a filter
        gain, else predicted. Without, one with an argument gain runs as an observer with two degrees of freedom, one with
        a model of its own as a copy of that model, any other as a copy of the plant with the gain of the prediction.

        Args:
            dt: sample time [s]; a discrete design needs its own, and may leave it out.
            options: see `IntervalObserver`; `ZonotopicLuenberger` or `ZonotopicStripFilter`, with `count` generators, by default
                five for each state and at least twenty; `TwoDofObserver`; `CorrectionObserver`.

        Raises:
            BadInput: a sample time that is missing or not the plant's.
            NotAccepted: a set around an observer that copies another model, or of a plant that zonotopes do not carry.
        """
        enclosing = next((c for c in self.certificate.claims if c.kind == "containment"), None)
        if enclosing is not None:
            return IntervalObserver(self.system, self.gain, dt, transform=enclosing.transform, **options)
        if "initial_half_width" in options:
            return self._set_observer(dt, options)
        if self.argument_gain is not None:
            return TwoDofObserver(self.system, self.gain, self.argument_gain, dt, **options)
        return CorrectionObserver(self.system if self.model is None else self.model, self.gain, dt, **options)

    def _set_observer(self, dt: float | None, options: Mapping[str, Any]) -> ZonotopicObserver:
        if self.model is not None:
            raise NotAccepted(
                f"The observer of this design copies another model than `{self.system.name}`; no set around it is known. Leave "
                "`initial_half_width` out."
            )
        if self.system.dt is not None:
            sample_time(self.system, dt)
        if self.filter_gain is not None:
            return ZonotopicStripFilter(self.system, self.filter_gain, **options)
        return ZonotopicLuenberger(self.system, self.gain, **options)

    def certify(self, progress: Callable[[str, float], None] | None = None) -> Certificate:
        """Check all claims again, from plant, gain and witnesses alone.

        Args:
            progress: called with what is being proved and the share done.
        """
        return certify(self, progress)

    def with_gain(self, gain: Any) -> "Design":
        """Return the design with another gain and its claims checked again; nothing is trusted.

        A filter gain does not belong to the new gain and is dropped: claims about the filter are refuted then.

        Args:
            gain: L, nested numbers or `Polynomial`.
        """
        changed = replace(self, gain=Polynomial.constant(gain), filter_gain=None)
        return replace(changed, certificate=certify(changed))

    def with_filter_gain(self, filter_gain: Any) -> "Design":
        """Return the design with another filter gain, the gain A K that belongs to it, and its claims checked again.

        Args:
            filter_gain: K, nested numbers or `Polynomial`.
        """
        K = Polynomial.constant(filter_gain)
        changed = replace(self, gain=predictor_gain(self.system, K), filter_gain=K)
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
            "argument_gain": _optional_text(self.argument_gain),
            "filter_gain": _optional_text(self.filter_gain),
            "certificate": self.certificate.as_text(),
            "statistics": dict(self.statistics),
        }
        write_file(path, data)

    @staticmethod
    def load(path: str | Path, function: Any = None) -> "Design":
        """Read a design; its outcomes are what the file says until `certify` checks them.

        Args:
            path: file written by `save`.
            function: the nonlinear JAX function of the plant, where it has one and an observer is wanted.

        Raises:
            BadInput: no such file, not JSON, or not a design.
        """
        return built_from(path, FORMAT, _KEYS, lambda data: _design(data, function), _LATER)


def predictor_gain(system: System, filter_gain: Polynomial) -> Polynomial:
    """Return L = A K, the gain of the prediction that goes with a filter gain.

    Args:
        system: discrete plant.
        filter_gain: K(r), shape (nx, ny).
    """
    return system.polynomial("A") @ filter_gain


def _design(data: Mapping[str, Any], function: Any) -> Design:
    return Design(
        system=system_from_text(data["system"], function),
        gain=polynomial_from_text(data["gain"]),
        model=None if data.get("model") is None else system_from_text(data["model"]),
        argument_gain=_optional_from_text(data.get("argument_gain")),
        filter_gain=_optional_from_text(data.get("filter_gain")),
        certificate=Certificate.from_text(data["certificate"], data["system"]["dt"] is not None),
        method=data["method"],
        options=data["options"],
        references=tuple(data["references"]),
        statistics=data["statistics"],
    )


def _optional_text(gain: Polynomial | None) -> Any:
    return None if gain is None else polynomial_as_text(gain)


def _optional_from_text(data: Any) -> Polynomial | None:
    return None if data is None else polynomial_from_text(data)
