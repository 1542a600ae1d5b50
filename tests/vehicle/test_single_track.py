"""The linear plants against finite differences of the equations of motion, and their printed properties."""

from itertools import product
from typing import Any

import numpy as np
import pytest

from luenberger.core import BadInput
from luenberger.systems import System
from luenberger.vehicle import (
    BrushTyre,
    LinearTyre,
    MagicFormulaTyre,
    SingleTrack,
    VehicleParameters,
    brush_tyres,
    carmaker_car,
    ferrari_250lm,
    lateral_speed_plant,
    slip_angle_plant,
    wang_car,
)

SPEED, ACCELERATION = (15 / 3.6, 150 / 3.6), (-8.0, 8.0)


def slips(car: VehicleParameters, vy: float, r: float, vx: float, delta: float) -> np.ndarray:
    a, b = car.front_axle_distance, car.rear_axle_distance
    return np.array([delta - (vy + a * r) / vx, -(vy - b * r) / vx])


def slip_rates(
    car: VehicleParameters, tyres: Any, state: np.ndarray, push: np.ndarray, delta_rate: float, ax: float
) -> np.ndarray:
    """d(alpha)/dt by a central difference along the motion; push is lateral force and yaw torque from outside."""
    vy, r, vx, delta = state
    alpha = slips(car, vy, r, vx, delta)
    Ff, Fr = float(tyres[0](alpha[0])), float(tyres[1](alpha[1]))
    vy_rate = (Ff + Fr + push[0]) / car.mass - vx * r
    r_rate = (car.front_axle_distance * Ff - car.rear_axle_distance * Fr + push[1]) / car.yaw_inertia
    motion, h = np.array([vy_rate, r_rate, ax, delta_rate]), 1e-5
    return (slips(car, *(state + h * motion)) - slips(car, *(state - h * motion))) / (2 * h)


@pytest.mark.parametrize("car", [wang_car, carmaker_car, ferrari_250lm], ids=lambda c: c.name)
@pytest.mark.parametrize("nonlinear", [False, True])
def test_slip_rows_match_finite_differences(car: VehicleParameters, nonlinear: bool) -> None:
    tyres = brush_tyres(car.with_values(friction=0.9)) if nonlinear else None
    plant = slip_angle_plant(car, SPEED, ACCELERATION, tyres=tyres, disturbance=True)
    truth = tyres or (lambda alpha: car.front_stiffness * alpha, lambda alpha: car.rear_stiffness * alpha)
    draw = np.random.default_rng(3)
    for _ in range(30):
        state = draw.uniform([-3, -1, 5, -0.2], [3, 1, 40, 0.2])
        push, delta_rate, ax = draw.uniform(-2e3, 2e3, 2), draw.uniform(-1, 1), draw.uniform(-8, 8)
        vy, yaw_rate, vx, delta = state
        x, r = slips(car, vy, yaw_rate, vx, delta), np.array([1 / vx, ax])
        u = np.array([delta, delta_rate, yaw_rate])
        found = np.asarray(plant.dynamics(0.0, x, u, r)) + np.asarray(plant.at("E", r)) @ push
        # Central difference: h^2 times a third derivative below 1e3 1/s^3, plus rounding 1e-16/h.
        np.testing.assert_allclose(found, slip_rates(car, truth, state, push, delta_rate, ax), atol=2e-7)
        y = delta - (car.front_axle_distance + car.rear_axle_distance) * yaw_rate / vx
        np.testing.assert_allclose(plant.output(0.0, x, u, r), [y], atol=1e-14)


def test_slip_matrices_are_those_of_the_thesis() -> None:
    plant = slip_angle_plant(wang_car, SPEED, ACCELERATION, disturbance=True)
    m, Iz, a, b, Cf, Cr = 800.0, 1152.0, 0.948, 1.422, 76500.0, 51000.0
    v, ax = 20.0, -3.0
    at = [1 / v, ax]
    k = a * b / Iz - 1 / m
    A1 = np.array([[-Cf * (1 / m + a**2 / Iz), Cr * k], [Cf * k, -Cr * (1 / m + b**2 / Iz)]])
    np.testing.assert_allclose(plant.at("A", at), A1 / v - np.eye(2) * ax / v, rtol=1e-13)
    # +1 on the yaw rate in both rows.
    np.testing.assert_allclose(plant.at("B", at), [[ax / v, 1, 1], [0, 0, 1]], rtol=1e-15)
    np.testing.assert_array_equal(plant.at("C", at), [[1, -1]])
    # The second row of (5.66) with its signs put right.
    np.testing.assert_allclose(plant.at("E", at), np.array([[-1 / m, -a / Iz], [-1 / m, b / Iz]]) / v, rtol=1e-14)


