"""A reduced zonotope holds the given one, and the default stays close to the exact set in the long run."""

import re
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


def columns(generators: jax.Array) -> np.ndarray:
    """The columns in a fixed order: a set does not know another."""
    # 0.0 drops the sign of a zero.
    return np.array(sorted(map(tuple, np.asarray(generators).T + 0.0)))


def sorted_out(G: np.ndarray, count: int, key: np.ndarray) -> np.ndarray:
    """The same reduction by a stable sort."""
    order = np.argsort(-key, kind="stable")
    kept, rest = order[: count - len(G)], order[count - len(G) :]
    return np.hstack([G[:, kept], np.diag(np.abs(G[:, rest]).sum(axis=1))])


KEYS = {girard: lambda G: abs(G).sum(axis=0) - abs(G).max(axis=0), combastel: lambda G: (G**2).sum(axis=0)}


@pytest.mark.parametrize("method", KEYS)
@pytest.mark.parametrize("n", [1, 3])
@pytest.mark.parametrize("whole", [False, True])
def test_the_choice_is_that_of_a_stable_sort(method: Callable[..., jax.Array], n: int, whole: bool) -> None:
    draw = np.random.default_rng(n)
    for count in (n, 4, 9, 19):
        reduce = jax.jit(lambda G, count=count: method(G, count))
        for _ in range(40):
            # Small whole numbers tie in most columns, and their sums are exact.
            G = draw.integers(-2, 3, (n, 20)).astype(float) if whole else draw.normal(size=(n, 20))
            np.testing.assert_allclose(
                columns(reduce(jnp.asarray(G))), columns(jnp.asarray(sorted_out(G, count, KEYS[method](G)))), rtol=1e-13
            )


def test_a_box_is_reduced_without_loss() -> None:
    boxes = np.hstack([np.diag([1.0, 2.0]), np.diag([0.5, 0.25]), [[3.0], [3.0]]])
    reduced = columns(girard(jnp.asarray(boxes), 3))
    np.testing.assert_allclose(reduced, [[0.0, 2.25], [1.5, 0.0], [3.0, 3.0]])


def test_of_equal_generators_the_first_are_kept() -> None:
    given = jnp.asarray([[1.0, 1.0, 1.0, 1.0], [1.0, -1.0, 1.0, -1.0]])
    np.testing.assert_allclose(columns(girard(given, 3)), [[0.0, 3.0], [1.0, 1.0], [3.0, 0.0]])


@pytest.mark.parametrize("place", [0, 4, 8])
def test_what_is_not_a_number_is_not_lost(place: int) -> None:
    given = generator.normal(size=(2, 9))
    given[0, place] = np.nan
    for count in (2, 4, 6):
        assert np.isnan(np.asarray(girard(jnp.asarray(given), count))).any()


@pytest.mark.parametrize("method", KEYS)
def test_plain_arithmetic_only(method: Callable[..., jax.Array]) -> None:
    # What can be written as C: no sort, no gather, no loop, at any depth.
    program = str(jax.make_jaxpr(lambda G: method(G, 6))(jnp.ones((3, 12))))
    found = set(re.findall(r"= (\w+)", program))
    assert "reduce_sum" in found
    assert not found & {"sort", "gather", "scatter", "while", "cond", "argmin", "argmax", "dot_general", "top_k"}


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
