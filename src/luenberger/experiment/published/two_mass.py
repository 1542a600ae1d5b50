"""Worst-case H-infinity norm of an uncertain two-mass spring-damper: a published table of conservatism."""

from itertools import product

import cvxpy as cp
import numpy as np

from luenberger.algebra import Polynomial, symmetric
from luenberger.lmi import Block, Problem

BOX = {"t1": (2 / 3, 2.0), "t2": (0.8, 4 / 3), "t3": (1.0, 3.0)}
PRINTED = (2.8429, 1.0540, 1.0108)


def _entries(*entries: tuple[int, int, float]) -> np.ndarray:
    matrix = np.zeros((4, 4))
    for i, j, value in entries:
        matrix[i, j] = value
    return matrix


def plant() -> tuple[Polynomial, Polynomial, np.ndarray]:
    """Return A(t), B(t), C of the two masses; t1, t2 inverse masses, t3 the damping."""
    A = Polynomial(
        ("t1", "t2", "t3"),
        {
            (0, 0, 0): _entries((0, 2, 1), (1, 3, 1)),
            (1, 0, 0): _entries((2, 0, -2), (2, 1, 1)),
            (1, 0, 1): _entries((2, 2, -1)),
            (0, 1, 0): _entries((3, 0, 1), (3, 1, -1)),
            (0, 1, 1): _entries((3, 3, -1)),
        },
    )
    B = Polynomial(("t1",), {(1,): np.array([[0.0], [0.0], [1.0], [0.0]])})
    return A, B, np.array([[0.0, 1.0, 0.0, 0.0]])


def bounded_real(degree: int) -> Problem:
    """Pose the bounded-real inequality with a storage of the given degree in each (constant) parameter.

    Minimises the squared norm bound g^2 subject to P(t) > 0 and [[P A + A' P + C' C, P B], [*, -g^2]] < 0 on the box.

    Args:
        degree: degree of P in each parameter.

    Reference: C. Agulhari, A. Felipe, R. Oliveira, P. Peres, ROLMIP manual, section 7.2.
    """
    A, B, C = plant()
    terms = {e: cp.Variable((4, 4), symmetric=True, name=f"P{e}") for e in product(range(degree + 1), repeat=3)}
    P, squared = Polynomial(("t1", "t2", "t3"), terms), cp.Variable(name="squared")
    drift = P @ A
    matrix = symmetric([[drift + drift.T + C.T @ C, P @ B], [Polynomial.constant(-squared * np.eye(1))]])
    blocks = [Block("storage", -P, BOX), Block("bounded real", matrix, BOX)]
    return Problem({**{f"P{e}": v for e, v in terms.items()}, "squared": squared}, blocks, squared)


def gridded_norm(points: int = 9, frequencies: int = 400) -> float:
    """Return the largest gain over a grid of parameters and frequencies, a lower bound of the truth.

    Args:
        points: grid points of each parameter, ends included.
        frequencies: points on the frequency axis, 0.2 to 5 rad/s.
    """
    A, B, C = plant()
    omega = 1j * np.linspace(0.2, 5.0, frequencies)[:, None, None] * np.eye(4)
    worst = 0.0
    for values in product(*(np.linspace(*BOX[n], points) for n in BOX)):
        point = dict(zip(BOX, values, strict=True))
        response = C @ np.linalg.solve(omega - A(point), np.broadcast_to(B(point).astype(complex), (frequencies, 4, 1)))
        worst = max(worst, float(np.abs(response).max()))
    return worst
