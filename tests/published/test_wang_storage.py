"""What a moving storage buys on the car, and a coarse grid that lies."""

import numpy as np
import pytest

from luenberger.core import Outcome
from luenberger.experiment.published.wang_storage import (
    BACK_OFF,
    GAIN,
    erring_car,
    noisy_car,
    speed_weighted,
    speed_weighted_outcome,
)
from luenberger.lmi import Bernstein, Grid
from luenberger.lmi.storage import affine_monomials, l2_storage


def test_affine_storage_is_a_third_tighter() -> None:
    found = l2_storage(
        erring_car(),
        GAIN,
        np.eye(2),
        "scheduling",
        form="estimate",
        monomials=affine_monomials(erring_car()),
        relaxation=Bernstein(parts=2),
    )
    assert found is not None
    # 0.148 on a dense grid; two sub-intervals of the speed cost two percent on the whole box (three cost one).
    assert found[0] / BACK_OFF == pytest.approx(0.148, rel=0.025)


def test_the_term_in_the_speed_is_proved_on_the_whole_box() -> None:
    found = speed_weighted(erring_car(), GAIN, "scheduling", "estimate", Bernstein(parts=2))
    assert found is not None
    assert found.level / BACK_OFF == pytest.approx(0.1252, rel=0.015)
    assert speed_weighted_outcome(erring_car(), GAIN, "scheduling", "estimate", found) is Outcome.PROVED


def test_a_coarse_grid_is_refuted() -> None:
    found = speed_weighted(noisy_car(), GAIN * 0.14, "both", "plant", Grid(2))
    assert found is not None
    assert speed_weighted_outcome(noisy_car(), GAIN * 0.14, "both", "plant", found) is Outcome.REFUTED
