"""Wang 2014, (5.73): the printed slip-angle gains, the states they are written for, and how far they reach."""

from collections.abc import Iterator, Sequence
from itertools import product
from typing import Any, Literal

import cvxpy as cp
import numpy as np

from luenberger.algebra import Polynomial
from luenberger.experiment.published.row import Row, judged
from luenberger.experiment.published.wang_plants import ACCELERATION, SPEED, stiffness_free
from luenberger.lmi import Block, Problem, solve
from luenberger.vehicle import wang_car

# (5.73): three columns in (1, 1/vx, ax/vx) of the gain and of the gain in the argument.
PRINTED = ((9.6103, 10.1651), (-72.1241, -84.5006), (-0.4527, -0.5227))
PRINTED_ARGUMENT = ((0.5307, 0.4693), (0.5170, -0.5154), (-0.018, 0.0187))
Reading = Literal["printed", "entry", "row"]
# Signs of the second row of L1 and of the three columns of L2: as printed; one entry turned; for the states (front, -rear).
_SIGNS: dict[Reading, tuple[float, tuple[float, float, float]]] = {
    "printed": (1.0, (1.0, 1.0, 1.0)),
    "entry": (1.0, (-1.0, 1.0, 1.0)),
    "row": (-1.0, (-1.0, -1.0, -1.0)),
}
READINGS: tuple[Reading, ...] = ("printed", "entry", "row")
Point = tuple[float, float]
# (1/vx, ax/vx): (5.69) with (5.70) as Lemma 19 takes it, and as speed and acceleration allow.
BOX: Sequence[Point] = [(1 / v, a / SPEED[0]) for v, a in product(SPEED, ACCELERATION)]
TRAPEZOID: Sequence[Point] = [(1 / v, a / v) for v, a in product(SPEED, ACCELERATION)]
STIFFNESS = np.array([wang_car.front_stiffness, wang_car.rear_stiffness])
_C = np.array([[1.0, -1.0]])
_HALVINGS = 8


def printed_rows() -> Iterator[Row]:
    """Yield the rows of what (5.73) is written for, of (5.40) with it, of frozen eigenvalues, and of Fig. 5.5."""
    yield _states()
    yield _condition()
    yield _frozen()
    yield _tables()


def printed_gains(reading: Reading, point: Point) -> tuple[np.ndarray, np.ndarray]:
    """Return (L1, L2) of (5.73), each (2, 1), in the states (front slip, rear slip).

    Args:
        reading: "printed" as it stands, "entry" with the sign of the second entry of L2,0 turned, "row" with the second row of
            both gains turned, which is right where they were written for (front slip, -rear slip).
        point: (1/vx, ax/vx).
    """
    first, second = _SIGNS[reading]
    L1 = _at([(f, first * r) for f, r in PRINTED], point)
    return L1, _at([(f, s * r) for s, (f, r) in zip(second, PRINTED_ARGUMENT, strict=True)], point)


def _at(parts: Any, point: Point) -> np.ndarray:
    return np.array(parts).T @ np.array([[1.0], [point[0]], [point[1]]])


def printed_violation(share: float, points: Sequence[Point], reading: Reading, *, axles: bool = False) -> float:
    """Return the least t with (5.40) <= t I for the printed gains, trace P <= 1, P >= 1e-3 I.

    Args:
        share: kappa, the share of their stiffness that the axles may lose.
        points: vertices of (1/vx, ax/vx), in which (5.40) is affine.
        reading: as `printed_gains`.
        axles: a multiplier for each axle in place of one.
    """
    P, t = cp.Variable((2, 2), symmetric=True, name="P"), cp.Variable(name="t")
    tau = cp.Variable(2, name="tau")
    blocks = [Block("storage", Polynomial.constant(1e-3 * np.eye(2) - P))]
    for point in points:
        L1, L2 = printed_gains(reading, point)
        # phi in units of the stiffness of its axle.
        columns = stiffness_free() * STIFFNESS * point[0]
        drift = (1 - share) * columns - point[1] * np.eye(2) - L1 @ _C
        beside = P @ columns + (cp.diag(tau) @ (share * (np.eye(2) - L2 @ _C))).T / 2
        left = cp.bmat([[drift.T @ P + P @ drift, beside], [beside.T, -cp.diag(tau)]])
        blocks.append(Block("decay", Polynomial.constant(left - t * np.eye(4))))
    same = [] if axles else [tau[0] == tau[1] * (STIFFNESS[0] / STIFFNESS[1]) ** 2]
    found = solve(
        Problem({"P": P, "t": t, "tau": tau}, blocks, t), extra=[cp.trace(P) <= 1, *same], solvers=("CLARABEL",)
    )
    return np.inf if found is None else float(found.values["t"])


