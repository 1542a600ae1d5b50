"""The inequalities of chapter 2 of Wang's dissertation for linear plants, with signs, strictness and zero blocks put right.

They are bricks of the comparison with the print, and small enough to be read beside a textbook. Designs and proofs of this
library rest on the error system instead (`luenberger.systems.error_system`), which states the same dissipation once for all.
"""

from typing import Any, Literal

import cvxpy as cp
import numpy as np

from luenberger.algebra import Polynomial, symmetric
from luenberger.core import BadInput
from luenberger.lmi.problem import Block, Problem, solve


def bounded_real_gain(
    A: np.ndarray, B: np.ndarray, C: np.ndarray, D: np.ndarray, form: Literal["square", "linear"] = "square"
) -> float | None:
    """Return the smallest level with T* T <= level^2 I, for a Hurwitz A; None where there is none.

    "square":  [he(P A) + C'C, P B + C'D; *, D'D - level^2 I] < 0           (2.50)
    "linear":  [he(P A), P B, C'; *, -level I, D'; *, *, -level I] < 0      (2.51), whose P is that of (2.50) over the level

    Args:
        A: (nx, nx).
        B: (nx, nu).
        C: (ny, nx).
        D: (ny, nu).
        form: which of two equivalent inequalities is solved.

    Reference: Wang 2014, (2.47) to (2.52); (2.47) prints >= for <=.
    """
    nx, nu, ny = A.shape[0], B.shape[1], C.shape[0]
    P, size = cp.Variable((nx, nx), symmetric=True, name="P"), cp.Variable(name="size")
    if form == "square":
        rows: list[list[Any]] = [
            [P @ A + A.T @ P + C.T @ C, P @ B + C.T @ D],
            [D.T @ D - size * np.eye(nu)],
        ]
    else:
        rows = [[P @ A + A.T @ P, P @ B, C.T], [-size * np.eye(nu), D.T], [-size * np.eye(ny)]]
    found = solve(Problem({"P": P, "size": size}, [_block("bounded_real", rows), _positive(P)], size))
    if found is None:
        return None
    return float(np.sqrt(found.objective)) if form == "square" else found.objective


def kyp_storage(
    A: np.ndarray, B: np.ndarray, supply: np.ndarray, *, definite: bool = False, margin: float = 1e-6
) -> np.ndarray | None:
    """Return a symmetric P with [he(P A), P B; B'P, 0] + supply <= -margin I, or None.

    The lemma asks for a symmetric P alone; a definite one exists where A is Hurwitz and the supply of x is not negative.

    Args:
        A: (nx, nx).
        B: (nx, nu).
        supply: symmetric, (nx + nu, nx + nu); [C D; 0 I]' M [C D; 0 I] for a supply M of output and input.
        definite: ask for P > 0 too.
        margin: how strictly the inequality has to hold.

    Reference: Wang 2014, (2.41), which prints P > 0 as part of the lemma.
    """
    nx, nu = A.shape[0], B.shape[1]
    if supply.shape != (nx + nu, nx + nu):
        raise BadInput(f"`supply` has shape {supply.shape}; ({nx + nu}, {nx + nu}) is needed.")
    P, t = cp.Variable((nx, nx), symmetric=True, name="P"), cp.Variable(name="t")
    rows = [
        [P @ A + A.T @ P + supply[:nx, :nx], P @ B + supply[:nx, nx:]],
        [supply[nx:, nx:] + np.zeros((nu, nu))],
    ]
    blocks = [_block("dissipation", rows), *([_positive(P)] if definite else [])]
    found = solve(Problem({"P": P, "t": t}, blocks, t), slack=t, extra=[t >= -1.0])
    return found.values["P"] if found is not None and found.margin >= margin else None


