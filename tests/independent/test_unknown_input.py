"""The unknown-input observer against plain textbook forms written here: its inequality, its bound, its error in a simulation."""

import warnings
from itertools import product
from typing import Any

import cvxpy as cp
import numpy as np
import pytest

from luenberger.core import Infeasible, NotAccepted
from luenberger.methods.unknown_input import UnknownInputGain
from luenberger.systems import Switched, System

# Numbers of the car, typed here again: mass, inertia, axle distances, stiffness of both axles, lever of the gust.
M, IZ, LF, LR, CF, CR, LW = 1500.0, 2500.0, 1.2, 1.6, 60e3, 65e3, 0.4
Triple = tuple[np.ndarray, np.ndarray, np.ndarray]


def car(step: float) -> list[Triple]:
    """(A, C, E) at three speeds: Euler's step of the single track with the gust as an unknown input."""
    found = []
    for v in (8.5, 13.55, 18.05):
        rates = [
            [-(CF + CR) / (M * v), (CR * LR - CF * LF) / (M * v) - v],
            [(CR * LR - CF * LF) / (IZ * v), -(CR * LR**2 + CF * LF**2) / (IZ * v)],
        ]
        E = step * np.array([[1 / M], [LW / IZ]])
        found.append((np.eye(2) + step * np.array(rates), np.array([[0.0, 1.0]]), E))
    return found


def random_triples(seed: int, states: int, outputs: int) -> list[Triple]:
    rng = np.random.default_rng(seed)
    C = rng.standard_normal((outputs, states))
    found = []
    for _ in range(2):
        A = rng.standard_normal((states, states))
        found.append((A / np.abs(np.linalg.eigvals(A)).max(), C, rng.standard_normal((states, 1))))
    return found


def plant(triples: list[Triple], **options: Any) -> Switched:
    return Switched.of([System.linear(A, C=C, E=E, dt=1.0, **options) for A, C, E in triples], dwell=50)


def textbook(triples: list[Triple], fade: float, per_mode: bool = False, alpha: float = 1.0) -> float:
    """Inequality (21) with I in block (1,3) and Q >= alpha I, X and Y of full size, S apart from Q; infinite if infeasible."""
    n, ny = triples[0][0].shape[0], triples[0][1].shape[0]
    gamma = cp.Variable()
    Q = [cp.Variable((n, n), symmetric=True) for _ in triples]
    S = [cp.Variable((n, n)) for _ in triples]
    conditions: list[Any] = [q - alpha * np.eye(n) >> 0 for q in Q]
    if not per_mode:
        conditions += [q == Q[0] for q in Q[1:]] + [s == S[0] for s in S[1:]]
    for i, (A, C, E) in enumerate(triples):
        inverse = np.linalg.inv((C @ E).T @ (C @ E)) @ (C @ E).T
        U, J = -E @ inverse, np.eye(ny) - C @ E @ inverse
        W, X = cp.Variable((n, ny)), cp.Variable((n, ny))
        loop = S[i] @ (np.eye(n) + U @ C) @ A + X @ J @ C @ A - W @ C
        for after in Q if per_mode else Q[:1]:
            rows = [
                [(fade - 1) * Q[i], np.zeros((n, n)), loop.T],
                [np.zeros((n, n)), -gamma * np.eye(n), S[i].T],
                [loop, S[i], after - S[i] - S[i].T],
            ]
            whole = cp.bmat(rows)
            conditions.append((whole + whole.T) / 2 << 0)
    problem = cp.Problem(cp.Minimize(gamma), conditions)
    with warnings.catch_warnings():
        # Unknowns without effect leave the last digits open, which the solver calls inaccurate; the comparison is the judge.
        warnings.simplefilter("ignore", UserWarning)
        problem.solve(solver="CLARABEL")
    return float(gamma.value) if problem.status.startswith("optimal") else np.inf


def level(triples: list[Triple], **options: Any) -> float:
    return float(UnknownInputGain(**options).design(plant(triples)).statistics["optimum"])


@pytest.mark.parametrize("step", [0.05, 0.06, 0.1])
def test_the_level_of_the_car_is_the_textbook_form_and_the_closed_form(step: float) -> None:
    zeros = [1 - step * (CF * (LW - LF) + CR * (LW + LR)) / (M * v * LW) for v in (8.5, 13.55, 18.05)]
    closed = max(0.5 / (0.5 - z**2) for z in zeros)
    # Both solvers stop at a relative gap of 1e-10 on numbers of order one.
    assert textbook(car(step), 0.5) == pytest.approx(closed, rel=1e-6)
    assert level(car(step), fade=0.5) == pytest.approx(closed, rel=1e-6)


@pytest.mark.parametrize("alpha", [1.0, 1e-2, 1e-4])
def test_as_printed_only_the_scale_of_the_storage_holds_the_level(alpha: float) -> None:
    assert textbook(car(0.06), 0.5, alpha=alpha) == pytest.approx(2.47274 * alpha, rel=1e-4)


def test_without_a_scale_the_level_is_nothing() -> None:
    assert abs(textbook(car(0.06), 0.5, alpha=0.0)) < 1e-6


