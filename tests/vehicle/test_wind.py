"""The single track in a wind: against the textbook form, the sister plant, the truth model, and its fixed error eigenvalue."""

from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from luenberger.core import BadInput
from luenberger.systems import System
from luenberger.systems.discretize import discretize
from luenberger.systems.strong_detectability import strong_detectability
from luenberger.vehicle import SingleTrack, gust_car, lateral_speed_plant, wind_plant

SPEED = (6.0, 19.9)
ARM = 0.4
STIFFNESS = ((54e3, 66e3), (58.5e3, 71.5e3))


def at(plant: System, letter: str, vx: float) -> np.ndarray:
    return np.asarray(plant.at(letter, [vx, 1 / vx]))


def textbook(vx: float, cf: float, cr: float, lw: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A, B, E from the balance of lateral forces and of moments, terms in the order of the books."""
    m, Iz, lf, lr = 1500.0, 2500.0, 1.2, 1.6
    A = np.array(
        [
            [-(cf + cr) / (m * vx), (cr * lr - cf * lf) / (m * vx) - vx],
            [(cr * lr - cf * lf) / (Iz * vx), -(cf * lf**2 + cr * lr**2) / (Iz * vx)],
        ]
    )
    return A, np.array([[cf / m], [cf * lf / Iz]]), np.array([[1 / m], [lw / Iz]])


@pytest.mark.parametrize("vx", [6.0, 8.5, 13.55, 19.9])
@pytest.mark.parametrize("stiffness", [None, STIFFNESS], ids=["numbers", "intervals"])
def test_textbook_form(vx: float, stiffness: tuple[tuple[float, float], tuple[float, float]] | None) -> None:
    plant = wind_plant(gust_car, SPEED, gust_arm=ARM, stiffness=stiffness)
    for letter, matrix in zip("ABE", textbook(vx, 60e3, 65e3, ARM), strict=True):
        np.testing.assert_allclose(at(plant, letter, vx), matrix, rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize("cf", STIFFNESS[0])
@pytest.mark.parametrize("cr", STIFFNESS[1])
def test_textbook_form_at_the_corners_of_the_stiffness_box(cf: float, cr: float) -> None:
    plant = wind_plant(gust_car, SPEED, gust_arm=ARM, stiffness=STIFFNESS)
    assert set(plant.uncertainty) == {"front_stiffness", "rear_stiffness"}
    corner = plant.freeze(front_stiffness=cf, rear_stiffness=cr)
    for letter, matrix in zip("ABE", textbook(12.0, cf, cr, ARM), strict=True):
        np.testing.assert_allclose(at(corner, letter, 12.0), matrix, rtol=1e-13, atol=1e-13)


def test_agrees_with_the_plant_of_the_filters_where_both_say_something() -> None:
    ours = wind_plant(gust_car, SPEED, gust_arm=ARM)
    theirs = lateral_speed_plant(gust_car, SPEED, disturbance=True)
    assert (ours.states, ours.inputs, ours.outputs) == (theirs.states, theirs.inputs, theirs.outputs)
    assert ours.scheduling_box == theirs.scheduling_box
    for vx in (6.0, 11.0, 19.9):
        for letter in "ABC":
            np.testing.assert_allclose(at(ours, letter, vx), at(theirs, letter, vx), rtol=1e-14, atol=1e-14)
        # One gust is a force and the moment of it about the centre of gravity.
        np.testing.assert_allclose(at(ours, "E", vx), at(theirs, "E", vx) @ [[1.0], [ARM]], rtol=1e-14)


@pytest.mark.parametrize("vx", [7.0, 16.0])
def test_is_the_derivative_of_the_truth_model(vx: float) -> None:
    plant, truth = wind_plant(gust_car, SPEED, gust_arm=ARM), SingleTrack(gust_car, small_angles=False)
    r = jnp.array([vx])
    zero, still = jnp.zeros(2), jnp.zeros(1)
    step = 1e-5
    for column in range(2):
        dx = step * jnp.eye(2)[column]
        slope = (truth(0.0, zero + dx, still, r) - truth(0.0, zero - dx, still, r)) / (2 * step)
        # Central differences of arctangents at zero: the error is of the order of the squared step.
        np.testing.assert_allclose(at(plant, "A", vx)[:, column], slope, atol=1e-6)
    du = jnp.array([step])
    slope = (truth(0.0, zero, du, r) - truth(0.0, zero, -du, r)) / (2 * step)
    np.testing.assert_allclose(at(plant, "B", vx)[:, 0], slope, atol=1e-6)
    jacobian = jax.jacobian(lambda x: SingleTrack(gust_car)(0.0, x, still, r))(zero)
    np.testing.assert_allclose(at(plant, "A", vx), jacobian, atol=1e-12)


# Computed by hand from -(Cf (lw - a) + Cr (lw + b)) / (m vx lw) with the numbers of the car: 82000 / (600 vx).
EIGENVALUES = ((8.5, -16.0784, 0.0353), (13.55, -10.0861, 0.3948), (18.05, -7.5716, 0.5457))


@pytest.mark.parametrize(("vx", "s0", "z"), EIGENVALUES)
def test_fixed_error_eigenvalue(vx: float, s0: float, z: float) -> None:
    plant = wind_plant(gust_car, SPEED, gust_arm=ARM, stiffness=STIFFNESS)
    A, C, E = (at(plant, letter, vx) for letter in "ACE")
    P = np.eye(2) - E @ np.linalg.inv(C @ E) @ C
    K = np.array([[(P @ A)[0, 1]], [0.0]])
    # Numbers are given to four decimals.
    np.testing.assert_allclose((P @ A - K @ C)[0, 0], s0, atol=6e-5)
    zeros = [found.eigenvalue for found in strong_detectability(plant.freeze(speed=vx, inverse_speed=1 / vx)).modes]
    np.testing.assert_allclose(zeros, [s0], atol=6e-5)

    sampled = discretize(plant, 0.06, "euler")
    A, C, E = (at(sampled, letter, vx) for letter in "ACE")
    H = -E @ np.linalg.inv(C @ E)
    np.testing.assert_allclose(H, [[-4.16667], [-1.0]], atol=5e-6)
    P = np.eye(2) + H @ C
    np.testing.assert_allclose(P, [[1.0, -4.16667], [0.0, 0.0]], atol=5e-6)
    for gain in (np.array([[(P @ A)[0, 1]], [0.0]]), np.array([[0.3], [-2.0]])):
        N = P @ A - gain @ C
        np.testing.assert_allclose(N @ H - gain, P @ A @ H, atol=1e-12)
    np.testing.assert_allclose((P @ A)[0, 0], z, atol=6e-5)


@pytest.mark.parametrize(("arm", "holds"), [(0.4, True), (-0.2, False), (-0.255, False), (-0.3, True)])
def test_stable_outside_the_interval_that_the_docstring_names(arm: float, holds: bool) -> None:
    # -(b Cr - a Cf) / (Cf + Cr) = -0.256 for this car.
    plant = wind_plant(gust_car, SPEED, gust_arm=arm).freeze(speed=12.0, inverse_speed=1 / 12)
    assert strong_detectability(plant).holds is holds


def test_no_arm_no_matching() -> None:
    plant = wind_plant(gust_car, SPEED, gust_arm=0.0).freeze(speed=12.0, inverse_speed=1 / 12)
    assert not strong_detectability(plant).matching


def test_noise_enters_the_gyro_and_the_steering() -> None:
    plant = wind_plant(gust_car, SPEED, gust_arm=ARM, yaw_rate_noise=0.005, steering_error=0.01)
    assert plant.noise_bound == (0.005, 0.01)
    np.testing.assert_array_equal(at(plant, "G", 8.0), [[1.0, 0.0]])
    np.testing.assert_array_equal(at(plant, "N", 8.0), [[0.0, 1.0]])
    assert plant.disturbance_bound is None
    assert wind_plant(gust_car, SPEED, gust_arm=ARM, gust_bound=900.0).disturbance_bound == (900.0,)


def test_error_of_the_inverse_covers_the_error_of_the_speed() -> None:
    plant = wind_plant(gust_car, SPEED, gust_arm=ARM, speed_error=0.2)
    speed, inverse = plant.parameters
    assert speed.error == 0.2
    true = np.linspace(*SPEED, 200)
    worst = max(np.abs(1 / (true + o) - 1 / true).max() for o in np.linspace(-0.2, 0.2, 41))
    # Reached where the car is slowest and the reading lowest.
    np.testing.assert_allclose(inverse.error, worst, rtol=1e-12)
    assert wind_plant(gust_car, SPEED, gust_arm=ARM).parameters[1].is_exact


@pytest.mark.parametrize(
    ("speed", "options", "word"),
    [
        ((0.0, 10.0), {}, "`speed` is \\[0, 10\\]"),
        ((12.0, 10.0), {}, "`speed`"),
        ((6.0, float("inf")), {}, "`speed`"),
        (SPEED, {"speed_error": 6.0}, "`speed_error` 6"),
        (SPEED, {"speed_error": -0.1}, "`speed_error`"),
        (SPEED, {"yaw_rate_noise": -0.1}, "`yaw_rate_noise`"),
        (SPEED, {"steering_error": -0.1}, "`steering_error`"),
        (SPEED, {"gust_arm": float("nan")}, "`gust_arm`"),
        (SPEED, {"stiffness": ((66e3, 54e3), STIFFNESS[1])}, "`front_stiffness` is"),
        (SPEED, {"stiffness": (STIFFNESS[0], (0.0, 1.0))}, "`rear_stiffness` is"),
        (SPEED, {"gust_bound": -1.0}, "disturbance_bound"),
    ],
)
def test_refusals(speed: tuple[float, float], options: dict[str, Any], word: str) -> None:
    with pytest.raises(BadInput, match=word):
        wind_plant(gust_car, speed, **{"gust_arm": ARM, **options})


def test_another_car_gives_other_numbers() -> None:
    heavy = replace(gust_car, mass=3000.0, front_load=None, rear_load=None)
    light = wind_plant(gust_car, SPEED, gust_arm=ARM)
    np.testing.assert_allclose(
        at(wind_plant(heavy, SPEED, gust_arm=ARM), "E", 9.0), at(light, "E", 9.0) * [[0.5], [1.0]]
    )