def test_the_box_is_exactly_the_printed_trapezoid() -> None:
    plant = slip_angle_plant(wang_car, SPEED, ACCELERATION)
    A = plant.polynomial("A")
    assert A.is_multi_affine
    at_corners = {(1 / v, ax / v): None for v, ax in product(SPEED, ACCELERATION)}
    found = sorted(
        (round(float(s), 12), round(float(s * a), 12)) for s, a in product(*(p.interval for p in plant.parameters))
    )
    assert found == sorted((round(x, 12), round(y, 12)) for x, y in at_corners)
    # Bernstein coefficients of a multi-affine matrix are its values at the four corners of (3.20).
    coefficients = list(A.bernstein(plant.scheduling_box).values())
    A1, A2 = A({"inverse_speed": 1.0, "acceleration": 0.0}), -np.eye(2)
    for corner in at_corners:
        expected = corner[0] * A1 + corner[1] * A2
        assert min(np.abs(c - expected).max() for c in coefficients) < 1e-11
    assert len(coefficients) == 4


def test_every_speed_and_acceleration_lies_in_the_hull_of_the_corners() -> None:
    draw = np.random.default_rng(9)
    v, ax = draw.uniform(*SPEED, 300), draw.uniform(*ACCELERATION, 300)
    s = (1 / v - 1 / SPEED[1]) / (1 / SPEED[0] - 1 / SPEED[1])
    w = (ax - ACCELERATION[0]) / (ACCELERATION[1] - ACCELERATION[0])
    weights = np.stack([(1 - s) * (1 - w), (1 - s) * w, s * (1 - w), s * w])
    corners = np.array([[1 / u, a / u] for u in SPEED[::-1] for a in ACCELERATION])
    assert weights.min() >= 0
    np.testing.assert_allclose(weights.T @ corners, np.stack([1 / v, ax / v], axis=1), atol=1e-13)


def observability_ratio(plant: System, r: list[float]) -> float:
    A, C = np.asarray(plant.at("A", r)), np.asarray(plant.at("C", r))
    values = np.linalg.svd(np.vstack([C, C @ A]), compute_uv=False)
    return values[-1] / values[0]


@pytest.mark.parametrize("v", [5.0, 20.0, 41.0])
def test_the_neutral_car_hides_equal_slip_and_other_cars_do_not(v: float) -> None:
    neutral = slip_angle_plant(wang_car, SPEED, ACCELERATION)
    assert observability_ratio(neutral, [1 / v, -3.0]) < 1e-12
    assert observability_ratio(slip_angle_plant(carmaker_car, SPEED, ACCELERATION), [1 / v, -3.0]) > 1e-3


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_no_gain_moves_the_hidden_mode_of_the_neutral_car(seed: int) -> None:
    plant = slip_angle_plant(wang_car, SPEED, ACCELERATION)
    L = np.random.default_rng(seed).uniform(-50, 50, (2, 1))
    v, ax = 150 / 3.6, -8.0
    A = np.asarray(plant.at("A", [1 / v, ax])) - L @ np.array([[1.0, -1.0]])
    # -(Cf + Cr)/(m vx) - ax/vx; eigenvalues of a 2 x 2 matrix of size 100.
    rate = -(76500.0 + 51000.0) / 800.0 / v - ax / v
    assert rate == pytest.approx(-3.633, abs=1e-3)
    assert np.abs(np.linalg.eigvals(A) - rate).min() < 1e-10


def test_rates_of_the_scheduling_are_bounded() -> None:
    plant = slip_angle_plant(wang_car, (5.0, 40.0), (-8.0, 4.0), jerk=10.0)
    inverse_speed, acceleration = plant.parameters
    # |d(1/v)/dt| = |ax| / v^2 is largest at the lowest speed and the hardest braking.
    assert inverse_speed.rate == pytest.approx(8.0 / 25.0)
    assert acceleration.rate == 10.0


