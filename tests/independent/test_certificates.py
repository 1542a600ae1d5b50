"""Every proved claim of the catalogue, looked at again with plain matrices on random points; no code of the proofs is used."""

from functools import cache
from itertools import product

import numpy as np
import pytest
import scipy.linalg

from catalogue import ROWS, SWITCHED_ROWS, Row
from luenberger.algebra import Polynomial
from luenberger.certify import Claim
from luenberger.design import Design
from luenberger.synthesize import synthesize


@cache
def designed(row: Row) -> Design:
    return synthesize(row.system(), row.method)


def claim_of(design: Design, kind: str) -> Claim | None:
    return next((c for c in design.certificate.claims if c.kind == kind), None)


DECAYING = [r for r in ROWS if not r.name.startswith("interval")]
ENCLOSING = [r for r in ROWS if r.name.startswith("interval")]


def random_loops(design: Design, count: int) -> list[tuple[dict[str, float], np.ndarray]]:
    """A - L C + F J H (I - L2 C) at random scheduling and random Jacobians: of the hull, the box, or a ball of them."""
    generator, system = np.random.default_rng(5), design.system
    loops = []
    for _ in range(count):
        # Vertices as often as interior points.
        pick = generator.random() < 0.5
        values = {
            n: float(generator.choice(i) if pick else generator.uniform(*i)) for n, i in system.scheduling_box.items()
        }
        r = np.array([values[n] for n in system.scheduling_names])
        A = np.asarray(system.at("A", r)) - np.asarray(design.gain(values)) @ np.asarray(system.at("C", r))
        f = system.nonlinearity
        if f is not None:
            if f.jacobian_vertices is not None:
                shares = generator.dirichlet(np.full(len(f.jacobian_vertices), 0.2))
                J = np.tensordot(shares, f.jacobian_vertices, 1)
            elif f.jacobian_lower is not None and f.jacobian_upper is not None:
                J = generator.uniform(f.jacobian_lower, f.jacobian_upper)
            else:
                J = generator.normal(size=(f.size, f.H.shape[0]))
                J *= f.lipschitz_bound / np.linalg.norm(J, 2)
            seen = np.eye(system.nx)
            if design.argument_gain is not None:
                seen = seen - np.asarray(design.argument_gain(values)) @ np.asarray(system.at("C", r))
            A = A + np.asarray(system.at("F", r)) @ J @ f.H @ seen
        loops.append((values, A))
    return loops


def storage_at(claim: Claim, values: dict[str, float]) -> tuple[np.ndarray, list[np.ndarray]]:
    """P at a point, and what every parameter it depends on adds to it per unit."""
    if not isinstance(claim.storage, Polynomial):
        return np.asarray(claim.storage), []
    assert claim.storage.is_multi_affine
    P = np.zeros(claim.storage.shape)
    slopes = {n: np.zeros(claim.storage.shape) for n in claim.storage.names}
    for exponents, coefficient in claim.storage:
        powers = dict(zip(claim.storage.names, exponents, strict=True))
        P = P + coefficient * np.prod([values[n] ** k for n, k in powers.items()])
        for n in powers:
            rest = np.prod([values[m] ** k for m, k in powers.items() if m != n])
            slopes[n] = slopes[n] + coefficient * powers[n] * rest
    return P, list(slopes.values())


@pytest.mark.parametrize("row", DECAYING, ids=lambda row: row.name)
def test_storage_decreases_at_random_points(row: Row) -> None:
    design = designed(row)
    claim = claim_of(design, "decay")
    assert claim is not None
    rates = [p.rate for p in design.system.parameters if p.measured]
    continuous = design.system.dt is None
    for values, A in random_loops(design, 300):
        P, slopes = storage_at(claim, values)
        assert np.linalg.eigvalsh(P)[0] > 0
        drift = P @ A + A.T @ P + 2 * claim.level * P if continuous else A.T @ P @ A - claim.level**2 * P
        for signs in product((-1.0, 1.0), repeat=len(slopes)):
            moving = sum((s * r * M for s, r, M in zip(signs, rates, slopes, strict=False)), start=drift)
            assert np.linalg.eigvalsh(moving)[-1] < 0