def largest_slope(A: np.ndarray, B: np.ndarray, C: np.ndarray) -> float | None:
    """Return the largest k for which x' = A x + B w, w = f(C x) is proved stable for every f in the sector [0, k].

    S-procedure on w (w - k z) <= 0 with multiplier one, which loses nothing here: the inequality is homogeneous,

        [he(P A), P B + k C'/2; *, -1] < 0,      P > 0.

    Args:
        A: (nx, nx), Hurwitz.
        B: (nx, 1).
        C: (1, nx).

    Reference: Wang 2014, (2.55), whose blocks off the diagonal lack a half, and (2.61), which lacks P > 0. Equal to the circle
        criterion.
    """
    nx = A.shape[0]
    P, k = cp.Variable((nx, nx), symmetric=True, name="P"), cp.Variable(name="k")
    rows = [[P @ A + A.T @ P, P @ B + (k / 2) * C.T], [-np.eye(1)]]
    found = solve(Problem({"P": P, "k": k}, [_block("sector", rows), _positive(P)], -k))
    return None if found is None else -found.objective


def positive_real_storage(A: np.ndarray, B: np.ndarray, C: np.ndarray) -> np.ndarray | None:
    """Return P > 0 with he(P A) < 0 and P B = C'/2: C (sI - A)^-1 B is strictly positive real; None where there is none.

    Without feedthrough the printed matrix inequality has a zero block and holds never; its limit is the equality.

    Args:
        A: (nx, nx).
        B: (nx, nu).
        C: (nu, nx).

    Reference: Wang 2014, (2.45) and (2.60).
    """
    nx = A.shape[0]
    P, t = cp.Variable((nx, nx), symmetric=True, name="P"), cp.Variable(name="t")
    blocks = [_block("decay", [[P @ A + A.T @ P]]), _positive(P)]
    found = solve(Problem({"P": P, "t": t}, blocks, t), slack=t, extra=[P @ B == C.T / 2, t >= -1.0])
    return found.values["P"] if found is not None and found.margin > 1e-9 else None


def unstructured_margin(A: np.ndarray, C: np.ndarray) -> float:
    """Return the best margin of (2.31) as printed, under trace P = 1: nothing positive, since its last block is zero.

    Args:
        A: (nx, nx).
        C: (ny, nx).

    Reference: Wang 2014, (2.31).
    """
    nx, ny = A.shape[0], C.shape[0]
    P, t = cp.Variable((nx, nx), symmetric=True, name="P"), cp.Variable(name="t")
    Q1, Q2 = cp.Variable((nx, nx), name="Q1"), cp.Variable((nx, ny), name="Q2")
    drift = P @ A - Q2 @ C
    rows = [[drift + drift.T, P @ A - Q1 - Q2 @ C], [np.zeros((nx, nx))]]
    problem = Problem({"P": P, "Q1": Q1, "Q2": Q2, "t": t}, [_block("printed", rows)], t)
    found = solve(problem, slack=t, extra=[P >> np.zeros((nx, nx)), cp.trace(P) == 1])
    return -np.inf if found is None else -found.objective


def unstructured_nominal(A: np.ndarray, C: np.ndarray, decay_rate: float) -> tuple[np.ndarray, np.ndarray] | None:
    """Return (Ao, Bo) of xhat' = Ao xhat + Bo y with Ao = A - Bo C, the equality that (2.31) stands for; None without.

    Args:
        A: (nx, nx).
        C: (ny, nx).
        decay_rate: wanted decay of the error [1/s].

    Reference: Wang 2014, (2.30) and (2.31), with Q1 = P A - Q2 C.
    """
    nx, ny = A.shape[0], C.shape[0]
    P, t = cp.Variable((nx, nx), symmetric=True, name="P"), cp.Variable(name="t")
    Q2 = cp.Variable((nx, ny), name="Q2")
    drift = P @ A - Q2 @ C
    blocks = [_block("decay", [[drift + drift.T + 2 * decay_rate * P]]), _positive(P)]
    found = solve(Problem({"P": P, "Q2": Q2, "t": t}, blocks, t), slack=t, extra=[cp.trace(P) == nx])
    if found is None or not found.margin > 1e-9:
        return None
    gain = np.linalg.solve(found.values["P"], found.values["Q2"])
    return A - gain @ C, gain


def _block(name: str, rows: list[list[Any]]) -> Block:
    return Block(name, symmetric([[Polynomial.constant(cell) for cell in row] for row in rows]))


def _positive(P: cp.Variable) -> Block:
    return Block("storage", Polynomial.constant(-P))
