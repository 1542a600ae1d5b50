"""The closed loop of an interval observer against plain matrices written out here, and the published order margins."""

from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq

from catalogue import oscillator, robot
from interval_plants import FLIP, lateral_car, printed_gain, slip_transform, thesis_car, uncertain_pair
from luenberger.algebra import Polynomial
from luenberger.algebra.definiteness import exact
from luenberger.core import BadInput, NotAccepted
from luenberger.systems import Parameter, SchedulingError, System
from luenberger.systems.enclosure_system import EnclosureSystem, order_margin
from luenberger.vehicle import wang_car

generator = np.random.default_rng(4)
NOISY = {"noise": (1e-3, 0.02, 5e-3), "scale_error": ((-0.1, 0.1), (-0.15, 0.15)), "output": "slip_constraint"}


def point_of(box: dict[str, tuple[float, float]]) -> dict[str, float]:
    return {n: generator.uniform(*ends) for n, ends in box.items()}


@cache
def printed_matrices(turned: bool) -> tuple[EnclosureSystem, Polynomial, Polynomial, Polynomial]:
    """The car in either sign, its closed loop with the printed gain, the largest loop and the range of A."""
    here = EnclosureSystem.of(thesis_car(), FLIP if turned else np.eye(2))
    loop = here.loop(here.correction(printed_gain(True)))
    (top,), (gap,) = here.upper(loop), here.spread(here.A @ here.inverse)
    return here, loop, top, gap


def at(value: Polynomial, point: dict[str, float]) -> np.ndarray:
    return np.asarray(value({n: point[n] for n in value.names}), dtype=float)


def slip_matrix(s: float, a: float, Cf: float, Cr: float) -> np.ndarray:
    m, Iz, lf, lr = wang_car.mass, wang_car.yaw_inertia, wang_car.front_axle_distance, wang_car.rear_axle_distance
    k = lf * lr / Iz - 1 / m
    return s * np.array([[-Cf * (1 / m + lf**2 / Iz), Cr * k], [Cf * k, -Cr * (1 / m + lr**2 / Iz)]]) - s * a * np.eye(
        2
    )


def test_closed_loop_in_both_views_written_out() -> None:
    system, L = thesis_car(**NOISY), printed_gain(False)
    T = np.array([[1.0, 0.3], [-0.2, 0.7]])
    C = np.array([[1.0, -1.0]])
    forward = EnclosureSystem.of(system, T, view="true")
    backward = EnclosureSystem.of(system, T)
    for _ in range(20):
        p = point_of(forward.box)
        s, a, f, g = (p[n] for n in ("inverse_speed", "acceleration", "inverse_speed_factor", "acceleration_factor"))
        read = {"inverse_speed": s * f, "acceleration": a * g}
        A = slip_matrix(s, a, p["front_stiffness"], p["rear_stiffness"])
        expected = T @ (A - L(read) @ C) @ np.linalg.inv(T)
        np.testing.assert_allclose(at(forward.loop(forward.correction(L)), p), expected, rtol=1e-10, atol=1e-10)
        stiffness = {n: p[n] for n in ("front_stiffness", "rear_stiffness")}
        q = read | stiffness | {"inverse_speed_inverse_factor": 1 / f, "acceleration_inverse_factor": 1 / g}
        assert all(lower <= q[n] <= upper for n, (lower, upper) in backward.box.items())
        np.testing.assert_allclose(at(backward.loop(backward.correction(L)), q), expected, rtol=1e-10, atol=1e-10)
        D = np.array([[-1.0, 0.0, (wang_car.front_axle_distance + wang_car.rear_axle_distance) * s]])
        B = np.array([[s * a, 1.0, 1.0], [0.0, 0.0, 1.0]])
        steer = backward.steer(backward.correction(L))
        np.testing.assert_allclose(at(steer, q), T @ (B - L(read) @ D), rtol=1e-10, atol=1e-10)
        # All three noises enter the inputs; y is identically zero, so the noise reaches it through D alone.
        noise = backward.noise(backward.correction(L))
        np.testing.assert_allclose(at(noise, q), T @ (B - L(read) @ D), rtol=1e-10, atol=1e-10)


def test_what_is_hidden() -> None:
    exactly = EnclosureSystem.of(thesis_car())
    assert set(exactly.hidden) == {"front_stiffness", "rear_stiffness"}
    erring = EnclosureSystem.of(thesis_car(**NOISY))
    assert set(erring.hidden) - set(exactly.hidden) == {"inverse_speed_inverse_factor", "acceleration_inverse_factor"}


def test_offset_is_taken_off_before_the_factor() -> None:
    r = Parameter("r", 1.0, 2.0, error=0.25, factor=(0.5, 2.0))
    plant = System.lpv(Polynomial.affine(np.zeros((1, 1)), r=np.eye(1)), C=[[1.0]], parameters=[r])
    here = EnclosureSystem.of(plant)
    assert here.box["r"][0] <= 0.25
    assert here.box["r"][1] >= 4.25
    point = {"r": 3.0, "r_offset": 0.2, "r_inverse_factor": 0.7}
    np.testing.assert_allclose(at(here.A, point), [[(3.0 - 0.2) * 0.7]])


