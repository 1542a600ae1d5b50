"""Law: a clipped function is the function inside its domain, keeps its Jacobian bounds everywhere, and calls every estimate home."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from luenberger.core import BadInput
from luenberger.observers import CorrectionObserver
from luenberger.systems import Nonlinearity, System
from van_der_pol_plants import GAIN, OPERATING, damping, motions, on_the_limit_cycle, van_der_pol

NONE = jnp.zeros(0)
PICK = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
FUNCTIONS: dict[str, Callable[[], Nonlinearity]] = {
    "Van der Pol": lambda: Nonlinearity.enclosed(damping, np.eye(2), ([-5.0, -5.0], [5.0, 5.0])),
    "off the middle": lambda: Nonlinearity.enclosed(damping, np.eye(2), ([-1.0, 0.5], [3.0, 4.0])),
    "two outputs of two states": lambda: Nonlinearity.enclosed(
        lambda z, u: jnp.stack([jnp.sin(z[0]) * z[1], z[0] ** 3 - z[1] ** 2]), PICK, ([-1, -9, 0.1], [2, 9, 1])
    ),
}


@pytest.fixture(params=FUNCTIONS)
def f(request: pytest.FixtureRequest) -> Nonlinearity:
    return FUNCTIONS[request.param]()


def points(f: Nonlinearity, stretch: float, count: int = 500) -> np.ndarray:
    """Random states in the domain blown up about its middle."""
    assert f.domain is not None
    lower, upper = f.domain
    share = np.random.default_rng(3).uniform(-stretch, stretch, (count, len(lower)))
    return 0.5 * (lower + upper) + 0.5 * (upper - lower) * share


def test_inside_it_is_the_function(f: Nonlinearity) -> None:
    x = points(f, 1.0)
    plain, clipped = (np.asarray(jax.vmap(lambda x, g=g: g(x, NONE))(x)) for g in (f, f.clipped()))
    # Nothing is added inside but a product with zero.
    np.testing.assert_array_equal(clipped, plain)
    assert f.clipped().is_clipped
    assert not f.is_clipped


def test_its_jacobian_stays_in_the_box_everywhere(f: Nonlinearity) -> None:
    assert f.jacobian_lower is not None
    assert f.jacobian_upper is not None
    g = f.clipped()
    z = np.concatenate([points(f, stretch) for stretch in (1.5, 5.0, 100.0)]) @ np.asarray(f.H).T
    J = np.asarray(jax.vmap(jax.jacfwd(lambda z: g.function(z, NONE)))(z))
    # The box may be touched at the faces, where rounding decides.
    room = 1e-12 * (1 + np.abs(f.jacobian_upper - f.jacobian_lower))
    assert np.all(f.jacobian_lower - room <= J)
    assert np.all(f.jacobian_upper + room >= J)
    # The function itself leaves the box out there, so the law can fail.
    raw = np.asarray(jax.vmap(jax.jacfwd(lambda z: f.function(z, NONE)))(z))
    assert np.any((raw < f.jacobian_lower - 1) | (raw > f.jacobian_upper + 1))


def test_difference_quotients_are_jacobians_of_the_box(f: Nonlinearity) -> None:
    assert f.jacobian_lower is not None
    assert f.jacobian_upper is not None
    g, H = f.clipped(), np.asarray(f.H)
    a, b = points(f, 6.0), points(f, 1.0)[::-1]
    rise = np.asarray(jax.vmap(lambda a, b: g(a, NONE) - g(b, NONE))(a, b))
    dz = (a - b) @ H.T
    # J dz over a box of J: every entry at its worse end.
    high = np.maximum(f.jacobian_lower * dz[:, None], f.jacobian_upper * dz[:, None]).sum(axis=2)
    low = np.minimum(f.jacobian_lower * dz[:, None], f.jacobian_upper * dz[:, None]).sum(axis=2)
    room = 1e-12 * (1 + np.abs(high) + np.abs(low))
    assert np.all((low - room <= rise) & (rise <= high + room))


def test_an_estimate_far_outside_comes_home_where_the_plain_copy_escapes() -> None:
    # x' = -x + x^2 + u rests below 0.5; with L = 0.5 the error falls for slopes up to 1, and a copy that starts above 1.5
    # escapes in finite time.
    f = Nonlinearity.enclosed(lambda z, u: z**2, [[1.0]], ([-0.5], [0.5]))
    plant = System.nonlinear([[-1.0]], None, [[1.0]], F=[[1.0]], nonlinearity=f)
    far = {}
    for name, g in (("plain", f), ("clipped", f.clipped())):
        observer = CorrectionObserver(plant.replace(nonlinearity=g), [[0.5]], 0.01)
        far[name] = jax.lax.scan(
            lambda s, _, o=observer: (o.step(s, NONE, jnp.zeros(1), NONE)[0], None), observer.init([3.0]), None, 2000
        )[0]
    assert not abs(float(far["plain"][0])) < 3.0
    # exp(-(1 + 0.5) t) with the slope 0 of the middle until 0.5, then no slower than exp(-0.5 t): 20 s leave 1e-4.
    assert abs(float(far["clipped"][0])) < 1e-3


def test_a_sampled_oscillator_observer_survives_any_first_guess() -> None:
    plant = van_der_pol()
    f = plant.nonlinearity
    assert f is not None
    x0 = on_the_limit_cycle(1)
    truth = jnp.asarray(motions(plant, np.zeros((2, 1)), np.zeros((2, 1)), x0, np.zeros((1, 2)), 0.005, 4000)[0][0])
    assert np.all(np.abs(truth) < OPERATING[1])
    guesses = 100.0 * np.random.default_rng(0).choice([-1.0, 1.0], (8, 2))
    worst = {}
    for name, g in (("plain", f), ("clipped", f.clipped())):
        observer = CorrectionObserver(plant.replace(nonlinearity=g), GAIN, 0.005)
        run = jax.vmap(
            lambda x, o=observer: jax.lax.scan(lambda s, y: o.step(s, NONE, y, NONE), o.init(x), truth[:, :1])[1].x
        )
        worst[name] = np.abs(np.asarray(run(guesses)) - truth)[:, -1000:].max()
    # The copied f makes the guess so stiff, slope 1 - 100^2, that Runge-Kutta at 5 ms leaves the finite numbers.
    assert not worst["plain"] < 1e6
    # y held for 5 ms at up to 2.7 1/s, times gains of 78 over rates of 10.
    assert worst["clipped"] < 0.1


def test_what_cannot_be_clipped_is_refused() -> None:
    free = Nonlinearity.bounded(damping, np.eye(2), jacobian=([[-1.0, -1.0]], [[1.0, 1.0]]))
    with pytest.raises(BadInput, match="needs a `domain`"):
        free.clipped()
    square = ([-1.0, -1.0], [1.0, 1.0])
    lipschitz = Nonlinearity.bounded(damping, np.eye(2), lipschitz=1.0, domain=square)
    with pytest.raises(BadInput, match="a Jacobian box"):
        lipschitz.clipped()
    mixed = Nonlinearity.bounded(lambda z, u: z, [[1.0, 1.0]], jacobian=([[-1.0]], [[1.0]]), domain=square)
    with pytest.raises(BadInput, match="one 1 in each row"):
        mixed.clipped()
    hull = Nonlinearity.bounded(damping, np.eye(2), hull=np.array([[[0.0, 1.0]], [[1.0, 0.0]]]), domain=square)
    with pytest.raises(BadInput, match="boxed"):
        hull.clipped()
    assert hull.boxed().clipped().is_clipped
