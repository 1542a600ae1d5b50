"""Wang 2014, section 5.2: the sector condition (5.7), which is false, and what rests on it, in exact numbers."""

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import cvxpy as cp
import numpy as np
from scipy.integrate import solve_ivp

from luenberger.algebra import Polynomial
from luenberger.algebra.definiteness import exact, positive_definite
from luenberger.core import Outcome
from luenberger.experiment.published.row import INDEPENDENT, Row, judged
from luenberger.experiment.published.van_der_pol import PRINTED_ARGUMENT_GAIN, PRINTED_GAIN
from luenberger.lmi import Block, Problem, rounded_storage, solve
from luenberger.methods.printed_two_dof import sector_lemma_violation, sector_product

# (5.58) and (5.61) in integers, which join floats and rationals alike.
A, C, F = np.array([[0, 1], [-1, 0]]), np.array([[1, 0]]), np.array([[0], [1]])
K1, K2 = np.array([[-50, -24]]), np.array([[50, 1]])
# z1 = -x1, measured with its own sign: the same oscillator, and the same bounds of its Jacobian.
FLIPPED = np.array([[0, -1], [1, 0]])
FLIPPED_GAIN, NO_GAIN = np.array([[10], [30]]), np.array([[0], [0]])
FLIPPED_STORAGE = np.array([[125.66, 29.35], [29.35, 10.87]])
_PAIRS, _BATCHES = 400_000, 10
_SMALL, _HORIZON = 1e-3, 15.0


@dataclass(frozen=True)
class Divergence:
    """What the observer of the flipped oscillator makes of small errors on the limit cycle.

    Args:
        largest: largest error norm of each run.
        grown: when the error norm first exceeds one [s], in each run.
        reach: largest |xhat_k| of all runs until then.
    """

    largest: np.ndarray
    grown: np.ndarray
    reach: float


def sector_rows() -> Iterator[Row]:
    """Yield the rows of Lemmas 15 and 16, of the flipped oscillator and of the sign in (5.13)."""
    yield _lemma()
    yield _shares()
    yield _mean_value()
    yield _monotone()
    yield _where_it_holds()
    yield _flipped()
    yield _divergent()
    yield _argument()
    yield _argument_sign()


def printed_blocks(P: Any, drift: Any, L1: Any, L2: Any, *, sign: int = -1) -> list[list[Any]]:
    """Return the blocks of (5.22) for the oscillator, negative definite where the print calls the observer stable.

    Args:
        P: storage, (2, 2).
        drift: A, (2, 2).
        L1: gain that acts beside F K1 L2, (2, 1).
        L2: gain in the argument of f, (2, 1).
        sign: that of L2 C in I + sign L2 C: -1 as derived in (5.14), +1 as printed in (5.13).
    """
    closed = drift + F @ K1 - L1 @ C
    beside = P @ F + ((K2 - K1) @ (np.eye(2, dtype=int) + sign * (L2 @ C))).T / 2
    return [[closed.T @ P + P @ closed, beside], [beside.T, -np.ones((1, 1), dtype=int)]]


def satisfies(P: np.ndarray, drift: Any, L1: Any, L2: Any) -> Outcome:
    """Decide (5.22) with P > 0 in exact rationals.

    Args:
        P: storage.
        drift: A.
        L1: gain.
        L2: gain in the argument.
    """
    given = [exact(M) for M in (P, drift, L1, L2)]
    return positive_definite(exact(-np.block(printed_blocks(*given)))) & positive_definite(given[0])


def least_violation(drift: Any, L1: Any, L2: Any, *, sign: int = -1) -> tuple[float, np.ndarray] | None:
    """Return the least t with (5.22) <= t I over P >= I, and that P; t < 0 where the printed condition is met.

    Args:
        drift: A.
        L1: gain.
        L2: gain in the argument.
        sign: as `printed_blocks`.
    """
    P, t = cp.Variable((2, 2), symmetric=True, name="P"), cp.Variable(name="t")
    left = Polynomial.constant(cp.bmat(printed_blocks(P, drift, L1, L2, sign=sign)) - t * np.eye(3))
    blocks = [Block("decay", left), Block("storage", Polynomial.constant(np.eye(2) - P))]
    found = solve(Problem({"P": P, "t": t}, blocks, t))
    return None if found is None else (float(found.values["t"]), rounded_storage(found.values["P"]))


