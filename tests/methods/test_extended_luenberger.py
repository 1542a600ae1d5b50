"""The vertex design against independent numbers, frozen error matrices, and norms of frozen error systems; its refusals."""

from itertools import pairwise
from typing import NamedTuple

import cvxpy as cp
import jax.numpy as jnp
import numpy as np
import pytest

from luenberger.admissible import largest_admissible
from luenberger.algebra import Polynomial
from luenberger.certify import Claim, certify_claims
from luenberger.core import BadInput, Infeasible, LuenbergerError, NotAccepted, Outcome
from luenberger.design import Design
from luenberger.lmi import decay_storage
from luenberger.methods import PolytopicLuenberger
from luenberger.methods.extended_luenberger import ExtendedLuenberger
from luenberger.synthesize import synthesize
from luenberger.systems import MatrixFunction, Nonlinearity, Parameter, System
from luenberger.vehicle import brush_tyres, slip_angle_plant, wang_car

SPEED, ACCELERATION = (15 / 3.6, 150 / 3.6), (-8.0, 8.0)


def van_der_pol(reach: float, tangents: int = 0, flipped: bool = False, **channels: object) -> System:
    """The oscillator on |x| <= reach; its Jacobian (-2 x1 x2, 1 - x1^2) in a box, or in a polygon of tangents."""
    box = np.array([[-2 * reach**2, 1 - reach**2]]), np.array([[2 * reach**2, 1.0]])
    s = np.linspace(-reach, reach, tangents + 1)
    # |g1| <= 2 reach sqrt(1 - g2) bounds a parabola; neighbouring tangents at x1 = s meet at (reach (s + t), 1 - s t).
    corners = [(-2 * reach**2, 1 - reach**2), (2 * reach**2, 1 - reach**2)]
    corners += [(reach * (a + b), 1 - a * b) for a, b in pairwise(s)]
    sign = np.array([-1.0 if flipped else 1.0, 1.0])
    bounds = {"hull": np.array(corners)[:, None, :] * sign} if tangents else {"jacobian": box}
    f = Nonlinearity.bounded(lambda z, u: jnp.array([(1 - z[0] ** 2) * z[1]]), np.eye(2), **bounds)
    A = np.array([[0.0, 1.0], [-1.0, 0.0]]) * np.outer(sign, sign)
    return System.nonlinear(A, C=[[sign[0], 0.0]], F=[[0.0], [1.0]], nonlinearity=f, name="oscillator", **channels)


def slip_angles(kappa: float) -> System:
    """Both axles lose up to kappa of their stiffness; scheduled over the trapezoid of (1 / v, a / v)."""
    tyres = brush_tyres(wang_car)
    limit = (1 - np.sqrt(1 - kappa)) / float(tyres[0].theta)
    return slip_angle_plant(wang_car, SPEED, ACCELERATION, tyres=tyres, slip_limit=limit, disturbance=True)


def boxed_slip_angles(kappa: float) -> System:
    """The same with 1 / v and a / v in a box, as if they were independent."""
    tyred = slip_angles(kappa)
    K, stiffness = np.asarray(tyred.polynomial("F").terms[(1, 0)]), np.array([76500.0, 51000.0])
    names = ("inverse_speed", "braking")
    f = Nonlinearity.bounded(
        lambda z, u: -0.5 * kappa * stiffness * z,
        np.eye(2),
        size=2,
        jacobian=(np.diag(-kappa * stiffness), np.zeros((2, 2))),
    )
    parameters = [
        Parameter("inverse_speed", 1 / SPEED[1], 1 / SPEED[0]),
        Parameter("braking", ACCELERATION[0] / SPEED[0], ACCELERATION[1] / SPEED[0]),
    ]
    A = Polynomial(names, {(1, 0): K * stiffness, (0, 1): -np.eye(2)})
    F = Polynomial(names, {(1, 0): K})
    return System.lpv(A, C=[[1.0, -1.0]], parameters=parameters, F=F, nonlinearity=f)


