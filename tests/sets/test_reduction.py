"""A reduced zonotope holds the given one, and the default stays close to the exact set in the long run."""

from collections.abc import Callable
from itertools import product

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from luenberger.core import BadInput
from luenberger.sets import Zonotope, combastel, girard, pca

METHODS = [girard, combastel, pca]
generator = np.random.default_rng(1)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(("n", "p", "count"), [(2, 9, 4), (3, 12, 6), (3, 12, 3), (2, 3, 5)])
def test_reduced_set_holds_the_given_one(method: Callable[..., jax.Array], n: int, p: int, count: int) -> None:
    given = Zonotope.of(generator.normal(size=n), generator.normal(size=(n, p)))
    reduced = given.reduce(count, method)
    assert reduced.generators.shape[1] == min(p, count)
    signs = np.array(list(product([-1.0, 1.0], repeat=p)))
    for b in signs[generator.choice(len(signs), 40)]:
        # The linear programme meets its constraints to about 1e-9.
        assert reduced.contains(np.asarray(given.center) + np.asarray(given.generators) @ b, 1e-7)


def test_a_box_is_reduced_without_loss() -> None:
    boxes = np.hstack([np.diag([1.0, 2.0]), np.diag([0.5, 0.25]), [[3.0], [3.0]]])
    reduced = np.asarray(girard(jnp.asarray(boxes), 3))
    np.testing.assert_allclose(reduced, [[3.0, 1.5, 0.0], [3.0, 0.0, 2.25]])


def test_ties_keep_their_order() -> None:
    given = jnp.asarray([[1.0, 1.0, 1.0, 1.0], [1.0, -1.0, 1.0, -1.0]])
    np.testing.assert_allclose(np.asarray(girard(given, 3))[:, 0], [1.0, 1.0])


# Exact interval hull of sum 0.95^k R(30 deg)^k D [-1, 1]^2 over 100 steps, D = 0.1 I.
EXACT = 2.4606


def turned(method: Callable[..., jax.Array], count: int, steps: int = 100) -> float:
    angle = np.pi / 6
    N = 0.95 * np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])

    def advance(G: jax.Array, _: None) -> tuple[jax.Array, None]:
        return method(jnp.concatenate([N @ G, 0.1 * jnp.eye(2)], axis=1), count), None

    G, _ = jax.jit(lambda G: jax.lax.scan(advance, G, None, length=steps))(jnp.zeros((2, count)))
    return float(jnp.abs(G).sum(axis=1)[0])


def test_exact_hull_of_a_turning_system() -> None:
    # Room for all generators: nothing is reduced. Printed to four decimals.
    assert turned(girard, 250) == pytest.approx(EXACT, abs=5e-5)


def test_girard_with_six_generators_is_as_good_as_exact() -> None:
    assert turned(girard, 6) / turned(girard, 250) < 1.001


def test_too_few_generators_on_a_turning_system_diverge() -> None:
    # A box a step: the reason why `count` has to exceed the dimension.
    assert turned(girard, 2) > 100 * EXACT


@pytest.mark.parametrize("method", METHODS)
def test_less_than_the_dimension_is_refused(method: Callable[..., jax.Array]) -> None:
    with pytest.raises(BadInput, match="at least 3"):
        method(jnp.ones((3, 5)), 2)
