"""The planner takes the vertices where they decide, multipliers where they are worth it, and says why."""

import numpy as np
import pytest

from luenberger.algebra import Polynomial
from luenberger.core import BadInput
from luenberger.lmi import Bernstein, FullBlockMultiplier, Planned, StructuredMultiplier, Vertices, largest_value

UNIT = dict.fromkeys("abcdef", (-1.0, 1.0))


def polynomial(*exponents: tuple[int, ...], n: int = 2) -> Polynomial:
    generator = np.random.default_rng(len(exponents))
    terms = {e: generator.normal(size=(n, n)) for e in exponents}
    return Polynomial("abcdef"[: len(exponents[0])], {e: c + c.T for e, c in terms.items()})


def squares(p: int) -> Polynomial:
    return polynomial((0,) * p, *(tuple(2 * (j == k) for j in range(p)) for k in range(p)))


def test_multi_affine_gives_the_very_matrices_of_bernstein() -> None:
    F = polynomial((0, 0, 0), (1, 0, 0), (1, 1, 0), (1, 1, 1))
    assert isinstance(Planned().plan(F, UNIT).relaxation, Vertices)
    numeric = F.map(lambda c: c.reshape(4, 1))
    for one, two in zip(Planned().relaxed(numeric, UNIT), Bernstein().relaxed(numeric, UNIT), strict=True):
        np.testing.assert_array_equal(one.conditions[0].K, two.conditions[0].K)


@pytest.mark.parametrize(
    ("p", "kind"),
    [(1, StructuredMultiplier), (2, FullBlockMultiplier), (3, FullBlockMultiplier), (4, StructuredMultiplier)],
)
def test_quadratic_choice_goes_by_the_number_of_curved_parameters(p: int, kind: type) -> None:
    plan = Planned().plan(squares(p), UNIT)
    assert isinstance(plan.relaxation, kind)
    assert "curved" in str(plan)
    # The announced size is the size.
    relaxed = Planned().relaxed(squares(p).map(lambda c: c.reshape(4, 1)), UNIT)
    assert plan.rows == sum(r.rows for r in relaxed)
    assert plan.unknowns == sum(r.unknowns for r in relaxed)


def test_affine_parameters_are_expanded_first() -> None:
    F = polynomial((0, 0), (1, 0), (0, 2), (1, 1), (1, 2))
    plan = Planned().plan(F, UNIT)
    assert isinstance(plan.relaxation, StructuredMultiplier)
    assert plan.expanded == ("a",)
    assert "b is curved" in plan.reason
    assert len(Planned().relaxed(F.map(lambda c: c.reshape(4, 1)), UNIT)) == 2


def test_higher_degrees_of_several_parameters_are_subdivided() -> None:
    F = polynomial((0, 0), (3, 0), (2, 2))
    plan = Planned().plan(F, UNIT)
    assert isinstance(plan.relaxation, Bernstein)
    assert plan.relaxation.parts > 1
    assert plan.rows == 2 * sum(len(r.conditions) for r in Planned().relaxed(F.map(lambda c: c.reshape(4, 1)), UNIT))


def test_too_dear_a_multiplier_gives_way() -> None:
    whole, less = Planned().plan(squares(3), UNIT), Planned(limit=7e4).plan(squares(3), UNIT)
    assert isinstance(whole.relaxation, FullBlockMultiplier)
    assert isinstance(less.relaxation, StructuredMultiplier)
    assert less.effort < 7e4 < whole.effort
    none = Planned(limit=1.0).plan(squares(3), UNIT)
    assert none.relaxation == Bernstein()
    assert "would need" in none.reason


def test_terms_that_are_zero_do_not_count() -> None:
    F = Polynomial(("a",), {(0,): np.eye(2), (1,): np.ones((2, 2)), (2,): np.zeros((2, 2))})
    assert len(Planned().relaxed(F.map(lambda c: c.reshape(4, 1)), UNIT)) == 2


def test_an_interval_without_width_is_a_number() -> None:
    F = polynomial((0, 0), (2, 0), (1, 1))
    box = {"a": (0.5, 0.5), "b": (-1.0, 1.0)}
    assert isinstance(Planned().plan(F, box).relaxation, Vertices)
    bound = largest_value([F], box, Planned())
    assert bound is not None
    truth = max(np.linalg.eigvalsh(F({"a": 0.5, "b": b}))[-1] for b in (-1.0, 1.0))
    assert bound[0] == pytest.approx(truth, abs=1e-8)


def test_missing_interval_is_refused() -> None:
    with pytest.raises(BadInput, match="interval"):
        largest_value([squares(2)], {"a": (-1.0, 1.0)}, Planned())