def printed_share(points: Sequence[Point], reading: Reading, *, axles: bool = False) -> float:
    """Return the largest kappa for which the printed gains satisfy (5.40), by bisection to 0.004; zero where none is found.

    Args:
        points: as `printed_violation`.
        reading: as `printed_gains`.
        axles: as `printed_violation`.
    """
    low, high = 0.0, 1.0
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        # The solver's own tolerance is 1e-10 before scaling.
        low, high = (middle, high) if printed_violation(middle, points, reading, axles=axles) < -1e-6 else (low, middle)
    return low


def frozen_rate(share: float, reading: Reading) -> float:
    """Return the largest real part of the error matrix over speeds, accelerations and the corners of the Jacobian [1/s].

    Args:
        share: kappa.
        reading: as `printed_gains`.
    """
    worst = -np.inf
    for v, a in product(np.linspace(*SPEED, 25), np.linspace(*ACCELERATION, 9)):
        L1, L2 = printed_gains(reading, (1 / v, a / v))
        columns, seen = stiffness_free() * STIFFNESS / v, np.eye(2) - L2 @ _C
        injected = L1 + share * columns @ L2
        for lost in product((0.0, share), repeat=2):
            closed = columns - a / v * np.eye(2) - injected @ _C - columns * lost @ seen
            worst = max(worst, float(np.linalg.eigvals(closed).real.max()))
    return worst


def _states() -> Row:
    """C L2 over the trapezoid: L2 makes the argument agree with what is measured where C L2 = 1."""
    seen = {r: [float((_C @ printed_gains(r, p)[1]).item()) for p in TRAPEZOID] for r in READINGS}
    ranges = [f"{min(v):.4f} to {max(v):.4f}" for v in seen.values()]
    return judged(
        "C L2 over speeds and accelerations: as printed; second entry of L2,0 turned; second row of both gains turned",
        "(5.73)",
        "states (front slip, rear slip)",
        "; ".join(ranges),
        "C L2 = 1 throughout, to the digits printed, only for the states (front slip, -rear slip): then zeta agrees with what is measured. "
        "(5.66) is written for the same states, and so are all gains of chapter 3. The model (5.64), (5.65), (5.67) is not.",
        reproduced=False,
        # Digits of 1e-4 in three columns, the second weighted by 1/vx <= 0.24 and the third by ax/vx <= 1.92.
        corrected=max(abs(v - 1) for v in seen["row"]) < 0.002 and min(abs(v - 1) for v in seen["printed"]) > 0.5,
    )


def _condition() -> Row:
    shares = {r: printed_share(TRAPEZOID, r) for r in READINGS}
    own, boxed = printed_share(TRAPEZOID, "printed", axles=True), printed_share(BOX, "printed")
    wide = printed_share(BOX, "row")
    return judged(
        "largest kappa for which the printed gains satisfy (5.40), over the trapezoid of speeds and accelerations",
        "(5.40), (5.73)",
        "optimal for an unprinted kappa",
        ", ".join(f"{v:.3f}" for v in shares.values()) + " (as printed, entry turned, row turned)",
        f"With a multiplier for each axle {own:.3f} as printed; on the box of Lemma 19 {boxed:.3f} as printed and {wide:.3f} with the row "
        "turned. Tyre coefficients, K1, K2, C_p and limits are not printed; those of chapter 3 are taken, which is an inference.",
        reproduced=False,
    )


def _frozen() -> Row:
    found = {(r, k): frozen_rate(k, r) for r in READINGS for k in (0.2, 0.3, 0.5)}
    shown = ["; ".join(f"{found[r, k]:+.2f}" for k in (0.2, 0.3, 0.5)) for r in READINGS]
    return judged(
        "largest real part of the frozen error, kappa = 0.2; 0.3; 0.5 [1/s]",
        "(5.73)",
        "stable",
        f"{shown[0]} as printed, {shown[1]} with the entry turned, {shown[2]} with the row turned",
        "With the coefficients of chapter 3. As printed the gains are slower than no correction at 0.2 already and unstable at 0.3, by either "
        "sign of the entry; with the row turned they are fast at 0.3 and unstable at 0.5, at the lowest speed.",
        reproduced=False,
    )


def _tables() -> Row:
    """Share of the change of the gains with speed that lies above 60 km/h; what acceleration changes there."""
    slow, middle, fast = (3.6 / v for v in (15.0, 60.0, 150.0))
    flat = (middle - fast) / (slow - fast)
    moved = max(
        abs(parts[2][k]) * 8.0 * middle / abs(parts[0][k] + middle * parts[1][k])
        for parts in (PRINTED, PRINTED_ARGUMENT)
        for k in (0, 1)
    )
    return judged(
        "share of the change with speed above 60 km/h; largest change by 8 m/s^2 there",
        "Fig. 5.5",
        "steady above 60 km/h; minor",
        f"{100 * flat:.0f} %; {100 * moved:.1f} %",
        "The gains are affine in 1/vx, so this is so for any coefficients.",
        reproduced=flat < 0.2 and moved < 0.1,
    )