def violating_shares(batches: int = _BATCHES) -> tuple[float, float, float]:
    """Return the shares of random pairs in the square that break (5.7): of all, with e1 e2 < 0, and with e1 e2 >= 0.

    Args:
        batches: how many times 400 000 pairs are drawn.
    """
    random, broken, mixed, both = np.random.default_rng(0), 0, 0, 0
    for _ in range(batches):
        x, xhat = random.uniform(-5.0, 5.0, size=(2, 2, _PAIRS))
        e, difference = x - xhat, [(1 - x[0] ** 2) * x[1] - (1 - xhat[0] ** 2) * xhat[1]]
        above, turned = sector_product(K1.tolist(), K2.tolist(), list(e), difference) > 0, e[0] * e[1] < 0
        broken, mixed, both = broken + above.sum(), mixed + turned.sum(), both + (above & turned).sum()
    total = batches * _PAIRS
    return float(broken / total), float(both / mixed), float((broken - both) / (total - mixed))


def divergence(directions: int = 8) -> Divergence:
    """Run the flipped oscillator on its limit cycle with the observer of `FLIPPED_GAIN`, errors of 1e-3 all around.

    Args:
        directions: how many.
    """

    def rates(_: float, s: np.ndarray) -> np.ndarray:
        z, zhat = s[:2], s[2:]
        injected = FLIPPED_GAIN[:, 0] * (z - zhat)[0]
        return np.concatenate(
            [FLIPPED @ z + F[:, 0] * _damping(z), FLIPPED @ zhat + F[:, 0] * _damping(zhat) + injected]
        )

    largest, grown, reach = [], [], 0.0
    for angle in 2 * np.pi * np.arange(directions) / directions:
        start = np.array([-2.0, 0.0])
        first = np.concatenate([start, start - _SMALL * np.array([np.cos(angle), np.sin(angle)])])
        run = solve_ivp(rates, (0.0, _HORIZON), first, method="LSODA", rtol=1e-9, atol=1e-12, max_step=0.02)
        error = np.linalg.norm(run.y[:2] - run.y[2:], axis=0)
        k = int(np.argmax(error > 1))
        largest.append(error.max())
        grown.append(run.t[k])
        reach = max(reach, float(np.abs(run.y[2:, : k + 1]).max()))
    return Divergence(np.array(largest), np.array(grown), reach)


def _damping(z: Any) -> Any:
    return (1 - z[0] ** 2) * z[1]


def _difference() -> tuple[list[Fraction], list[Fraction]]:
    """e and f(x) - f(xhat) at x = (0.1, -0.3), xhat = 0."""
    x = [Fraction(1, 10), Fraction(-3, 10)]
    return x, [_damping(x)]


def _lemma() -> Row:
    product = sector_product(K1.tolist(), K2.tolist(), *_difference())
    found = sector_lemma_violation(K1, K2)
    return judged(
        "(f(x) - f(xhat) - K1 e)' (f(x) - f(xhat) - K2 e), oscillator, x = (0.1, -0.3), xhat = 0",
        "Lemma 15, (5.7)",
        "<= 0",
        f"{float(product):+.4f}",
        "Exact rationals. The bounds of the Jacobian hold, the condition does not: two entries of one row vary, and errors of opposite "
        "sign add up what the condition takes apart. Lemmas 16 to 18 and theorems 7 to 10 rest on it.",
        reproduced=product <= 0,
        corrected=product == Fraction(12477509, 1000000) and found is not None and found.product > 0,
    )