def level(design: Design, kind: str) -> float:
    return next(p.claim.level for p in design.certificate.proofs if p.claim.kind == kind)


class Frozen(NamedTuple):
    """A + F J H (I - L2 C) - L C, the feed F J H, L and E at one scheduling vector and Jacobian."""

    closed: np.ndarray
    feed: np.ndarray
    L: np.ndarray
    E: np.ndarray


def frozen(design: Design, count: int, seed: int = 0) -> list[Frozen]:
    """Error matrices at random scheduling and Jacobians of the set."""
    system, random = design.system, np.random.default_rng(seed)
    f = system.nonlinearity
    assert f is not None
    L2 = np.zeros((system.nx, system.ny)) if design.argument_gain is None else np.asarray(design.argument_gain({}))
    found = []
    for _ in range(count):
        r = np.array([random.uniform(*ends) for ends in system.scheduling_box.values()])
        where = dict(zip(system.scheduling_names, r, strict=True))
        if f.jacobian_vertices is None:
            J = random.uniform(f.jacobian_lower, f.jacobian_upper)
        else:
            shares = random.dirichlet(np.full(len(f.jacobian_vertices), 0.2))
            J = np.tensordot(shares, f.jacobian_vertices, 1)
        A, C, F, E = (np.asarray(system.at(k, r)) for k in "ACFE")
        feed, L = F @ J @ f.H, design.gain_at(**where)
        found.append(Frozen(A + feed @ (np.eye(system.nx) - L2 @ C) - L @ C, feed, L, E))
    return found


def infinity_norm(A: np.ndarray, B: np.ndarray) -> float:
    """Largest singular value of (i w - A)^-1 B on a grid of frequencies: a lower bound of the norm."""
    return max(
        float(np.linalg.norm(np.linalg.solve(1j * w * np.eye(len(A)) - A, B), 2)) for w in np.logspace(-3, 4, 200)
    )


@pytest.mark.parametrize(
    ("reach", "rate", "tangents", "gain"),
    [
        (1.0, 0.0, 0, 5.397),
        (2.7, 0.0, 0, 24.959),
        (5.0, 0.0, 0, 75.805),
        (5.0, 1.0, 0, 95.317),
        (1.0, 0.0, 24, 3.544),
        (2.7, 0.0, 24, 10.247),
        (5.0, 0.0, 24, 22.298),
        (5.0, 1.0, 24, 41.366),
    ],
)
def test_smallest_gain_of_the_oscillator(reach: float, rate: float, tangents: int, gain: float) -> None:
    design = synthesize(van_der_pol(reach, tangents), ExtendedLuenberger(rate))
    # Half a unit of the last digit that was known beforehand.
    assert np.sqrt(design.statistics["optimum"]) == pytest.approx(gain, abs=6e-4)
    assert level(design, "gain_bound") <= 1.015 * gain
    # 1e-9 for the arithmetic of the test; the claim itself is proved.
    assert all(np.linalg.eigvals(A).real.max() <= -rate + 1e-9 for A, *_ in frozen(design, 400))


def test_sign_of_a_state_changes_nothing() -> None:
    one, other = (ExtendedLuenberger().design(van_der_pol(2.7, 24, flipped)) for flipped in (False, True))
    # The solver's own tolerance, 1e-10 before scaling.
    assert other.statistics["optimum"] == pytest.approx(one.statistics["optimum"], rel=1e-6)


def test_large_gains_are_still_found() -> None:
    # The gain grows faster than the square of the reach; without units of P L the solver fails from a reach of 50.
    design = synthesize(van_der_pol(100.0), ExtendedLuenberger())
    assert np.sqrt(design.statistics["optimum"]) == pytest.approx(33319.55, rel=1e-4)


