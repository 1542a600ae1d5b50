"""Ifqir et al. 2020, section 3 and the existence conditions of section 4.1: (8) to (18)."""

from collections.abc import Iterator

import numpy as np

from luenberger.experiment.published.ifqir_car import PRINTED_STEP, SPEEDS, STEP, Axles, switched
from luenberger.experiment.published.ifqir_printed import theorem_printed
from luenberger.experiment.published.row import Row, judged
from luenberger.systems import System
from luenberger.systems.strong_detectability import strong_detectability

_OUTPUT = np.array([[0.0, 1.0]])
_TRIALS = 200


def observer_rows() -> Iterator[Row]:
    """Rows of the observer and of the conditions for its existence."""
    yield _error()
    yield _free_part()
    yield _inverse()
    yield _no_freedom()
    yield _zeros()
    yield _sufficient()
    yield _first_errors()


def _error() -> Row:
    """(9) to (11) against one step of plant and observer on random plants."""
    rng = np.random.default_rng(0)
    apart = 0.0
    for _ in range(_TRIALS):
        n, nu, nd, ny = 4, 2, 1, 2
        A, B, E, C = (rng.normal(size=s) for s in ((n, n), (n, nu), (n, nd), (ny, n)))
        K, Y = rng.normal(size=(n, ny)), rng.normal(size=(n, ny))
        x, xh, delta = rng.normal(size=(3, n))
        u, d, now, later = (rng.normal(size=s) for s in (nu, nd, ny, ny))
        H = decoupling(C, E, Y)
        P = np.eye(n) + H @ C
        N = P @ A - K @ C
        after = A @ x + B @ u + E @ d + delta
        estimate = N @ xh + K @ (C @ x + now) + P @ B @ u - H @ (C @ after + later)
        error = N @ (x - xh) + P @ delta + H @ later - K @ now
        apart = max(apart, float(np.abs(after - estimate - error).max() / np.abs(after).max()))
    return judged(
        "Error dynamics",
        "(9) to (11)",
        "e+ = N e + P delta + H v+ - K v",
        f"holds within {apart:.1e} of the state",
        f"One step of plant and observer on {_TRIALS} random plants with 4 states, 2 outputs and random Y and K. So Delta holds the noise "
        "twice, which the text after (22) forgets.",
        reproduced=apart < 1e-10,
        deviation=apart,
    )


def decoupling(C: np.ndarray, E: np.ndarray, Y: np.ndarray) -> np.ndarray:
    """Return H of (15) with the unit matrix that fits, (nx, ny).

    Args:
        C: output matrix, (ny, nx).
        E: unknown inputs, (nx, nd).
        Y: free part, (nx, ny).
    """
    inverse = np.linalg.pinv(C @ E)
    return -E @ inverse + Y @ (np.eye(len(C)) - C @ E @ inverse)


def _free_part() -> Row:
    rng = np.random.default_rng(1)
    worst = 0.0
    for _ in range(_TRIALS):
        C, E, Y = rng.normal(size=(2, 4)), rng.normal(size=(4, 1)), rng.normal(size=(4, 2))
        worst = max(worst, float(np.abs((np.eye(4) + decoupling(C, E, Y) @ C) @ E).max()))
    return judged(
        "Unit matrix in the free part of H, and J",
        "(15), (17)",
        "I_n",
        f"I_ny: |P E| <= {worst:.1e} on {_TRIALS} random plants",
        "C E (C E)^+ is ny by ny, so I_n fits only where every state is measured; with I_ny every Y decouples.",
        reproduced=False,
        corrected=worst < 1e-10,
    )


def _inverse() -> Row:
    rng = np.random.default_rng(2)
    CE = rng.normal(size=(2, 2))
    printed, meant = np.linalg.inv(CE.T @ CE) @ CE, np.linalg.inv(CE.T @ CE) @ CE.T
    left = [float(np.abs(M @ CE - np.eye(2)).max()) for M in (printed, meant)]
    return judged(
        "Generalised inverse of C E",
        "(16)",
        "((CE)' CE)^-1 CE",
        f"((CE)' CE)^-1 (CE)': |(CE)^+ CE - I| = {left[1]:.1e}; printed {left[0]:.2f}",
        "The last factor is to be transposed; as printed it does not even fit unless C E is square. On a random 2 by 2 matrix.",
        reproduced=left[0] < 1e-9,
        corrected=left[1] < 1e-9,
        deviation=left[0],
    )


