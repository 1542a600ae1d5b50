"""The Lipschitz designs and their proofs against plain textbook forms written here."""

import warnings
from fractions import Fraction

import cvxpy as cp
import numpy as np
import pytest
from scipy.linalg import expm, solve_continuous_are
from scipy.optimize import minimize_scalar

from luenberger.experiment.published.flexible_joint import PRINTED_GAINS, TRANSFORM, flexible_joint
from luenberger.methods.hamiltonian import hinf_peak, riccati_solution
from luenberger.methods.kalman_gain import KalmanGain
from luenberger.methods.lipschitz_bracket import largest_epsilon, margin_bracket
from luenberger.methods.lipschitz_disturbance import LipschitzDisturbance
from luenberger.methods.lipschitz_gain import disturbance_gain
from luenberger.methods.lipschitz_margin import margin_at, stability_margin
from luenberger.methods.lipschitz_pareto import LipschitzPareto
from luenberger.methods.lipschitz_riccati import LipschitzRiccati
from luenberger.systems import System

A = np.array([[0, 1, 0, 0], [-48.6, -1.25, 48.6, 0], [0, 0, 0, 1], [19.5, 0, -19.5, 0]])
C = np.eye(2, 4)
T = np.diag([1, 1, 1, 0.1])
A_T, C_T = T @ A @ np.linalg.inv(T), C @ np.linalg.inv(T)
EYE = np.eye(4)
G = 0.333
TIGHT = {"tol_gap_abs": 1e-11, "tol_gap_rel": 1e-11, "tol_feas": 1e-11}


def symmetric_blocks(rows: list[list[object]]) -> cp.Expression:
    M = cp.bmat(rows)
    return (M + M.T) / 2


def solved(objective: object, constraints: list[object]) -> None:
    with warnings.catch_warnings():
        # Status "inaccurate" is usual at this tolerance; the comparison with the oracle is the judge.
        warnings.simplefilter("ignore", UserWarning)
        cp.Problem(objective, constraints).solve(solver="CLARABEL", **TIGHT)


def test_margin_programme_24() -> None:
    for matrix, output, transform in ((A, C, None), (A_T, C_T, TRANSFORM)):
        P, a = cp.Variable((4, 4), symmetric=True), cp.Variable()
        M = symmetric_blocks([[P @ matrix + matrix.T @ P + a * EYE - output.T @ output / 2.0, P], [P, -EYE]])
        solved(cp.Maximize(a), [P >> 0, M << 0])
        assert margin_at(flexible_joint("none"), 2.0, transform) == pytest.approx(np.sqrt(a.value), rel=1e-6)


def test_largest_eigenvalue_programme_26() -> None:
    P = cp.Variable((4, 4), symmetric=True)
    M = symmetric_blocks([[P @ A_T + A_T.T @ P + G**2 * EYE - C_T.T @ C_T, P], [P, -EYE]])
    solved(cp.Maximize(cp.lambda_min(P)), [M << 0])
    L = np.linalg.inv(T) @ np.linalg.solve(P.value, C_T.T) / 2
    made = LipschitzRiccati(1.0, TRANSFORM).design(flexible_joint("none"))
    # The optimum is a point on the boundary: an error d of the solver moves the gain by about 7.5 d.
    np.testing.assert_allclose(np.asarray(made.gain({})), L, rtol=1e-4)


def test_pareto_programme_27() -> None:
    P, sigma = cp.Variable((4, 4), symmetric=True), cp.Variable()
    M = symmetric_blocks([[P @ A_T + A_T.T @ P + G**2 * EYE - sigma * C_T.T @ C_T, P], [P, -EYE]])
    objective = 0.7 * cp.lambda_min(P) - 0.3 * sigma
    solved(cp.Maximize(objective), [M << 0])
    made = LipschitzPareto(0.7, 0.0, TRANSFORM).design(flexible_joint("none"))
    assert made.statistics["optimum"] == pytest.approx(float(objective.value), abs=1e-8)