def test_plant_without_nonlinearity_gets_the_polytopic_design() -> None:
    A = Polynomial.affine([[0.0, 1.0], [0.0, -0.2]], stiffness=[[0.0, 0.0], [-1.0, 0.0]])
    plant = System.lpv(A, C=[[1.0, 0.0]], parameters=[Parameter("stiffness", 1.0, 4.0)])
    one, other = (m.design(plant).statistics["optimum"] for m in (ExtendedLuenberger(1.0), PolytopicLuenberger(1.0)))
    assert one == pytest.approx(other, rel=1e-6)


def test_largest_loss_of_stiffness_on_the_trapezoid() -> None:
    found = largest_admissible(slip_angles, ExtendedLuenberger(), 0.9, 0.97, 1e-4)
    # The unobservable mode (1, 1) dies out at 159.375 (1 - kappa) / v - 8 / v: kappa < 1 - 8 / 159.375 = 0.94980.
    assert found.proved >= 0.9496
    assert found.refused is not None
    assert found.refused <= 0.9499
    assert all(np.linalg.eigvals(A).real.max() < 0 for A, *_ in frozen(found.design, 400))


def test_box_in_place_of_the_trapezoid_costs_half() -> None:
    found = largest_admissible(boxed_slip_angles, ExtendedLuenberger(), 0.3, 0.6, 1e-3)
    assert found.refused is not None
    # 159.375 (1 - kappa) / 41.67 = 8 / 4.167 at the corner that the car never reaches: kappa < 0.49804.
    assert 0.496 <= found.proved < 0.49804 < found.refused


@pytest.mark.parametrize(("kappa", "gamma"), [(0.3, 0.02969), (0.5, 0.04289), (0.69, 0.07425), (0.9, 0.38735)])
@pytest.mark.parametrize("limit", [None, 10.0])
def test_smallest_disturbance_gain_of_slip_angles(kappa: float, gamma: float, limit: float | None) -> None:
    design = synthesize(slip_angles(kappa), ExtendedLuenberger(goal="l2", gain_limit=limit))
    # From 1 kN and 1 kN m to rad; half a unit of the last digit.
    assert 1e3 * np.sqrt(design.statistics["optimum"]) == pytest.approx(gamma, abs=6e-6)
    assert 1e3 * level(design, "l2_gain") <= 1.015 * gamma
    assert limit is None or level(design, "gain_bound") <= limit
    for closed, _, _, E in frozen(design, 40):
        assert np.linalg.eigvals(closed).real.max() < 0
        assert infinity_norm(closed, E) <= level(design, "l2_gain")


@pytest.mark.parametrize("kappa", [0.9, 0.94])
def test_known_gain_of_slip_angles_is_proved(kappa: float) -> None:
    system, names = slip_angles(kappa), ("inverse_speed", "acceleration")
    gain = Polynomial(
        names,
        {
            (0, 0): np.array([[0.6519], [-1.0642]]),
            (1, 0): np.array([[10.7832], [-18.8658]]),
            (1, 1): np.array([[-0.4137], [0.2837]]),
        },
    )
    found = decay_storage(system, gain, 0.0)
    assert found is not None
    assert certify_claims(system, gain, [Claim("decay", 0.0, *found)]).outcome is Outcome.PROVED
    assert decay_storage(slip_angles(0.96), gain, 0.0) is None


def test_scale_of_the_storage_is_found_and_not_scanned() -> None:
    plant = van_der_pol(5.0, 24, E=[[0.0], [1.0]])
    mine = np.sqrt(ExtendedLuenberger(goal="l2", gain_limit=30.0).design(plant).statistics["optimum"])
    scanned = [_level_at(plant, 30.0, p) for p in np.logspace(-2, 1, 13)]
    best = min(s for s in scanned if s is not None)
    # Four steps a decade come within a few percent of the free scale and can never pass it.
    assert mine * (1 - 1e-5) <= best <= 1.05 * mine


