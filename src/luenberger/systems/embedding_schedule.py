"""A plant whose nonlinear terms are linear in the state once the measured states are taken as scheduling parameters."""

# pyright: reportUnknownMemberType=false, reportUnknownArgumentType=false
from collections.abc import Callable, Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from luenberger.algebra import Polynomial
from luenberger.algebra.jaxpr import trace
from luenberger.core import NotAccepted
from luenberger.systems.embedding_structure import JacobianStructure
from luenberger.systems.nonlinearity import Nonlinearity
from luenberger.systems.parameter import Parameter
from luenberger.systems.system import System


class PolynomialArithmetic:
    """Scalars that are polynomials (1, 1) of named parameters: sums, products, whole powers."""

    def __init__(self) -> None:
        self.functions: Mapping[str, Callable[..., Any]] = {
            "add": lambda a, b: a + b,
            "sub": lambda a, b: a - b,
            "mul": lambda a, b: a * b,
            "neg": lambda a: -a,
            "square": lambda a: a * a,
            "integer_pow": _power,
            "div": _quotient,
        }

    def constant(self, value: float) -> Polynomial:
        """Return the constant polynomial."""
        return Polynomial.constant(np.array([[value]]))

    def select(self, predicate: Any, when_true: Any, when_false: Any) -> Polynomial:
        """Refuse: a branch is no polynomial."""
        raise NotAccepted("The function uses `select`, which polynomials do not have; write it without branches.")


def measured_states(plant: System) -> dict[int, int]:
    """Return state -> output for the states that an output of its own measures, up to a factor.

    Args:
        plant: plant with a constant C.
    """
    C, D = np.asarray(plant.at("C")), np.asarray(plant.at("D"))
    alone = [i for i in range(plant.ny) if np.count_nonzero(C[i]) == 1 and not D[i].any()]
    return {int(np.flatnonzero(C[i])[0]): i for i in alone}


def scheduled_plant(plant: System, input_box: tuple[np.ndarray, np.ndarray]) -> System:
    """Return dx = A(r) x + B u with r the measured states and known inputs that enter f, exactly the plant on its domain.

    Every channel must be affine in the states that are not measured, with polynomials of what is measured as slopes;
    what depends on measured signals only is divided by a measured state.

    Args:
        plant: plant whose nonlinearity has a domain.
        input_box: inputs at which the nonlinearity is read, (lower, upper) each (nu,).

    Raises:
        NotAccepted: the reason why the nonlinearity is not of this form.

    Reference: J. S. Shamma, J. R. Cloutier, J. Guidance, Control and Dynamics 16 (1993) 256-263 (quasi-LPV form).
    """
    f = plant.nonlinearity
    if f is None:
        return plant
    assert f.domain is not None
    function, places = _of_states(f)
    H = np.eye(plant.nx)[places]
    measured = measured_states(plant)
    middle = 0.5 * (f.domain[0] + f.domain[1])
    u = 0.5 * (input_box[0] + input_box[1])
    structure = JacobianStructure.of(function, middle[places], u)
    _require_measured(plant, structure, places, set(measured))
    nz = len(places)
    # Arguments that are known at run time: measured states, then the inputs that are read.
    known = [j for j, s in enumerate(places) if s in measured] + sorted(s for s in structure.reads if s >= nz)
    hidden = [j for j, s in enumerate(places) if s not in measured]
    signals = [plant.states[s] for s in places] + list(plant.inputs)
    names = [f"measured_{signal}" for signal in signals]
    slopes, rest = _polynomials(function, names, known, hidden, (nz, len(u)))
    A = Polynomial.constant(np.asarray(plant.at("A")))
    F = np.asarray(plant.at("F"))
    for k in range(f.size):
        for j, slope in [
            *((j, slopes[k][position]) for position, j in enumerate(hidden)),
            *_divided(plant, rest[k], names, nz),
        ]:
            direction = np.outer(F[:, k], H[j])
            A = A + slope.map(lambda c, d=direction: float(np.asarray(c)[0, 0]) * d)
    A = _tidy(A)
    lower, upper = (
        np.concatenate([f.domain[0][places], input_box[0]]),
        np.concatenate([f.domain[1][places], input_box[1]]),
    )
    parameters = [
        Parameter(names[j], float(lower[j]), float(upper[j]), plant.units.get(signals[j], ""))
        for j in known
        if names[j] in A.names
    ]
    return plant.replace(A=A, F=None, nonlinearity=None, parameters=parameters)


def _of_states(f: Nonlinearity) -> tuple[Callable[..., jax.Array], list[int]]:
    """The nonlinearity as a function of single states, and which these are."""
    H, inner = np.asarray(f.H), f.function
    places = [int(s) for s in np.flatnonzero(H.any(axis=0))]
    mixing = H[:, places]
    return (lambda x, u: inner((mixing * x).sum(axis=1), u)), places


