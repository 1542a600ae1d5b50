"""The parts of an unknown-input observer that no gain changes: decoupling matrices, zeros, and what is refused for them."""

from typing import Any

import numpy as np
import pytest

from luenberger.algebra import Polynomial
from luenberger.core import BadInput, NotAccepted
from luenberger.methods.unknown_input_plant import OpenMode, largest_fade, require_decouplable
from luenberger.systems import Nonlinearity, Parameter, Switched, System
from luenberger.systems.discretize import discretize
from luenberger.vehicle import gust_car
from luenberger.vehicle.wind import wind_plant


def gusty(step: float = 0.06, arm: float = 0.4, **options: Any) -> Switched:
    """The car in a side wind, three speeds, sampled by Euler's method."""
    plant = discretize(wind_plant(gust_car, (6.0, 19.9), gust_arm=arm, **options), step, "euler")
    modes = [plant.freeze(speed=v, inverse_speed=1 / v) for v in (8.5, 13.55, 18.05)]
    return Switched.of(modes, "speed", (6.0, 11.0, 16.0, 19.899), unit="m/s")


def plant_of(**changes: Any) -> System:
    """Two states; the unknown input drives the measured one, and the other fades by 0.8 a step."""
    parts: dict[str, Any] = {"A": [[0.8, 0.1], [0.2, 0.5]], "B": [[1.0], [0.0]], "C": [[0.0, 1.0]], "E": [[0.0], [1.0]]}
    parts |= {"dt": 0.1, **changes}
    return System.build(**parts)


def zeros(plant: Switched) -> list[complex]:
    return [mode.eigenvalue for _, mode in require_decouplable(plant)]


def test_zeros_of_the_car_have_their_closed_form() -> None:
    # 1 + Ts s0, s0 = -[cf (lw - lf) + cr (lw + lr)] / (m vx lw), slowest first.
    np.testing.assert_allclose(zeros(gusty()), [0.545706, 0.394834, 0.035294], atol=1e-6)
    assert [number for number, _ in require_decouplable(gusty())] == [2, 1, 0]


def test_the_largest_fade_is_what_the_slowest_zero_leaves() -> None:
    assert largest_fade(require_decouplable(gusty())) == pytest.approx(1 - 0.545706**2, abs=1e-6)
    assert largest_fade(()) == 1.0


def test_decoupling_of_the_car_is_the_closed_form() -> None:
    mode = OpenMode.of(gusty().modes[0])
    np.testing.assert_allclose(mode.U, [[-2500 / (1500 * 0.4)], [-1.0]], rtol=1e-12)
    np.testing.assert_allclose(mode.projection(mode.U) @ mode.E, 0.0, atol=1e-15)
    assert mode.free == 0


@pytest.mark.parametrize("scale", [1.0, 1e-6])
def test_every_free_choice_decouples(scale: float) -> None:
    rng = np.random.default_rng(1)
    E = rng.standard_normal((5, 2)) * [1.0, scale]
    mode = OpenMode.of(System.linear(np.eye(5) * 0.5, C=rng.standard_normal((4, 5)), E=E, dt=1.0))
    assert mode.free == 2
    H = mode.decoupling(rng.standard_normal((5, 2)))
    # Relative to each column of E: forces and torques come in numbers of unlike size.
    np.testing.assert_allclose((np.eye(5) + H @ mode.C) @ E / [1.0, scale], 0.0, atol=1e-12)
    np.testing.assert_allclose(mode.M.T @ mode.C @ E / [1.0, scale], 0.0, atol=1e-12)


def test_columns_that_repeat_count_once() -> None:
    one = plant_of(C=np.eye(2))
    two = plant_of(C=np.eye(2), E=np.array([[0.0, 0.0], [1.0, -2.0]]))
    np.testing.assert_allclose(OpenMode.of(two).U, OpenMode.of(one).U, atol=1e-14)
    assert OpenMode.of(two).free == OpenMode.of(one).free == 1


def test_without_unknown_inputs_all_of_the_decoupling_is_free() -> None:
    mode = OpenMode.of(plant_of(E=None))
    assert mode.free == 1
    np.testing.assert_array_equal(mode.U, np.zeros((2, 1)))


def test_inputs_of_the_error_are_those_of_a_step_of_the_observer() -> None:
    # One step of plant and observer in plain arithmetic, with noise at both samples, against N e + B w.
    rng = np.random.default_rng(3)
    A, B, C, E = (rng.standard_normal(shape) for shape in ((3, 3), (3, 1), (2, 3), (3, 1)))
    G, N = rng.standard_normal((2, 2)), rng.standard_normal((1, 2))
    bound = np.array([0.3, 2.0])
    plant = System.linear(0.3 * A, B, C, E=E, G=G, N=N, dt=1.0, noise_bound=bound.tolist())
    mode = OpenMode.of(plant)
    K, H = rng.standard_normal((3, 2)), mode.decoupling(rng.standard_normal((3, 1)))
    x, xh, d, u = rng.standard_normal(3), rng.standard_normal(3), 100 * rng.standard_normal(1), rng.standard_normal(1)
    now, later = bound * rng.uniform(-1, 1, 2), bound * rng.uniform(-1, 1, 2)
    P = np.eye(3) + H @ C
    x_next = 0.3 * A @ x + B @ u + E @ d
    loop = P @ (0.3 * A) - K @ C
    xh_next = loop @ xh + K @ (C @ x + G @ now) + P @ B @ (u + N @ now) - H @ (C @ x_next + G @ later)
    gain = Polynomial.constant(K)
    driven = np.asarray(mode.driven(gain, H)({})) @ np.concatenate([later / bound, now / bound])
    np.testing.assert_allclose(np.asarray(mode.error(gain, H)({})) @ (x - xh) + driven, x_next - xh_next, atol=1e-10)