@given(st.floats(0, 1), st.floats(0, 1), st.floats(0, 1), st.floats(0, 1), st.booleans())
def test_largest_matrix_dominates_every_plant(i: float, j: float, k: float, n: float, turned: bool) -> None:
    here, loop, top, gap = printed_matrices(turned)
    p = {name: lo + w * (hi - lo) for (name, (lo, hi)), w in zip(here.box.items(), (i, j, k, n), strict=True)}
    assert np.all(at(top, p) >= at(loop, p) - 1e-9)  # entries are of the order of 100 1/s
    assert np.all(at(top, p) - at(loop, p) <= at(gap, p) + 1e-9)


def test_one_largest_vertex_only_where_signs_in_a_column_agree() -> None:
    # k < 0: in (front, rear) both entries of a column are largest at the smallest stiffness; with one sign turned not.
    smallest = {"front_stiffness": 60e3, "rear_stiffness": 35e3}
    r = {"inverse_speed": 0.1, "acceleration": 2.0}
    for T, agrees in ((np.eye(2), True), (FLIP, False)):
        here = EnclosureSystem.of(thesis_car(), T)
        (top,) = here.upper(here.A @ here.inverse)
        assert np.allclose(at(top, r), at(here.A @ here.inverse, r | smallest)) == agrees


def test_exact_arithmetic_gives_the_same_matrices() -> None:
    T = np.array([[1.0, 0.3], [-0.2, 0.7]])
    floats = EnclosureSystem.of(thesis_car(), T)
    rational = EnclosureSystem.of(thesis_car(), T, lambda m: m.map(exact))
    value = rational.loop(rational.correction(printed_gain(True)))
    assert all(c.dtype == object for _, c in value)
    identity = rational.transform @ rational.inverse
    assert np.all(identity.terms[()] == exact(np.eye(2)))
    p = point_of(floats.box)
    expected = at(floats.loop(floats.correction(printed_gain(True))), p)
    exactly = value({n: exact(np.array([p[n]]))[0] for n in value.names})
    np.testing.assert_allclose(np.vectorize(lambda x: int(x.p) / int(x.q))(exactly), expected, rtol=1e-9)


def test_order_margin_of_the_printed_gain() -> None:
    # Wang (4.47): as printed it cannot keep order with C = [1, -1]; with row 2 turned it does up to 118.5 km/h.
    assert order_margin(thesis_car(), printed_gain(False)).value == pytest.approx(-14.67, abs=0.01)
    turned = order_margin(thesis_car(), printed_gain(True), FLIP)
    assert turned.value == pytest.approx(-0.347, abs=0.001)
    assert (turned.row, turned.column, turned.point["inverse_speed"]) == (0, 1, pytest.approx(3.6 / 150))
    limit = brentq(lambda v: order_margin(thesis_car(fast=v), printed_gain(True), FLIP).value, 100.0, 150.0)
    assert limit == pytest.approx(118.5, abs=0.2)


def test_order_margin_of_the_lateral_car() -> None:
    # a21 = (b Cr - a Cf)/(Iz v) spans [-1.543, 1.543] at 20 m/s and y = r does not reach it.
    for T in (np.eye(2), FLIP):
        assert order_margin(lateral_car(), np.zeros((2, 1)), T).value <= -1.54
    assert order_margin(lateral_car(), np.zeros((2, 1)), slip_transform()).value < 0  # needs a gain there


def test_refusals() -> None:
    with pytest.raises(NotAccepted, match="nonlinearity"):
        EnclosureSystem.of(robot())
    with pytest.raises(NotAccepted, match="discrete"):
        EnclosureSystem.of(oscillator().replace(dt=0.1))
    with pytest.raises(BadInput, match="no inverse"):
        EnclosureSystem.of(uncertain_pair(), [[1.0, 2.0], [2.0, 4.0]])
    with pytest.raises(BadInput, match="`transform` has shape"):
        EnclosureSystem.of(uncertain_pair(), np.eye(3))
    with pytest.raises(BadInput, match="does not measure"):
        EnclosureSystem.of(uncertain_pair()).correction(Polynomial.affine(np.zeros((2, 1)), q=np.ones((2, 1))))
    with pytest.raises(BadInput, match="needs"):
        EnclosureSystem.of(uncertain_pair()).correction(Polynomial.constant(np.zeros((1, 2))))
    with pytest.raises(BadInput, match="one state"):
        order_margin(System.linear([[-1.0]], C=[[1.0]]), np.zeros((1, 1)))


def test_a_declared_map_has_no_measured_view() -> None:
    one = Polynomial(("r",), {(1,): np.eye(1)})
    error = SchedulingError({"r": one}, {"r": one * 1.1}, {"r": (1.0, 2.0)})
    plant = System.lpv(
        Polynomial.affine(np.zeros((2, 2)), r=-np.eye(2)), C=[[1.0, 0.0]], parameters=[Parameter("r", 1.0, 2.0)]
    ).replace(scheduling_error=error)
    assert EnclosureSystem.of(plant, view="true").measured
    with pytest.raises(NotAccepted, match="declared as a map"):
        EnclosureSystem.of(plant)
