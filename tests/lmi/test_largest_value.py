"""The bound is read from the multipliers, one for each matrix."""

import numpy as np
import pytest

from luenberger.algebra import Polynomial
from luenberger.lmi import Bernstein, Planned, Vertices, largest_value


def test_vertices_and_bernstein_agree_with_eigenvalues() -> None:
    plane = Polynomial.affine(np.eye(2), a=np.ones((2, 2)), b=np.diag([1.0, -1.0]))
    other = Polynomial.affine(np.diag([3.0, 1.0]), b=np.eye(2))
    box = {"a": (-1.0, 2.0), "b": (0.0, 3.0)}
    truth = [
        max(np.linalg.eigvalsh(plane({"a": a, "b": b}))[-1] for a in box["a"] for b in box["b"]),
        6.0,
    ]
    for relaxation in (Vertices(), Bernstein(), Planned()):
        bounds = largest_value([plane, other], box, relaxation)
        assert bounds is not None
        np.testing.assert_allclose(bounds, truth, atol=1e-7)
        assert np.all(bounds >= np.array(truth) - 1e-12)


def test_sizes_may_differ() -> None:
    curved = [Polynomial(("s",), {(0,): np.eye(n), (2,): -np.diag(np.arange(1.0, n + 1))}) for n in (1, 3)]
    bounds = largest_value(curved, {"s": (-1.0, 1.0)}, Planned())
    assert bounds is not None
    assert bounds == pytest.approx([1.0, 1.0], abs=1e-8)
