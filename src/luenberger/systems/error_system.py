"""The closed-loop error system of plant + gain, and the dissipation inequality a quadratic storage must satisfy on it.

With e = x - xhat, the correction observer  xhat' = A xhat + B u + F f(H xhat, u) + L (y - C xhat - D u)  has the error

    e' = (A(r) - L(r) C(r)) e + F(r) phi + E(r) d - (L (G - D N) + B N)(r) v,      phi = f(H x, u) - f(H xhat, u).

phi lies in one of two sets: {J H e, J in the Jacobian box}, written into A(r, J) with every varying Jacobian entry as one
more parameter, or {|phi| <= g |H e|}, kept as a channel with an S-procedure multiplier. The inequality is the analysis
condition; it says nothing of how a gain was found, so design and proof may both state it.

A two-degree-of-freedom observer evaluates f at zeta = xhat + L2 (y - C xhat - D u) instead of xhat; then
phi = f(H x, u) - f(H zeta, u), and x - zeta = (I - L2 C) e - L2 (G - D N) v stands where e stood.

Where the scheduling is measured with error, or the observer copies a model other than the plant, a further input
(x, u) or (xhat, u) drives the error; see `ErrorSystem.of`.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from luenberger.algebra import Polynomial, symmetric
from luenberger.core import BadInput, NotAccepted
from luenberger.systems.jacobian_box import as_floats, error_box, jacobian
from luenberger.systems.matrix import PlantMatrix
from luenberger.systems.scheduling_error import scheduling_rates
from luenberger.systems.system import System

Lift = Callable[[PlantMatrix], Polynomial]
Form = Literal["plant", "estimate"]
CHANNELS = ("disturbance", "noise", "scheduling")


@dataclass(frozen=True)
class ErrorSystem:
    """Error dynamics over parameters and Jacobian entries.

    Args:
        A: matrix of e, shape (nx, nx).
        inputs: channel name -> direction of that input: "disturbance" (nx, nd), "noise" (nx, nv) and, where the
            scheduling is measured with error or the model is not the plant, "scheduling" (nx, nx + nu).
        F: direction of the norm-bounded channel, (nx, nf), or None where the Jacobian box is used.
        H: argument of the norm-bounded channel, (nz, nx), or None.
        lipschitz: g of the norm-bounded channel.
        box: name -> interval of every free parameter, Jacobian entries and free rates included.
        dt: sample time of a discrete plant, else None.
        lift: turns float matrices into the coefficient arithmetic in use.
        true: scheduling name -> true scheduling as a polynomial of the free parameters.
        rates: scheduling name -> its time derivative as a polynomial of the free parameters.
    """

    A: Polynomial
    inputs: Mapping[str, Polynomial]
    F: Polynomial | None
    H: Polynomial | None
    lipschitz: float
    box: dict[str, tuple[float, float]]
    dt: float | None
    lift: Lift
    true: Mapping[str, Polynomial] = field(default_factory=dict)
    rates: Mapping[str, Polynomial] = field(default_factory=dict)

    @staticmethod
    def of(
        system: System,
        gain: Polynomial,
        lift: Lift = as_floats,
        *,
        model: System | None = None,
        form: Form = "plant",
        argument_gain: Polynomial | None = None,
    ) -> "ErrorSystem":
        """Close the loop.

        With measured scheduling m beside the true r, and the model matrices An, Bn of the observer (those of the plant
        where `model` is None), the error is driven by one of

            "plant":     e' = (An(m) - L(m) C(m)) e + [A(r) - An(m) - L (C(r) - C(m)),  B(r) - Bn(m) - L (D(r) - D(m))] (x; u)
            "estimate":  e' = (A(r) - L(m) C(r)) e  + [the same directions] (xhat; u).

        Both are exact; their gains differ, since x and xhat differ.

        Args:
            system: plant; its uncertainties must not enter, since the error would then depend on the state.
            gain: L(r), shape (nx, ny), taken at the measured scheduling.
            lift: arithmetic of the result.
            model: what the observer copies, with the outputs of the plant; None for the plant itself.
            form: which signal the scheduling error multiplies.
            argument_gain: L2(r), shape (nx, ny), of an observer with two degrees of freedom; None for zero.

        Raises:
            BadInput: gain of the wrong shape or with parameters that are not scheduling.
            NotAccepted: unmeasured parameters in A, C or F, or a scheduling error beside a nonlinearity or a function.
        """
        _require_measured(system, gain)
        if argument_gain is not None:
            _require_measured(system, argument_gain)
            if system.nonlinearity is None:
                raise NotAccepted(f"`{system.name}` has no nonlinearity whose argument a gain could correct.")
        error = system.measured_scheduling
        if (error is not None or model is not None) and system.nonlinearity is not None:
            raise NotAccepted(
                f"`{system.name}` has a nonlinearity; the error under a scheduling error is written for plants without one."
            )
        true = {} if error is None else {n: lift(p) for n, p in error.true.items()}
        measured = {} if error is None else {n: lift(p) for n, p in error.measured.items()}
        copy = system if model is None else model

        def at_true(matrix: PlantMatrix) -> Polynomial:
            return lift(matrix).compose(true) if true else lift(matrix)

        def at_measured(matrix: PlantMatrix) -> Polynomial:
            return lift(matrix).compose(measured) if measured else lift(matrix)

        L = at_measured(gain)
        C, Cm = at_true(system.C), at_measured(system.C)
        A = at_measured(copy.A) - L @ Cm if form == "plant" else at_true(system.A) - L @ C
        noise = L @ at_measured(system.G)
        if _is_noisy(system.N):
            entering = at_measured(system.N)
            noise = noise + (at_measured(copy.B) - L @ at_measured(system.D)) @ entering
        inputs = {"disturbance": at_true(system.E), "noise": -noise}
        if error is not None or model is not None:
            mismatch = at_true(system.A) - at_measured(copy.A) - L @ (C - Cm)
            if system.nu:
                steered = at_true(system.B) - at_measured(copy.B) - L @ (at_true(system.D) - at_measured(system.D))
                mismatch = beside(mismatch, steered, lift)
            inputs["scheduling"] = mismatch
        seen = lift(Polynomial.constant(np.eye(system.nx)))
        blurred = None
        if argument_gain is not None:
            L2, G = lift(argument_gain), lift(system.G)
            seen = seen - L2 @ C
            blurred = L2 @ (G - lift(system.D) @ lift(system.N) if _is_noisy(system.N) else G)
        F, H, gamma, A, feed = _nonlinear_part(system, A, seen, lift)
        if blurred is not None and feed is None:
            # |phi| <= g |H (x - zeta)| then holds noise inside the channel, which no input direction can say.
            del inputs["noise"]
        elif blurred is not None and feed is not None:
            inputs["noise"] = inputs["noise"] - feed @ blurred
        rates, rate_box = scheduling_rates(system.parameters) if true or system.nr else ({}, {})
        moving = {n: lift(p).compose(true) if true else lift(p) for n, p in rates.items()}
        return ErrorSystem(A, inputs, F, H, gamma, error_box(system) | rate_box, system.dt, lift, true, moving)

    @property
    def disturbance(self) -> Polynomial:
        """Direction of d, shape (nx, nd)."""
        return self.inputs["disturbance"]

    @property
    def noise(self) -> Polynomial:
        """Direction of v, shape (nx, nv)."""
        return self.inputs["noise"]

    def joined(self, names: str) -> Polynomial:
        """Return the directions of several channels side by side.

        Args:
            names: channels joined by "+", e.g. "scheduling+noise"; "both" is "disturbance+noise".

        Raises:
            BadInput: an unknown channel, or one that this error does not have.
        """
        wanted = ("disturbance+noise" if names == "both" else names).split("+")
        if unknown := [n for n in wanted if n not in self.inputs]:
            raise BadInput(f"The error has no input {unknown}; it has {list(self.inputs)}.")
        total = self.inputs[wanted[0]]
        for name in wanted[1:]:
            total = beside(total, self.inputs[name], self.lift)
        return total

    def eye(self, n: int) -> Polynomial:
        """The identity in the arithmetic in use."""
        return self.lift(Polynomial.constant(np.eye(n)))

    def storage(self, P: Any) -> tuple[Polynomial, Polynomial | None]:
        """Return P at the true scheduling and its time derivative along the scheduling (None for a constant P).

        Args:
            P: constant storage, or a polynomial of the scheduling parameters.

        Raises:
            NotAccepted: P depends on a parameter whose rate nobody bounds, or the plant is discrete.
        """
        P = Polynomial.constant(P)
        moving = [n for n, d in P.degree.items() if d]
        here = P.compose(self.true) if self.true else P
        if not moving:
            return here, None
        if self.dt is not None:
            raise NotAccepted("A parameter-dependent storage is written for continuous plants; use a constant one.")
        if still := [n for n in moving if n not in self.rates]:
            raise NotAccepted(
                f"The storage depends on {still}, whose rate nobody bounds; give the parameter a `rate` or a `rate_law`."
            )
        slopes = [(P.partial(n).compose(self.true) if self.true else P.partial(n)) * self.rates[n] for n in moving]
        total = slopes[0]
        for slope in slopes[1:]:
            total = total + slope
        return here, total

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
            P: storage matrix (nx, nx) in the arithmetic in use, or a polynomial of the scheduling parameters.
            rate: decay rate [1/s], or factor a step for a discrete plant.
            weight: performance output matrix (nz, nx), or None.
            inputs: direction of w, (nx, nw), with `gain_squared`; or None.
            gain_squared: squared L2 gain from w to the weighted error.
            multiplier: S-procedure multiplier s >= 0 of the norm-bounded channel.
        """
        P, motion = self.storage(P)
        corner = P * rate * 2 if self.dt is None else -(P * rate * rate)
        if motion is not None:
            corner = corner + motion
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