@pytest.mark.parametrize("row", DECAYING, ids=lambda row: row.name)
def test_frozen_loops_decay_at_least_as_fast(row: Row) -> None:
    design = designed(row)
    claim = claim_of(design, "decay")
    assert claim is not None
    for _, A in random_loops(design, 100):
        values = np.linalg.eigvals(A)
        assert values.real.max() < -claim.level if design.system.dt is None else np.abs(values).max() < claim.level


@pytest.mark.parametrize("row", ENCLOSING, ids=lambda row: row.name)
def test_order_is_kept_and_widths_stay_at_random_points(row: Row) -> None:
    design = designed(row)
    system, claim = design.system, claim_of(design, "cooperative")
    assert claim is not None
    T = np.eye(system.nx) if claim.transform is None else np.asarray(claim.transform)
    width = claim_of(design, "width")
    generator = np.random.default_rng(7)
    for _ in range(300):
        vertex = generator.random() < 0.5
        q = {
            p.name: float(generator.choice(p.interval) if vertex else generator.uniform(*p.interval))
            for p in system.parameters
        }
        A = np.asarray(system.A({n: q[n] for n in system.A.names}))
        C = np.asarray(system.C({n: q[n] for n in system.C.names}))
        L = np.asarray(design.gain({n: q[n] for n in design.gain.names}))
        M = T @ (A - L @ C) @ np.linalg.inv(T)
        assert np.all(M[~np.eye(system.nx, dtype=bool)] >= -1e-12 * np.abs(M).max())
        if width is not None:
            assert np.all(M @ np.asarray(width.vector) < 0)


@pytest.mark.parametrize("row", [r for r in ROWS if r.system().nd], ids=lambda row: row.name)
def test_frozen_gain_from_disturbance_is_below_the_claim(row: Row) -> None:
    design = designed(row)
    claim = claim_of(design, "l2_gain")
    if claim is None:
        return
    E, W = np.asarray(design.system.at("E", np.zeros(design.system.nr))), np.asarray(claim.weight)
    for _, A in random_loops(design, 20):
        n = A.shape[0]
        response = [
            np.linalg.norm(W @ np.linalg.solve(1j * w * np.eye(n) - A, E), 2)
            for w in np.concatenate([[0.0], np.logspace(-2, 3, 200)])
        ]
        assert max(response) <= claim.level


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.name)
def test_a_lyapunov_equation_agrees_that_the_loop_is_stable(row: Row) -> None:
    for _, A in random_loops(designed(row), 5):
        one = np.eye(A.shape[0])
        if row.system().dt is None:
            X = scipy.linalg.solve_continuous_lyapunov(A.T, -one)
        else:
            X = scipy.linalg.solve_discrete_lyapunov(A.T, one)
        assert np.linalg.eigvalsh((X + X.T) / 2)[0] > 0


DISCRETE = [r for r in ROWS if r.system().dt is not None]


def matrices(design: Design) -> tuple[np.ndarray, ...]:
    """A to N of a constant plant, its bounds, and the gain of the prediction."""
    system = design.system
    parts = [np.asarray(system.at(letter)) for letter in "ABCDEGN"]
    return *parts, np.array(system.disturbance_bound or ()), np.array(system.noise_bound), np.asarray(design.gain({}))


@pytest.mark.parametrize("row", DISCRETE, ids=lambda row: row.name)
def test_steady_boxes_are_support_functions_of_sums(row: Row) -> None:
    # The largest entry i of the steady set is the support of its zonotope in direction i: term by term, transposed.
    design = designed(row)
    claim = claim_of(design, "steady_box")
    if claim is None:
        pytest.skip("no steady box is claimed")
    A, B, C, D, E, G, N, dbar, vbar, L = matrices(design)
    for i, claimed in enumerate(np.asarray(claim.vector)):
        direction, support = np.eye(len(A))[i], 0.0
        for _ in range(400):
            support += np.abs(E.T @ direction) @ dbar
            support += np.abs(N.T @ B.T @ direction + (G - D @ N).T @ L.T @ direction) @ vbar
            direction = (A - L @ C).T @ direction
        # The claim leaves a millionth for its proof, and a billionth of the widest state.
        assert support <= claimed <= support * (1 + 2e-6) + 2e-9 * claim.level
    assert claim.level == np.asarray(claim.vector).max()


