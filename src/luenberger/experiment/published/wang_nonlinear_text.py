"""Wang 2014, sections 5.2 and 5.3: theorems, remarks and relaxations checked as algebra, in exact numbers."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from luenberger.algebra.definiteness import exact, positive_definite
from luenberger.core import Outcome
from luenberger.experiment.published.row import Row, Verdict, judged
from luenberger.experiment.published.wang_nonlinear_sector import K1, K2, A, C, F

_POINTS = 20
_NONE, _ONE = np.zeros((1, 2), dtype=int), np.ones((1, 1), dtype=int)


def text_rows() -> Iterator[Row]:
    """Yield the rows of theorems 6 to 8, of the remarks, and of the relaxations (5.46) to (5.56)."""
    yield _shifted()
    yield _observer_of_the_example()
    yield _changed_variables()
    yield _supply()
    yield _convexity()
    yield _sizes()
    yield _gain_bound()
    yield _squared_norm()
    yield _lifted()
    yield _unstructured()
    yield _structured()
    yield _stacked()
    yield _numbering()


def _shifted() -> Row:
    worst = max(_error_gap(point, correction=True) for point in _points())
    return judged(
        "e' of plant and observer (5.21) against Abar e + F (fbar(x) - fbar(zeta)), twenty random rational points",
        "(5.21), (5.22), (5.24) to (5.27)",
        "equal",
        f"largest difference {worst}",
        "The sign of - Bf K1 L2 is right: the injected gain is L1 - Bf K1 L2, and what is printed as L1 is not injected. Given (5.7), "
        "(5.22) follows.",
        reproduced=worst == 0,
    )


def _observer_of_the_example() -> Row:
    """(5.59) injects L1 alone; its error differs from (5.22) by Bf K1 L2 C e."""
    missing = [_error_gap(point, correction=False) for point in _points()]
    return judged(
        "the same for the observer of the example, which injects L1 alone",
        "(5.59), Theorem 7",
        "equal",
        f"differs at {sum(g != 0 for g in missing)} of {len(missing)} points",
        "(5.59) leaves out - Bf K1 L2 of (5.21), which Theorem 7 needs. The difference is Bf K1 L2 C e exactly, so none where C e = 0.",
        reproduced=max(missing) == 0,
        corrected=max(missing) > 0,
    )


def _points() -> Iterator[tuple[Any, ...]]:
    """Random rational (x, xhat, L1, L2), each (2, 1)."""
    random = np.random.default_rng(2)
    for _ in range(_POINTS):
        yield tuple(exact(random.integers(1, 99, size=(2, 1)).tolist()) / 7 for _ in range(4))


def _error_gap(point: tuple[Any, ...], *, correction: bool) -> Any:
    """Largest difference of x' - xhat' and the error equation behind (5.22); without the correction, less Bf K1 L2 C e too."""
    x, xhat, L1, L2 = point
    y = C @ (x - xhat)
    zeta = xhat + L2 @ y
    injected = L1 - F @ K1 @ L2 if correction else L1
    plant, copy = A @ x + F @ _f(x), A @ xhat + F @ _f(zeta) + injected @ y
    e = x - xhat
    form = (A + F @ K1 - L1 @ C) @ e + F @ ((_f(x) - K1 @ x) - (_f(zeta) - K1 @ zeta))
    gap = plant - copy - form
    if not correction:
        assert all(v == 0 for v in (gap + F @ K1 @ L2 @ y).flat)
    return max(abs(v) for v in gap.flat)


def _f(x: Any) -> Any:
    return (1 - x[:1] * x[:1]) * x[1:]


def _changed_variables() -> Row:
    random, gaps = np.random.default_rng(3), []
    for x, xhat, L1, L2 in _points():
        G, tau = exact(random.integers(-9, 9, size=(2, 2)).tolist()), x[0, 0] + 1
        P = G @ G.T + exact(np.eye(2))
        closed, Y, scaled = A - L1 @ C, P @ L1, tau * L2
        gaps += list((closed.T @ P + P @ closed - (A.T @ P + P @ A - Y @ C - C.T @ Y.T)).flat)
        gaps += list((tau * (xhat - L2 @ (C @ xhat)) - (tau * xhat - scaled @ (C @ xhat))).flat)
    return judged(
        "Y = P L1 and tau L2 as variables, random rational points",
        "Remarks 2 and 6",
        "equal",
        f"largest difference {max(abs(g) for g in gaps)}",
        "Right. One tau for all arguments, though: with one tau for each state both gains stay linear too.",
        reproduced=all(g == 0 for g in gaps),
    )


def _supply() -> Row:
    """The multiplier term of (5.30) is tau phi' (phi - (K2 - K1)(I - L2 C) e); (5.32) prints it without I - L2 C."""
    as_condition, as_printed = [], []
    for x, xhat, _, L2 in _points():
        e, phi = x - xhat, x[:1]
        S = np.eye(2, dtype=int) - L2 @ C
        M = exact(np.block([[np.zeros((2, 2)), -(K2 - K1).T / 2], [-(K2 - K1) / 2, np.eye(1)]]))
        wide = np.block([[S, _NONE.T], [_NONE, _ONE]])
        v = np.vstack([e, phi])
        value = (v.T @ wide.T @ M @ wide @ v)[0, 0]
        as_condition.append(value - (phi * (phi - (K2 - K1) @ S @ e))[0, 0])
        as_printed.append(value - (phi * (phi - (K2 - K1) @ e))[0, 0])
    return judged(
        "multiplier term of (5.30) against phi' [phi - (K2 - K1) e], twenty random rational points",
        "(5.30), (5.32)",
        "equal",
        f"differs at {sum(g != 0 for g in as_printed)}; with (I - L2 C) e in place of e at {sum(g != 0 for g in as_condition)}",
        "(5.30) is right, (5.32) and the line above it drop I - L2 C.",
        reproduced=all(g == 0 for g in as_printed),
        corrected=all(g == 0 for g in as_condition) and any(g != 0 for g in as_printed),
    )


