"""The smallest H2 or L2 gain that any observer of a form has, by projection on what the outputs do not show.

A gain acts through the outputs alone. On N, a basis of ker C, it is gone from N' he(P A - Y C) N, and by Finsler's lemma a
storage with P N = V exists, and a gain L = rho P^-1 C', rho large, if and only if

    H2:  [he(V'A N), V'B; *, -I] < 0   and  [N'V, N'W'; W N, Z] > 0,  trace Z < level^2
    L2:  [he(V'A N), V'B, N'W'; *, -level^2 I, 0; *, 0, -I] < 0   and  N'V > 0.

For an unstructured observer  xhat' = (An - L C)(m) xhat + Bn(m) u + L y  the free matrices An, Bn leave the free terms V'An and V'Bn
in V'B, polynomials of the measured scheduling. The gain is large at the infimum, its direction is known:
for one output and two states L1 / L2 = -V2 / V1.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import product
from typing import Any, Literal

import cvxpy as cp
import numpy as np
from scipy.linalg import null_space

from luenberger.algebra import Polynomial, symmetric
from luenberger.core import Infeasible, NotAccepted
from luenberger.lmi import Block, Problem, solve
from luenberger.systems import System
from luenberger.systems.jacobian_box import error_box

Structure = Literal["luenberger", "unstructured"]


@dataclass(frozen=True)
class GammaStar:
    """Infimum of the level and the witness on ker C.

    Args:
        level: smallest H2 or L2 gain.
        unseen: V = P N, shape (nx, nk).
        direction: L1 / L2 of large gains for two states and one output where L2 is not zero, else None.
    """

    level: float
    unseen: np.ndarray
    direction: float | None


@dataclass(frozen=True)
class _Corner:
    """Plant matrices at one vertex of the free parameters: true, measured, and direction of the other inputs."""

    values: Mapping[str, float]
    A: np.ndarray
    B: np.ndarray
    A_measured: np.ndarray
    B_measured: np.ndarray
    E: np.ndarray


def can_bound(system: System, inputs: str, form: str) -> bool:
    """Tell whether `gamma_star` covers a plant: multi-affine, constant C, and a gain that amplifies no input.

    Args:
        system: plant.
        inputs: channels of w joined by "+".
        form: which signal a scheduling error multiplies.
    """
    return _obstacle(system, inputs) == ""


def gamma_star(
    system: System,
    norm: Literal["h2", "l2"],
    inputs: str = "scheduling",
    form: Literal["plant", "estimate"] = "estimate",
    *,
    structure: Structure = "luenberger",
    weight: np.ndarray | None = None,
    decay_rate: float = 0.0,
) -> GammaStar:
    """Return the infimum of the level over all gains, from an inequality that has no gain in it.

    Choose it to know what can be asked for, and as a check of a design; the infimum is not attained.

    Assumes: multi-affine plant in its free parameters, so that the vertices decide; constant C; no input that L multiplies.

    Args:
        system: plant.
        norm: "h2" or "l2".
        inputs: "scheduling", "disturbance", or both joined by "+".
        form: which signal a scheduling error multiplies; an unstructured observer is bounded in the form "estimate".
        structure: "luenberger" copies the plant, "unstructured" has matrices of its own, affine in the monomials of A and B.
        weight: W, shape (nz, nx), default the identity.
        decay_rate: wanted decay [1/s].

    Raises:
        NotAccepted: outside the assumptions.
        Infeasible: no gain has a finite level.

    Reference: S. Boyd et al. 1994, elimination of matrix variables, for (3.41), (3.43), (3.52), (3.53) of Wang 2014.
    """
    if obstacle := _obstacle(system, inputs):
        raise NotAccepted(obstacle)
    if structure == "unstructured" and form != "estimate":
        raise NotAccepted("The bound of an unstructured observer is written for form = `estimate`; ask for that form.")
    problem = _posed(system, norm, inputs, form, structure, weight, decay_rate)
    found = solve(problem)
    if found is None or not found.objective > 0:
        raise Infeasible(
            f"No gain gives `{system.name}` a finite {norm} level with a constant storage.", f"{norm}_gain"
        )
    unseen = found.values["V"]
    known = unseen.shape == (2, 1) and unseen[0, 0] != 0
    # A large gain is a multiple of P^-1 C'; for two states that is orthogonal to V.
    return GammaStar(float(np.sqrt(found.objective)), unseen, float(-unseen[1, 0] / unseen[0, 0]) if known else None)


def _posed(
    system: System,
    norm: str,
    inputs: str,
    form: str,
    structure: Structure,
    weight: np.ndarray | None,
    decay_rate: float,
) -> Problem:
    """Minimise the squared level over V, and over the free matrices of an unstructured observer."""
    N = _unseen(system)
    W = np.eye(system.nx) if weight is None else np.asarray(weight, dtype=float)
    V, reach = cp.Variable((system.nx, N.shape[1]), name="V"), cp.Variable(name="reach")
    copy, variables = _free_copy(system, V) if structure == "unstructured" else ({}, {})
    blocks: list[Block] = []
    for corner in _corners(system):
        A = corner.A_measured if form == "plant" else corner.A
        entering = _entering(system, V, corner, inputs, copy, structure)
        drift = V.T @ A @ N
        blocks.append(_block("gain", _inequality(norm, drift + drift.T, entering, N, W, reach)))
        if decay_rate > 0:
            blocks.append(_block("decay", drift + drift.T + decay_rate * (V.T @ N + N.T @ V)))
    level, more = _positive(norm, V, N, W, reach)
    return Problem({"V": V, "reach": reach, **variables, **more}, [*blocks, *level], reach)


def _entering(
    system: System, V: cp.Variable, corner: _Corner, inputs: str, copy: Mapping[str, Polynomial], structure: Structure
) -> list[Any]:
    """V' times the directions of the parts of w."""
    parts: list[Any] = []
    for name in inputs.split("+"):
        if name == "disturbance":
            parts.append(V.T @ corner.E)
        elif structure == "luenberger":
            parts.append(V.T @ (corner.A - corner.A_measured))
            parts += [V.T @ (corner.B - corner.B_measured)] * bool(system.nu)
        else:
            parts.append(V.T @ corner.A - _value(copy["A"], corner))
            parts += [V.T @ corner.B - _value(copy["B"], corner)] if system.nu else []
    return parts


