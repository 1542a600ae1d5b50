"""Plants taken apart: the factors against the plant at random parameters, their number, their directions, their exact cover."""

from dataclasses import replace
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest
from flint import fmpq

from luenberger.algebra import Polynomial
from luenberger.algebra.definiteness import exact
from luenberger.core import NotAccepted
from luenberger.systems import MatrixFunction, Nonlinearity, Parameter, SchedulingError, System
from luenberger.systems.discretize import discretize
from luenberger.systems.error_system import beside
from luenberger.systems.uncertainty import Uncertain, uncovered
from luenberger.vehicle import gust_car, wind_plant

TS = 0.06
STIFFNESS = ((54e3, 66e3), (58.5e3, 71.5e3))
# A few times the rounding of entries of size one.
ROUNDING = 1e-13


def windy(speed_error: float = 0.0) -> System:
    plant = wind_plant(
        gust_car,
        (6.0, 19.9),
        gust_arm=0.4,
        stiffness=STIFFNESS,
        yaw_rate_noise=0.005,
        steering_error=0.01,
        speed_error=speed_error,
    )
    return discretize(plant, TS, "euler")


def crowded() -> System:
    """Powers, products, rank two, E that moves with both kinds of parameter, and a measurement with error and factor."""
    rng = np.random.default_rng(11)
    names = ("r", "s", "p", "q")
    A = Polynomial(
        names,
        {
            (0, 0, 0, 0): rng.normal(size=(3, 3)),
            (1, 0, 1, 0): rng.normal(size=(3, 3)),
            (0, 1, 0, 1): np.outer([1.0, -2.0, 0.5], [0.3, 0.0, 1.0]),
            (0, 0, 2, 1): rng.normal(size=(3, 3)) * 0.1,
            (2, 0, 0, 0): rng.normal(size=(3, 3)) * 0.1,
        },
    )
    B = Polynomial(names, {(0, 0, 0, 1): rng.normal(size=(3, 2)), (0, 1, 0, 0): rng.normal(size=(3, 2))})
    E = Polynomial(names, {(0, 0, 0, 0): rng.normal(size=(3, 1)), (0, 1, 1, 0): rng.normal(size=(3, 1))})
    return System.lpv(
        A,
        B,
        np.eye(2, 3),
        E=E,
        parameters=[
            Parameter("r", -1.0, 2.0, error=0.1, factor=(0.9, 1.05)),
            Parameter("s", 0.3, 0.7),
            Parameter("p", 1.0, 1.5, measured=False),
            Parameter("q", -0.2, 0.3, measured=False),
        ],
        dt=0.1,
        disturbance_bound=[2.0],
    )


def wide(system: System, values: dict[str, float]) -> np.ndarray:
    """[A, B, E] of a plant at values of all its parameters."""
    parts = (system.polynomial(letter) for letter in "ABE")
    return np.hstack([np.asarray(p({n: values[n] for n in p.names})) for p in parts])


def units(cause: str, unit: dict[str, float]) -> float:
    """Value of one factor: the monomial its name spells."""
    value = 1.0
    for part in cause.split("*"):
        name, _, power = part.partition("^")
        value *= unit[name] ** int(power or 1)
    return value


def test_wind_plant_has_two_factors_along_the_axles_and_rows_of_slip_angles() -> None:
    uncertain = Uncertain.of(windy())
    assert uncertain.names == ("front_stiffness", "rear_stiffness")
    assert uncertain.nk == 2
    m, Iz, lf, lr = 1500.0, 2500.0, 1.2, 1.6
    vx = 11.0
    rows = uncertain.rows({"speed": vx, "inverse_speed": 1 / vx})
    axles = (
        (np.array([1 / m, lf / Iz]), np.array([-1 / vx, -lf / vx, 1.0, 0.0]), 6e3),
        (np.array([1 / m, -lr / Iz]), np.array([-1 / vx, lr / vx, 0.0, 0.0]), 6.5e3),
    )
    for k, (direction, slip, radius) in enumerate(axles):
        product = np.outer(uncertain.directions[:, k], rows[k])
        np.testing.assert_allclose(product, TS * radius * np.outer(direction, slip), rtol=1e-13, atol=1e-17)
    np.testing.assert_array_equal(uncertain.spread, [6e3, 6.5e3])


