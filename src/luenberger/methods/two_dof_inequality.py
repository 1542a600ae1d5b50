"""The inequalities of a two-degree-of-freedom design by multipliers, over gains that are free, fixed, or free beside a storage."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import cvxpy as cp
import numpy as np

from luenberger.algebra import Polynomial, symmetric
from luenberger.lmi import Block, Problem, Relaxation
from luenberger.methods.channels import Channels, diagonal, row_space
from luenberger.methods.method import scheduled_variable
from luenberger.systems import System
from luenberger.systems.error_system import beside
from luenberger.systems.jacobian_box import as_floats


@dataclass(frozen=True)
class Limits:
    """Largest norms of the gains; None for no limit.

    Args:
        gain: of what `Unknowns.bounded` says.
        argument: of L2.
    """

    gain: float | None = None
    argument: float | None = None


@dataclass(frozen=True)
class Unknowns:
    """What is looked for: some of storage, multipliers and gains are variables, the rest are numbers.

    Args:
        channels: channels that the multipliers belong to.
        P: storage, (nx, nx).
        multipliers: tau, shape (na, 1).
        Y: P L1, (nx, ny).
        Lb: tau times the argument rows of L2, (na, ny).
        bounded: P times the gain that a limit speaks of, (nx, ny).
        argument: (T, N, S) with |L2| <= limit wherever T >= p S and N' T^-1 N <= limit^2 p; None where L2 is given.
        variables: the variables by name.
        first: L at the present values of the variables, once L2 is known there.
        second: L2 at the present values of the variables.
    """

    channels: Channels
    P: Any
    multipliers: Any
    Y: Polynomial
    Lb: Polynomial
    bounded: Polynomial
    argument: tuple[Polynomial, Polynomial, np.ndarray] | None
    variables: dict[str, cp.Variable]
    first: Callable[[Polynomial], Polynomial]
    second: Callable[[], Polynomial]

    def gains(self, values: Mapping[str, np.ndarray]) -> tuple[Polynomial, Polynomial]:
        """Return (L, L2) at a solution.

        Args:
            values: of all variables.
        """
        for name, variable in self.variables.items():
            variable.save_value(values[name])
        second = self.second()
        return self.first(second), second


@dataclass(frozen=True)
class Posing:
    """A plant with its channels, and what is asked of the error.

    Args:
        system: plant.
        channels: channels with one multiplier an argument.
        decay_rate: wanted decay [1/s].
        weight: W of the L2 gain; None where the gain norm is the goal.
        inputs: channels of w joined by "+".
        scheduled: whether gains follow the plant.
        relaxation: of the box.
    """

    system: System
    channels: Channels
    decay_rate: float
    weight: np.ndarray | None
    inputs: str
    scheduled: bool
    relaxation: Relaxation

    def free(self) -> Unknowns:
        """Return everything as a variable: jointly convex, but the limit speaks of L1, which is L where no slope is split off."""
        ch, H = self.channels, self.channels.arguments
        P, Y, variables = self._storage_and_gain("Y")
        V = row_space(H)
        if V.shape[1] == len(H):
            tau = cp.Variable((len(H), 1), name="tau")
            Lb, more = self._scheduled(len(H), "Lb")
            # L2 = h^+ T^-1 Lb, so L2' L2 = Lb' T^-1 (h h')^-1 T^-1 Lb.
            size = diagonal(tau), Lb, np.linalg.inv(H @ H.T)
            multipliers: Any = tau

            def second() -> Polynomial:
                return Lb.map(lambda c: np.linalg.pinv(H) @ (np.asarray(c.value) / np.asarray(tau.value)))
        else:
            # tau h L2 is linear in Z = tau V' L2 for one tau alone.
            tau = cp.Variable((1, 1), name="tau")
            Z, more = self._scheduled(V.shape[1], "Z")
            multipliers, Lb = np.ones((len(H), 1)) @ tau, (H @ V) @ Z
            size = diagonal(np.ones((V.shape[1], 1)) @ tau), Z, np.eye(V.shape[1])

            def second() -> Polynomial:
                return Z.map(lambda c: V @ np.asarray(c.value) / np.asarray(tau.value)[0, 0])

        def first(L2: Polynomial) -> Polynomial:
            L1 = Y.map(lambda y: np.linalg.solve(np.asarray(P.value), np.asarray(y.value)))
            return L1 - self._split() @ L2 if ch.is_shifted else L1

        return Unknowns(ch, P, multipliers, Y, Lb, Y, size, {"P": P, "tau": tau, **variables, **more}, first, second)

    def fixed(self, L2: Polynomial) -> Unknowns:
        """Return storage, multipliers and L as variables beside a given L2; the limit speaks of L.

        Args:
            L2: argument gain, (nx, ny).
        """
        ch = self.channels.behind(L2, as_floats(self.system.C), self.system.scheduling_box)
        fed = self._split() @ L2
        P, X, variables = self._storage_and_gain("X", fed if ch.is_shifted else None)
        tau = cp.Variable((len(ch.arguments), 1), name="tau")
        Lb = diagonal(tau) @ (ch.arguments @ L2)

        def first(_: Polynomial) -> Polynomial:
            return X.map(lambda y: np.linalg.solve(np.asarray(P.value), np.asarray(y.value)))

        Y = X + Polynomial.constant(P) @ fed
        return Unknowns(ch, P, tau, Y, Lb, X, None, {"P": P, "tau": tau, **variables}, first, lambda: L2)

    def stored(self, fixed: Unknowns, values: Mapping[str, np.ndarray]) -> Unknowns:
        """Return both gains as variables beside a given storage and multipliers; the limit speaks of L.

        Args:
            fixed: what `fixed` gave.
            values: its solution.
        """
        P, multipliers, ch = values["P"], values["tau"], fixed.channels
        V = row_space(self.channels.arguments)
        Z, more = self._scheduled(V.shape[1], "Z", fixed.second())
        split = self._split() @ V @ Z
        L, variables = self._scheduled(self.system.nx, "L", split if ch.is_shifted else None)
        Lb = np.diag(multipliers[:, 0]) @ (ch.arguments @ V) @ Z
        one = np.eye(V.shape[1])

        def first(_: Polynomial) -> Polynomial:
            return L.map(lambda c: np.asarray(c.value))

        def second() -> Polynomial:
            return Z.map(lambda c: V @ np.asarray(c.value))

        size, Y = (Polynomial.constant(one), Z, one), P @ (L + split)
        return Unknowns(ch, P, multipliers, Y, Lb, P @ L, size, {**variables, **more}, first, second)

    def problem(self, unknowns: Unknowns, limits: Limits) -> Problem:
        """Return the problem whose objective is the squared gain norm, or the squared L2 gain in units of `unit`.

        Args:
            unknowns: what is looked for.
            limits: of the gains.
        """
        squared = cp.Variable(name="squared")
        variables = {**unknowns.variables, "squared": squared}
        blocks: list[Block] = []
        if self.weight is None or self.decay_rate > 0:
            blocks.append(self._block("decay", self._decay(unknowns)))
        nx, ny = unknowns.Y.shape
        P, X = Polynomial.constant(unknowns.P), unknowns.bounded
        if self.weight is not None:
            blocks += [self._block("l2_gain", self._l2(unknowns, squared)), Block("storage", -P)]
        if self.weight is None or limits.gain is not None:
            # In either case L' P L <= unit^2 size and P >= p, so |L|^2 <= unit^2 size / p.
            p, size, unit = 1.0, squared, 1.0
            if self.weight is not None and limits.gain is not None:
                p = size = variables["floor"] = cp.Variable(name="floor")
                unit = limits.gain
            wide = symmetric([[P, X * (1 / unit)], [Polynomial.constant(size * np.eye(ny))]])
            blocks += [Block("storage", Polynomial.constant(p * np.eye(nx) - unknowns.P)), self._block("gain", -wide)]
        if limits.argument is not None and unknowns.argument is not None:
            T, N, S = unknowns.argument
            p = variables["argument_floor"] = cp.Variable(name="argument_floor")
            wide = symmetric([[T, N * (1 / limits.argument)], [Polynomial.constant(p * np.eye(ny))]])
            blocks += [self._block("argument_gain", -wide), Block("argument_floor", Polynomial.constant(p * S) - T)]
        return Problem(variables, blocks, squared)

    @property
    def unit(self) -> float:
        """What an L2 gain of one in the scaled problem is in the units of the plant."""
        return self.weight_size * self._input_size()

    @property
    def weight_size(self) -> float:
        """Norm of W; with W in these units the storage is divided by its square."""
        assert self.weight is not None
        return float(np.linalg.norm(self.weight, 2))

    def _drift(self, u: Unknowns) -> Polynomial:
        A = as_floats(self.system.A) + self._split()
        return Polynomial.constant(u.P) @ A - u.Y @ as_floats(self.system.C)

    def _split(self) -> Polynomial:
        """F K H, the slopes split off."""
        assert self.system.nonlinearity is not None
        return as_floats(self.system.F) @ (self.channels.fixed @ np.asarray(self.system.nonlinearity.H))

    def _seen(self, u: Unknowns) -> Polynomial:
        return diagonal(u.multipliers) @ u.channels.arguments - u.Lb @ as_floats(self.system.C)

    def _decay(self, u: Unknowns) -> Polynomial:
        drift = self._drift(u)
        corner = drift + drift.T + Polynomial.constant(2 * self.decay_rate * u.P)
        PB = Polynomial.constant(u.P) @ u.channels.directions
        return u.channels.inequality(corner, PB, u.multipliers, self._seen(u))

    def _l2(self, u: Unknowns, squared: Any) -> Polynomial:
        assert self.weight is not None
        W = self.weight / self.weight_size
        drift = self._drift(u)
        P = Polynomial.constant(u.P)
        columns, blurred = self._inputs(u)
        driven = columns, blurred, squared
        corner = drift + drift.T + Polynomial.constant(W.T @ W)
        return u.channels.inequality(corner, P @ u.channels.directions, u.multipliers, self._seen(u), driven)

    def _inputs(self, u: Unknowns) -> tuple[Polynomial, Polynomial]:
        """Columns of w, scaled, in the rows of e and in tau times the arguments."""
        P, scale = Polynomial.constant(u.P), 1 / self._input_size()
        made: list[tuple[Polynomial, Polynomial]] = []
        for name in wanted(self.inputs):
            if name == "disturbance":
                E = as_floats(self.system.E)
                made.append((P @ E, Polynomial.constant(np.zeros((len(u.channels.arguments), E.shape[1])))))
            else:
                G, entering = self._noise()
                made.append((-(u.Y @ G) - P @ entering, -(u.Lb @ G)))
        columns, blurred = made[0]
        for more, other in made[1:]:
            columns, blurred = beside(columns, more), beside(blurred, other)
        return columns * scale, blurred * scale

    def _noise(self) -> tuple[Polynomial, Polynomial]:
        """Noise of y - D u, and what the noise of the inputs adds to the derivative."""
        system = self.system
        N = as_floats(system.N)
        return as_floats(system.G) - as_floats(system.D) @ N, as_floats(system.B) @ N

    def _input_size(self) -> float:
        parts = [as_floats(self.system.E)] if "disturbance" in wanted(self.inputs) else []
        parts += list(self._noise()) if "noise" in wanted(self.inputs) else []
        hulls = [c for p in parts for c in p.bernstein(self.system.scheduling_box).values() if c.size]
        return max((float(np.linalg.norm(c, 2)) for c in hulls), default=0.0) or 1.0

    def _storage_and_gain(
        self, name: str, like: Polynomial | None = None
    ) -> tuple[cp.Variable, Polynomial, dict[str, cp.Variable]]:
        P = cp.Variable((self.system.nx, self.system.nx), symmetric=True, name="P")
        gain, variables = self._scheduled(self.system.nx, name, like)
        return P, gain, variables

    def _scheduled(
        self, rows: int, name: str, like: Polynomial | None = None
    ) -> tuple[Polynomial, dict[str, cp.Variable]]:
        """A decision matrix with the monomials of the plant, and of one more polynomial of numbers or variables."""
        shown = [as_floats(getattr(self.system, letter)) for letter in "ACF"]
        extra = [] if like is None else [like.map(lambda c: np.ones((1, 1)))]
        kept = [*shown, *extra] if self.scheduled else []
        return scheduled_variable(rows, self.system.ny, kept, self.system.scheduling_names, name)

    def _block(self, name: str, matrix: Polynomial) -> Block:
        return Block(name, matrix, self.system.scheduling_box, relaxation=self.relaxation)


def wanted(inputs: str) -> list[str]:
    """Return the channels that a text names.

    Args:
        inputs: names joined by "+"; "both" is "disturbance+noise".
    """
    return ("disturbance+noise" if inputs == "both" else inputs).split("+")