def _convexity() -> Row:
    """S = -(K1' K2 + K2' K1): where S >= 0, (5.20) is convex in L2 and a Schur complement makes it linear."""
    lipschitz = np.array([[1, 2]])
    symmetric, oscillator = (_curvature(-lipschitz, lipschitz), _curvature(K1, K2))
    return judged(
        "least eigenvalue of -(K1' K2 + K2' K1): K1 = -K2 = -(1, 2); oscillator",
        "(5.20), below Lemma 18",
        "linear matrix inequality only where K1 or K2 is zero",
        f"{symmetric:.3g}; {oscillator:.4g}",
        "The square of (I - L2 C) has this weight, up to one half. Where it is >= 0, as for every Lipschitz bound K1 = -K2, a Schur complement "
        "makes (5.20) linear in L2 without (5.21). For the oscillator it is not.",
        reproduced=False,
        corrected=symmetric >= -1e-12 and oscillator < 0,
    )


def _curvature(lower: np.ndarray, upper: np.ndarray) -> float:
    return float(np.linalg.eigvalsh(-(lower.T @ upper + upper.T @ lower)).min())


def _sizes() -> Row:
    varying, n, m = int((K1 < K2).sum()), 2, 1
    return judged(
        "oscillator: inequalities of (5.19) and of the vertices, number and rows",
        "Remark 3",
        "(5.19) has a much lower dimension",
        f"1 of {n + m} rows; {2**varying} of {n} rows",
        "Fewer, and each larger. What is saved is what is not checked: the single inequality speaks of the segment between K1 and K2, the "
        f"{2**varying} of the whole box.",
        reproduced=False,
        corrected=n + m > n and 2**varying > 1,
    )


def _gain_bound() -> Row:
    """P >= alpha I and Y' Y <= alpha^2 epsilon give |P^-1 Y|^2 <= epsilon: P^2 - alpha^2 I = (P - alpha I)(P + alpha I) >= 0."""
    random, outcomes = np.random.default_rng(4), []
    for _ in range(_POINTS):
        G = exact(random.integers(-9, 9, size=(2, 2)).tolist()) / 5
        alpha = exact([[random.integers(1, 99)]])[0, 0] / 50
        P = G @ G.T + (alpha + exact([[1e-3]])[0, 0]) * exact(np.eye(2))
        outcomes.append(positive_definite(P @ P - alpha * alpha * exact(np.eye(2))))
    return judged(
        "P^2 > alpha^2 I wherever P > alpha I, twenty random rational P",
        "(5.35), (5.36)",
        "sufficient for (5.33)",
        f"holds at {sum(o is Outcome.PROVED for o in outcomes)}",
        "Right: squares of commuting matrices keep the order. What is bounded is L1, not the injected L1 - Bf K1 L2.",
        reproduced=all(o is Outcome.PROVED for o in outcomes),
    )


def _squared_norm() -> Row:
    """P = alpha I, |Y|^2 = alpha^2 epsilon is allowed by (5.36)."""
    alpha, epsilon = 0.5, 9.0
    Y = alpha * np.sqrt(epsilon) * np.array([[0.6], [0.8]])
    wide = np.block([[np.array([[epsilon]]), Y.T], [Y, alpha**2 * np.eye(2)]])
    norm = float(np.linalg.norm(Y / alpha))
    return judged(
        f"largest |L1| that (5.36) allows with epsilon_1 = {epsilon:g}",
        "(5.33)",
        f"epsilon_1 = {epsilon:g}",
        f"{norm:g}",
        "epsilon bounds the squared norm: L1' L1 <= epsilon.",
        reproduced=False,
        corrected=abs(norm - np.sqrt(epsilon)) < 1e-12 and float(np.linalg.eigvalsh(wide).min()) > -1e-12,
    )