def test_a_gust_at_the_centre_of_gravity_is_a_rank_error() -> None:
    with pytest.raises(NotAccepted, match=r"Rank error in mode 0 .*rank\(C E\) = 0, but rank\(E\) = 1"):
        require_decouplable(gusty(arm=0.0))


def test_a_gust_behind_it_leaves_an_unstable_zero() -> None:
    with pytest.raises(NotAccepted, match=r"mode 0 .*unstable zero z = 1\.1.*\|z\| < 1 is needed"):
        require_decouplable(gusty(arm=-0.2))


def test_a_long_euler_step_leaves_an_unstable_zero_too() -> None:
    with pytest.raises(NotAccepted, match=r"z = -8\.65 a step .*shorter sample time or the exact hold"):
        require_decouplable(gusty(step=0.6))


@pytest.mark.parametrize("zero", [0.5, -0.5, 0.999])
def test_a_mutated_border_is_caught_by_zeros_inside_the_circle(zero: float) -> None:
    # Re(z) >= 0, the border of continuous time, would refuse 0.5 and 0.999.
    A = np.array([[zero, 1.0], [0.0, 0.0]])
    np.testing.assert_allclose(zeros(Switched.of(plant_of(A=A))), [zero], atol=1e-12)


@pytest.mark.parametrize("zero", [-2.0, -1.0, 1.0, 1.5])
def test_a_mutated_border_is_caught_by_zeros_outside_the_circle(zero: float) -> None:
    # Re(z) >= 0 would let -2 and -1 pass.
    with pytest.raises(NotAccepted, match="unstable zero"):
        require_decouplable(Switched.of(plant_of(A=np.array([[zero, 1.0], [0.0, 0.0]]))))


def test_what_the_theorem_does_not_cover_is_refused() -> None:
    def refused(plant: System, words: str) -> None:
        with pytest.raises(NotAccepted, match=words):
            require_decouplable(Switched.of(plant))

    sine = Nonlinearity.bounded(lambda z, u: z * 0.1, [[1.0, 0.0]], jacobian=([[0.0]], [[0.2]]))
    speed = [Parameter("speed", 1.0, 2.0)]
    slope = Polynomial(("speed",), {(0,): np.array([[0.0], [1.0]]), (1,): np.array([[0.1], [0.0]])})
    refused(System.linear([[-1.0, 0.0], [0.0, -1.0]], C=[[0.0, 1.0]], E=[[0.0], [1.0]]), "continuous")
    refused(plant_of(D=[[1.0]]), "feedthrough")
    refused(plant_of(F=[[0.0], [1.0]], nonlinearity=sine), "nonlinearity")
    refused(plant_of(E=slope, parameters=speed), r"`E` of .* depends on the measured \['speed'\]")
    refused(plant_of(C=slope.T, parameters=speed), r"`C` of .* depends on the measured \['speed'\]")


def test_an_unknown_input_that_turns_is_taken_where_what_is_left_of_it_is_bounded() -> None:
    speed = [Parameter("speed", 1.0, 2.0)]
    slope = Polynomial(("speed",), {(0,): np.array([[0.0], [1.0]]), (1,): np.array([[0.1], [0.0]])})
    plant = plant_of(E=slope, parameters=speed, disturbance_bound=[3.0])
    require_decouplable(Switched.of(plant))
    mode = OpenMode.of(plant)
    # At the middle it is (0.15, 1); the rest, 0.1 (speed - 1.5) d, is a factor.
    np.testing.assert_allclose(mode.U, [[-0.15], [-1.0]], atol=1e-15)
    assert mode.uncertain.shape == (2, 1)


def test_factors_come_in_the_size_of_their_rows() -> None:
    # a x1 + 2 a u with a within 0.1 around 1: direction (1, 0), row 0.1 (1, 0; 2).
    half = [Parameter("a", 0.9, 1.1, measured=False)]
    A = Polynomial(("a",), {(0,): np.array([[0.0, 0.1], [0.2, 0.5]]), (1,): np.array([[1.0, 0.0], [0.0, 0.0]])})
    B = Polynomial(("a",), {(1,): np.array([[2.0], [0.0]])})
    mode = OpenMode.of(plant_of(A=A, B=B, parameters=half))
    np.testing.assert_allclose(np.abs(mode.uncertain * mode.sizes), [[0.1 * np.sqrt(5.0)], [0.0]], atol=1e-15)


def test_a_plant_without_outputs_is_refused() -> None:
    with pytest.raises(BadInput, match="no outputs"):
        require_decouplable(Switched.of(System.linear([[0.5]], C=np.zeros((0, 1)), E=[[1.0]], dt=1.0)))