def _no_freedom() -> Row:
    """One output, one unknown input: J = 0."""
    seen = Axles.at(SPEEDS[0]).decoupled(STEP)
    car = Axles.at(SPEEDS[0])
    Y = np.random.default_rng(3).normal(size=(2, 1))
    moved = float(np.abs(decoupling(_OUTPUT, STEP * car.E, Y) - seen.H).max())
    return judged(
        "Freedom of Y in the vehicle example",
        "(15), section 5",
        "Y arbitrary",
        f"J = 0: H = ({seen.H[0, 0]:.5f}, {seen.H[1, 0]:g}) for every Y (moved by {moved:.1e})",
        "One output and one unknown input: decoupling takes all of the output, and P = [[1, -Iz/(m lw)], [0, 0]]. X_i has no effect in (21).",
        reproduced=moved > 1e-9,
        corrected=moved < 1e-9,
    )


def _zeros() -> Row:
    """(18) asks Re(s) >= 0; in discrete time |z| >= 1 counts. The car shows both errors that this makes."""
    good, bad = (strong_detectability(switched(step=step).first) for step in (STEP, PRINTED_STEP))
    inside, outside = (float(report.modes[0].eigenvalue.real) for report in (good, bad))
    sigma = [_smallest_singular_value(step, z) for step, z in ((STEP, inside), (PRINTED_STEP, outside))]
    right = bool(good) and not bool(bad) and max(sigma) < 1e-9
    return judged(
        "Where the rank of the pencil must not fall",
        "(18)",
        "Re(s) >= 0",
        f"|z| >= 1: at Ts = {STEP:g} s mode 1 has the zero z = {inside:.4f} (harmless, refused as printed), at Ts = {PRINTED_STEP:g} s "
        f"z = {outside:.2f} (unstable, accepted as printed)",
        f"(18) is the continuous-time condition. Smallest singular values of the pencil there: {sigma[0]:.1e}, {sigma[1]:.1e}. "
        "`strong_detectability` judges by the sample time of the plant.",
        reproduced=False,
        corrected=right,
    )


def _smallest_singular_value(step: float, z: float) -> float:
    A, _, E = Axles.at(SPEEDS[0]).sampled(step)
    pencil = np.block([[z * np.eye(2) - A, E], [_OUTPUT, np.zeros((1, 1))]])
    return float(np.linalg.svd(pencil / np.linalg.norm(pencil, axis=0), compute_uv=False)[-1])


def hidden_modes() -> tuple[tuple[np.ndarray, np.ndarray, np.ndarray], ...]:
    """Return A, E, C of two modes that each meet Assumption 1, while no gain keeps the errors bounded when they alternate.

    The third state is measured and takes the unknown input; the error of the first two obeys their own dynamics whatever the gain.
    """
    upper, lower = np.array([[0.5, 2.0], [0.0, 0.5]]), np.array([[0.5, 0.0], [2.0, 0.5]])
    E, C, one = np.array([[0.0], [0.0], [1.0]]), np.array([[0.0, 0.0, 1.0]]), np.ones((1, 1))
    return tuple((np.block([[M, np.ones((2, 1))], [np.ones((1, 2)), one]]), E, C) for M in (upper, lower))


def _sufficient() -> Row:
    modes = hidden_modes()
    alone = [theorem_printed([mode], 0.1, 1.0) for mode in modes]
    both = theorem_printed(modes, 0.1, 1.0)
    plants = [System.build(A, C=C, E=E, dt=1.0) for A, E, C in modes]
    detectable = all(bool(report) and bool(report.matching) for report in map(strong_detectability, plants))
    first, second = (A[:2, :2] for A, _, _ in modes)
    radius = float(np.abs(np.linalg.eigvals(first @ second)).max())
    shown = detectable and radius > 1 and both is None and all(one is not None for one in alone)
    return judged(
        "Conditions for the existence of the switched observer",
        "Assumption 1",
        "necessary and sufficient",
        f"necessary only: two modes meet it with the zeros 0.5, 0.5 each, and alternating multiplies the error by {radius:.2f} every two steps",
        "Detectability mode by mode says nothing about switching. (21) is feasible for each mode alone and infeasible for both, as it must be: "
        "the error of two of the three states does not depend on any gain.",
        reproduced=False,
        corrected=shown,
        deviation=radius - 1,
    )


def _first_errors() -> Row:
    return judged(
        "Set of the first errors",
        "Assumption 2",
        "E0 = C X0",
        "E0 = X0 - xh0",
        "C X0 lives among the outputs: for the car it is a segment, not a set of errors in the plane.",
        reproduced=_OUTPUT.shape[0] == 2,
        corrected=True,
    )
