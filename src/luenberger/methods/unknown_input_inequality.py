"""The inequality of the unknown-input observer: V falls by a share a step up to the supply, for every mode that may follow.

For a transition from mode i to mode j, V_i = e' Q_i e, N_i = (I + H_i C) A - K_i C and B_i the columns of the inputs,

    [[(fade - 1) Q_i, 0, N_i' S_i'], [*, -supply I, B_i' S_i'], [*, *, Q_j - S_i - S_i']] < 0

gives V_j(e+) < (1 - fade) V_i(e) + supply |w|^2: multiply by [[I, 0, N'], [0, I, B']] from the left and its transpose from the
right. With W = S K and X = S Z, H = U + Z M', it is linear in all unknowns. Where j = i, or one Q serves all, S = Q loses nothing. With the storage of the mode that acted last, Q_i stands before and Q_j after
the step of mode j, and S_j = Q_j loses nothing either.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import cvxpy as cp
import numpy as np

from luenberger.algebra import Polynomial, block, symmetric
from luenberger.lmi import Block, Problem, Relaxation
from luenberger.methods.method import scheduled_variable
from luenberger.methods.unknown_input_plant import OpenMode

Storage = Literal["common", "mode", "last", "dwell"]
Attenuate = Literal["lumped", "physical"]


@dataclass(frozen=True)
class Form:
    """Which inequality is posed.

    Args:
        storage: one Q for all modes; one a mode with any switching, that of the mode which acts next ("mode") or which acted last
            ("last"); or one a mode with a dwell time.
        attenuate: "lumped" for all that reaches the error at once, "physical" for factors and noises one by one.
        growth: Q_j <= growth Q_i at a switch, with a dwell time.
        constant: True for gains that do not follow the scheduling.
        slack: True for a free S where S = Q would do.
        relaxation: how polynomial inequalities become matrix inequalities.
        unit: what the columns of the inputs are divided by, so that they compare with the error; the supply is in its square.
    """

    storage: Storage
    attenuate: Attenuate
    growth: float
    constant: bool
    slack: bool
    relaxation: Relaxation
    unit: float = 1.0

    def transitions(self, count: int) -> list[tuple[int, int, int]]:
        """Return the triples (mode whose storage counts before, mode that acts, mode whose storage counts after it).

        Args:
            count: number of modes.
        """
        every = [(i, j) for i in range(count) for j in range(count)]
        if self.storage == "mode":
            return [(i, i, j) for i, j in every]
        if self.storage == "last":
            return [(i, j, j) for i, j in every]
        return [(i, i, i) for i in range(count)]


@dataclass(frozen=True, eq=False)
class PosedGain:
    """The problem for one fade, with what recovers gains from its solution.

    Args:
        problem: blocks, unknowns and the supply to minimise.
        storages: Q, one a mode, or one for all.
        slacks: S, one a mode.
        gains: W = S K, one a mode.
        free: X = S Z, one a mode; None where decoupling leaves no freedom.
        loops: S N, one a mode.
    """

    problem: Problem
    storages: tuple[cp.Variable, ...]
    slacks: tuple[Any, ...]
    gains: tuple[Polynomial, ...]
    free: tuple[cp.Variable | None, ...]
    loops: tuple[Polynomial, ...]

    def recovered(self, modes: Sequence[OpenMode]) -> tuple[tuple[Polynomial, ...], tuple[np.ndarray, ...]]:
        """Return (K, H) of every mode from the values that the variables hold.

        Args:
            modes: the modes that the problem was posed for.
        """
        K, H = [], []
        for mode, S, W, X in zip(modes, self.slacks, self.gains, self.free, strict=True):
            inverse = np.linalg.inv(np.asarray(S.value))
            K.append(W.map(lambda w, inverse=inverse: inverse @ np.asarray(w.value)))
            Z = np.zeros((len(inverse), 0)) if X is None else inverse @ np.asarray(X.value)
            H.append(mode.decoupling(Z))
        return tuple(K), tuple(H)


def posed_gain(modes: Sequence[OpenMode], form: Form, fade: float, alpha: float = 1.0) -> PosedGain:
    """Pose the smallest supply for a fade, with Q >= alpha I.

    Args:
        modes: modes before their gains are chosen.
        form: which inequality.
        fade: share by which V falls in a step, 0 < fade < 1.
        alpha: scale of the storages; the inequality is homogeneous, so only supply / alpha says anything.
    """
    nx = len(modes[0].U)
    supply = cp.Variable(name="supply")
    variables: dict[str, cp.Variable] = {"supply": supply}
    Q = [_variable(variables, f"Q{i}", nx, nx, symmetric=True) for i in range(_count(modes, form))]
    S = _slacks(variables, Q, len(modes), form)
    W: list[Polynomial] = []
    X: list[cp.Variable | None] = []
    loops: list[Polynomial] = []
    for i, mode in enumerate(modes):
        like = [] if form.constant else [mode.A]
        gain, own = scheduled_variable(nx, mode.C.shape[0], like, tuple(mode.box), f"W{i}_")
        variables |= own
        W.append(gain)
        X.append(_variable(variables, f"X{i}", nx, mode.free) if mode.free else None)
        loops.append(_projected(mode, S[i], X[i]) @ mode.A - gain @ mode.C)
    blocks = [Block("storage", Polynomial.constant(alpha * np.eye(nx) - q)) for q in Q]
    for first, i, last in form.transitions(len(modes)):
        before, after = Q[first % len(Q)], Q[last % len(Q)]
        corner = Polynomial.constant(after - S[i] - S[i].T)
        inputs = _inputs(modes[i], form, S[i], W[i], X[i])
        matrix = _inequality(before, corner, loops[i], inputs, fade, supply)
        blocks.append(Block(f"fade of mode {i}", matrix, modes[i].box, relaxation=form.relaxation))
    if form.storage == "dwell":
        pairs = [(i, j) for i in range(len(Q)) for j in range(len(Q)) if i != j]
        blocks += [Block("growth at a switch", Polynomial.constant(Q[j] - form.growth * Q[i])) for i, j in pairs]
    return PosedGain(Problem(variables, blocks, supply), tuple(Q), tuple(S), tuple(W), tuple(X), tuple(loops))


def posed_supply(
    loops: Sequence[tuple[Polynomial, Polynomial, dict[str, tuple[float, float]]]], form: Form, fade: float
) -> tuple[Problem, list[cp.Variable]]:
    """Pose the smallest supply for gains already fixed, Q >= I: linear in Q, so that nothing is lost to a common S.

    Args:
        loops: (N, B, box) of every mode.
        form: which inequality.
        fade: share by which V falls in a step.
    """
    nx = loops[0][0].shape[0]
    supply = cp.Variable(name="supply")
    variables: dict[str, cp.Variable] = {"supply": supply}
    count = 1 if form.storage == "common" else len(loops)
    Q = [_variable(variables, f"Q{i}", nx, nx, symmetric=True) for i in range(count)]
    blocks = [Block("storage", Polynomial.constant(np.eye(nx) - q)) for q in Q]
    for first, i, last in form.transitions(len(loops)):
        N, B, box = loops[i]
        before, after = Q[first % count], Q[last % count]
        weigh = Polynomial.constant(after)
        matrix = _inequality(before, -weigh, weigh @ N, weigh @ B, fade, supply)
        blocks.append(Block(f"fade of mode {i}", matrix, box, relaxation=form.relaxation))
    if form.storage == "dwell":
        pairs = [(i, j) for i in range(count) for j in range(count) if i != j]
        blocks += [Block("growth at a switch", Polynomial.constant(Q[j] - form.growth * Q[i])) for i, j in pairs]
    return Problem(variables, blocks, supply), Q


def _count(modes: Sequence[OpenMode], form: Form) -> int:
    return 1 if form.storage == "common" else len(modes)


def _variable(
    variables: dict[str, cp.Variable], name: str, rows: int, columns: int, symmetric: bool = False
) -> cp.Variable:
    """A named matrix of unknowns, entered in the list."""
    made = (
        cp.Variable((rows, columns), name=name, symmetric=True)
        if symmetric
        else cp.Variable((rows, columns), name=name)
    )
    variables[name] = made
    return made


def _slacks(variables: dict[str, cp.Variable], Q: Sequence[cp.Variable], count: int, form: Form) -> list[Any]:
    """S of every mode: its Q where that loses nothing, else free; one for all where one Q serves all."""
    nx = Q[0].shape[0]
    if form.storage == "mode":
        return [_variable(variables, f"S{i}", nx, nx) for i in range(count)]
    if not form.slack:
        return [Q[i % len(Q)] for i in range(count)]
    free = [_variable(variables, f"S{i}", nx, nx) for i in range(len(Q))]
    return [free[i % len(Q)] for i in range(count)]


def _projected(mode: OpenMode, S: Any, X: Any) -> Polynomial:
    """S P = S (I + U C) + X M' C."""
    projected = Polynomial.constant(S @ (np.eye(S.shape[0]) + mode.U @ mode.C))
    return projected if X is None else projected + Polynomial.constant(X @ (mode.M.T @ mode.C))


def _inputs(mode: OpenMode, form: Form, S: Any, W: Polynomial, X: Any) -> Polynomial:
    """S times the columns of the inputs."""
    if form.attenuate == "lumped":
        return Polynomial.constant(S)
    decoupled = Polynomial.constant(S @ mode.U)
    if X is not None:
        decoupled = decoupled + Polynomial.constant(X @ mode.M.T)
    projected = _projected(mode, S, X)
    columns = [projected @ (mode.uncertain * mode.sizes)] if mode.uncertain.shape[1] else []
    if mode.measured.shape[1]:
        columns += [decoupled @ mode.measured, -(W @ mode.measured) - projected @ mode.applied]
    return block([columns]) * (1.0 / form.unit)


def _inequality(
    before: Any, corner: Polynomial, loop: Polynomial, inputs: Polynomial, fade: float, supply: Any
) -> Polynomial:
    size = Polynomial.constant(-supply * np.eye(inputs.shape[1]))
    return symmetric([[Polynomial.constant((fade - 1) * before), 0, loop.T], [size, inputs.T], [corner]])