def test_slopes_of_the_tyre_remainders_fill_their_box() -> None:
    f = slip_angle_plant(wang_car, SPEED, ACCELERATION, tyres=brush_tyres(wang_car), slip_limit=0.1).nonlinearity
    assert f is not None
    # c1 (1 - theta alpha)^2 - c1 at theta alpha = 0.5.
    np.testing.assert_allclose(f.jacobian_lower, np.diag([-0.75 * 76500.0, -0.75 * 51000.0]), rtol=1e-14)
    np.testing.assert_array_equal(f.jacobian_upper, np.zeros((2, 2)))
    assert f.domain is not None
    np.testing.assert_array_equal(f.domain[1], [0.1, 0.1])
    everywhere = slip_angle_plant(wang_car, SPEED, ACCELERATION, tyres=brush_tyres(wang_car)).nonlinearity
    assert everywhere is not None
    assert everywhere.domain is None
    np.testing.assert_array_equal(everywhere.jacobian_lower, np.diag([-76500.0, -51000.0]))


def test_different_tyres_may_stand_on_the_axles() -> None:
    tyres = (BrushTyre(76500.0, 5100.0), MagicFormulaTyre(10.0, 1.3, 4000.0, -0.2))
    f = slip_angle_plant(wang_car, SPEED, ACCELERATION, tyres=tyres, slip_limit=0.2).nonlinearity
    assert f is not None
    assert f.jacobian_lower is not None
    assert f.jacobian_lower[1, 1] < -40e3


@pytest.mark.parametrize("outputs", [("yaw_rate",), ("yaw_rate", "lateral_acceleration"), ("lateral_acceleration",)])
def test_lateral_rows_match_the_truth_with_linear_tyres(outputs: tuple[str, ...]) -> None:
    plant = lateral_speed_plant(carmaker_car, (4.0, 40.0), outputs=outputs)
    truth, picked = SingleTrack(carmaker_car), [SingleTrack.outputs.index(n) for n in outputs]
    draw = np.random.default_rng(4)
    for _ in range(20):
        x, u, v = draw.uniform([-3, -1], [3, 1]), draw.uniform(-0.2, 0.2, 1), draw.uniform(4, 40)
        r = np.array([v, 1 / v])
        # Terms up to 1e3 m/s^2 that cancel: rounding near 1e-12.
        np.testing.assert_allclose(plant.dynamics(0.0, x, u, r), truth(0.0, x, u, r[:1]), atol=1e-11)
        expected = np.asarray(truth.output(0.0, x, u, r[:1]))[picked]
        np.testing.assert_allclose(plant.output(0.0, x, u, r), expected, atol=1e-11)
    assert plant.outputs == outputs


def test_both_plants_tell_one_story() -> None:
    lateral = lateral_speed_plant(carmaker_car, (4.0, 40.0), disturbance=True)
    slip = slip_angle_plant(carmaker_car, (4.0, 40.0), (-8.0, 8.0), disturbance=True)
    a, b = carmaker_car.front_axle_distance, carmaker_car.rear_axle_distance
    v = 18.0
    T = np.array([[-1 / v, -a / v], [-1 / v, b / v]])
    A, E = np.asarray(lateral.at("A", [v, 1 / v])), np.asarray(lateral.at("E", [v, 1 / v]))
    np.testing.assert_allclose(slip.at("E", [1 / v, 0.0]), T @ E, rtol=1e-13)
    # alpha = T (vy, r) + (1, 0) delta, so the poles at constant speed differ only by the yaw rate fed in as an input.
    along_r = np.asarray(slip.at("A", [1 / v, 0.0])) @ T + np.outer([1.0, 1.0], [0.0, 1.0])
    np.testing.assert_allclose(along_r, T @ A, atol=1e-11)


