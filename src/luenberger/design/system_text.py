"""A plant as plain data for JSON, and back; numbers are rationals as strings, the nonlinear function stays code."""

from typing import Any

import numpy as np

from luenberger.algebra import Polynomial
from luenberger.certify.claim import from_text, matrix_from_text, matrix_text, to_text
from luenberger.core import BadInput, NotAccepted
from luenberger.core.checks import known_keys
from luenberger.systems import Nonlinearity, Parameter, System

_KEYS = ("name", "dt", "states", "inputs", "outputs", "units", "parameters", "matrices", "nonlinearity")


def polynomial_as_text(polynomial: Polynomial) -> dict[str, Any]:
    """Return names, shape and terms of a matrix polynomial."""
    terms = [{"exponents": list(e), "coefficient": matrix_text(np.asarray(c))} for e, c in polynomial]
    return {"names": list(polynomial.names), "shape": list(polynomial.shape), "terms": terms}


def polynomial_from_text(data: dict[str, Any]) -> Polynomial:
    """Read what `polynomial_as_text` wrote.

    Args:
        data: names, shape and terms.
    """
    shape = tuple(data["shape"])
    return Polynomial(
        data["names"],
        {tuple(t["exponents"]): matrix_from_text(t["coefficient"]).reshape(shape) for t in data["terms"]},
    )


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
            }
            for p in system.parameters
        ],
        "matrices": {letter: polynomial_as_text(system.polynomial(letter)) for letter in system.matrices},
        "nonlinearity": None if f is None else _nonlinearity_as_text(f),
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
    known_keys("The plant in the design file", data, _KEYS)
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
        )
        for p in data["parameters"]
    ]
    signals = {k: data[k] for k in ("states", "inputs", "outputs", "units", "name")}
    dt = None if data["dt"] is None else from_text(data["dt"])
    return System.build(**matrices, nonlinearity=nonlinearity, parameters=parameters, dt=dt, **signals)


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
    }


def _nonlinearity_from_text(data: dict[str, Any], function: Any) -> Nonlinearity:
    def optional(rows: Any) -> Any:
        return None if rows is None else matrix_from_text(rows)

    def absent(z: Any, u: Any) -> Any:
        raise BadInput(
            f"The design was loaded without its nonlinear function `{data['function']}`; pass `function=` to `Design.load` to run an observer."
        )

    domain = data["domain"]
    return Nonlinearity(
        function=absent if function is None else function,
        H=matrix_from_text(data["H"]),
        size=data["size"],
        jacobian_lower=optional(data["jacobian_lower"]),
        jacobian_upper=optional(data["jacobian_upper"]),
        lipschitz=None if data["lipschitz"] is None else from_text(data["lipschitz"]),
        domain=None
        if domain is None
        else (np.array([from_text(x) for x in domain[0]]), np.array([from_text(x) for x in domain[1]])),
        bound_status=data["bound_status"],
    )
