"""A plant as plain data for JSON, and back; numbers are rationals as strings, the nonlinear function stays code."""

from dataclasses import replace
from typing import Any

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
from luenberger.core import BadInput, NotAccepted
from luenberger.core.checks import known_keys
from luenberger.systems import Nonlinearity, Parameter, System
from luenberger.systems.parameter import RateLaw
from luenberger.systems.scheduling_error import SchedulingError

_KEYS = ("name", "dt", "states", "inputs", "outputs", "units", "parameters", "matrices", "nonlinearity")
_LATER = ("scheduling_error", "disturbance_bound", "noise_bound")


def system_as_text(system: System) -> dict[str, Any]:
    """Return a plant as plain data.

    Args:
        system: plant.

    Raises:
        NotAccepted: a matrix is a function on the domain, which has no text.
    """
    for letter, value in system.matrices.items():
        if not isinstance(value, Polynomial):
            raise NotAccepted(
                f"`{letter}` of `{system.name}` is a JAX function; only constant and polynomial matrices can be saved."
            )
    f = system.nonlinearity
    return {
        "name": system.name,
        "dt": None if system.dt is None else to_text(system.dt),
        "states": list(system.states),
        "inputs": list(system.inputs),
        "outputs": list(system.outputs),
        "units": dict(system.units),
        "parameters": [
            {
                "name": p.name,
                "interval": [to_text(p.lower), to_text(p.upper)],
                "unit": p.unit,
                "measured": p.measured,
                "rate": None if p.rate is None else to_text(p.rate),
                "error": to_text(p.error),
                "factor": [to_text(f) for f in p.factor],
                "rate_law": None if p.rate_law is None else [[to_text(c), dict(powers)] for c, powers in p.rate_law],
            }
            for p in system.parameters
        ],
        "matrices": {letter: polynomial_as_text(system.polynomial(letter)) for letter in system.matrices},
        "nonlinearity": None if f is None else _nonlinearity_as_text(f),
        "scheduling_error": None if system.scheduling_error is None else _error_as_text(system.scheduling_error),
        "disturbance_bound": _bound_as_text(system.disturbance_bound),
        "noise_bound": _bound_as_text(system.noise_bound),
    }


def system_from_text(data: dict[str, Any], function: Any = None) -> System:
    """Read what `system_as_text` wrote.

    Args:
        data: plain data.
        function: the JAX function of the nonlinearity. It is code and is never read from a file; without it claims can
            be proved again (they rest on the bounds) but no observer can run.

    Raises:
        BadInput: an unknown or missing entry.
    """
    known_keys("The plant in the design file", data, [*_KEYS, *_LATER])
    if missing := [k for k in _KEYS if k not in data]:
        raise BadInput(f"The plant in the design file lacks {missing}; write it again with `Design.save`.")
    matrices: dict[str, Polynomial | None] = {letter: polynomial_from_text(m) for letter, m in data["matrices"].items()}
    nonlinearity = None
    if data["nonlinearity"] is None:
        matrices["F"] = None
    else:
        nonlinearity = _nonlinearity_from_text(data["nonlinearity"], function)
    parameters = [
        Parameter(
            p["name"],
            from_text(p["interval"][0]),
            from_text(p["interval"][1]),
            p["unit"],
            p["measured"],
            None if p["rate"] is None else from_text(p["rate"]),
            from_text(p["error"]),
            _factor_from_text(p.get("factor")),
            _rate_law_from_text(p.get("rate_law")),
        )
        for p in data["parameters"]
    ]
    signals = {k: data[k] for k in ("states", "inputs", "outputs", "units", "name")}
    dt = None if data["dt"] is None else from_text(data["dt"])
    later = {
        "scheduling_error": _error_from_text(data.get("scheduling_error")),
        **{k: _bound_from_text(data.get(k)) for k in ("disturbance_bound", "noise_bound")},
    }
    return System.build(**matrices, nonlinearity=nonlinearity, parameters=parameters, dt=dt, **signals, **later)


def _error_as_text(error: SchedulingError) -> dict[str, Any]:
    return {
        "true": {n: polynomial_as_text(p) for n, p in error.true.items()},
        "measured": {n: polynomial_as_text(p) for n, p in error.measured.items()},
        "box": {n: [to_text(lower), to_text(upper)] for n, (lower, upper) in error.box.items()},
    }


def _error_from_text(data: Any) -> SchedulingError | None:
    if data is None:
        return None
    true, measured = ({n: polynomial_from_text(p) for n, p in data[k].items()} for k in ("true", "measured"))
    return SchedulingError(true, measured, {n: (from_text(a), from_text(b)) for n, (a, b) in data["box"].items()})


def _bound_as_text(bound: tuple[float, ...] | None) -> list[str] | None:
    return None if bound is None else [to_text(b) for b in bound]


def _bound_from_text(texts: Any) -> tuple[float, ...] | None:
    return None if texts is None else tuple(from_text(t) for t in texts)


def _factor_from_text(data: Any) -> tuple[float, float]:
    return (1.0, 1.0) if data is None else (from_text(data[0]), from_text(data[1]))


def _rate_law_from_text(data: Any) -> RateLaw | None:
    if data is None:
        return None
    return tuple((from_text(c), tuple((str(n), int(k)) for n, k in powers.items())) for c, powers in data)


def _nonlinearity_as_text(f: Nonlinearity) -> dict[str, Any]:
    def optional(array: Any) -> Any:
        return None if array is None else matrix_text(np.asarray(array))

    return {
        "function": f"{f.function.__module__}:{f.function.__qualname__}",
        "H": matrix_text(f.H),
        "size": f.size,
        "jacobian_lower": optional(f.jacobian_lower),
        "jacobian_upper": optional(f.jacobian_upper),
        "lipschitz": None if f.lipschitz is None else to_text(float(f.lipschitz)),
        "domain": None if f.domain is None else [matrix_text(d)[0] for d in f.domain],
        "bound_status": f.bound_status,
        "jacobian_vertices": None
        if f.jacobian_vertices is None
        else [matrix_text(np.asarray(J)) for J in f.jacobian_vertices],
        "is_clipped": f.is_clipped,
    }


def _nonlinearity_from_text(data: dict[str, Any], function: Any) -> Nonlinearity:
    def absent(z: Any, u: Any) -> Any:
        raise BadInput(
            f"The design was loaded without its nonlinear function `{data['function']}`; give it back to run an observer: "
            "`Design.load(path, function=f)`, or `--function MODULE:NAME` on the command line, of a function that can be imported."
        )

    domain, vertices = data["domain"], data.get("jacobian_vertices")
    # A hull comes with its box.
    lower = None if vertices is not None else data["jacobian_lower"]
    found = Nonlinearity.bounded(
        absent if function is None else function,
        matrix_from_text(data["H"]),
        size=data["size"],
        jacobian=None if lower is None else (matrix_from_text(lower), matrix_from_text(data["jacobian_upper"])),
        lipschitz=None if data["lipschitz"] is None else from_text(data["lipschitz"]),
        domain=None if domain is None else (matrix_from_text([domain[0]])[0], matrix_from_text([domain[1]])[0]),
        hull=None if vertices is None else np.array([matrix_from_text(J) for J in vertices]),
    )
    return replace(found, bound_status=data["bound_status"], is_clipped=bool(data.get("is_clipped", False)))
