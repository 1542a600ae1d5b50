"""What numbers prove about the inequality behind a relaxation, violations included."""

import numpy as np
import pytest

from luenberger.lmi.relaxed import Condition, Relaxed, plain


def constant(M: np.ndarray, unit: list[float], reach: float) -> Condition:
    return Condition(len(M), M.reshape(-1, 1), None, np.array(unit), reach)


def test_plain_level_is_the_largest_eigenvalue() -> None:
    M = np.array([[1.0, 2.0], [2.0, -3.0]])
    level, size = plain(M.reshape(-1, 1)).level(np.ones(1), np.zeros(0))
    assert level == pytest.approx(np.linalg.eigvalsh(M)[-1], abs=1e-12)
    assert size == 3.0


def test_a_margin_of_rounding_size_is_none() -> None:
    level, _ = plain(np.diag([-1e3, -1e-14]).reshape(-1, 1)).level(np.ones(1), np.zeros(0))
    assert level > 0


def test_level_of_a_lifted_matrix_is_a_schur_complement() -> None:
    # [l - 1, 2; 2, -4] <= [level, 0; 0, 0] needs level >= 1 + 2^2 / 4 for l = 2.
    lifted = constant(np.array([[1.0, 2.0], [2.0, -4.0]]), [1.0, 0.0], 1.0)
    assert Relaxed((lifted,)).level(np.ones(1), np.zeros(0))[0] == pytest.approx(2.0, abs=1e-9)


def test_what_is_violated_outside_the_unit_block_is_paid_for() -> None:
    # A lower block of +0.3 can add 0.3 s^2 <= 0.3 reach to the value, whatever the corner says.
    lifted = constant(np.diag([1.0, 0.3]), [1.0, 0.0], 2.0)
    assert Relaxed((lifted,)).level(np.ones(1), np.zeros(0))[0] == pytest.approx(1.0 + 0.6, abs=1e-6)
    sided = constant(np.diag([-1.0, 0.25]), [0.0, 0.0], 2.0)
    assert Relaxed((sided,)).level(np.ones(1), np.zeros(0))[0] == pytest.approx(0.5)
    assert Relaxed((constant(-np.eye(2), [0.0, 0.0], 2.0),)).level(np.ones(1), np.zeros(0))[0] == 0.0


def test_level_holds_for_every_parameter() -> None:
    """The level read from any lifted matrix bounds its form (1, s)' M (1, s) on [-1, 1]."""
    generator = np.random.default_rng(0)
    line = np.linspace(-1, 1, 41)
    for _ in range(50):
        M = generator.normal(size=(4, 4))
        M = M + M.T - 2.0 * np.diag([0.0, 0.0, 1.0, 1.0])
        level, _ = Relaxed((constant(M, [1.0, 1.0, 0.0, 0.0], 1.0),)).level(np.ones(1), np.zeros(0))
        lifts = [np.vstack([np.eye(2), s * np.eye(2)]) for s in line]
        assert level >= max(np.linalg.eigvalsh(E.T @ M @ E)[-1] for E in lifts) - 1e-12