def test_disturbance_programme_34() -> None:
    for direction, E in (("printed", [[0.0], [2.0], [0.0], [0.0]]), ("motor_angle", [[1.0], [0.0], [0.0], [0.0]])):
        P, squared = cp.Variable((4, 4), symmetric=True), cp.Variable()
        corner = P @ A_T + A_T.T @ P + (1 + G**2) * EYE - C_T.T @ C_T / 0.1
        E_T = T @ np.array(E)
        M = symmetric_blocks(
            [
                [corner, P, P @ E_T],
                [P, -EYE, np.zeros((4, 1))],
                [E_T.T @ P, np.zeros((1, 4)), -cp.reshape(squared, (1, 1), order="F")],
            ]
        )
        solved(cp.Minimize(0.2 * squared - 0.8 * cp.lambda_min(P)), [M << 0])
        made = LipschitzDisturbance(0.1, 0.2, TRANSFORM).design(flexible_joint(direction))
        # The objective is flat at its optimum: kappa and gain carry about the square root of the solver's accuracy.
        assert made.statistics["disturbance_gain"] == pytest.approx(np.sqrt(squared.value), rel=1e-3)
        L = np.linalg.inv(T) @ np.linalg.solve(P.value, C_T.T) / 0.2
        np.testing.assert_allclose(np.asarray(made.gain({})), L, rtol=2e-3)


def test_disturbance_gain_by_scaled_small_gain() -> None:
    # For a fixed multiplier s the inequality says |[g sqrt(s) I; I] (j w I - A)^-1 [I / sqrt(s), E / kappa]| < 1.
    E = np.array([[0.0], [2.0], [0.0], [0.0]])
    for name in ("L1", "L4"):
        loop = T @ (A - PRINTED_GAINS[name] @ C) @ np.linalg.inv(T)

        def kappa(log_s: float, loop: np.ndarray = loop) -> float:
            s = np.exp(log_s)
            output = np.sqrt(1 + G**2 * s) * EYE
            low, high = 1e-4, 1e4
            for _ in range(50):
                middle = np.sqrt(low * high)
                norm = hinf_peak(loop, np.hstack([EYE / np.sqrt(s), T @ E / middle]), output, 1e-8).level
                low, high = (low, middle) if norm < 1 else (middle, high)
            return high

        best = minimize_scalar(kappa, bounds=(-5.0, 10.0), method="bounded", options={"xatol": 1e-4})
        assert disturbance_gain(flexible_joint("printed"), PRINTED_GAINS[name], TRANSFORM) == pytest.approx(
            best.fun, rel=1e-4
        )


def test_margin_is_the_distance_to_a_destabilising_matrix() -> None:
    # The smallest complex D with A + D on the stability border is found on a sweep of frequencies.
    for name, gain in PRINTED_GAINS.items():
        loop = T @ (A - gain @ C) @ np.linalg.inv(T)
        sweep = [
            np.linalg.svd(1j * w * EYE - loop, compute_uv=False)[-1]
            for w in np.concatenate([[0.0], np.geomspace(1e-3, 1e3, 4001)])
        ]
        assert stability_margin(flexible_joint("none"), gain, TRANSFORM) == pytest.approx(min(sweep), rel=1e-4), name


def rational_pivots(rows: list[list[Fraction]]) -> list[Fraction]:
    """Pivots of Gaussian elimination without exchange; all positive exactly where a symmetric matrix is positive definite."""
    M = [row[:] for row in rows]
    for k in range(len(M)):
        for i in range(k + 1, len(M)):
            factor = M[i][k] / M[k][k]
            M[i] = [x - factor * y for x, y in zip(M[i], M[k], strict=True)]
    return [M[k][k] for k in range(len(M))]


def fractions(matrix: np.ndarray) -> list[list[Fraction]]:
    return [[Fraction(float(x)) for x in row] for row in matrix]