@pytest.mark.parametrize("row", DISCRETE, ids=lambda row: row.name)
def test_filter_boxes_hold_the_recursion_of_the_filter(row: Row) -> None:
    # Predict and correct as written in textbooks, with the plant beside it; boxes by hand from the two columns of numbers.
    design = designed(row)
    claim = claim_of(design, "filter_box")
    if claim is None:
        assert design.filter_gain is None
        pytest.skip("no filter")
    assert design.filter_gain is not None
    K = np.asarray(design.filter_gain({}))
    A, B, C, D, E, G, N, dbar, vbar, L = matrices(design)
    np.testing.assert_allclose(L, A @ K, rtol=1e-15)
    rng = np.random.default_rng(2)
    x, guess, left = np.zeros((len(A), 4000)), np.zeros((len(A), 4000)), np.zeros(len(A))
    for k in range(60):
        d = dbar[:, None] * rng.choice([-1.0, 1.0], (len(dbar), 4000))
        v = vbar[:, None] * rng.choice([-1.0, 1.0], (len(vbar), 4000))
        u = np.full((B.shape[1], 4000), np.sin(k))
        y, heard = C @ x + D @ u + G @ v, u + N @ v
        corrected = guess + K @ (y - C @ guess - D @ heard)
        left = np.maximum(left, np.abs(x - corrected).max(axis=1))
        x, guess = A @ x + B @ u + E @ d, A @ corrected + B @ heard
    box = np.asarray(claim.vector)
    assert (left <= box).all()
    # Random signs come near the worst ones in loops that forget within a few steps.
    assert (left > 0.7 * box).all()


@pytest.mark.parametrize("row", SWITCHED_ROWS, ids=lambda row: row.name)
def test_storages_of_modes_fall_on_every_transition(row: Row) -> None:
    design = synthesize(row.system(), row.method)
    plant, rng = design.system, np.random.default_rng(6)
    claims = {c.kind: c for c in design.certificate.claims}
    falls = claims["iss"]
    assert falls.inputs == "lumped"
    modes, one = range(len(plant.modes)), np.eye(plant.first.nx)
    Q = [falls.storages[min(i, len(falls.storages) - 1)] for i in modes]
    for _ in range(100):
        r = np.array(
            [
                rng.choice(box) if rng.random() < 0.5 else rng.uniform(*box)
                for box in plant.first.scheduling_box.values()
            ]
        )
        values = dict(zip(plant.first.scheduling_names, r, strict=True))
        for i, mode in enumerate(plant.modes):
            A, C, E = (np.asarray(mode.at(letter, r)) for letter in "ACE")
            K, H = (
                np.asarray(gain[i]({n: values[n] for n in gain[i].names})) for gain in (design.gains, design.decoupling)
            )
            P = one + H @ C
            N = P @ A - K @ C
            assert np.abs(P @ E).max() <= claims["decoupling"].level + 1e-16 * np.abs(E).max()
            assert np.linalg.norm(K, 2) <= claims["gain_bound"].level
            assert np.abs(np.linalg.eigvals(N)).max() ** 2 <= 1 - falls.fade
            for j in modes if falls.growth == 1 else [i]:
                corner = (1 - falls.fade) * Q[i] - N.T @ Q[j] @ N
                whole = np.block([[corner, -N.T @ Q[j]], [-Q[j] @ N, falls.supply * one - Q[j]]])
                assert np.linalg.eigvalsh(whole)[0] > 0
    alpha = min(np.linalg.eigvalsh(q)[0] for q in Q)
    stretch = falls.growth * (1 - falls.fade) ** plant.dwell
    assert stretch < 1
    assert falls.level >= np.sqrt(falls.supply / (alpha * falls.fade))
    for i, j in product(modes, modes):
        assert np.linalg.eigvalsh(falls.growth * (1 + 1e-9) * Q[i] - Q[j])[0] >= 0 or falls.growth == 1