def test_understeer_gradient_is_that_of_steady_cornering() -> None:
    v, delta = 25.0, 0.02
    plant = lateral_speed_plant(carmaker_car, (4.0, 40.0))
    r = [v, 1 / v]
    _, yaw_rate = np.linalg.solve(np.asarray(plant.at("A", r)), -np.asarray(plant.at("B", r))[:, 0] * delta)
    steer = carmaker_car.wheelbase * yaw_rate / v + carmaker_car.understeer_gradient * v * yaw_rate
    assert steer == pytest.approx(delta, rel=1e-12)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: slip_angle_plant(wang_car, (0.0, 10.0), (-1, 1)), r"`speed` is \[0, 10\] m/s; .* above zero"),
        (lambda: slip_angle_plant(wang_car, (20.0, 10.0), (-1, 1)), r"`speed` is \[20, 10\]"),
        (lambda: slip_angle_plant(wang_car, (5.0, 10.0), (1, -1)), r"`acceleration` is \[1, -1\] m/s\^2"),
        (
            lambda: slip_angle_plant(wang_car, SPEED, (-1, 1), tyres=brush_tyres(wang_car), slip_limit=-1.0),
            "`slip_limit` is -1",
        ),
        (lambda: lateral_speed_plant(wang_car, (5.0, 10.0), outputs=("yawrate",)), "Did you mean `yaw_rate`"),
        (lambda: lateral_speed_plant(wang_car, (5.0, 10.0), outputs=()), "`outputs` is empty"),
        (
            lambda: lateral_speed_plant(wang_car, (5.0, 10.0), outputs=("lateral_acceleration",), disturbance=True),
            "reaches the accelerometer without delay",
        ),
    ],
)
def test_what_makes_no_plant_is_refused(make: Any, message: str) -> None:
    with pytest.raises(BadInput, match=message):
        make()


def test_constraint_output_is_zero_on_the_car_and_sees_a_wrong_speed() -> None:
    plant = slip_angle_plant(wang_car, SPEED, ACCELERATION, output="slip_constraint")
    vy, yaw_rate, vx, delta = 0.4, 0.3, 20.0, 0.05
    x, u = slips(wang_car, vy, yaw_rate, vx, delta), np.array([delta, 0.0, yaw_rate])
    np.testing.assert_allclose(plant.output(0.0, x, u, [1 / vx, 0.0]), [0.0], atol=1e-15)
    wrong = float(plant.output(0.0, x, u, [1.1 / vx, 0.0])[0])
    assert wrong == pytest.approx(0.1 / vx * wang_car.wheelbase * yaw_rate, rel=1e-12)


def test_uncertain_stiffness_at_its_middle_is_the_plant_itself() -> None:
    known = slip_angle_plant(wang_car, SPEED, ACCELERATION)
    unsure = slip_angle_plant(wang_car, SPEED, ACCELERATION, stiffness=((70e3, 83e3), (46e3, 56e3)))
    np.testing.assert_allclose(unsure.at("A", [0.1, 2.0]), known.at("A", [0.1, 2.0]), rtol=1e-13)
    assert unsure.uncertainty == {"front_stiffness": 76500.0, "rear_stiffness": 51000.0}


def test_force_offset_enters_as_the_axle_forces_do() -> None:
    plant = slip_angle_plant(wang_car, SPEED, ACCELERATION, force_offset=30.0)
    assert plant.disturbance_bound == (30.0, 30.0)
    stiff = np.diag([wang_car.front_stiffness, wang_car.rear_stiffness])
    at = [0.1, 0.0]
    np.testing.assert_allclose(np.asarray(plant.at("E", at)) @ stiff, plant.at("A", at), rtol=1e-13)


def test_scale_errors_become_factors() -> None:
    plant = slip_angle_plant(wang_car, SPEED, ACCELERATION, scale_error=((-0.1, 0.1), (-0.2, 0.2)))
    assert [p.factor for p in plant.parameters] == [(1 / 1.1, 1 / 0.9), (0.8, 1.2)]
    with pytest.raises(BadInput, match="around zero"):
        slip_angle_plant(wang_car, SPEED, ACCELERATION, scale_error=((0.1, 0.2), (0.0, 0.0)))


@pytest.mark.parametrize(
    "options",
    [
        {"stiffness": ((1e4, 2e4), (1e4, 2e4)), "tyres": (LinearTyre(2e4), LinearTyre(2e4))},
        {"disturbance": True, "force_offset": 1.0},
    ],
)
def test_options_that_exclude_each_other(options: dict[str, Any]) -> None:
    with pytest.raises(BadInput, match="give one of them"):
        slip_angle_plant(wang_car, SPEED, ACCELERATION, **options)