def product(left: list[list[Fraction]], right: list[list[Fraction]]) -> list[list[Fraction]]:
    return [
        [sum((x * y for x, y in zip(row, column, strict=True)), Fraction(0)) for column in zip(*right, strict=True)]
        for row in left
    ]


def test_epsilon_bracket_with_the_standard_library_alone() -> None:
    bracket = largest_epsilon(flexible_joint("none"), G, TRANSFORM)
    # Lower end: a storage matrix, checked with `fractions`. A is transformed by exact rationals.
    scale = [Fraction(1), Fraction(1), Fraction(1), Fraction(0.1)]
    drift = [[scale[i] * Fraction(float(A[i, j])) / scale[j] for j in range(4)] for i in range(4)]
    P = riccati_solution(A_T, EYE, (G * (1 + 1e-9)) ** 2 * EYE - C_T.T @ C_T / bracket.feasible)
    assert P is not None
    exact_P = fractions(P)
    PA = product(exact_P, drift)
    level, output = Fraction(G) ** 2, 1 / Fraction(bracket.feasible)
    corner = [
        [PA[i][j] + PA[j][i] + (level if i == j else 0) - (output if i == j < 2 else 0) for j in range(4)]
        for i in range(4)
    ]
    whole = [[-x for x in corner[i]] + [-x for x in exact_P[i]] for i in range(4)]
    whole += [[-x for x in exact_P[i]] + [Fraction(int(i == j)) for j in range(4)] for i in range(4)]
    assert min(rational_pivots(exact_P)) > 0
    assert min(rational_pivots(whole)) > 0
    # Upper end: just above it the programme itself stays below the constant.
    assert bracket.infeasible is not None
    assert margin_bracket(flexible_joint("none"), epsilon=bracket.infeasible, transform=TRANSFORM).upper < level


def test_riccati_solution_against_scipy() -> None:
    generator = np.random.default_rng(5)
    M, out = generator.normal(size=(3, 3)), generator.normal(size=(1, 3))
    B, Q = generator.normal(size=(3, 2)), out.T @ out + np.eye(3)
    X = solve_continuous_are(M, B, Q, np.eye(2))
    P = riccati_solution(M, B @ B.T, -Q, "minimal")
    assert P is not None
    # SciPy: He(X M) - X B B' X + Q = 0 with M - B B' X stable, so P = -X solves ours with M + B B' P stable.
    np.testing.assert_allclose(-P, X, rtol=1e-9, atol=1e-9)


def test_kalman_gain_is_the_stationary_filter() -> None:
    # Integrate the covariance equation until it stands still.
    Q, R = np.diag([0.0, 1.0, 0.0, 1.0]), np.diag([0.01, 0.1])
    plant = System.linear(A, C=C)
    hamiltonian = np.block([[-A.T, C.T @ np.linalg.inv(R) @ C], [Q, A]])
    X, Y, P = EYE, EYE, EYE
    step = expm(hamiltonian * 0.05)
    for _ in range(600):
        X, Y = step[:4, :4] @ EYE + step[:4, 4:] @ P, step[4:, :4] @ EYE + step[4:, 4:] @ P
        P = Y @ np.linalg.inv(X)
        P = (P + P.T) / 2
    np.testing.assert_allclose(KalmanGain(Q, R).gain_at(plant), P @ C.T @ np.linalg.inv(R), rtol=1e-8, atol=1e-9)


def test_error_falls_as_claimed_for_the_true_sine() -> None:
    made = LipschitzRiccati(1.0, TRANSFORM).design(flexible_joint("none"))
    claim = made.claims(made.gain)[0]
    L, P = np.asarray(made.gain({})), np.asarray(claim.storage)
    generator = np.random.default_rng(1)
    for x, e in generator.uniform(-3, 3, (200, 2, 4)):
        slip = np.zeros(4)
        slip[3] = -3.33 * (np.sin(x[2]) - np.sin(x[2] - e[2]))
        rate = 2 * e @ P @ ((A - L @ C) @ e + slip)
        assert rate <= -2 * claim.level * (e @ P @ e) * (1 - 1e-9)
