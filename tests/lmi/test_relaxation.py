"""No relaxation may accept what is false somewhere on the box, and the exact ones must accept what is true."""

import numpy as np
import pytest

from luenberger.algebra import Polynomial
from luenberger.core import BadInput, NotAccepted
from luenberger.lmi import Bernstein, Grid, Vertices

BENT = Polynomial(("x",), {(0,): np.array([[1.0]]), (2,): np.array([[-2.0]])})
BOX = {"x": (-1.0, 1.0)}


@pytest.mark.parametrize("relaxation", [Bernstein(), Bernstein(3), Bernstein(0, 4), Bernstein(2, 3), Grid(3)])
def test_positive_in_the_middle_is_rejected(relaxation: Bernstein | Grid) -> None:
    # F = 1 - 2 x^2 is negative at both ends and +1 in the middle.
    assert max(m[0, 0] for m in relaxation.matrices(BENT, BOX)) >= 1 - 1e-12


def test_vertices_refuse_what_they_cannot_decide() -> None:
    with pytest.raises(NotAccepted, match="unsound"):
        Vertices().matrices(BENT, BOX)


def test_vertices_are_bernstein_where_affine() -> None:
    plane = Polynomial.affine(np.eye(2), a=np.ones((2, 2)), b=np.diag([1.0, -1.0]))
    box = {"a": (-1.0, 2.0), "b": (0.0, 3.0)}
    for one, two in zip(Vertices().matrices(plane, box), Bernstein(2).matrices(plane, box), strict=True):
        np.testing.assert_array_equal(one, two)


@pytest.mark.parametrize("n", [1, 2, 3])
def test_random_quadratics_are_never_under_estimated(n: int) -> None:
    generator = np.random.default_rng(n)
    line = np.linspace(-1, 1, 201)
    for _ in range(40):
        terms = {(k,): generator.normal(size=(n, n)) for k in range(3)}
        matrix = Polynomial(("x",), {e: c + c.T for e, c in terms.items()})
        truth = max(np.linalg.eigvalsh(matrix({"x": x}))[-1] for x in line)
        bounds = [
            max(np.linalg.eigvalsh(m)[-1] for m in Bernstein(0, parts).matrices(matrix, BOX)) for parts in (1, 4, 16)
        ]
        assert bounds[-1] >= truth - 1e-12
        # Subdivision tightens: the hull of a piece lies inside the hull of the whole.
        assert bounds[0] >= bounds[1] - 1e-12 >= bounds[2] - 2e-12
        assert bounds[2] - truth <= 0.05 * max(1.0, abs(truth))


def test_options_are_checked() -> None:
    with pytest.raises(BadInput, match="elevation"):
        Bernstein(-1)
