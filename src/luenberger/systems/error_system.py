"""The closed-loop error system of plant + gain, and the dissipation inequality a quadratic storage must satisfy on it.

With e = x - xhat, the correction observer  xhat' = A xhat + B u + F f(H xhat, u) + L (y - C xhat - D u)  has the error

    e' = (A(r) - L(r) C(r)) e + F(r) phi + E(r) d - L(r) G v,      phi = f(H x, u) - f(H xhat, u).

phi lies in one of two sets: {J H e, J in the Jacobian box}, written into A(r, J) with every varying Jacobian entry as one
more parameter, or {|phi| <= g |H e|}, kept as a channel with an S-procedure multiplier. The inequality is the analysis
condition; it says nothing of how a gain was found, so design and proof may both state it.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from luenberger.algebra import Polynomial, symmetric
from luenberger.core import BadInput, NotAccepted
from luenberger.systems.matrix import PlantMatrix, polynomial
from luenberger.systems.system import System

Lift = Callable[[PlantMatrix], Polynomial]


def as_floats(value: PlantMatrix) -> Polynomial:
    """The lift of design code: polynomial form with float coefficients.

    Args:
        value: a matrix of the plant.
    """
    return polynomial("a plant matrix", value)


@dataclass(frozen=True)
class ErrorSystem:
    """Error dynamics over parameters and Jacobian entries.

    Args:
        A: A(r) - L(r) C(r) + F(r) J H, shape (nx, nx).
        disturbance: E(r), shape (nx, nd).
        noise: -L(r) G(r), shape (nx, nv).
        F: direction of the norm-bounded channel, (nx, nf), or None where the Jacobian box is used.
        H: argument of the norm-bounded channel, (nz, nx), or None.
        lipschitz: g of the norm-bounded channel.
        box: name -> interval of every parameter, Jacobian entries included.
        dt: sample time of a discrete plant, else None.
        lift: turns float matrices into the coefficient arithmetic in use.
    """

    A: Polynomial
    disturbance: Polynomial
    noise: Polynomial
    F: Polynomial | None
    H: Polynomial | None
    lipschitz: float
    box: dict[str, tuple[float, float]]
    dt: float | None
    lift: Lift

    @staticmethod
    def of(system: System, gain: Polynomial, lift: Lift = as_floats) -> "ErrorSystem":
        """Close the loop.

        Args:
            system: plant; its uncertainties must not enter, since the error would then depend on the state.
            gain: L(r), shape (nx, ny).
            lift: arithmetic of the result.

        Raises:
            BadInput: gain of the wrong shape or with parameters that are not scheduling.
            NotAccepted: unmeasured parameters in A, C or F.
        """
        if gain.shape != (system.nx, system.ny):
            raise BadInput(
                f"The gain has shape {gain.shape}; a plant with {system.nx} states and {system.ny} outputs needs ({system.nx}, {system.ny})."
            )
        if unknown := set(gain.names) - set(system.scheduling_names):
            raise BadInput(
                f"The gain depends on {sorted(unknown)}, which `{system.name}` does not measure; use {system.scheduling_names}."
            )
        hidden = {n for m in (system.A, system.B, system.C, system.F) for n in m.names} & set(system.uncertainty)
        if hidden:
            raise NotAccepted(
                f"`{system.name}` depends on the unmeasured {sorted(hidden)}; the error of a copy of the plant then depends on the "
                "state itself. Freeze them with `system.freeze`, or use a robust or interval method."
            )
        L = lift(gain)
        A = lift(system.A) - L @ lift(system.C)
        F = H = None
        gamma = 0.0
        f = system.nonlinearity
        if f is not None and f.jacobian_lower is not None:
            J = jacobian(system, lift)
            A = A + lift(system.F) @ J @ lift(Polynomial.constant(f.H))
        elif f is not None:
            F, H, gamma = lift(system.F), lift(Polynomial.constant(f.H)), f.lipschitz_bound
        return ErrorSystem(A, lift(system.E), -(L @ lift(system.G)), F, H, gamma, error_box(system), system.dt, lift)

    def eye(self, n: int) -> Polynomial:
        """The identity in the arithmetic in use."""
        return self.lift(Polynomial.constant(np.eye(n)))

    def dissipation(
        self,
        P: Any,
        *,
        rate: Any = 0,
        weight: Any = None,
        inputs: Polynomial | None = None,
        gain_squared: Any = None,
        multiplier: Any = None,
    ) -> Polynomial:
        """Return the symmetric matrix that must be negative definite everywhere on the box.

        Continuous, V = e' P e:   dV/dt + 2 rate V + |weight e|^2 - gain_squared |w|^2 < 0.
        Discrete:                 V(e+) - rate^2 V + |weight e|^2 - gain_squared |w|^2 < 0, rate the factor a step.

        Args:
            P: storage matrix (nx, nx) in the arithmetic in use.
            rate: decay rate [1/s], or factor a step for a discrete plant.
            weight: performance output matrix (nz, nx), or None.
            inputs: direction of w, (nx, nw), with `gain_squared`; or None.
            gain_squared: squared L2 gain from w to the weighted error.
            multiplier: S-procedure multiplier s >= 0 of the norm-bounded channel.
        """
        P = Polynomial.constant(P)
        corner = Polynomial.constant(P * rate * 2 if self.dt is None else -(P * rate * rate))
        if weight is not None:
            corner = corner + weight.T @ weight
        columns, sizes = [], []
        if self.F is not None and self.H is not None:
            # The exact square of the double g, in the arithmetic in use.
            g = self.lift(Polynomial.constant(np.array([[self.lipschitz]])))
            corner = corner + (self.H.T @ self.H) * (g * multiplier) * g
            columns.append(self.F)
            sizes.append(self.eye(self.F.shape[1]) * multiplier)
        if inputs is not None:
            columns.append(inputs)
            sizes.append(self.eye(inputs.shape[1]) * gain_squared)
        if self.dt is None:
            PA = P @ self.A
            first = [PA + PA.T + corner, *(P @ column for column in columns)]
            return symmetric([first, *([-s, *[0] * (len(sizes) - k - 1)] for k, s in enumerate(sizes))])
        last = [self.A.T @ P, *(column.T @ P for column in columns)]
        rows = [[corner, *[0] * len(columns), last[0]]]
        rows += [[-s, *[0] * (len(sizes) - k - 1), last[k + 1]] for k, s in enumerate(sizes)]
        return symmetric([*rows, [-P]])


def error_box(system: System) -> dict[str, tuple[float, float]]:
    """Return name -> interval of every scheduling parameter and every varying Jacobian entry of a plant.

    Args:
        system: plant.
    """
    f = system.nonlinearity
    if f is None or f.jacobian_lower is None or f.jacobian_upper is None:
        return dict(system.scheduling_box)
    lower, upper = f.jacobian_lower, f.jacobian_upper
    return system.scheduling_box | {
        _entry(i, j): (float(lower[i, j]), float(upper[i, j])) for i, j in _varying(lower, upper)
    }


def jacobian(system: System, lift: Lift = as_floats) -> Polynomial:
    """Return df/dz as a matrix polynomial in which every varying entry is a parameter of `error_box`.

    Args:
        system: plant whose nonlinearity has a Jacobian box.
        lift: arithmetic of the result.

    Raises:
        NotAccepted: no Jacobian box.
    """
    f = system.nonlinearity
    if f is None or f.jacobian_lower is None or f.jacobian_upper is None:
        raise NotAccepted(
            f"`{system.name}` has no Jacobian box; give `jacobian=(lower, upper)` to its nonlinearity or let `Nonlinearity.enclosed` prove one."
        )
    lower, upper = f.jacobian_lower, f.jacobian_upper
    slopes = {}
    for i, j in _varying(lower, upper):
        slopes[_entry(i, j)] = np.zeros(lower.shape)
        slopes[_entry(i, j)][i, j] = 1.0
    return lift(Polynomial.affine(np.where(lower == upper, lower, 0.0), **slopes))


def _entry(i: int, j: int) -> str:
    return f"df{i + 1}_dz{j + 1}"


def _varying(lower: np.ndarray, upper: np.ndarray) -> list[tuple[int, int]]:
    return [(int(i), int(j)) for i, j in np.argwhere(lower < upper)]