@pytest.mark.parametrize(("seed", "states", "outputs"), [(10, 3, 1), (33, 3, 1), (1, 4, 2), (15, 4, 2)])
@pytest.mark.parametrize("storage", ["common", "mode"])
def test_levels_of_random_plants_are_the_textbook_form(seed: int, states: int, outputs: int, storage: str) -> None:
    triples = random_triples(seed, states, outputs)
    # Slack, Q and gains are all free there, S = Q and a short basis of the free outputs here.
    ours = level(triples, fade=0.1, storage=storage)
    assert ours == pytest.approx(textbook(triples, 0.1, per_mode=storage == "mode"), rel=2e-4)


def test_the_textbook_form_finds_no_common_storage_either() -> None:
    triples = random_triples(225, 3, 1)
    assert textbook(triples, 0.1) == np.inf
    with pytest.raises(Infeasible):
        level(triples, fade=0.1)
    assert level(triples, fade=0.1, storage="mode") == pytest.approx(textbook(triples, 0.1, per_mode=True), rel=2e-4)


@pytest.mark.parametrize("seed", [10, 33, 47])
@pytest.mark.parametrize("storage", ["common", "mode", "dwell"])
def test_the_claimed_bound_holds_in_simulations_of_plant_and_observer(seed: int, storage: str) -> None:
    # Plain recursion of both, an unknown input a thousand times the rest, switching at random within the dwell time.
    triples = random_triples(seed, 3, 1)
    bound = 0.1
    system = plant(triples, noise_bound=[bound])
    found = UnknownInputGain(fade=0.1, storage=storage).design(system)
    claim = next(c for c in found.claims(found.gains, found.decoupling) if c.kind == "iss")
    K, H = ([np.asarray(m({})) for m in side] for side in (found.gains, found.decoupling))
    rng = np.random.default_rng(seed)
    x, xh, v, mode, worst, largest = rng.standard_normal(3), np.zeros(3), np.zeros(1), 0, 0.0, 0.0
    for k in range(1500):
        if k % 50 == 0:
            mode = int(rng.integers(2))
        A, C, E = triples[mode]
        later = bound * np.sign(rng.standard_normal(1))
        after = A @ x + E @ (1000 * rng.standard_normal(1))
        P = np.eye(3) + H[mode] @ C
        lump = H[mode] @ later - K[mode] @ v
        xh = (P @ A - K[mode] @ C) @ xh + K[mode] @ (C @ x + v) - H[mode] @ (C @ after + later)
        x, v, largest = after, later, max(largest, float(np.linalg.norm(lump)))
        if k > 700:
            worst = max(worst, float(np.linalg.norm(x - xh)))
        # The unstable plant would leave the numbers; the error does not know of a shift of both.
        x, xh = x - xh, np.zeros(3)
    assert 0.02 * claim.level * largest < worst < claim.level * largest


@pytest.mark.parametrize("zero", [0.5, -0.5])
def test_a_mutated_half_plane_is_caught_by_a_stable_zero(zero: float) -> None:
    # Re(s) >= 0 of continuous time refuses z = 0.5, which fades by half a step.
    triples = [(np.array([[zero, 1.0], [0.0, 0.3]]), np.array([[0.0, 1.0]]), np.array([[0.0], [1.0]]))]
    UnknownInputGain(fade=0.5).accept(plant(triples))
    assert level(triples, fade=0.5) == pytest.approx(0.5 / (0.5 - zero**2), rel=1e-6)


def test_a_mutated_half_plane_is_caught_by_an_unstable_zero() -> None:
    # Re(s) >= 0 would let z = -2 pass; with any gain the error then doubles at every step.
    A, C, E = np.array([[-2.0, 1.0], [0.0, 0.3]]), np.array([[0.0, 1.0]]), np.array([[0.0], [1.0]])
    with pytest.raises(NotAccepted, match="unstable zero z = -2"):
        UnknownInputGain(fade=0.5).accept(plant([(A, C, E)]))
    for K in product((-1.0, 0.0, 2.0), repeat=2):
        P = np.diag([1.0, 0.0])
        assert np.abs(np.linalg.eigvals(P @ A - np.array([K]).T @ C)).max() >= 2 - 1e-12


def test_a_mutated_constant_of_the_bound_is_caught() -> None:
    # z = 0.8: the constant input 1 takes the error to 5, and the claim says so; with 1 - fade under the root it says 2.5.
    triples = [(np.array([[0.8, 0.1], [0.0, 0.5]]), np.array([[0.0, 1.0]]), np.array([[0.0], [1.0]]))]
    found = UnknownInputGain(fade=0.2).design(plant(triples))
    claim = next(c for c in found.claims(found.gains, found.decoupling) if c.kind == "iss")
    K, H = np.asarray(found.gains[0]({})), np.asarray(found.decoupling[0]({}))
    A, C, _ = triples[0]
    loop = (np.eye(2) + H @ C) @ A - K @ C
    error = np.zeros(2)
    for _ in range(300):
        error = loop @ error + [1.0, 0.0]
    assert claim.level == pytest.approx(5.0, abs=1e-4)
    assert 4.999 < np.linalg.norm(error) <= claim.level
    alpha = np.linalg.eigvalsh(claim.storages[0])[0]
    assert np.sqrt(claim.supply / (alpha * (1 - claim.fade))) < 0.51 * np.linalg.norm(error)