def _lifted() -> Row:
    """lambda1 lambda2 appears once (i <= j) or twice (the printed double sum); (5.47) has it twice at 0.5."""
    first, second, square, F12 = exact([[2]])[0, 0], exact([[3]])[0, 0], exact([[0]])[0, 0], exact([[1]])[0, 0]
    G = [[square, F12 / 2], [F12 / 2, square]]
    form = sum(G[i][j] * (first, second)[i] * (first, second)[j] for i in range(2) for j in range(2))
    once, twice = first * second * F12, 2 * first * second * F12
    return judged(
        "term lambda1 lambda2 F12 at (2, 3), F12 = 1: (5.47); sum over i <= j; printed double sum",
        "(5.46), (5.47)",
        "equal",
        f"{form}; {once}; {twice}",
        "With 0.5 F_ij beside the diagonal the sum of (5.46) has to run over i <= j; with the double sum as printed the block is F_ij.",
        reproduced=form == twice,
        corrected=form == once,
    )


def _unstructured() -> Row:
    """F(lambda) = 1 - 2 lambda^2 on [-1, 1], V1 = diag(1.25, -1.5)."""
    G, V = exact(np.diag([1.0, -2.0])), exact(np.diag([1.25, -1.5]))
    ends = [_at(V, end) < 0 for end in (-1, 1)]
    printed = positive_definite(V - G) is Outcome.PROVED and all(ends)
    return judged(
        "1 - 2 lambda^2 < 0 on [-1, 1], V1 = diag(5/4, -3/2): largest value there",
        "(5.48) to (5.50)",
        "negative",
        f"(5.49) and (5.50) {'hold' if printed else 'fail'}, {_at(G, 0)} at lambda = 0",
        "Unsound: (5.49) at the vertices does not give (5.48) between them where V1 is concave, and then V1 adds nothing to the vertices of F. "
        "V_ii >= 0 has to be added: here V11 > 1 and V22 >= 0 contradict V11 + V22 < 0.",
        reproduced=False,
        corrected=printed and _at(G, 0) > 0 and V[1, 1] < 0,
    )


def _structured() -> Row:
    """lambda^2 - 2 on [-1, 1]: G - V2 < 0 for Gamma = 3/2, G + V2 never; 1 - 2 lambda^2: never."""
    U = np.diag([-1.0, 1.0])
    inside = [exact([[k]])[0, 0] / 8 for k in range(-8, 9)]
    never_positive = all(_at(exact(U), v) <= 0 for v in inside)
    met, turned = (_negative(np.diag([-2.0, 1.0]) - sign * 1.5 * U) for sign in (1, -1))
    gammas = np.arange(1, 64) / 8
    other = any(_negative(np.diag([-2.0, 1.0]) + gamma * U) for gamma in gammas)
    wrong = any(_negative(np.diag([1.0, -2.0]) - gamma * U) for gamma in gammas)
    return judged(
        "lambda^2 - 2 < 0 on [-1, 1]: G - V2 < 0 and G + V2 < 0; 1 - 2 lambda^2",
        "(5.51), (5.52), (5.56)",
        "G - V2",
        f"{'holds' if met else 'fails'} and {'holds' if turned or other else 'fails'}; {'accepted' if wrong else 'refused'}",
        "Right as printed: [I; lambda I]' U [I; lambda I] = (lambda - lower)(lambda - upper) Gamma <= 0.",
        reproduced=met and never_positive and not (turned or other or wrong),
    )


def _stacked() -> Row:
    """T of (5.54) for two parameters, and V2 = T' diag(U1, U2) T of (5.55)."""
    random, gaps = np.random.default_rng(5), []
    T = np.array([[1, 0, 0], [0, 1, 0], [1, 0, 0], [0, 0, 1]])
    for first, second in exact(random.integers(-9, 9, size=(_POINTS, 2)).tolist()) / 4:
        short, long = np.array([[1], [first], [second]]), np.array([[1], [first], [1], [second]])
        ends = [(-2, 3), (-1, 5)]
        U = exact(np.zeros((4, 4)))
        for k, (low, high) in enumerate(ends):
            U[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = exact([[low * high, -(low + high) / 2], [-(low + high) / 2, 1]])
        product = sum((v - low) * (v - high) for v, (low, high) in zip((first, second), ends, strict=True))
        gaps += [*(T @ short - long).flat, (short.T @ T.T @ U @ T @ short)[0, 0] - product]
    return judged(
        "T and V2 for two parameters, twenty random rational points",
        "(5.53) to (5.55)",
        "equal",
        f"largest difference {max(abs(g) for g in gaps)}",
        "Algebra, right as printed. Skew blocks beside the diagonal may be added to V2 without changing the form, and cost nothing but variables.",
        reproduced=all(g == 0 for g in gaps),
    )


def _numbering() -> Row:
    return Row(
        "theorems and lemmas cited",
        "sections 5.2 to 5.4",
        "Theorem 2, Theorem 3, Lemma 2, Lemma 13",
        "Theorem 6, Theorem 7, Lemma 15, Lemma 17",
        Verdict.CORRECTED,
        "By what they are cited for: the stability of the Lure system, the observer (5.21), the sector condition, the extended observer. "
        "Phi(y, u) of (5.67) is Psi(y, u) of (5.37).",
    )


def _at(M: np.ndarray, value: Any) -> Any:
    return M[0, 0] + (M[0, 1] + M[1, 0]) * value + M[1, 1] * value * value


def _negative(M: np.ndarray) -> bool:
    return positive_definite(exact(-M)) is Outcome.PROVED
