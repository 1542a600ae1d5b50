"""Ifqir et al. 2020, section 2 and the bounds below (34): products of intervals as printed, corrected, and exact."""

from collections.abc import Iterator

import jax
import numpy as np

from luenberger.experiment.published.ifqir_printed import (
    Bounds,
    delta_printed,
    lemma_corrected,
    lemma_printed,
    minus,
    plus,
)
from luenberger.experiment.published.row import Row, judged
from luenberger.sets import Interval, Zonotope

TRIALS = 20_000
_ROUNDING = 1e-12


def preliminary_rows() -> Iterator[Row]:
    """Rows of section 2 and of the bounds of delta."""
    A, x = random_boxes(TRIALS)
    exact = exact_product(A, x)
    yield _constant_matrix(A, x)
    yield _lemma(A, x, exact)
    yield _width()
    yield _delta(A, x, exact)
    yield _symmetric_delta()
    yield _hull()


def random_boxes(count: int, seed: int = 0) -> tuple[Bounds, Bounds]:
    """Return interval matrices (count, 2, 2) and interval vectors (count, 2, 1) with bounds drawn between -1 and 1.

    Args:
        count: how many.
        seed: of the random numbers.
    """
    rng = np.random.default_rng(seed)
    A, x = np.sort(rng.uniform(-1, 1, (2, count, 2, 2)), axis=0), np.sort(rng.uniform(-1, 1, (2, count, 2, 1)), axis=0)
    return Bounds(*A), Bounds(*x)


def exact_product(A: Bounds, x: Bounds) -> Bounds:
    """Return the smallest boxes around all products.

    Args:
        A: interval matrices, (count, n, n).
        x: interval vectors, (count, n, 1).
    """
    found = jax.vmap(lambda a, b: a @ b)(Interval.of(A.lower, A.upper), Interval.of(x.lower, x.upper))
    return Bounds(np.asarray(found.lower), np.asarray(found.upper))


def unsound(bounds: Bounds, exact: Bounds) -> np.ndarray:
    """Return for each trial whether the bounds cut off a product that can happen.

    Args:
        bounds: to be judged, (count, n, 1).
        exact: smallest boxes, (count, n, 1).
    """
    cut = (bounds.lower > exact.lower + _ROUNDING) | (bounds.upper < exact.upper - _ROUNDING)
    return np.asarray(cut.any(axis=(1, 2)))


def _constant_matrix(A: Bounds, x: Bounds) -> Row:
    M = A.upper
    printed = Bounds(plus(M) @ x.lower - minus(M) @ x.upper, plus(M) @ x.upper - minus(M) @ x.lower)
    exact = exact_product(Bounds(M, M), x)
    apart = float(max(np.abs(printed.lower - exact.lower).max(), np.abs(printed.upper - exact.upper).max()))
    return judged(
        "Lemma 1, product with a constant matrix",
        "(1)",
        "bounds of A x",
        f"equal to the exact box within {apart:.1e}",
        f"{len(M)} random boxes in the plane against the exact interval product.",
        reproduced=apart < _ROUNDING,
        deviation=apart,
    )


def _lemma(A: Bounds, x: Bounds, exact: Bounds) -> Row:
    shares = [float(unsound(f(A, x), exact).mean()) for f in (lemma_printed, lemma_corrected)]
    return judged(
        "Lemma 1, product with an interval matrix",
        "(2)",
        "bounds of A x",
        f"{100 * shares[0]:.1f} % of {len(exact.lower)} random boxes are cut; corrected {100 * shares[1]:.1f} %",
        "As the superscripts stand in the text at hand. Meant is Al+ xl+ - Au+ xl- - Al- xu+ + Au- xu- to "
        "Au+ xu+ - Al+ xu- - Au- xl+ + Al- xl-; its upper half is what is printed below (34).",
        reproduced=shares[0] == 0,
        corrected=shares[1] == 0,
        deviation=shares[0],
    )


def _width() -> Row:
    """Both factors in [-1, 1]."""
    one = Bounds(-np.ones((1, 1, 1)), np.ones((1, 1, 1)))
    loose, exact = lemma_corrected(one, one), exact_product(one, one)
    ratio = float((loose.upper - loose.lower)[0, 0, 0] / (exact.upper - exact.lower)[0, 0, 0])
    return judged(
        "Lemma 1 where both factors change sign",
        "(2)",
        "bounds of A x",
        f"[{loose.lower[0, 0, 0]:g}, {loose.upper[0, 0, 0]:g}] for [-1, 1] [-1, 1]; the exact product is "
        f"[{exact.lower[0, 0, 0]:g}, {exact.upper[0, 0, 0]:g}]",
        f"Sound once corrected, but {ratio:g} times as wide: positive and negative parts of one number are bounded as if they were two. "
        "The least and greatest of the four products of bounds is exact (`sets.Interval`).",
        reproduced=ratio == 1,
        corrected=ratio == 2,
        deviation=ratio - 1,
    )


def _delta(A: Bounds, x: Bounds, exact: Bounds) -> Row:
    found = delta_printed(A, x)
    upper = float((found.upper < exact.upper - _ROUNDING).any(axis=(1, 2)).mean())
    share = float(unsound(found, exact).mean())
    corrected = float(unsound(lemma_corrected(A, x), exact).mean())
    return judged(
        "Bounds of delta = dA x + dB u",
        "below (34)",
        "lower and upper bound",
        f"{100 * share:.1f} % of {len(exact.lower)} random boxes are cut, all from below (upper bound {100 * upper:g} %); "
        f"corrected {100 * corrected:g} %",
        "The last two terms of the lower bound take the lower bound of x (and of u) where the upper one belongs.",
        reproduced=share == 0,
        corrected=upper == 0 and corrected == 0,
        deviation=share,
    )


def _symmetric_delta() -> Row:
    rng = np.random.default_rng(1)
    A, x = (Bounds.around(rng.uniform(0, 1, shape)) for shape in ((TRIALS, 2, 2), (TRIALS, 2, 1)))
    exact = exact_product(A, x)
    share = float(unsound(delta_printed(A, x), exact).mean())
    ratio = delta_printed(A, x).upper / exact.upper
    return judged(
        "Bounds of delta for the symmetric boxes of section 5",
        "below (34), section 5.2",
        "lower and upper bound",
        f"{100 * share:g} % of {TRIALS} boxes are cut; the upper bound is {ratio.min():.3f} to {ratio.max():.3f} times the exact one",
        "With -xu <= x <= xu and -D <= dA <= D the faulty terms vanish, so the section's own numbers do not show the fault.",
        reproduced=share == 0,
    )


def _hull() -> Row:
    """Definition 4 on random zonotopes in the plane, against their vertices."""
    rng = np.random.default_rng(2)
    apart = 0.0
    for _ in range(50):
        zonotope = Zonotope.of(rng.normal(size=2), rng.normal(size=(2, 7)))
        corners, box = zonotope.vertices(), zonotope.interval()
        apart = max(apart, float(np.abs(corners.max(axis=0) - np.asarray(box.upper)).max()))
    return judged(
        "Interval hull of a zonotope",
        "(4)",
        "p + rs(H) B",
        f"equal to the box around all vertices within {apart:.1e}",
        "50 random planar zonotopes with seven generators.",
        reproduced=apart < 1e-12,
        deviation=apart,
    )