def _inequality(norm: str, drift: Any, entering: list[Any], N: np.ndarray, W: np.ndarray, reach: Any) -> Polynomial:
    """The matrix above; every part of w and the performance output have a block row of their own."""
    sizes: list[Any] = [(1.0 if norm == "h2" else reach) * np.eye(part.shape[1]) for part in entering]
    columns = list(entering)
    if norm == "l2":
        columns.append(N.T @ W.T)
        sizes.append(np.eye(W.shape[0]))
    return symmetric([[drift, *columns], *([-s, *[0] * (len(sizes) - k - 1)] for k, s in enumerate(sizes))])


def _positive(
    norm: str, V: cp.Variable, N: np.ndarray, W: np.ndarray, reach: Any
) -> tuple[list[Block], dict[str, cp.Variable]]:
    """N'V > 0, a number since one direction is unseen, and for H2 large enough."""
    size = N.T @ V
    if norm == "l2":
        return [_block("storage", -size)], {}
    Z = cp.Variable((W.shape[0], W.shape[0]), symmetric=True, name="Z")
    wide = symmetric([[size, N.T @ W.T], [Z]])
    unit = np.eye(W.shape[0])
    trace = sum((unit[[k]] @ Z @ unit[:, [k]] for k in range(1, W.shape[0])), start=unit[[0]] @ Z @ unit[:, [0]])
    return [_block("trace", -wide), _block("level", trace - reach * np.eye(1))], {"Z": Z}


def _free_copy(system: System, V: cp.Variable) -> tuple[dict[str, Polynomial], dict[str, cp.Variable]]:
    """V'An and V'Bn with one row of unknowns for every monomial of A and B, and a constant one."""
    A, B = system.polynomial("A"), system.polynomial("B")
    names = system.scheduling_names
    keys = {(0,) * len(names)} | {e for m in (A, B) for e, _ in m.over(tuple(names))}
    made: dict[str, Polynomial] = {}
    variables: dict[str, cp.Variable] = {}
    for letter, columns in (("A", system.nx), ("B", system.nu)):
        if columns:
            parts = {e: cp.Variable((V.shape[1], columns), name=f"{letter}{e}") for e in sorted(keys)}
            made[letter] = Polynomial(names, parts)
            variables |= {p.name(): p for p in parts.values()}
    return made, variables


def _value(part: Polynomial, corner: _Corner) -> Any:
    return part({n: corner.values[n] for n in part.names})


def _corners(system: System) -> Iterator[_Corner]:
    """Evaluate the plant at every vertex of its free parameters, true and measured side by side."""
    error, box = system.measured_scheduling, error_box(system)
    for ends in product(*box.values()):
        point = dict(zip(box, ends, strict=True))

        def at(values: Mapping[str, Polynomial] | None, point: dict[str, float] = point) -> dict[str, float]:
            if values is None:
                return {n: point[n] for n in system.scheduling_names}
            return {n: float(p({k: point[k] for k in p.names})[0, 0]) for n, p in values.items()}

        true, measured = at(None if error is None else error.true), at(None if error is None else error.measured)
        A, B, E = (system.polynomial(letter) for letter in "ABE")
        yield _Corner(
            measured,
            _numbers(A, true),
            _numbers(B, true),
            _numbers(A, measured),
            _numbers(B, measured),
            _numbers(E, true),
        )


def _numbers(matrix: Polynomial, values: Mapping[str, float]) -> np.ndarray:
    return np.asarray(matrix({n: values[n] for n in matrix.names}))


def _obstacle(system: System, inputs: str) -> str:
    """Why the projection does not apply, or nothing."""
    names = ("disturbance+noise" if inputs == "both" else inputs).split("+")
    if "noise" in names:
        return "Noise enters through the gain, which this bound projects away; leave `noise` out."
    if system.dt is not None or system.nonlinearity is not None:
        return f"`{system.name}` is discrete or nonlinear; this bound is for continuous plants that are linear in the state."
    if any(system.polynomial("C").degree.values()):
        return f"C of `{system.name}` depends on the scheduling; this bound needs a constant C."
    if (unseen := _unseen(system).shape[1]) != 1:
        return f"The outputs of `{system.name}` leave {unseen} directions unseen; this bound is written for one."
    D = system.polynomial("D")
    if "scheduling" in names and any(D.degree.values()) and system.measured_scheduling is not None:
        return f"D of `{system.name}` depends on the scheduling, so the gain amplifies its error; this bound does not cover that."
    error = system.measured_scheduling
    maps = [] if error is None else [error.true, error.measured]
    for letter in "ABE":
        matrix = system.polynomial(letter)
        if not all((matrix.compose(m) if m else matrix).is_multi_affine for m in maps or [{}]):
            return f"{letter} of `{system.name}` is not multi-affine in its free parameters, so its vertices decide nothing."
    return ""


def _unseen(system: System) -> np.ndarray:
    """Basis of ker C of a constant C, (nx, nk)."""
    C = system.polynomial("C")
    return null_space(np.asarray(C(dict.fromkeys(C.names, 0.0)), dtype=float))


def _block(name: str, matrix: Any) -> Block:
    return Block(name, Polynomial.constant(matrix))
