"""The sector lemma of chapter 5 of Wang's dissertation, counted out in fractions: false for two varying entries in a row."""

from fractions import Fraction

import numpy as np

K1, K2 = (Fraction(-50), Fraction(-24)), (Fraction(50), Fraction(1))


def f(x1: Fraction, x2: Fraction) -> Fraction:
    return (1 - x1 * x1) * x2


def product(x: tuple[Fraction, Fraction], z: tuple[Fraction, Fraction]) -> Fraction:
    """(phi - K1 e)(phi - K2 e), which the lemma calls never positive."""
    e = x[0] - z[0], x[1] - z[1]
    phi = f(*x) - f(*z)
    return (phi - K1[0] * e[0] - K1[1] * e[1]) * (phi - K2[0] * e[0] - K2[1] * e[1])


def test_one_pair_inside_the_square_breaks_the_lemma() -> None:
    found = product((Fraction(1, 10), Fraction(-3, 10)), (Fraction(0), Fraction(0)))
    assert found == Fraction(12477509, 1000000)


def test_a_twelfth_of_all_pairs_do_and_none_of_equal_signs() -> None:
    generator = np.random.default_rng(1)
    pairs = generator.uniform(-5, 5, (200_000, 2, 2))
    x, z = pairs[:, 0].T, pairs[:, 1].T
    e, phi = x - z, (1 - x[0] ** 2) * x[1] - (1 - z[0] ** 2) * z[1]
    bad = (phi + 50 * e[0] + 24 * e[1]) * (phi - 50 * e[0] - e[1]) > 0
    # 200 000 draws: three standard deviations of a share of 0.09 are 0.002.
    assert abs(bad.mean() - 0.0868) < 0.002
    assert not bad[e[0] * e[1] >= 0].any()
    assert bad[e[0] * e[1] < 0].mean() > 0.16
