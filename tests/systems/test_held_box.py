"""The enclosed hold against SciPy's exponential at random parameters, against closed forms, and how wide it is."""

from itertools import product
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest
import scipy.linalg

from luenberger.algebra import Polynomial
from luenberger.core import BadInput, NotAccepted
from luenberger.systems import MatrixFunction, Nonlinearity, Parameter, System
from luenberger.systems.discretize import discretize
from luenberger.systems.error_system import beside
from luenberger.systems.held_box import discretize_enclosed
from luenberger.systems.uncertainty import Uncertain, uncovered
from luenberger.vehicle import gust_car, wind_plant

TS = 0.06
STIFFNESS = ((54e3, 66e3), (58.5e3, 71.5e3))
SPEEDS = (8.5, 13.55, 18.05)


def windy(**options: Any) -> System:
    return wind_plant(gust_car, (6.0, 19.9), gust_arm=0.4, stiffness=STIFFNESS, gust_bound=1000.0, **options)


def at_speed(vx: float) -> System:
    return windy().freeze(speed=vx, inverse_speed=1 / vx)


def crowded() -> System:
    """Three states, three parameters, squares and products, every matrix uncertain."""
    rng = np.random.default_rng(7)
    names = ("p", "q", "w")
    A = Polynomial(
        names,
        {
            (0, 0, 0): rng.normal(size=(3, 3)),
            (1, 0, 0): rng.normal(size=(3, 3)),
            (0, 1, 1): rng.normal(size=(3, 3)),
            (0, 0, 2): rng.normal(size=(3, 3)),
        },
    )
    return System.lpv(
        A,
        Polynomial(("q",), {(0,): rng.normal(size=(3, 2)), (2,): rng.normal(size=(3, 2))}),
        np.eye(1, 3),
        E=Polynomial(("p",), {(1,): rng.normal(size=(3, 1))}),
        parameters=[
            Parameter("p", -0.3, 0.5, measured=False),
            Parameter("q", 0.0, 0.4, measured=False),
            Parameter("w", 1.0, 1.4, measured=False),
        ],
    )


def wide(system: System) -> Polynomial:
    """[A, B, E] over the unmeasured parameters."""
    whole = beside(beside(system.polynomial("A"), system.polynomial("B")), system.polynomial("E"))
    return whole.over([p.name for p in system.parameters if not p.measured])


def holds(system: System, dt: float, box: np.ndarray) -> np.ndarray:
    """First rows of the exponential of dt [A B E; 0 0 0] at every point of a list, shape (points, nx, nx + nu + nd)."""
    matrix = wide(system)
    values = sum(np.prod(box ** np.array(e), axis=1)[:, None, None] * np.asarray(c) for e, c in matrix)
    n, columns = matrix.shape
    square = np.zeros((len(box), columns, columns))
    square[:, :n] = dt * values
    return scipy.linalg.expm(square)[:, :n]


