"""The rear-axle formula is exact where its derivation says so, and only there."""

import jax
import numpy as np
import pytest

from luenberger.vehicle import (
    BrushTyre,
    SingleTrack,
    VehicleParameters,
    brush_tyres,
    carmaker_car,
    ferrari_250lm,
    lateral_speed_plant,
    rear_axle_force,
    rear_axle_sideslip,
    wang_car,
)


@pytest.mark.parametrize("car", [wang_car, carmaker_car, ferrari_250lm], ids=lambda c: c.name)
@pytest.mark.parametrize("v", [6.0, 20.0, 38.0])
def test_it_is_exact_in_steady_cornering_of_the_linear_car(car: VehicleParameters, v: float) -> None:
    plant = lateral_speed_plant(car, (4.0, 40.0), outputs=("yaw_rate", "lateral_acceleration"))
    r, u = [v, 1 / v], np.array([0.03])
    x = np.linalg.solve(np.asarray(plant.at("A", r)), -np.asarray(plant.at("B", r)) @ u)
    yaw_rate, ay = plant.output(0.0, x, u, r)
    found = rear_axle_sideslip(yaw_rate, v, ay, car)
    # Rounding of a 2 x 2 solve.
    assert float(found) == pytest.approx(np.arctan(x[0] / v), abs=1e-13)
    assert float(ay) == pytest.approx(v * float(yaw_rate), rel=1e-9)


def test_it_is_exact_in_every_motion_once_the_yaw_acceleration_is_known() -> None:
    truth = SingleTrack(carmaker_car)
    draw = np.random.default_rng(8)
    for _ in range(30):
        x, u, r = draw.uniform([-2, -0.8], [2, 0.8]), draw.uniform(-0.2, 0.2, 1), draw.uniform(5, 40, 1)
        dx, ay = truth(0.0, x, u, r), truth.output(0.0, x, u, r)[1]
        _, rear_force = truth.forces(x, u, r)
        assert float(rear_axle_force(ay, carmaker_car, dx[1])) == pytest.approx(float(rear_force), abs=1e-7)
        beta = np.arctan(x[0] / r[0])
        assert float(rear_axle_sideslip(x[1], r[0], ay, carmaker_car, dx[1])) == pytest.approx(beta, abs=1e-12)
        # The quasi-steady form errs by Iz dr / ((a + b) Cr) of slope.
        slope = np.tan(rear_axle_sideslip(x[1], r[0], ay, carmaker_car)) - x[0] / r[0]
        miss = -carmaker_car.yaw_inertia * dx[1] / (carmaker_car.wheelbase * carmaker_car.rear_stiffness)
        assert float(slope) == pytest.approx(float(miss), abs=1e-12)


def test_a_saturating_tyre_is_inverted() -> None:
    front, rear = brush_tyres(wang_car)
    truth = SingleTrack(wang_car, front, rear)
    x, u, r = np.array([-1.0, 0.3]), np.array([0.05]), np.array([20.0])
    dx, ay = truth(0.0, x, u, r), truth.output(0.0, x, u, r)[1]
    found = rear_axle_sideslip(x[1], r[0], ay, wang_car, dx[1], tyre=rear)
    assert float(found) == pytest.approx(np.arctan(-1.0 / 20.0), abs=1e-12)
    # The linear formula is well off here: the rear tyre works at a third of its slip range.
    linear = rear_axle_sideslip(x[1], r[0], ay, wang_car, dx[1])
    assert abs(float(linear - found)) > 0.01


def test_forces_beyond_the_peak_stay_finite_under_jax() -> None:
    tyre = BrushTyre(51000.0, 3400.0)
    formula = jax.jit(lambda y: rear_axle_sideslip(y[0], 20.0, y[1], wang_car, tyre=tyre))
    assert np.isfinite(formula(np.array([0.5, 30.0])))
