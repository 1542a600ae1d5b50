"""Enclosures: proved bounds hold at every sample and overshoot no more than stated."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from luenberger.algebra.enclosure import Enclosure, enclose, enclose_jacobian
from luenberger.core import BadInput

pytestmark = pytest.mark.filterwarnings("ignore:Do not use the `random` module")


def range_of(function: Callable, lower: list[float], upper: list[float], count: int) -> tuple[np.ndarray, np.ndarray]:
    """Least and greatest double on a dense grid with the corners."""
    axes = [np.linspace(a, b, count) for a, b in zip(lower, upper, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, len(lower))
    values = np.asarray(jax.vmap(function)(points))
    return values.min(0), values.max(0)


def check(found: Enclosure, function: Callable, lower: list[float], upper: list[float], count: int = 60) -> None:
    least, greatest = range_of(function, lower, upper, count)
    size = 1e-13 * (1 + np.maximum(abs(least), abs(greatest)))
    assert (found.lower <= least + size).all()
    assert (greatest - size <= found.upper).all()
    assert (found.lower <= found.inner_lower).all()
    assert (found.inner_upper <= found.upper).all()


def test_flexible_joint_slope_is_exact() -> None:
    found = enclose_jacobian(lambda x: -3.33 * jnp.sin(x), [-5.0], [5.0])
    assert found.lower.tolist() == [[-3.33]]
    assert found.upper.tolist() == [[3.33]]
    assert found.tight
    assert found.assumptions == ()
    # Spoiled: on a box that cos = 1 does not reach, the bound must fall below 3.33.
    assert enclose_jacobian(lambda x: -3.33 * jnp.sin(x), [0.5], [1.0]).lower[0, 0] > -3.33


def test_van_der_pol() -> None:
    found = enclose_jacobian(lambda x: jnp.stack([0.0 * x[0], (1 - x[0] ** 2) * x[1]]), [-2.0, -2.0], [2.0, 2.0])
    # d/dx1 = -2 x1 x2, d/dx2 = 1 - x1^2.
    assert found.lower.tolist() == [[0.0, 0.0], [-8.0, -3.0]]
    assert found.upper.tolist() == [[0.0, 0.0], [8.0, 1.0]]
    assert found.pieces == 1


def magic(slip: jax.Array) -> jax.Array:
    b, c, d, e = 10.0, 1.9, 1.0, 0.97
    return d * jnp.sin(c * jnp.arctan(b * slip - e * (b * slip - jnp.arctan(b * slip))))


@pytest.mark.parametrize("tolerance", [1e-1, 1e-3, 1e-5])
def test_tyre_stiffness(tolerance: float) -> None:
    found = enclose_jacobian(magic, [-0.3], [0.3], tolerance=tolerance)
    slope = jax.vmap(jax.grad(lambda a: magic(a)))
    values = np.asarray(slope(jnp.linspace(-0.3, 0.3, 100001)))
    assert found.tight
    assert found.lower[0, 0] <= values.min()
    # b c d at zero slip, exactly: 10 and 1.9 as doubles give a product that rounds to 19.
    assert found.upper[0, 0] == pytest.approx(19.0, abs=20 * tolerance)
    assert found.upper[0, 0] >= 19.0
    # The grid misses the true minimum by at most (slope'' * 6e-6^2), far below the overshoot allowed.
    assert values.min() - found.lower[0, 0] <= tolerance * (values.max() - values.min()) + 1e-6


FUNCTIONS: dict[str, tuple[Callable, list[float], list[float]]] = {
    "pendulum": (
        lambda x: jnp.sin(x[0]) * (1 + x[1] ** 2 * jnp.cos(x[0])) / (1 + jnp.sin(x[0]) ** 2),
        [-1, -2],
        [1, 2],
    ),
    "product": (lambda x: jnp.array([jnp.sin(3 * x[0]) * jnp.cos(2 * x[1]) * x[2]]), [-2, -2, -1], [2, 2, 1]),
    "polynomial": (lambda x: jnp.array([x[0] * x[1] - x[0] ** 2 * x[1] + x[1] ** 3, x @ x]), [-2, -2], [2, 2]),
    "banana": (lambda x: (1 - x[0]) ** 2 + 100 * (x[1] - x[0] ** 2) ** 2, [-2, -1], [2, 3]),
    "kinks": (lambda x: jnp.maximum(x[0], 0) * 2 + jnp.abs(x[1] - x[0]) + jnp.clip(x[1], -0.5, 0.5), [-1, -1], [1, 1]),
    "quotient": (lambda x: (x[0] + x[1]) / (1 + x[0] ** 2 + x[1] ** 2), [-2, -2], [2, 2]),
    "guarded": (
        lambda x: jnp.where(x[0] > 0.5, 1 / jnp.where(x[0] > 0.5, x[0], 1.0), 2 * x[0]) + x[1],
        [-1, 0],
        [1, 1],
    ),
    "slip": (lambda x: jnp.arctan2(x[1], x[0]) + jnp.sqrt(x[0] ** 2 + x[1] ** 2), [5, -2], [20, 2]),
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_values_are_held_tightly(name: str) -> None:
    function, lower, upper = FUNCTIONS[name]
    found = enclose(function, lower, upper, tolerance=5e-2)
    check(found, function, lower, upper, 40)
    least, greatest = range_of(function, lower, upper, 90 if len(lower) < 3 else 40)
    assert found.tight
    # 5 % allowed, and 1 % for what the grid misses.
    assert (found.upper - greatest <= 0.06 * (greatest - least)).all()
    assert (least - found.lower <= 0.06 * (greatest - least)).all()


@pytest.mark.parametrize("name", ["pendulum", "polynomial", "banana", "kinks", "slip"])
def test_slopes_bound_difference_quotients(name: str) -> None:
    function, lower, upper = FUNCTIONS[name]
    found = enclose_jacobian(function, lower, upper, tolerance=5e-2)
    assert found.assumptions == ()
    generator = np.random.default_rng(3)
    x, z = (generator.uniform(lower, upper, (300, len(lower))) for _ in range(2))
    difference = np.asarray(jax.vmap(function)(x)) - np.asarray(jax.vmap(function)(z))
    gap = (x - z).reshape((300,) + (1,) * (difference.ndim - 1) + (len(lower),))
    most = np.maximum(found.lower * gap, found.upper * gap).sum(-1)
    least = np.minimum(found.lower * gap, found.upper * gap).sum(-1)
    assert (difference <= most + 1e-10).all()
    assert (least - 1e-10 <= difference).all()


def test_jumps_and_hand_written_rules_are_told() -> None:
    jump = enclose_jacobian(lambda x: jnp.where(x > 0.3, 1.0, 0.0) + x, [0.0], [1.0])
    assert jump.assumptions == ("continuity across a branch",)
    beside = enclose_jacobian(lambda x: jnp.where(x > 0.3, 1.0, 0.0) + x, [0.5], [1.0])
    assert beside.assumptions == ()
    assert "continuity across floor" in enclose_jacobian(lambda x: jnp.floor(x), [0.0], [1.5]).assumptions
    assert enclose_jacobian(jax.nn.relu, [-1.0], [1.0]).assumptions[0].startswith("the derivative rule of")
    smooth = enclose_jacobian(lambda x: jnp.where(x > 3.0, jnp.exp(x), x), [0.0], [1.0])
    assert smooth.assumptions == ()


def test_a_kink_is_held_from_both_sides() -> None:
    found = enclose_jacobian(lambda x: jnp.maximum(x, 0.0) * 2 + jnp.abs(x), [-1.0], [1.0])
    assert found.lower.tolist() == [[-1.0]]
    assert found.upper.tolist() == [[3.0]]


def test_an_entry_that_is_zero_does_not_eat_all_pieces() -> None:
    found = enclose(lambda x: x * (1 - x) - x + x * x, [0.0], [1.0])
    assert found.tight
    assert found.pieces < 100
    assert found.lower[0] <= 0.0 <= found.upper[0]


def test_loose_bounds_are_still_bounds() -> None:
    function, lower, upper = FUNCTIONS["quotient"]
    few = enclose(function, lower, upper, tolerance=1e-4, max_pieces=3)
    many = enclose(function, lower, upper, tolerance=0.1)
    assert not few.tight
    assert few.pieces == 3
    # The range is about 1.4, so that the tighter bounds overshoot by no more than 0.14.
    assert few.lower <= many.lower + 0.14
    assert few.upper >= many.upper - 0.14
    check(few, function, lower, upper)


def test_constants_scalars_and_empty_arguments() -> None:
    found = enclose(lambda x: jnp.array([[1.5, 2.0]]), [0.0], [1.0])
    assert found.lower.tolist() == found.upper.tolist() == [[1.5, 2.0]]
    scalar = enclose(lambda x: x[0] ** 2, [-1.0], [2.0])
    assert scalar.lower.shape == ()
    assert (float(scalar.lower), float(scalar.upper)) == (0.0, 4.0)
    empty = enclose(lambda x: jnp.sum(x) + 2.0, [], [])
    assert float(empty.lower) == 2.0
    point = enclose(jnp.sin, [0.7], [0.7])
    assert point.upper[0] - point.lower[0] <= 2.0**-53


def test_a_pole_inside_is_named() -> None:
    with pytest.raises(BadInput, match=r"not known to be defined on the whole box after 50 pieces.*contains zero"):
        enclose(lambda x: 1 / x, [-1.0], [1.0], max_pieces=50)


@pytest.mark.parametrize(
    ("lower", "upper", "options", "message"),
    [
        ([1.0], [0.0], {}, "inverted in entry 0"),
        ([0.0, 0.0], [1.0], {}, r"shape \(2,\) and `upper` \(1,\)"),
        ([float("nan")], [1.0], {}, "nan"),
        ([0.0], [float("inf")], {}, "inf"),
        (0.0, 1.0, {}, "one shape"),
        ([0.0], [1.0], {"tolerance": 0.0}, "tolerance"),
        ([0.0], [1.0], {"max_pieces": 0}, "max_pieces"),
    ],
)
def test_bad_boxes_are_refused(lower: object, upper: object, options: dict, message: str) -> None:
    for verb in (enclose, enclose_jacobian):
        with pytest.raises(BadInput, match=message):
            verb(jnp.sin, lower, upper, **options)


UNARY = [
    jnp.sin,
    jnp.cos,
    jnp.tanh,
    jnp.arctan,
    jnp.abs,
    jnp.square,
    jax.nn.sigmoid,
    lambda a: jnp.exp(jnp.minimum(a, 2.0)),
]
UNARY += [lambda a: jnp.sqrt(1 + a * a), lambda a: jnp.log(2 + jnp.abs(a)), lambda a: a**3 / (1 + a**4), jnp.sign]
UNARY += [lambda a: jnp.where(a > 0.3, a, jnp.cos(a)), lambda a: jnp.mod(a, 1.5), jnp.floor]
BINARY = [
    jnp.add,
    jnp.subtract,
    jnp.multiply,
    jnp.maximum,
    jnp.minimum,
    lambda a, b: a / (2 + jnp.sin(b)),
    lambda a, b: jnp.sqrt(a * a + b * b),
]

leaves = st.one_of(
    st.integers(0, 1).map(lambda k: lambda x: x[k]), st.floats(-2, 2, width=16).map(lambda c: lambda x: c + 0 * x[0])
)


def compose_one(f: Callable, a: Callable) -> Callable:
    return lambda x: f(a(x))


def compose_two(f: Callable, a: Callable, b: Callable) -> Callable:
    return lambda x: f(a(x), b(x))


# XLA takes subnormal numbers for zero, which the exact arithmetic of balls does not.
corners = st.tuples(*[st.floats(-3, 3, allow_subnormal=False)] * 2)
expressions = st.recursive(
    leaves,
    lambda inner: st.one_of(
        st.builds(compose_one, st.sampled_from(UNARY), inner),
        st.builds(compose_two, st.sampled_from(BINARY), inner, inner),
    ),
    max_leaves=6,
)


@settings(deadline=None, max_examples=40, derandomize=True)
@given(
    function=expressions,
    corner=corners,
    size=st.floats(0, 4),
    seed=st.integers(0, 99),
)
def test_random_expressions_stay_inside(function: Callable, corner: tuple, size: float, seed: int) -> None:
    lower = np.array(corner)
    upper = lower + size
    found = enclose(function, lower, upper, tolerance=0.05, max_pieces=12)
    points = np.random.default_rng(seed).uniform(lower, upper, (64, 2))
    values = np.asarray(jax.vmap(function)(points))
    # Doubles of such compositions are good to 1e-12 of their size, except next to a step, where they may take either side.
    slack = 1e-12 * (1 + abs(values))
    assert (found.lower - slack <= values).all()
    assert (values <= found.upper + slack).all()


SMOOTH = [f for f in UNARY if f not in (jnp.sign, jnp.floor)][:11]
smooth_expressions = st.recursive(
    leaves,
    lambda inner: st.one_of(
        st.builds(compose_one, st.sampled_from(SMOOTH), inner),
        st.builds(compose_two, st.sampled_from(BINARY[:-1]), inner, inner),
    ),
    max_leaves=5,
)


@settings(deadline=None, max_examples=40, derandomize=True)
@given(function=smooth_expressions, corner=corners, size=st.floats(0.01, 3))
def test_random_slopes_bound_difference_quotients(function: Callable, corner: tuple, size: float) -> None:
    lower = np.array(corner)
    upper = lower + size
    found = enclose_jacobian(function, lower, upper, tolerance=0.2, max_pieces=6)
    assert found.assumptions == ()
    generator = np.random.default_rng(7)
    x, z = generator.uniform(lower, upper, (64, 2)), generator.uniform(lower, upper, (64, 2))
    difference = np.asarray(jax.vmap(function)(x)) - np.asarray(jax.vmap(function)(z))
    most = np.maximum(found.lower * (x - z), found.upper * (x - z)).sum(-1)
    least = np.minimum(found.lower * (x - z), found.upper * (x - z)).sum(-1)
    slack = 1e-11 * (1 + abs(most) + abs(least))
    assert (least - slack <= difference).all()
    assert (difference <= most + slack).all()