def _shares() -> Row:
    every, mixed, same = violating_shares()
    # Both counts scatter: four standard deviations of 4e5 pairs, which covers the other count too.
    near = abs(every - 0.0865) < 0.002 and abs(mixed - 0.173) < 0.0025
    return judged(
        "share of random pairs in [-5, 5]^2 that break (5.7): all, e1 e2 < 0, e1 e2 >= 0",
        f"Lemma 15, {INDEPENDENT}",
        "8.65 %, 17.3 %, 0",
        f"{100 * every:.2f} %, {100 * mixed:.2f} %, {100 * same:g}",
        "Four million pairs. Beside stands an independent count. Where no two components of e have opposite signs (5.8) holds, and so does (5.7).",
        reproduced=near and same == 0,
        deviation=abs(every - 0.0865),
    )


def _mean_value() -> Row:
    e, (phi,) = _difference()
    low, high = (sum(int(k) * v for k, v in zip(K[0], e, strict=True)) for K in (K1, K2))
    return judged(
        "K1 e <= f(x) - f(xhat) <= K2 e at the same points",
        "(5.8), (5.9)",
        "by the mean value theorem",
        f"{float(low):g} <= {float(phi):g} <= {float(high):g}",
        "False as printed: K1 <= K <= K2 entry by entry gives K1 e <= K e <= K2 e for e >= 0 only. For any e each entry of e picks its own "
        "end of [K1, K2], which is the set of vertices that the other methods take.",
        reproduced=low <= phi <= high,
        corrected=not low <= phi <= high,
    )


def _monotone() -> Row:
    """K1 = -gamma, K2 = gamma with two entries: e = (1, -1) leaves nothing on the right."""
    product = sector_product([[-1, -1]], [[1, 1]], [1, -1], [2])
    # One entry a row: every (e, phi) of the sector [l, u] inside [-g, g] satisfies phi^2 <= g^2 e^2.
    ends = [(l, u, max(abs(l), abs(u))) for l in range(-3, 4) for u in range(l, 4)]
    narrower = all(k * k <= g * g for l, u, g in ends for k in (l, u))
    return judged(
        "the Lipschitz case K1 = -gamma, K2 = gamma, gamma = (1, 1), f(x) = x1 - x2, e = (1, -1)",
        "Remark 1, (5.10), (5.11)",
        "a special case of (5.7)",
        f"product {product:+d}",
        "The special case is false like the rule, f(x) - f(xhat) = 2 while gamma e = 0. With one varying entry a row it holds, and the set "
        "of (5.6) is indeed the smaller one.",
        reproduced=product <= 0,
        corrected=product == 4 and narrower,
    )


def _where_it_holds() -> Row:
    slips = sector_lemma_violation(np.diag([-1.0, -1.0]), np.zeros((2, 2)))
    return judged(
        "counterexample to (5.7): one varying entry a row (slip angles); two in one row (oscillator)",
        "Lemma 15",
        "none, none",
        f"{'none' if slips is None else 'found'}, {'none' if sector_lemma_violation(K1, K2) is None else 'found'}",
        "(5.7) holds exactly where each row of K2 - K1 has at most one nonzero entry: then it is a sum of t (t - 1) D^2 e^2, 0 <= t <= 1. "
        "So the slip angles of section 5.4.2 are covered and the oscillator of section 5.4.1 is not.",
        reproduced=False,
        corrected=slips is None and sector_lemma_violation(K1, K2) is not None,
    )


def _flipped() -> Row:
    met = satisfies(FLIPPED_STORAGE, FLIPPED, FLIPPED_GAIN, NO_GAIN)
    error = FLIPPED + F @ np.array([[0, 1]]) - FLIPPED_GAIN @ C
    determinant = error[0, 0] * error[1, 1] - error[0, 1] * error[1, 0]
    return judged(
        "oscillator in z1 = -x1, L1 = (10, 30), L2 = 0: det of the error matrix at x = 0",
        "Theorem 7, (5.22)",
        "stable where (5.22) holds",
        f"(5.22) {met.value}, det {determinant}",
        "P = [[125.66, 29.35], [29.35, 10.87]] satisfies (5.22) in exact rationals; at the origin the Jacobian is (0, 1), and the error "
        "matrix has a positive eigenvalue. (5.22) speaks of the segment K1 + t (K2 - K1) only, and turning a state turns the other diagonal "
        "of the box into that segment.",
        reproduced=determinant > 0,
        corrected=met is Outcome.PROVED and determinant == -39,
    )


