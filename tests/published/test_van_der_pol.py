"""The oscillator's bounds against exact arithmetic: the box, the Lipschitz constant, and the polygon that holds all Jacobians."""

from collections.abc import Callable
from fractions import Fraction
from itertools import pairwise

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from luenberger.core import BadInput
from luenberger.experiment.published.van_der_pol import tangent_polygon, van_der_pol
from luenberger.systems.jacobian_hull import prove_hull

RADII = (0.3, 1.0, 2.7, 5.0, 100.0)


def largest_on_the_set(a: Fraction, b: Fraction, r: Fraction) -> Fraction:
    """max of a g1 + b g2 over {|g1| <= 2 r q, g2 = 1 - q^2, 0 <= q <= r}, a quadratic in q, in rationals."""
    ends = [Fraction(0), r]
    if b > 0:
        # d/dq (2 r |a| q - b q^2) = 0
        ends.append(min(r, r * abs(a) / b))
    return max(2 * r * abs(a) * q + b * (1 - q * q) for q in ends)


def sides_of(polygon: np.ndarray) -> list[tuple[Fraction, Fraction, Fraction]]:
    """Rows (a, b, c) of a g1 + b g2 <= c, exactly through neighbouring vertices, turned so that (0, 1 - r^2 / 2) is inside."""
    points = [tuple(Fraction(v) for v in J[0]) for J in polygon]
    found = []
    for (x1, y1), (x2, y2) in pairwise([*points, points[0]]):
        a, b = y2 - y1, x1 - x2
        c = a * x1 + b * y1
        middle = b * (points[0][1] + min(p[1] for p in points)) / 2
        found.append((a, b, c) if middle <= c else (-a, -b, -c))
    return found


@pytest.mark.parametrize("radius", RADII)
@pytest.mark.parametrize("sides", [4, 6, 26, 200])
def test_polygon_holds_every_jacobian_exactly(radius: float, sides: int) -> None:
    polygon = tangent_polygon(radius, sides)
    assert polygon.shape == (sides, 1, 2)
    for a, b, c in sides_of(polygon):
        # Every vertex lies on the inner side, so that the half planes are those of the hull.
        assert all(a * Fraction(g1) + b * Fraction(g2) <= c for (g1, g2) in polygon[:, 0])
        assert largest_on_the_set(a, b, Fraction(radius)) <= c


@pytest.mark.parametrize("radius", RADII)
def test_a_smaller_polygon_does_not(radius: float) -> None:
    """The same check refuses a polygon whose sides lost one part in a billion: tangents leave no room."""
    shrunk = tangent_polygon(radius, 26) * np.array([1 - 1e-9, 1.0])
    assert any(largest_on_the_set(a, b, Fraction(radius)) > c for a, b, c in sides_of(shrunk))


def test_more_sides_are_tighter() -> None:
    def area(polygon: np.ndarray) -> float:
        x, y = polygon[:, 0].T
        return 0.5 * abs(float(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1))))

    areas = [area(tangent_polygon(5.0, n)) for n in (4, 8, 26, 100)]
    assert areas == sorted(areas, reverse=True)
    # The set itself: 2 * integral of 2 r sqrt(s) over [0, r^2] = 8/3 r^4; a tangent polygon of n contacts misses O(1/n^2).
    assert areas[-1] == pytest.approx(8 / 3 * 5.0**4, rel=1e-3)


def test_polygon_is_confirmed_by_ball_arithmetic() -> None:
    plain, middle = van_der_pol(2.7).nonlinearity, np.array([0.0, 1 - 2.7**2 / 2])
    assert plain is not None
    # Tangents touch, which balls of finite width cannot decide; a hundredth of room is enough for them.
    wide = middle + 1.01 * (tangent_polygon(2.7, 26) - middle)
    assert prove_hull(plain.function, wide, np.eye(2), plain.domain).bound_status == "proved"


@pytest.mark.parametrize("radius", RADII)
def test_box_and_lipschitz_constant(radius: float) -> None:
    f, constant = van_der_pol(radius).nonlinearity, van_der_pol(radius, lipschitz=True).nonlinearity
    assert f is not None
    assert f.jacobian_lower is not None
    assert f.jacobian_upper is not None
    assert constant is not None
    assert constant.jacobian_lower is None
    r = Fraction(radius)
    for ends, exact, side in (
        (f.jacobian_lower, (-2 * r**2, 1 - r**2), -1),
        (f.jacobian_upper, (2 * r**2, Fraction(1)), 1),
    ):
        for value, bound in zip(ends[0], exact, strict=True):
            # Outward, by one unit of the last place at most.
            assert 0 <= side * (Fraction(value) - bound) <= abs(bound) * Fraction(2) ** -51
    square = max(Fraction(1), 4 * r**4 + (1 - r**2) ** 2)
    assert square <= Fraction(constant.lipschitz_bound) ** 2 <= square * (1 + Fraction(2) ** -50)


def test_bounds_meet_the_gradient_of_the_function() -> None:
    plant, random = van_der_pol(2.7, mu=1.5), np.random.default_rng(0)
    f = plant.nonlinearity
    assert f is not None
    x = np.vstack([random.uniform(-2.7, 2.7, size=(2000, 2)), [[2.7, 2.7], [-2.7, 2.7], [0.0, 0.0]]])
    slopes = np.asarray(jax.vmap(jax.jacfwd(lambda z: f(z, jnp.zeros(0))))(jnp.asarray(x)))
    # 1e-12 for the rounding of the gradient itself.
    assert (slopes >= f.jacobian_lower - 1e-12).all()
    assert (slopes <= f.jacobian_upper + 1e-12).all()
    # Three corners of the box are met by the last three points together, to the same rounding.
    assert np.ptp(slopes[:, 0], axis=0) == pytest.approx(np.ptp([f.jacobian_lower[0], f.jacobian_upper[0]], axis=0))
    rate = plant.dynamics(0.0, jnp.array([0.5, -2.0]), jnp.zeros(0), jnp.zeros(0))
    assert np.asarray(rate).tolist() == [-2.0, -0.5 - 1.5 * 0.75 * 2.0]


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (lambda: van_der_pol(0.0), "above zero"),
        (lambda: van_der_pol(1.0, mu=-1.0), "above zero"),
        (lambda: van_der_pol(1.0, hull=tangent_polygon(1.0, 4), lipschitz=True), "one of them"),
        (lambda: tangent_polygon(1.0, 5), "even number"),
        (lambda: tangent_polygon(np.inf, 4), "above zero"),
    ],
)
def test_what_is_refused(given: Callable[[], object], words: str) -> None:
    with pytest.raises(BadInput, match=words):
        given()