def beside(left: Polynomial, right: Polynomial, lift: Lift = as_floats) -> Polynomial:
    """Return [left, right].

    Args:
        left: shape (n, p).
        right: shape (n, q).
        lift: arithmetic of both.
    """
    p, q = left.shape[1], right.shape[1]
    first, second = (lift(Polynomial.constant(m)) for m in (np.eye(p, p + q), np.eye(q, p + q, p)))
    return left @ first + right @ second


def _is_noisy(N: PlantMatrix) -> bool:
    return not isinstance(N, Polynomial) or any(np.any(np.asarray(c) != 0) for _, c in N)


def _nonlinear_part(
    system: System, A: Polynomial, seen: Polynomial, lift: Lift
) -> tuple[Polynomial | None, Polynomial | None, float, Polynomial, Polynomial | None]:
    """Channel (F, H, g) or none, A with the Jacobian in it, and F J H where there is a Jacobian; x - zeta = seen e."""
    f = system.nonlinearity
    if f is None:
        return None, None, 0.0, A, None
    if f.jacobian_lower is not None:
        feed = lift(system.F) @ jacobian(system, lift) @ lift(Polynomial.constant(f.H))
        return None, None, 0.0, A + feed @ seen, feed
    return lift(system.F), lift(Polynomial.constant(f.H)) @ seen, f.lipschitz_bound, A, None


def _require_measured(system: System, gain: Polynomial) -> None:
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