def _divergent() -> Row:
    found = divergence()
    return judged(
        f"the same in simulation: largest |e| from |e(0)| = {_SMALL:g} on the limit cycle, eight directions",
        "Theorem 7",
        "e goes to zero",
        f"{found.largest.min():.1f} to {found.largest.max():.1f}; |e| > 1 after {found.grown.min():.1f} to {found.grown.max():.1f} s",
        f"Until |e| > 1 the estimate stays within {found.reach:.1f} < 5, where K1 and K2 hold. Beyond, the cubic term holds the error.",
        reproduced=bool(found.largest.max() < _SMALL),
        corrected=bool(found.largest.min() > 20 and found.reach < 5),
    )


def _argument() -> Row:
    """x - (xhat + L2 (C x - C xhat)) = (I - L2 C) e in rationals; M of (5.12) and its congruence in (5.15)."""
    random, gaps = np.random.default_rng(1), []
    for _ in range(20):
        x, xhat, L2 = (exact(random.integers(-99, 99, size=(2, 1)).tolist()) / 7 for _ in range(3))
        q, phi = x - (xhat + L2 @ (C @ (x - xhat))), exact([[int(random.integers(-99, 99))]])
        e = x - xhat
        S = np.eye(2, dtype=int) - L2 @ C
        M = exact(np.block([[(K1.T @ K2 + K2.T @ K1) / 2, -(K1 + K2).T / 2], [-(K1 + K2) / 2, np.eye(1)]]))
        wide = np.block([[S, np.zeros((2, 1), dtype=int)], [np.zeros((1, 2), dtype=int), np.ones((1, 1), dtype=int)]])
        v = np.vstack([e, phi])
        product = ((phi - K1 @ q).T @ (phi - K2 @ q))[0, 0]
        gaps += [*(q - S @ e).flat, (v.T @ wide.T @ M @ wide @ v)[0, 0] - product]
    return judged(
        "argument error (I - L2 C) e, and the quadratic forms (5.12), (5.15) against (5.7), twenty random rational points",
        "(5.12), (5.14), (5.15)",
        "equal",
        f"largest difference {max(abs(g) for g in gaps)}",
        "Algebra, right as printed; what the forms say is another matter.",
        reproduced=all(g == 0 for g in gaps),
    )


def _argument_sign() -> Row:
    right, wrong = (least_violation(A, PRINTED_GAIN, PRINTED_ARGUMENT_GAIN, sign=s) for s in (-1, 1))
    # Where t = 1 of the segment K1 + t (K2 - K1) is unstable, no P exists.
    end = A + F @ K1 - PRINTED_GAIN @ C + F @ (K2 - K1) @ (np.eye(2) + PRINTED_ARGUMENT_GAIN @ C)
    determinant = exact(end)[0, 0] * exact(end)[1, 1] - exact(end)[0, 1] * exact(end)[1, 0]
    shown = ["none" if v is None else f"{v[0]:+.4f}" for v in (right, wrong)]
    return judged(
        "printed gains (5.62) in (5.22): least t with (5.22) <= t I, I - L2 C and I + L2 C",
        "(5.13), Lemma 16",
        "I + L2 C",
        f"{shown[0]} and {shown[1]}",
        "A misprint: (5.14), (5.15) and all that follows have I - L2 C, and so have the printed gains. With I + L2 C the end K2 of the "
        f"segment has an error matrix with det {float(determinant.p) / float(determinant.q):.1f} < 0, so no P serves. In Lemma 16, y - C x is y - C xhat.",
        reproduced=False,
        corrected=right is not None and wrong is not None and right[0] < 0 < wrong[0] and determinant < 0,
    )