def _require_measured(plant: System, structure: JacobianStructure, places: list[int], measured: set[int]) -> None:
    outputs = ", ".join(plant.states[s] for s in sorted(measured)) or "none"
    for k, row in enumerate(structure.depends):
        for j, entry in enumerate(row):
            # Slopes along measured states may depend on anything: only those along the others become entries of A.
            for s in sorted(entry) if places[j] not in measured else ():
                if s < len(places) and places[s] not in measured:
                    raise NotAccepted(
                        f"df{k + 1}/d{plant.states[places[j]]} depends on `{plant.states[places[s]]}`, which no output "
                        f"measures on its own (measured: {outputs}); no parameter known at run time makes the plant linear. "
                        "Measure it, or use `box` or `hull`."
                    )


def _polynomials(
    function: Callable[..., jax.Array], names: list[str], known: list[int], hidden: list[int], sizes: tuple[int, int]
) -> tuple[list[list[Polynomial]], list[Polynomial]]:
    """Slopes of every channel along the hidden arguments, and its value where these are zero."""
    nz, nu = sizes
    eye = np.eye(nz + nu)

    def at(m: Any, w: Any) -> jax.Array:
        whole = sum((m[p] * eye[j] for p, j in enumerate(known)), jnp.zeros(nz + nu))
        whole = sum((w[p] * eye[j] for p, j in enumerate(hidden)), whole)
        return jnp.atleast_1d(function(whole[:nz], whole[nz:]))

    parameters = [_parameter(names[j]) for j in known]
    zero = jnp.zeros(len(hidden))
    found: list[Any] = []
    for part in (lambda m: jax.jacfwd(at, argnums=1)(m, zero), lambda m: at(m, zero)):
        read = trace(part, np.zeros(len(known)))
        try:
            values = read.run(parameters, PolynomialArithmetic())
        except NotAccepted as cause:
            raise NotAccepted(
                f"The nonlinearity is no polynomial of what is measured: {str(cause).split(', which')[0]}. Use `box` or "
                "`hull`, or write that term as a known input computed from the measurement."
            ) from None
        found.append([[values[k] for k in np.atleast_1d(row)] for row in read.outputs[0]])
    return found[0], [row[0] for row in found[1]]


def _divided(plant: System, value: Polynomial, names: list[str], nz: int) -> list[tuple[int, Polynomial]]:
    """Write a polynomial as a sum of polynomial times state; every term needs a state to divide by."""
    found: list[tuple[int, Polynomial]] = []
    for exponents, coefficient in value:
        if not np.asarray(coefficient).any():
            continue
        places = [k for k, name in enumerate(value.names) if exponents[k] and names.index(name) < nz]
        if not places:
            term = float(np.asarray(coefficient)[0, 0])
            factors = "".join(f" {n}^{e}" for n, e in zip(value.names, exponents, strict=True) if e)
            raise NotAccepted(
                f"The nonlinearity of `{plant.name}` has the term {term:g}{factors} without a state, for which a plant linear "
                "in the state has no place; choose states that are zero at an equilibrium, or make that term an input."
            )
        place = max(places, key=lambda k: exponents[k])
        lowered = tuple(e - (k == place) for k, e in enumerate(exponents))
        found.append((names.index(value.names[place]), Polynomial(value.names, {lowered: coefficient})))
    return found


def _tidy(value: Polynomial) -> Polynomial:
    """Leave out parameters and terms that do not matter."""
    terms = {e: c for e, c in value if np.asarray(c).any() or not any(e)}
    kept = [k for k in range(len(value.names)) if any(e[k] for e in terms)]
    return Polynomial([value.names[k] for k in kept], {tuple(e[k] for k in kept): c for e, c in terms.items()})


def _parameter(name: str) -> Polynomial:
    return Polynomial((name,), {(1,): np.array([[1.0]])})


def _power(base: Polynomial, exponent: int) -> Polynomial:
    if exponent < 0:
        raise NotAccepted("The function uses `a negative power`, which polynomials do not have; write it otherwise.")
    total = Polynomial.constant(np.array([[1.0]]))
    for _ in range(exponent):
        total = total * base
    return total


def _quotient(value: Polynomial, divisor: Polynomial) -> Polynomial:
    terms = [(e, c) for e, c in divisor if np.asarray(c).any()]
    if len(terms) != 1 or any(terms[0][0]):
        raise NotAccepted(
            "The function uses `a division by a signal`, which polynomials do not have; write it otherwise."
        )
    return value * (1.0 / float(np.asarray(terms[0][1])[0, 0]))