def _level_at(plant: System, limit: float, p: float) -> float | None:
    """The textbook problem for one scale p: minimise g over P >= p I, [[P, Y], [Y', limit^2 p I]] >= 0."""
    A, C, F, E = (np.asarray(plant.at(k)) for k in "ACFE")
    P, Y, g = cp.Variable((2, 2), symmetric=True), cp.Variable((2, 1)), cp.Variable()
    assert plant.nonlinearity is not None
    held = [P >> p * np.eye(2), cp.bmat([[P, Y], [Y.T, np.array([[limit**2 * p]])]]) >> 0]
    for J in np.asarray(plant.nonlinearity.jacobian_vertices):
        drift = P @ (A + F @ J) - Y @ C
        whole = cp.bmat([[drift + drift.T + np.eye(2), P @ E], [E.T @ P, cp.reshape(-g, (1, 1), order="C")]])
        held.append(0.5 * (whole + whole.T) << 0)
    problem = cp.Problem(cp.Minimize(g), held)
    problem.solve(solver="CLARABEL")
    return float(np.sqrt(g.value)) if problem.status == "optimal" else None


def test_limit_below_the_smallest_gain_is_named_and_the_nearest_one_works() -> None:
    plant = van_der_pol(2.7, E=[[0.0], [1.0]])
    for goal in ("gain", "l2"):
        with pytest.raises(Infeasible, match=r"gain_limit = 20 *; the closest found was 25\.0") as caught:
            synthesize(plant, ExtendedLuenberger(goal=goal, gain_limit=20.0))
        assert caught.value.nearest is not None
        design = synthesize(plant, ExtendedLuenberger(goal=goal, gain_limit=caught.value.nearest))
        assert level(design, "gain_bound") <= caught.value.nearest


def test_level_that_no_finite_gain_reaches_asks_for_a_limit() -> None:
    # The disturbance acts where the measured position sees it: larger gains press it down without end.
    with pytest.raises(Infeasible, match=r"Give a `gain_limit`; observers of this form exist from 5\.4"):
        synthesize(van_der_pol(1.0, E=[[0.0], [1.0]]), ExtendedLuenberger(goal="l2"))


def test_decay_beyond_reach_names_the_nearest() -> None:
    A = np.array([[0.0, 1.0], [-1.0, -1.0]])
    f = Nonlinearity.bounded(lambda z, u: jnp.zeros(1), [[0.0, 1.0]], jacobian=([[-1.0]], [[1.0]]))
    # y shows the first state, the second one moves by itself: its decay of 0.5 for J = 0.5 is all there is.
    plant = System.nonlinear(A * [[1, 0], [0, 1]], C=[[1.0, 0.0]], F=[[0.0], [0.5]], nonlinearity=f)
    with pytest.raises(BadInput, match=r"unobservable mode at -0\.5 1/s"):
        synthesize(plant, ExtendedLuenberger(0.7))
    assert synthesize(plant, ExtendedLuenberger(0.4)).certificate.outcome is Outcome.PROVED


@pytest.mark.parametrize("inputs", ["disturbance", "noise", "both"])
def test_level_holds_for_frozen_jacobians_with_a_gain_in_the_argument(inputs: str) -> None:
    plant = van_der_pol(2.7, E=[[0.5], [1.0]], G=[[0.1]])
    second = ((0.8,), (0.3,))
    design = synthesize(plant, ExtendedLuenberger(0.2, "l2", inputs, gain_limit=60.0, argument_gain=second))
    assert design.argument_gain is not None
    assert np.array_equal(np.asarray(design.argument_gain({})), np.array(second))
    assert level(design, "argument_gain_bound") == pytest.approx(np.hypot(0.8, 0.3), rel=1e-5)
    worst = 0.0
    for closed, feed, L, E in frozen(design, 60):
        assert np.linalg.eigvals(closed).real.max() <= -0.2
        noise = -(L + feed @ np.array(second)) @ np.asarray(plant.at("G"))
        B = {"disturbance": E, "noise": noise}
        worst = max(worst, infinity_norm(closed, np.hstack(list(B.values())) if inputs == "both" else B[inputs]))
    assert worst <= level(design, "l2_gain")