def test_nominal_wind_plant_is_the_one_at_the_midpoints() -> None:
    system, nominal = windy(), Uncertain.of(windy()).nominal
    values = {"speed": 9.0, "inverse_speed": 1 / 9, "front_stiffness": 60e3, "rear_stiffness": 65e3}
    np.testing.assert_allclose(wide(nominal, values), wide(system, values), atol=ROUNDING)
    assert nominal.uncertainty == {}
    assert nominal.noise_bound == system.noise_bound
    assert "front_stiffness" not in nominal.units


@pytest.mark.parametrize("system", [windy(), windy(0.2), crowded()], ids=["wind", "wind, speed read", "crowded"])
def test_factors_give_the_plant_back_at_random_parameters(system: System) -> None:
    uncertain, rng = Uncertain.of(system), np.random.default_rng(0)
    moving = [p for p in system.parameters if p.measured]
    for _ in range(40):
        values, measured, unit = {}, {}, {}
        for p in system.parameters:
            values[p.name] = rng.choice([p.lower, p.upper, rng.uniform(p.lower, p.upper)])
            if not p.measured:
                unit[p.name] = (values[p.name] - p.middle) / (0.5 * (p.upper - p.lower))
        for p in moving:
            read = values[p.name] * rng.choice(p.factor) + p.error * rng.choice([-1.0, 1.0])
            measured[p.name] = read
            if not p.is_exact:
                radius = p.error + max(abs(f - 1) for f in p.factor) * max(abs(p.lower), abs(p.upper))
                unit[p.name] = (values[p.name] - read) / radius
        assert max(abs(v) for v in unit.values()) <= 1 + 1e-12
        s = np.array([1.0 if cause == "E(r)" else units(cause, unit) for cause in uncertain.names])
        found = np.hstack(uncertain.at(s, **measured))
        np.testing.assert_allclose(found, wide(system, values), atol=ROUNDING * 10)


@pytest.mark.parametrize("system", [windy(), windy(0.2), crowded()], ids=["wind", "wind, speed read", "crowded"])
def test_readings_lie_in_the_box_of_the_nominal_plant(system: System) -> None:
    box = Uncertain.of(system).nominal.scheduling_box
    for p in system.parameters:
        if p.measured:
            readings = [end * f + o for end in p.interval for f in p.factor for o in (-p.error, p.error)]
            assert box[p.name][0] <= min(readings) + 1e-15
            assert box[p.name][1] >= max(readings) - 1e-15


def test_a_coefficient_of_rank_three_takes_three_factors_and_one_of_rank_one_gives_its_entries_back() -> None:
    names = Uncertain.of(crowded()).names
    # r*p multiplies a full 3 x 3 matrix.
    assert names.count("r*p") == 3
    single = System.lpv(
        Polynomial.affine(np.eye(2) * 0.5, q=np.outer([3.0, -1e-9], [1.0, 7e6])),
        parameters=[Parameter("q", -1, 1, measured=False)],
        dt=1.0,
    )
    uncertain = Uncertain.of(single)
    assert uncertain.nk == 1
    product = uncertain.directions @ uncertain.rows({})
    np.testing.assert_allclose(product, np.outer([3.0, -1e-9], [1.0, 7e6]), rtol=1e-15)


def test_units_of_a_state_do_not_change_the_number_of_factors() -> None:
    def plant(scale: float) -> System:
        T = np.diag([1.0, scale])
        slope = T @ np.array([[1.0, 2.0], [3.0, 4.0]]) @ np.linalg.inv(T)
        return System.lpv(
            Polynomial.affine(np.zeros((2, 2)), q=slope), parameters=[Parameter("q", -1, 1, measured=False)], dt=1.0
        )

    assert {Uncertain.of(plant(scale)).nk for scale in (1.0, 1e-14, 1e14)} == {2}


