"""The truth model against plain equations of motion."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from luenberger.vehicle import BrushTyre, SingleTrack, brush_tyres, carmaker_car, wang_car


def by_hand(x: np.ndarray, delta: float, vx: float, small: bool) -> tuple[np.ndarray, float]:
    """Newton and Euler with the brush tyres of the printed car, written out."""
    front, rear = (x[0] + 0.948 * x[1]) / vx, (x[0] - 1.422 * x[1]) / vx
    af, ar = (delta - front, -rear) if small else (delta - np.arctan(front), -np.arctan(rear))

    def force(alpha: float, load: float) -> float:
        s = min(abs(alpha) * 5.0, 1.0)
        return np.sign(alpha) * 0.85 * load * (1 - (1 - s) ** 3)

    Ff = force(af, 6000.0) * (1.0 if small else np.cos(delta))
    Fr = force(ar, 4000.0)
    return np.array([(Ff + Fr) / 800.0 - vx * x[1], (0.948 * Ff - 1.422 * Fr) / 1152.0]), (Ff + Fr) / 800.0


@pytest.mark.parametrize("small", [True, False])
def test_derivative_and_outputs_match_the_equations_of_motion(small: bool) -> None:
    model = SingleTrack(wang_car, *brush_tyres(wang_car), small_angles=small)
    draw = np.random.default_rng(5)
    for _ in range(50):
        x, delta, vx = draw.uniform([-4, -1], [4, 1]), draw.uniform(-0.3, 0.3), draw.uniform(5, 40)
        dx, ay = by_hand(x, delta, vx, small)
        # 1 - (1 - s)^3 and s (3 - 3 s + s^2) agree to rounding: 1e-12 of m/s^2 and rad/s^2 of order ten.
        np.testing.assert_allclose(model(0.0, x, np.array([delta]), np.array([vx])), dx, atol=1e-11)
        y = model.output(0.0, x, np.array([delta]), np.array([vx]))
        np.testing.assert_allclose(y, [x[1], ay], atol=1e-11)


def test_steering_to_the_left_turns_to_the_left() -> None:
    model = SingleTrack(carmaker_car)
    dx = model(0.0, jnp.zeros(2), jnp.array([0.01]), jnp.array([20.0]))
    assert (np.asarray(dx) > 0).all()


def test_the_accelerometer_reads_the_motion() -> None:
    model = SingleTrack(carmaker_car)
    x, u, r = jnp.array([0.4, 0.3]), jnp.array([0.05]), jnp.array([15.0])
    ay = model.output(0.0, x, u, r)[1]
    assert float(ay) == pytest.approx(float(model(0.0, x, u, r)[0] + 15.0 * 0.3), rel=1e-13)


def test_the_model_is_a_pytree_of_its_tyres() -> None:
    models = jax.vmap(lambda C: SingleTrack(wang_car, BrushTyre(C, 5e3)))(jnp.array([50e3, 80e3]))
    dx = jax.jit(jax.vmap(lambda m: m(0.0, jnp.zeros(2), jnp.array([0.02]), jnp.array([20.0]))))(models)
    assert dx.shape == (2, 2)
    assert float(dx[1, 0]) > float(dx[0, 0])