def test_weight_and_schedule() -> None:
    plant = slip_angles(0.5)
    both = ExtendedLuenberger(goal="l2", gain_limit=10.0)
    front = ExtendedLuenberger(goal="l2", gain_limit=10.0, weight=((1.0, 0.0),))
    # One of two angles has less to show than both.
    assert front.design(plant).statistics["optimum"] < both.design(plant).statistics["optimum"]
    still = synthesize(plant, ExtendedLuenberger(goal="l2", gain_limit=10.0, schedule="constant"))
    assert all(not any(exponents) for exponents, _ in still.gain)


def test_scheduling_error_beside_the_plant_is_refused() -> None:
    plant = System.lpv(
        Polynomial.affine([[-1.0]], speed=[[-1.0]]),
        C=[[1.0]],
        parameters=[Parameter("speed", 1.0, 2.0, factor=(0.9, 1.1))],
    )
    with pytest.raises(NotAccepted, match="RobustLuenberger"):
        synthesize(plant, ExtendedLuenberger())


def test_function_matrices_lipschitz_bounds_and_discrete_plants_are_refused() -> None:
    A = MatrixFunction(lambda p: -np.eye(1) * p["r"], ("r",), (1, 1))
    with pytest.raises(NotAccepted, match="`A`"):
        synthesize(System.lpv(A, C=[[1.0]], parameters=[Parameter("r", 1.0, 2.0)]), ExtendedLuenberger())
    f = Nonlinearity.bounded(lambda z, u: jnp.sin(z), [[1.0]], lipschitz=1.0)
    plant = System.nonlinear([[-2.0]], C=[[1.0]], F=[[1.0]], nonlinearity=f)
    with pytest.raises(NotAccepted, match="no Jacobian box"):
        synthesize(plant, ExtendedLuenberger())
    with pytest.raises(NotAccepted, match=r"discrete \(dt = 0\.1 s\)"):
        synthesize(System.linear([[0.5]], C=[[1.0]], dt=0.1), ExtendedLuenberger())


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"goal": "l2", "inputs": "scheduling"}, BadInput, "`inputs`"),
        ({"goal": "l2", "inputs": "noise"}, NotAccepted, "no input `noise`; give the plant a `G`"),
        ({"goal": "l2", "inputs": "disturbance"}, NotAccepted, "no input `disturbance`; give the plant an `E`"),
        ({"gain_limit": 0.0}, BadInput, "`gain_limit` is 0.0"),
        ({"gain_limit": np.inf}, BadInput, "`gain_limit` is inf"),
        ({"decay_rate": -1.0}, BadInput, "`decay_rate` is -1.0"),
        ({"argument_gain": ((1.0, 2.0),)}, BadInput, r"`argument_gain` has shape \(1, 2\)"),
    ],
)
def test_options_that_no_plant_could_satisfy(options: dict, error: type[LuenbergerError], message: str) -> None:
    with pytest.raises(error, match=message):
        synthesize(van_der_pol(1.0, G=np.zeros((1, 0))), ExtendedLuenberger(**options))


def test_weight_of_the_wrong_width_and_argument_of_no_function() -> None:
    plant = System.linear([[-1.0]], C=[[1.0]], E=[[1.0]])
    with pytest.raises(BadInput, match=r"`weight` has shape \(1, 2\)"):
        synthesize(plant, ExtendedLuenberger(goal="l2", weight=((1.0, 2.0),)))
    with pytest.raises(NotAccepted, match="no nonlinearity whose argument"):
        synthesize(plant, ExtendedLuenberger(argument_gain=((1.0,),)))