def test_no_state_leads_by_its_unit() -> None:
    def products(scale: float) -> np.ndarray:
        slope = np.diag([1.0, scale]) @ np.array([[1.0, 2.0], [3.0, 4.0]])
        plant = System.lpv(
            np.zeros((2, 2)),
            Polynomial.affine(np.zeros((2, 2)), q=slope),
            parameters=[Parameter("q", -1, 1, measured=False)],
            dt=1.0,
        )
        found = Uncertain.of(plant)
        rows = np.asarray(found.rows({}))[:, 2:]
        return np.einsum("ik,kj->kij", found.directions / [[1.0], [scale]], rows)

    for scale in (1e-6, 1e6):
        np.testing.assert_allclose(products(scale), products(1.0), rtol=1e-12, atol=1e-15)


def test_a_certain_plant_has_no_factors() -> None:
    plant = System.linear(np.diag([0.5, 0.2]), E=[[1.0], [0.0]], C=[[1.0, 0.0]], dt=1.0)
    uncertain = Uncertain.of(plant)
    assert uncertain.nk == 0
    assert uncertain.directions.shape == (2, 0)
    assert uncertain.rows.shape == (0, 3)
    assert np.all(uncovered(plant, uncertain) == 0)
    np.testing.assert_array_equal(uncertain.at(np.zeros(0))[0], np.diag([0.5, 0.2]))


def test_an_unmeasured_parameter_of_no_width_moves_into_the_nominal_plant() -> None:
    plant = System.lpv(
        Polynomial.affine(np.zeros((1, 1)), q=np.ones((1, 1))), parameters=[Parameter("q", 0.3, 0.3, measured=False)]
    )
    uncertain = Uncertain.of(plant)
    assert uncertain.nk == 0
    assert np.asarray(uncertain.nominal.at("A")) == 0.3


@pytest.mark.parametrize("system", [windy(), windy(0.2), crowded()], ids=["wind", "wind, speed read", "crowded"])
def test_what_is_left_uncovered_is_rounding(system: System) -> None:
    left = uncovered(system, Uncertain.of(system))
    assert all(isinstance(entry, fmpq) for entry in left.flat)
    assert float(max(left.flat).p) / float(max(left.flat).q) < ROUNDING


def test_cover_holds_in_exact_arithmetic_at_random_rational_parameters() -> None:
    system = crowded()
    uncertain, rng = Uncertain.of(system), np.random.default_rng(5)
    left = uncovered(system, uncertain)
    nominal = uncertain.nominal
    known = beside(beside(nominal.polynomial("A"), nominal.polynomial("B")), nominal.polynomial("E")).map(exact)
    plant = beside(beside(system.polynomial("A"), system.polynomial("B")), system.polynomial("E")).map(exact)
    spread = dict(zip(uncertain.names, uncertain.spread, strict=True))
    for _ in range(10):
        values = {p.name: exact(rng.uniform(p.lower, p.upper))[()] for p in system.parameters}
        read = values | {"r": values["r"] + exact(rng.uniform(-0.2, 0.2))[()]}
        unit = {n: (values[n] - exact(0.5 * (a + b))[()]) / exact(0.5 * (b - a))[()] for n, (a, b) in HIDDEN.items()}
        unit["r"] = (values["r"] - read["r"]) / exact(spread["r"])[()]
        s = [fmpq(1) if c == "E(r)" else powers(c, unit) for c in uncertain.names]
        rows = uncertain.rows.map(exact)({n: read[n] for n in uncertain.rows.names})
        found = known({n: read[n] for n in known.names}) + (exact(uncertain.directions) * np.array(s)) @ rows
        assert np.all(abs(plant({n: values[n] for n in plant.names}) - found) <= left)


HIDDEN = {"p": (1.0, 1.5), "q": (-0.2, 0.3)}


def powers(cause: str, unit: dict[str, Any]) -> fmpq:
    value = fmpq(1)
    for part in cause.split("*"):
        name, _, power = part.partition("^")
        for _ in range(int(power or 1)):
            value = value * unit[name]
    return value