def enclosures(held: System, box: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Middle of [A, B, E] at every point of a list, and radius, both read off the plant by hand."""
    matrix, count = wide(held), box.shape[1]
    middle, radius = np.zeros((len(box), *matrix.shape)), np.zeros(matrix.shape)
    for e, c in matrix:
        assert sum(e) <= 1
        if any(e[count:]):
            radius = radius + abs(np.asarray(c))
        else:
            middle = middle + np.prod(box ** np.array(e[:count]), axis=1)[:, None, None] * np.asarray(c)
    return middle, radius


def points(system: System, count: int) -> np.ndarray:
    """Corners of the box of the parameters, then random points of it, shape (points, parameters)."""
    intervals = np.array([p.interval for p in system.parameters if not p.measured])
    inside = np.random.default_rng(1).uniform(*intervals.T, size=(count, len(intervals)))
    return np.vstack([list(product(*intervals)), inside])


CASES = [*((at_speed(vx), TS) for vx in SPEEDS), (crowded(), 0.1), (crowded(), 0.4)]
NAMES = [*(f"wind at {vx} m/s" for vx in SPEEDS), "crowded", "crowded, long step"]


@pytest.mark.parametrize(("system", "dt"), CASES, ids=NAMES)
def test_exponential_lies_inside_entry_by_entry(system: System, dt: float) -> None:
    held = discretize_enclosed(system, dt)
    assert held.dt == dt
    box = points(system, 400)
    exactly, (middle, radius) = holds(system, dt, box), enclosures(held, box)
    # The exponential in floats is good to a few units of the last place of the largest entry in a column.
    rounding = 1e-14 * np.abs(exactly).max(axis=1, keepdims=True)
    assert np.all(abs(exactly - middle) <= radius + rounding)


@pytest.mark.parametrize(("system", "dt", "most"), [(*c, 1.5) for c in CASES[:3]] + [(*CASES[3], 2.0)], ids=NAMES[:4])
def test_enclosure_is_as_wide_as_the_remainder_seen(system: System, dt: float, most: float) -> None:
    held = discretize_enclosed(system, dt)
    box = points(system, 1000)
    whole, (middle, radius) = holds(system, dt, box), enclosures(held, box)
    rest = whole - middle
    seen = np.ptp(rest, axis=0) / 2
    # Odd parts of higher degree and products of parameters are bounded one by one, which costs the rest.
    assert np.all(radius <= most * seen)
    # Reached somewhere: a radius a tenth smaller would not contain.
    assert np.abs(rest / radius).max() > 0.9
    # What is not affine is a small part of what the parameters do.
    if most < 2.0:
        assert np.all(radius <= 0.03 * np.ptp(whole, axis=0))


@pytest.mark.parametrize(("vx", "leak"), [(8.5, 1.85e-3), (13.55, 1.34e-3), (18.05, 1.05e-3)])
def test_what_an_unknown_gust_leaves_in_the_lateral_speed(vx: float, leak: float) -> None:
    """With the middle of E decoupled, a kilonewton held for one step leaves 1 to 2 mm/s."""
    system = at_speed(vx)
    held = discretize_enclosed(system, TS)
    uncertain = Uncertain.of(held)
    E = np.asarray(uncertain.nominal.at("E"))
    P = np.eye(2) - E @ np.array([[0.0, 1.0]]) / E[1, 0]
    corners = 1000 * (P @ holds(system, TS, points(system, 0)))[:, 0, 3]
    np.testing.assert_allclose(np.abs(corners).max(), leak, rtol=0.01)
    rows = np.asarray(uncertain.rows({}))
    bound = 1000 * (abs(P @ uncertain.directions) @ abs(rows[:, 3:]))[0, 0]
    # Two parameters whose parts are each bounded along two directions, and the remainder.
    assert leak * 0.99 <= bound <= 1.3 * leak


def test_forward_differences_leave_out_more() -> None:
    system = at_speed(18.05)
    box = points(system, 0)
    euler = sum(
        np.prod(box ** np.array(e), axis=1)[:, None, None] * np.asarray(c)
        for e, c in wide(discretize(system, TS, "euler"))
    )
    _, radius = enclosures(discretize_enclosed(system, TS), box)
    missed = abs(euler - holds(system, TS, box))[:, :, :2]
    assert np.all(missed > 10 * radius[:, :2])


def test_factors_of_the_sampled_plant_cover_it() -> None:
    held = discretize_enclosed(at_speed(13.55), TS)
    uncertain = Uncertain.of(held)
    assert {"front_stiffness", "rear_stiffness", "hold_a_11", "hold_b_21", "hold_e_11"} <= set(uncertain.names)
    left = max(uncovered(held, uncertain).flat)
    assert int(left.p) / int(left.q) < 1e-14


def test_scalar_plant_in_closed_form() -> None:
    system = System.lpv(
        Polynomial(("q",), {(1,): -np.ones((1, 1))}), [[2.0]], parameters=[Parameter("q", 0.5, 1.5, measured=False)]
    )
    held = discretize_enclosed(system, 0.4)
    box = np.array([[0.5], [0.8], [1.0], [1.5]])
    middle, radius = enclosures(held, box)
    expected = np.stack([np.exp(-0.4 * box), 2 * (1 - np.exp(-0.4 * box)) / box], axis=2)
    assert np.all(abs(middle - expected) <= radius + 1e-15)
    # exp(-0.4 - 0.2 s): even powers of s give half their size to the middle, odd ones count in full; the tail is below 1e-5.
    series = 0.2**2 / 4 + 0.2**3 / 6 + 0.2**4 / 48
    np.testing.assert_allclose(radius[0, 0], series * np.exp(-0.4), rtol=1e-3)


def test_a_hold_that_is_affine_leaves_rounding_alone() -> None:
    system = System.lpv(
        [[0.0, 1.0], [0.0, 0.0]],
        Polynomial(("q",), {(1,): np.array([[0.0], [1.0]])}),
        parameters=[Parameter("q", 1.0, 3.0, measured=False)],
    )
    middle, radius = enclosures(discretize_enclosed(system, 0.25), np.array([[2.0]]))
    np.testing.assert_allclose(middle[0], [[1.0, 0.25, 2 * 0.25**2 / 2], [0.0, 1.0, 0.5]], rtol=1e-15)
    assert radius.max() < 1e-16
    # Entries that no product reaches stay exactly zero or one.
    assert np.all(radius[:, 0] == 0)


def test_a_fast_plant_keeps_a_narrow_enclosure() -> None:
    system = System.lpv(
        Polynomial(("q",), {(1,): np.array([[-1.0]])}), parameters=[Parameter("q", 2000.0, 2020.0, measured=False)]
    )
    held = discretize_enclosed(system, 0.1)
    middle, radius = enclosures(held, np.array([[2003.0]]))
    assert abs(middle[0, 0, 0] - np.exp(-200.3)) <= radius[0, 0]
    assert radius[0, 0] < np.exp(-199)


def test_steps_that_end_nowhere_are_refused() -> None:
    system = System.lpv(
        Polynomial(("q",), {(1,): np.array([[0.0, 1.0], [1.0, 0.0]])}),
        parameters=[Parameter("q", 0.0, 1e300, measured=False)],
    )
    with pytest.raises(NotAccepted, match="shorter step"):
        discretize_enclosed(system, 0.1)


def test_without_uncertainty_it_is_the_plain_hold() -> None:
    plant = System.linear([[0.0, 1.0], [-4.0, -0.3]], [[0.0], [1.0]], [[1.0, 0.0]], E=[[1.0], [0.0]])
    ours, theirs = discretize_enclosed(plant, 0.1), discretize(plant, 0.1)
    for letter in "ABE":
        np.testing.assert_array_equal(np.asarray(ours.at(letter)), np.asarray(theirs.at(letter)))
    assert ours.parameters == ()


def test_scheduling_of_the_output_stays() -> None:
    plant = System.lpv(
        Polynomial.affine(np.zeros((1, 1)), q=-np.ones((1, 1))),
        C=Polynomial.affine(np.ones((1, 1)), r=np.ones((1, 1))),
        parameters=[Parameter("q", 0.9, 1.1, measured=False), Parameter("r", 0.0, 1.0)],
    )
    held = discretize_enclosed(plant, 0.1)
    assert held.scheduling_names == ("r",)
    assert float(np.asarray(held.at("C", [0.5]))[0, 0]) == 1.5


@pytest.mark.parametrize(
    ("system", "dt", "kind", "word"),
    [
        (windy(), TS, NotAccepted, "freeze\\(speed=..., inverse_speed=...\\)"),
        (at_speed(8.5), 0.0, BadInput, "`dt` is 0.0"),
        (discretize(at_speed(8.5), TS, "euler"), TS, NotAccepted, "discrete already"),
        (
            System.nonlinear(
                [[-1.0]],
                F=[[1.0]],
                nonlinearity=Nonlinearity(lambda z, u: jnp.sin(z), np.eye(1), 1, lipschitz=1.0),
            ),
            TS,
            NotAccepted,
            "nonlinearity",
        ),
        (
            System.lpv(
                MatrixFunction(lambda p: jnp.eye(1) * p["q"], ("q",), (1, 1)),
                parameters=[Parameter("q", 0, 1, measured=False)],
            ),
            TS,
            NotAccepted,
            "`A`",
        ),
        (
            System.lpv(
                Polynomial.affine(np.zeros((1, 1)), hold_a_11=np.ones((1, 1))),
                parameters=[Parameter("hold_a_11", 0, 1, measured=False)],
            ),
            TS,
            BadInput,
            "rename",
        ),
    ],
    ids=["scheduled", "step", "discrete", "nonlinear", "function", "name"],
)
def test_refusals(system: System, dt: float, kind: type[Exception], word: str) -> None:
    with pytest.raises(kind, match=word):
        discretize_enclosed(system, dt)