def test_a_factor_too_small_is_found_uncovered() -> None:
    system = windy()
    uncertain = Uncertain.of(system)
    short = replace(uncertain, rows=uncertain.rows * (1 - 1e-3))
    left = uncovered(system, short)
    # A thousandth of 0.24, what the front axle does with the steering.
    np.testing.assert_allclose(float(left[0, 2].p) / float(left[0, 2].q), 0.24e-3, rtol=1e-9)
    lost = replace(uncertain, directions=uncertain.directions[:, :1], names=uncertain.names[:1], rows=first(uncertain))
    assert float(uncovered(system, lost)[0, 0].p) > 0
    assert max(uncovered(system, lost).flat) > fmpq(1, 100)


def first(uncertain: Uncertain) -> Polynomial:
    return uncertain.rows.map(lambda c: np.asarray(c)[:1])


def test_a_moved_middle_is_found_uncovered() -> None:
    system = windy().freeze(speed=8.5, inverse_speed=1 / 8.5)
    uncertain = Uncertain.of(system)
    moved = replace(uncertain, nominal=uncertain.nominal.replace(A=np.asarray(uncertain.nominal.at("A")) + 1e-6))
    assert min(uncovered(system, moved)[:, :2].flat) > fmpq(1, 2_000_000)


def test_a_direction_that_moves_is_a_factor_and_asks_for_a_bound() -> None:
    def plant(**options: Any) -> System:
        return System.lpv(
            np.diag([0.5, 0.2]),
            C=[[1.0, 0.0]],
            E=Polynomial.affine(np.array([[1.0], [0.0]]), r=np.array([[0.0], [1.0]])),
            parameters=[Parameter("r", 0.0, 2.0)],
            dt=1.0,
            **options,
        )

    with pytest.raises(NotAccepted, match="disturbance_bound"):
        Uncertain.of(plant())
    uncertain = Uncertain.of(plant(disturbance_bound=[3.0]))
    assert uncertain.names == ("E(r)",)
    np.testing.assert_array_equal(np.asarray(uncertain.nominal.at("E", [0.5])), [[1.0], [1.0]])
    np.testing.assert_allclose(uncertain.at(np.ones(1), r=0.5)[2], [[1.0], [0.5]])


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"C": Polynomial.affine(np.eye(1, 2), q=np.eye(1, 2, 1))}, "`C` of .* depends on \\['q'\\]"),
        ({"G": Polynomial.affine(np.eye(1), q=np.eye(1))}, "`G`"),
        ({"C": Polynomial.affine(np.eye(1, 2), r=np.eye(1, 2, 1))}, "depends on \\['r'\\]"),
        ({"A": MatrixFunction(lambda p: np.eye(2) * p["r"], ("r",), (2, 2))}, "`A`"),
        (
            {
                "F": np.eye(2, 1),
                "nonlinearity": Nonlinearity(lambda z, u: jnp.sin(z), np.eye(1, 2), 1, lipschitz=1.0),
            },
            "nonlinearity",
        ),
    ],
    ids=["output", "noise", "output by a reading", "function", "nonlinear"],
)
def test_refusals(changes: dict[str, Any], word: str) -> None:
    plain = System.lpv(
        np.eye(2) * 0.5,
        C=[[1.0, 0.0]],
        parameters=[Parameter("q", 0, 1, measured=False), Parameter("r", 0, 1, error=0.1)],
        dt=1.0,
    )
    with pytest.raises(NotAccepted, match=word):
        Uncertain.of(plain.replace(**changes))


def test_a_declared_map_of_the_scheduling_is_refused() -> None:
    r = Polynomial(("r",), {(1,): np.ones((1, 1))})
    plant = System.lpv(
        np.eye(1) * 0.5,
        parameters=[Parameter("r", 0, 1)],
        dt=1.0,
        scheduling_error=SchedulingError({"r": r}, {"r": r}, {"r": (0.0, 1.0)}),
    )
    with pytest.raises(NotAccepted, match="declared as a map"):
        Uncertain.of(plant)
